//! Basins of attraction: the attractor to which each start of a map leads.
//!
//! Contact-free motion is one attractor, even if a run has not reached it yet. Periodic starts are distinguished by
//! their cycles, which Newton's method finds on the reference ([`catalogue`]); symmetry-conjugate orbits are different
//! attractors. All chaotic starts share one attractor, because records do not distinguish chaotic attractors. Undecided
//! and failed starts have none.
//!
//! Attractors are numbered by decreasing share; equal shares are ordered by period, then by strobe state. The result
//! depends only on the records, not on their order.
//!
//! If one axis sweeps a parameter, each of its values has attractors of its own. An attractor continues at the next
//! value as the nearest cycle of the same period within a relative distance of [`CONTINUATION`]. Otherwise it ends
//! there, and the remaining cycles of the next value are new attractors.

use rayon::prelude::*;

use crate::map::catalogue::{self, Catalogue, Outcome};
use crate::map::cycle::{StrobeCycle, distance};
use crate::map::engine::Flows;
use crate::map::plan::Plan;
use crate::record::classify::classify;
use crate::record::distance::farther;
use crate::record::{Record, Records};
use rattlemap_dynamics::model::{Law, State};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{self, Class, Settings};
use rattlemap_dynamics::word::Word;

/// Label of a start without an attractor.
pub const NONE: u16 = u16::MAX;

/// Largest relative distance of a cycle from its continuation at the next value of a parameter.
pub const CONTINUATION: f64 = 0.25;

/// An attractor.
#[derive(Clone, Debug, PartialEq)]
pub struct Attractor {
    /// Periodic or chaotic.
    pub class: Class,
    /// The lexicographically smallest strobe state; none for aperiodic motion.
    pub strobe: Option<State>,
    /// Word of the cycle, if the reference confirmed it.
    pub word: Option<Word>,
    /// Whether the cycle is in contact at phase 0.
    pub meshes: bool,
    /// Largest Lyapunov exponent; for aperiodic motion the mean over its cells.
    pub exponent: Option<f64>,
    /// Modulus of the largest Floquet multiplier of the cycle.
    pub multiplier: Option<f64>,
    /// Whether the cycle is its own mirror image.
    pub symmetric: Option<bool>,
    /// Number of cells in the basin.
    pub cells: usize,
    /// A cell of the basin. If a parameter is swept, strobe state, word, exponent, multiplier and symmetry are those at
    /// this cell.
    pub cell: usize,
}

/// A map of basins.
#[derive(Clone, Debug)]
pub struct Basins {
    labels: Vec<u16>,
    list: Vec<Attractor>,
    /// Cycles at each value of the swept parameter; one entry without one.
    groups: Vec<Group>,
    /// Labels of chaos and of quasi-periodic motion.
    aperiodic: [Option<u16>; 2],
    grouping: Grouping,
}

/// Cycles at one value of the parameter, with their labels.
#[derive(Clone, Debug)]
struct Group {
    catalogue: Catalogue,
    labels: Vec<u16>,
}

/// Grouping of cells by the value of the swept parameter.
#[derive(Clone, Copy, Debug)]
struct Grouping {
    counts: [usize; 2],
    /// Axis of the parameter, if there is one.
    along: Option<usize>,
}

impl Grouping {
    fn of(plan: &Plan) -> Grouping {
        let along = plan.axes().iter().position(|axis| !axis.target().is_start());
        Grouping { counts: plan.counts(), along }
    }

    fn groups(&self) -> usize {
        self.along.map_or(1, |axis| self.counts[axis])
    }

    fn group(&self, id: usize) -> usize {
        self.along.map_or(0, |axis| [id % self.counts[0], id / self.counts[0]][axis])
    }

    /// Returns the ids of the cells of a group.
    fn cells(&self, group: usize) -> Vec<usize> {
        let [columns, rows] = self.counts;
        match self.along {
            None => (0..columns * rows).collect(),
            Some(0) => (0..rows).map(|j| j * columns + group).collect(),
            Some(_) => (group * columns..(group + 1) * columns).collect(),
        }
    }
}

/// Labels the cells of a map of basins; returns none for other maps. `filled_from` has for every cell the cell from
/// which it was filled, itself if it was integrated; empty if all were integrated.
///
/// # Panics
/// If the number of records is not that of the cells.
pub fn basins(plan: &Plan, records: &(impl Records + ?Sized), filled_from: &[u32]) -> Option<Basins> {
    if !plan.is_basin() {
        return None;
    }
    assert_eq!(plan.cell_count(), records.count(), "one record per cell");
    let grouping = Grouping::of(plan);
    let is_own = |id: usize| filled_from.get(id).is_none_or(|&from| from as usize == id);
    let flows = Flows::new(plan);
    let groups: Vec<(Catalogue, Vec<(usize, Outcome)>)> = (0..grouping.groups())
        .into_par_iter()
        .map(|group| {
            let ids: Vec<usize> = grouping.cells(group).into_iter().filter(|&id| is_own(id)).collect();
            let cell = plan.cell(grouping.cells(group)[0] as u32);
            let learn = |flow: &Flow| catalogue::learn(flow, plan.law(cell.law), records, &ids);
            let (catalogue, found) = flows.with(cell.flow, learn);
            (catalogue, ids.into_iter().zip(found).collect())
        })
        .collect();
    // A cycle and its continuations have one number.
    let numbers = follow(groups.iter().map(|(catalogue, _)| catalogue));
    let cycles = numbers.iter().flatten().map(|&n| n + 1).max().unwrap_or(0);
    // All chaotic motions count as one attractor, all quasi-periodic ones as another.
    let [chaos, torus] = [cycles, cycles + 1];
    let mut own = vec![None; records.count()];
    for (group, (_, found)) in groups.iter().enumerate() {
        for &(id, found) in found {
            own[id] = match found {
                Outcome::Cycle(nth) => Some(numbers[group][nth as usize]),
                Outcome::Chaos => Some(chaos),
                Outcome::Torus => Some(torus),
                Outcome::Unresolved(_) | Outcome::Undecided | Outcome::Failed => None,
            };
        }
    }
    let of = |id: usize| filled_from.get(id).map_or(own[id], |&from| own[from as usize]);
    let cells: Vec<Option<usize>> = (0..records.count()).map(of).collect();
    let mut counts = vec![0usize; cycles + 2];
    cells.iter().flatten().for_each(|&n| counts[n] += 1);
    let catalogues: Vec<&Catalogue> = groups.iter().map(|(catalogue, _)| catalogue).collect();
    let sources =
        Sources { plan, records, grouping, flows: &flows, catalogues: &catalogues, numbers: &numbers };
    let mut list: Vec<(usize, Attractor)> = (0..counts.len())
        .into_par_iter()
        .filter(|&n| counts[n] > 0)
        .map(|n| {
            let aperiodic = |class| sources.aperiodic(class, &own, n);
            let attractor = match n.checked_sub(chaos) {
                None => sources.cycle(&cells, n),
                Some(0) => aperiodic(Class::Chaotic),
                Some(_) => aperiodic(Class::QuasiPeriodic),
            };
            (n, attractor)
        })
        .collect();
    list.iter_mut().for_each(|(n, attractor)| attractor.cells = counts[*n]);
    list.sort_by(|(_, a), (_, b)| {
        let period = |attractor: &Attractor| match attractor.class {
            Class::Periodic { period } => period,
            _ => u32::MAX,
        };
        let state = |attractor: &Attractor| attractor.strobe.unwrap_or_default();
        let by_state = || lexicographic(&state(a), &state(b));
        b.cells.cmp(&a.cells).then(period(a).cmp(&period(b))).then_with(by_state)
    });
    let mut label_of = vec![NONE; counts.len()];
    for (label, (n, _)) in (0..NONE).zip(&list) {
        label_of[*n] = label;
    }
    list.truncate(usize::from(NONE));
    let groups = groups.into_iter().zip(numbers).map(|((catalogue, _), numbers)| Group {
        catalogue,
        labels: numbers.into_iter().map(|n| label_of[n]).collect(),
    });
    Some(Basins {
        labels: cells.iter().map(|n| n.map_or(NONE, |n| label_of[n])).collect(),
        list: list.into_iter().map(|(_, attractor)| attractor).collect(),
        groups: groups.collect(),
        aperiodic: [chaos, torus].map(|n| Some(label_of[n]).filter(|&label| label != NONE)),
        grouping,
    })
}

impl Basins {
    /// Returns the label of every cell, by id: the index of its attractor, or [`NONE`].
    pub fn labels(&self) -> &[u16] {
        &self.labels
    }

    /// Returns the attractors, the one with the largest basin first.
    pub fn attractors(&self) -> &[Attractor] {
        &self.list
    }

    /// Returns the strobe states of all periodic attractors.
    pub fn strobes(&self) -> impl Iterator<Item = &State> {
        let cycles = self.groups.iter().flat_map(|group| group.catalogue.cycles().iter().zip(&group.labels));
        cycles.filter(|(_, label)| **label != NONE).flat_map(|(entry, _)| &entry.cycle.points)
    }

    /// Returns the label of the attractor that another record of the cell `id` shows; none if the record is undecided
    /// or shows none of the map's attractors.
    pub fn label(&self, id: usize, record: &Record) -> Option<u16> {
        let group = &self.groups[self.grouping.group(id)];
        match classify(record) {
            Class::Chaotic => self.aperiodic[0],
            Class::QuasiPeriodic => self.aperiodic[1],
            Class::Periodic { period } => {
                let nth = group.catalogue.nearest(&record.strobe(), period)?;
                Some(group.labels[nth as usize]).filter(|&label| label != NONE)
            }
            Class::Undecided | Class::Failed => None,
        }
    }
}

/// Numbers the cycles of each group. A cycle and its continuations in the next groups have one number.
fn follow<'c>(catalogues: impl Iterator<Item = &'c Catalogue>) -> Vec<Vec<usize>> {
    let mut numbers: Vec<Vec<usize>> = Vec::new();
    let mut before: Option<&Catalogue> = None;
    let mut next = 0;
    for catalogue in catalogues {
        let mut own = vec![None; catalogue.cycles().len()];
        if let (Some(before), Some(theirs)) = (before, numbers.last()) {
            let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
            for (i, a) in before.cycles().iter().enumerate() {
                for (j, b) in catalogue.cycles().iter().enumerate() {
                    let is_alike = a.cycle.period == b.cycle.period
                        && a.cycle.is_non_impacting == b.cycle.is_non_impacting;
                    let distance =
                        if is_alike { between(&a.cycle, &b.cycle, b.units) } else { f64::INFINITY };
                    if distance < CONTINUATION {
                        pairs.push((distance, i, j));
                    }
                }
            }
            pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
            let mut is_taken = vec![false; theirs.len()];
            for (_, i, j) in pairs {
                if !is_taken[i] && own[j].is_none() {
                    is_taken[i] = true;
                    own[j] = Some(theirs[i]);
                }
            }
        }
        let fresh = |n: Option<usize>| {
            n.unwrap_or_else(|| {
                next += 1;
                next - 1
            })
        };
        numbers.push(own.into_iter().map(fresh).collect());
        before = Some(catalogue);
    }
    numbers
}

/// Returns the smallest distance of two cycles of one period over all shifts by whole periods.
fn between(a: &StrobeCycle, b: &StrobeCycle, units: [f64; 2]) -> f64 {
    let period = a.period as usize;
    if a.points.len() < period || b.points.len() < period {
        return f64::INFINITY;
    }
    let turned = |turn: usize| {
        let apart = |k: usize| distance(units, &a.points[k], &b.points[(k + turn) % period]);
        (0..period).map(apart).fold(0.0, farther)
    };
    (0..period).map(turned).fold(f64::INFINITY, f64::min)
}

fn lexicographic(a: &State, b: &State) -> std::cmp::Ordering {
    let pairs = a.iter().zip(b).map(|(a, b)| a.total_cmp(b));
    pairs.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
}

/// Data from which attractors are computed.
struct Sources<'a, R: ?Sized> {
    plan: &'a Plan,
    records: &'a R,
    grouping: Grouping,
    flows: &'a Flows<'a>,
    catalogues: &'a [&'a Catalogue],
    numbers: &'a [Vec<usize>],
}

impl<R: Records + ?Sized> Sources<'_, R> {
    /// Computes a periodic attractor at the value of the parameter at which its basin is largest.
    fn cycle(&self, cells: &[Option<usize>], number: usize) -> Attractor {
        let mut counts = vec![0usize; self.grouping.groups()];
        let of = || (0..cells.len()).filter(|&id| cells[id] == Some(number));
        of().for_each(|id| counts[self.grouping.group(id)] += 1);
        let largest = counts.iter().copied().max().unwrap_or(0);
        let group = counts.iter().position(|&count| count == largest).unwrap_or(0);
        let cell = of().find(|&id| self.grouping.group(id) == group).unwrap_or(0);
        let nth = self.numbers[group].iter().position(|&n| n == number).unwrap_or(0);
        let cycle = &self.catalogues[group].cycles()[nth].cycle;
        let least = cycle.points.iter().copied().min_by(lexicographic).unwrap_or(cycle.last);
        let of_cell = self.plan.cell(cell as u32);
        let (law, settings) = (self.plan.law(of_cell.law), self.plan.budget().settings);
        let orbit = self.flows.with(of_cell.flow, |flow| read(flow, law, least, cycle.period, &settings));
        Attractor {
            class: Class::Periodic { period: cycle.period },
            strobe: Some(least),
            exponent: orbit.as_ref().map(|orbit| orbit.lyapunov),
            multiplier: orbit.as_ref().and_then(|orbit| {
                let [re, im] = *orbit.floquet.as_ref()?.first()?;
                Some(re.hypot(im))
            }),
            symmetric: orbit.as_ref().and_then(|orbit| orbit.symmetric),
            meshes: orbit.as_ref().is_some_and(|orbit| orbit.strobe_meshing.is_some()),
            word: orbit.map(|orbit| orbit.word),
            cells: 0,
            cell,
        }
    }

    fn aperiodic(&self, class: Class, own: &[Option<usize>], number: usize) -> Attractor {
        let ids: Vec<usize> = (0..own.len()).filter(|&id| own[id] == Some(number)).collect();
        let sum: f64 = ids.iter().map(|&id| self.records.record(id).lyapunov).sum();
        Attractor {
            class,
            strobe: None,
            word: None,
            meshes: false,
            exponent: Some(sum / ids.len() as f64).filter(|mean| mean.is_finite()),
            multiplier: None,
            symmetric: None,
            cells: 0,
            cell: ids.first().copied().unwrap_or(0),
        }
    }
}

/// Analyses the orbit through a state of a cycle; none if the analysis finds another class or period.
fn read(flow: &Flow, law: Law, state: State, period: u32, settings: &Settings) -> Option<orbit::Orbit> {
    let orbit = orbit::analyse_flow(flow, law, state, settings, 0);
    (orbit.class == Class::Periodic { period }).then_some(orbit)
}
