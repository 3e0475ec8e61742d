//! The cycles of one oscillator, as records show them one after the other.
//!
//! A record that lies within [`SETTLED_TOLERANCE`] of a known cycle is on it. From any other Newton's method finds the cycle that it was
//! on its way to; cycles as near to each other as that are one. So what is told the same does not depend on which
//! record came first.

use rayon::prelude::*;

use crate::map::cycle::{CYCLE_TOLERANCE, StrobeCycle, distance};
use crate::record::classify::classify;
use crate::record::{Record, Records};
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Law, NonImpacting, State};
use rattlemap_dynamics::orbit::Class;

/// States this close, relative to the motion's size, lie on one cycle without a question: lanes in single precision
/// are nearer to theirs where they have settled.
const SETTLED_TOLERANCE: f64 = 1e-4;

/// A refined cycle that comes back to itself within this is one of fewer periods.
const CLOSING_TOLERANCE: f64 = 1e-6;

/// Records that are compared with the same catalogue, at first: few, since what they show has to be found.
const FIRST_CHUNK: usize = 16;
/// And at most.
const LARGEST_CHUNK: usize = 1 << 16;

/// What a record shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// The cycle at this place of the catalogue.
    Cycle(u32),
    /// A cycle of so many periods that Newton's method does not find.
    Unresolved(u32),
    Chaos,
    Undecided,
    Failed,
}

/// A cycle, and what distances to it are relative to.
#[derive(Clone, Debug)]
pub(crate) struct ScaledCycle {
    pub(crate) cycle: StrobeCycle,
    pub(crate) units: [f64; 2],
}

/// The cycles that are known.
#[derive(Clone, Debug)]
pub(crate) struct Catalogue {
    contact_free: Option<NonImpacting>,
    cycles: Vec<ScaledCycle>,
    /// Strobe states with the cycle that each is on, by the first displacement.
    points: Vec<(State, u32)>,
    /// The largest unit of displacement.
    largest_unit: f64,
    /// The contact-free one.
    free: Option<u32>,
}

impl Catalogue {
    /// None yet of an oscillator.
    pub(crate) fn of(flow: &Flow) -> Catalogue {
        // Beside a degree of freedom at rest it is one of many motions.
        let contact_free = flow.non_impacting().filter(|free| free.resting().is_none()).cloned();
        Catalogue { contact_free, cycles: Vec::new(), points: Vec::new(), largest_unit: 0.0, free: None }
    }

    pub(crate) fn cycles(&self) -> &[ScaledCycle] {
        &self.cycles
    }

    /// What so many records show, one after the other, by their place; they may show cycles that were not known.
    pub(crate) fn learn(
        &mut self,
        flow: &Flow,
        law: Law,
        count: usize,
        record: impl Fn(usize) -> Record + Sync,
    ) -> Vec<Outcome> {
        let mut all = Vec::with_capacity(count);
        let mut size = if self.cycles.is_empty() { FIRST_CHUNK } else { LARGEST_CHUNK };
        while all.len() < count {
            let block = all.len()..count.min(all.len() + size);
            size = (2 * size).min(LARGEST_CHUNK);
            let known = &*self;
            let identify = |nth: usize| {
                let record = &record(nth);
                let new = |period| (period, known.refined(flow, law, record, period));
                known.identify(record).map_err(new)
            };
            let identified: Vec<_> = block.into_par_iter().map(identify).collect();
            all.extend(identified.into_iter().map(|identified| match identified {
                Ok(found) => found,
                Err((_, Some(cycle))) => Outcome::Cycle(self.add(flow, cycle)),
                Err((period, None)) => Outcome::Unresolved(period),
            }));
        }
        all
    }

    /// What a record shows as far as it is known; else its period.
    fn identify(&self, record: &Record) -> Result<Outcome, u32> {
        match classify(record) {
            Class::Failed => Ok(Outcome::Failed),
            Class::Undecided => Ok(Outcome::Undecided),
            Class::Chaotic => Ok(Outcome::Chaos),
            Class::Periodic { .. } if !record.strobe.iter().all(|x| x.is_finite()) => Ok(Outcome::Undecided),
            Class::Periodic { period } => {
                let free = self.free.filter(|_| self.is_contact_free(&record.strobe));
                free.or_else(|| self.within(SETTLED_TOLERANCE, &record.strobe, period))
                    .map(Outcome::Cycle)
                    .ok_or(period)
            }
        }
    }

    /// The cycle that comes nearest to a state, if it comes within `bar` of it.
    fn within(&self, bar: f64, state: &State, period: u32) -> Option<u32> {
        let largest_unit = bar * self.largest_unit;
        let from = self.points.partition_point(|(point, _)| point[0] < state[0] - largest_unit);
        let near = self.points[from..].iter().take_while(|(point, _)| point[0] <= state[0] + largest_unit);
        let related = near.filter(|(_, nth)| self.cycles[*nth as usize].cycle.is_related(period));
        let apart =
            related.map(|(point, nth)| (distance(self.cycles[*nth as usize].units, point, state), *nth));
        let nearest = apart.filter(|(apart, _)| *apart < bar).min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map(|(_, nth)| nth)
    }

    /// The cycle that a state of a slow approach belongs to.
    pub(crate) fn nearest(&self, state: &State, period: u32) -> Option<u32> {
        self.free
            .filter(|_| self.is_contact_free(state))
            .or_else(|| self.within(CYCLE_TOLERANCE, state, period))
    }

    /// The cycle that a record was on its way to, in as few periods as it closes in.
    fn refined(&self, flow: &Flow, law: Law, record: &Record, period: u32) -> Option<StrobeCycle> {
        if self.is_contact_free(&record.strobe) {
            let steady = self.contact_free.as_ref()?.steady();
            return Some(StrobeCycle::through(flow, law, steady, 1));
        }
        let cycle = StrobeCycle::refined(flow, law, record.strobe, period)?;
        let units = cycle.units(flow);
        let closes = |turn: &u32| {
            let later = cycle.points.get(*turn as usize);
            period.is_multiple_of(*turn)
                && later.is_some_and(|later| distance(units, &cycle.points[0], later) < CLOSING_TOLERANCE)
        };
        let turn = (1..period).find(closes).unwrap_or(period);
        let short = |mut states: Vec<State>| {
            states.truncate(turn as usize);
            states
        };
        Some(StrobeCycle { period: turn, points: short(cycle.points), halves: short(cycle.halves), ..cycle })
    }

    /// Whether a state certainly leads to contact-free motion.
    fn is_contact_free(&self, state: &State) -> bool {
        self.contact_free.as_ref().is_some_and(|free| free.is_certain(*state))
    }

    /// The place of a cycle, which may be known.
    fn add(&mut self, flow: &Flow, cycle: StrobeCycle) -> u32 {
        if let Some(known) = self.place(flow, &cycle) {
            return known;
        }
        let (nth, units) = (self.cycles.len() as u32, cycle.units(flow));
        self.largest_unit = self.largest_unit.max(units[0]);
        self.points.extend(cycle.points.iter().map(|point| (*point, nth)));
        self.points.sort_by(|(a, _), (b, _)| a[0].total_cmp(&b[0]));
        if cycle.is_non_impacting {
            self.free.get_or_insert(nth);
        }
        self.cycles.push(ScaledCycle { cycle, units });
        nth
    }

    fn place(&self, flow: &Flow, cycle: &StrobeCycle) -> Option<u32> {
        if let Some(free) = self.free.filter(|_| cycle.is_non_impacting) {
            return Some(free);
        }
        // One that has an event at phase 0 has two states there.
        let halves = || {
            let units = cycle.units(flow);
            let half = cycle.halves.first()?;
            let meets = |known: &ScaledCycle| {
                let is_met = |other: &State| distance(units, other, half) < SETTLED_TOLERANCE;
                known.cycle.is_related(cycle.period) && known.cycle.halves.iter().any(is_met)
            };
            self.cycles.iter().position(meets).map(|nth| nth as u32)
        };
        self.within(SETTLED_TOLERANCE, &cycle.points[0], cycle.period).or_else(halves)
    }
}

/// What every one of these records shows, and the cycles that they are on.
pub(crate) fn learn(
    flow: &Flow,
    law: Law,
    records: &(impl Records + ?Sized),
    ids: &[usize],
) -> (Catalogue, Vec<Outcome>) {
    let mut catalogue = Catalogue::of(flow);
    let mut all = catalogue.learn(flow, law, ids.len(), |nth| records.record(ids[nth]));
    // What is left takes the nearest cycle, or is one of its own.
    for (found, &id) in all.iter_mut().zip(ids) {
        if let Outcome::Unresolved(period) = *found {
            let state = records.record(id).strobe;
            let known = catalogue.nearest(&state, period);
            *found = Outcome::Cycle(match known {
                Some(nth) => nth,
                None => catalogue.add(flow, StrobeCycle::through(flow, law, state, period)),
            });
        }
    }
    (catalogue, all)
}
