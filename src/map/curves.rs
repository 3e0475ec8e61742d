//! Bifurcation curves of a map: the borders between its regions, as lines.
//!
//! Neighbouring cells with different motions are the seeds. The cycle of one of them is followed along the axis to the other one; what it
//! passes on the way, a fold, a flip, a pitchfork or a graze, is a point of a curve. The curve is then followed over both axes.

use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use crate::map::plan::Plan;
use crate::map::random::Random;
use crate::map::scene::{Axis, Scene};
use crate::record::classify::classify;
use crate::record::{Record, Records};
use rattlemap_dynamics::cycle::{
    Branch, BranchEnd, BranchLimits, BranchPoint, Condition, CycleError, Itinerary, Seed, Special, curve,
    follow_on,
};
use rattlemap_dynamics::machine::Touched;
use rattlemap_dynamics::model::State;
use rattlemap_dynamics::named;
use rattlemap_dynamics::orbit::{Class, analyse};
use rattlemap_dynamics::word::Word;

/// Steps along the way between two cells: the first, least and largest one, relative to the way, and the largest number of points.
const STEPS: [f64; 3] = [0.25, 1e-6, 0.5];
const MOST_POINTS: usize = 30;

/// Steps from a cell to the end of an axis.
const STEPS_BEYOND: [f64; 3] = [0.01, 1e-6, 0.1];

/// Largest step of a curve, relative to the axes.
const LARGEST_STEP: f64 = 0.02;

/// Largest distance of a seed from a curve that it lies on, relative to the axes.
const ON_CURVE: f64 = 1e-4;

/// Largest distance of a curve from the line between the centres of two cells, in cells: curves are drawn as polygons.
const SLACK: f64 = 0.1;

/// Largest number of cycles of a word that are followed beyond their basins, along each axis in each direction.
const BEYOND_BASINS: usize = 4;

/// Number of curves that are followed at once.
const SEEDS: usize = 8;

/// Number of pairs of cells that are examined at once.
const BATCH: usize = 64;

named! {
    /// Kind of a bifurcation curve.
    pub enum Kind {
        /// Two cycles meet and vanish.
        Fold = "fold",
        /// The period doubles.
        Flip = "flip",
        /// A cycle loses its symmetry.
        Pitchfork = "pitchfork",
        /// The motion touches a wall.
        Grazing = "grazing",
        /// Motion in lasting contact touches the wall of its contact.
        MeshingGrazing = "meshing_grazing",
        /// The force of a contact touches 0.
        MeshingBorder = "meshing_border",
        /// The motion without events touches a wall.
        ContactEnd = "contact_end",
        /// A sliding rate or a holding force is at its limit.
        Sticking = "sticking",
    }
}

impl Kind {
    /// Returns the kind of the curve of a seed; none of a border between pieces of a smooth law.
    fn of(seed: &Seed) -> Option<Kind> {
        Some(match (seed.condition, seed.touched()) {
            (Condition::Fold, _) => Kind::Fold,
            (Condition::Flip, _) if seed.is_half() => Kind::Pitchfork,
            (Condition::Flip, _) => Kind::Flip,
            (Condition::Touch, Some(Touched::Wall)) if seed.events() == 0 => Kind::ContactEnd,
            (Condition::Touch, Some(Touched::Wall)) => Kind::Grazing,
            (Condition::Touch, Some(Touched::Contact)) => Kind::MeshingGrazing,
            (Condition::Touch, Some(Touched::Force)) => Kind::MeshingBorder,
            (Condition::Touch, Some(Touched::Friction)) => Kind::Sticking,
            (Condition::Touch, Some(Touched::Piece) | None) => return None,
        })
    }
}

/// A cycle on a curve.
#[derive(Clone, Debug)]
pub struct CurvePoint {
    /// Values of the two axes.
    pub values: [f64; 2],
    /// Length of the curve from its first point, in scaled unknowns.
    pub arclength: f64,
    /// State at phase 0.
    pub state: State,
    /// Floquet multipliers, largest modulus first: of half a cycle that is its own mirror image, those of the reflected map.
    pub multipliers: Vec<[f64; 2]>,
    /// Whether all multipliers but the critical one lie within the unit circle.
    pub stable: bool,
}

/// A point at which the condition of another kind is met, too.
#[derive(Clone, Debug)]
pub struct Meeting {
    /// Number of the curve, from 1.
    pub curve: usize,
    /// The other condition.
    pub with: Special,
    /// The cycle.
    pub at: CurvePoint,
}

/// A bifurcation curve.
#[derive(Clone, Debug)]
pub struct Curve {
    /// What happens on it.
    pub kind: Kind,
    /// Word of the cycle at which it was found.
    pub word: Word,
    /// Period of the cycles, in forcing periods.
    pub period: u32,
    /// The cycles, in order.
    pub points: Vec<CurvePoint>,
    /// Why it ends, at the first and at the last point.
    pub ends: [&'static str; 2],
}

/// Pairs of neighbouring cells with different motions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pairs {
    /// Pairs of two cycles with a curve between them.
    pub explained: usize,
    /// Pairs of two cycles that both continue stably to the other cell: borders of basins.
    pub basins: usize,
    /// Other pairs of two cycles.
    pub unexplained: usize,
}

/// A pair of two cycles between which no curve was found.
#[derive(Clone, Debug)]
pub struct Unexplained {
    /// Values of the axes at both cells.
    pub cells: [[f64; 2]; 2],
    /// Why.
    pub reason: &'static str,
}

/// All curves of a map.
#[derive(Clone, Debug, Default)]
pub struct Curves {
    /// The curves.
    pub curves: Vec<Curve>,
    /// Points where two conditions meet.
    pub meetings: Vec<Meeting>,
    /// What lies between neighbouring cells.
    pub pairs: Pairs,
    /// Pairs without a curve.
    pub unexplained: Vec<Unexplained>,
    /// Seeds that could not be followed, with their kinds and places.
    pub failures: Vec<(Kind, [f64; 2], String)>,
}

/// What is searched for.
#[derive(Clone, Debug)]
pub struct Search<'a> {
    /// Longest cycles, in forcing periods.
    pub longest: u32,
    /// Kinds of curves; all if empty.
    pub kinds: &'a [Kind],
    /// Largest number of curves.
    pub most_curves: usize,
    /// Largest number of points of each part of a curve.
    pub most_points: usize,
}

/// Runs of two neighbouring cells from the same start, and the axis along which the cells differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Pair {
    cells: [usize; 2],
    axis: usize,
}

/// What the cycle of one cell meets on its way to the other one.
enum Way {
    /// It arrives there, and is stable.
    Continues,
    /// It ends or loses stability at these seeds.
    Meets(Vec<Seed>),
    /// It cannot be followed.
    Fails(&'static str),
}

/// The search in a map.
struct Finder<'a> {
    scene: &'a Scene,
    plan: &'a Plan,
    records: &'a dyn Records,
    search: &'a Search<'a>,
    parameters: [(usize, [f64; 2]); 2],
    halt: &'a AtomicBool,
    /// Pairs of cells that a curve passes between.
    crossed: HashSet<(usize, usize)>,
    /// How many cycles of a word were followed beyond their basins, along an axis in a direction.
    followed: HashMap<(u64, usize, bool), usize>,
    found: Curves,
}

/// Finds the bifurcation curves of a finished map over two parameters. `progress` gets the number of pairs that are done, and of all.
///
/// # Panics
/// If the axes of the scene are not two parameters.
pub fn curves(
    scene: &Scene,
    plan: &Plan,
    records: &dyn Records,
    search: &Search<'_>,
    progress: &dyn Fn(usize, usize),
    halt: &AtomicBool,
) -> Curves {
    let axes = scene.axes();
    let of = |i: usize| {
        let index = axes[i].target().parameter().expect("the axes are parameters");
        (index, [axes[i].min(), axes[i].max()])
    };
    let mut finder = Finder {
        scene,
        plan,
        records,
        search,
        parameters: [of(0), of(1)],
        halt,
        crossed: HashSet::new(),
        followed: HashMap::new(),
        found: Curves::default(),
    };
    finder.run(progress);
    finder.found
}

impl Finder<'_> {
    fn class(&self, cell: usize) -> (Class, Record) {
        let record = self.records.record(cell);
        (classify(&record), record)
    }

    /// Whether the class is that of a cycle that is short enough to be followed.
    fn is_short(&self, class: Class) -> bool {
        matches!(class, Class::Periodic { period } if period <= self.search.longest)
    }

    /// Whether a neighbour has the same motion from the same start.
    fn has_like(&self, run: usize) -> bool {
        let ([columns, rows], [i, j]) = (self.plan.counts(), self.plan.indices(run as u32));
        let (class, record) = self.class(run);
        let is_like = |other: usize| {
            let (next, there) = self.class(other);
            class == next && (record.word_hash, record.symmetric) == (there.word_hash, there.symmetric)
        };
        (i > 0 && is_like(run - 1))
            || (i + 1 < columns && is_like(run + 1))
            || (j > 0 && is_like(run - columns))
            || (j + 1 < rows && is_like(run + columns))
    }

    /// Returns all pairs of neighbours with different motions, of which at least one is a short cycle.
    fn pairs(&self) -> Vec<Pair> {
        let [columns, rows] = self.plan.counts();
        let mut pairs = Vec::new();
        for cell in 0..self.records.count() {
            let (class, record) = self.class(cell);
            let [i, j] = self.plan.indices(cell as u32);
            let right = (i + 1 < columns).then_some((cell + 1, 0));
            let above = (j + 1 < rows).then_some((cell + columns, 1));
            for (other, axis) in right.into_iter().chain(above) {
                let (next, other_record) = self.class(other);
                let differ = class != next
                    || (record.word_hash, record.symmetric)
                        != (other_record.word_hash, other_record.symmetric);
                // A cycle in one cell alone, amid other motion, shows no region.
                let is_region = |cell: usize, class: Class| self.is_short(class) && self.has_like(cell);
                if differ
                    && ((self.is_short(class) && self.is_short(next))
                        || is_region(cell, class)
                        || is_region(other, next))
                {
                    pairs.push(Pair { cells: [cell, other], axis });
                }
            }
        }
        pairs
    }

    fn run(&mut self, progress: &dyn Fn(usize, usize)) {
        let mut pairs = self.pairs();
        let count = pairs.len();
        Random::new(1).draw(&mut pairs, count);
        let mut undecided = Vec::new();
        for (nth, batch) in pairs.chunks(BATCH).enumerate() {
            if self.halt.load(Ordering::Relaxed) {
                break;
            }
            progress(nth * BATCH, count);
            let open: Vec<Pair> = batch.iter().copied().filter(|pair| !self.is_crossed(pair)).collect();
            let ways: Vec<[Way; 2]> =
                open.par_iter().map(|pair| [false, true].map(|side| self.way(pair, side, false))).collect();
            let continuing = self.continuing(&open, &ways);
            let beyond: Vec<Way> =
                continuing.par_iter().map(|(pair, side)| self.way(pair, *side, true)).collect();
            let mut seeds = Vec::new();
            for ((pair, side), way) in continuing.iter().zip(beyond) {
                let Way::Meets(met) = way else { continue };
                seeds.extend(met.into_iter().map(|seed| (seed, pair.cells[usize::from(*side)], pair.axis)));
            }
            for (pair, ways) in open.iter().zip(ways) {
                for (way, from) in ways.iter().zip(pair.cells) {
                    let Way::Meets(met) = way else { continue };
                    seeds.extend(met.iter().map(|seed| (seed.clone(), from, pair.axis)));
                }
                undecided.push((*pair, ways));
            }
            self.trace(seeds);
        }
        progress(count, count);
        self.tally(&pairs, undecided);
    }

    fn is_crossed(&self, pair: &Pair) -> bool {
        let [from, to] = pair.cells.map(|run| run % self.plan.cell_count());
        self.crossed.contains(&(from, to))
    }

    /// Follows the cycle of one cell of a pair to the other one; `beyond`: on to the end of the axis.
    fn way(&self, pair: &Pair, swapped: bool, beyond: bool) -> Way {
        let [from, to] = if swapped { [pair.cells[1], pair.cells[0]] } else { pair.cells };
        let (class, _) = self.class(from);
        let Class::Periodic { period } = class else { return Way::Fails("no cycle") };
        if !self.is_short(class) {
            return Way::Fails("the cycle is long");
        }
        let (parameter, axis) = (self.parameters[pair.axis].0, &self.scene.axes()[pair.axis]);
        let value = |cell: usize| axis.value(self.plan.indices(cell as u32)[pair.axis]);
        let rises = value(to) > value(from);
        let end = match (beyond, rises) {
            (false, _) => value(to),
            (true, false) => axis.min(),
            (true, true) => axis.max(),
        };
        let range = [value(from).min(end), value(from).max(end)];
        let mut model = self.plan.model(from as u32);
        let start = self.plan.start(from as u32, self.records);
        let Ok(orbit) = analyse(&*model, start, &self.scene.orbit_settings()) else {
            return Way::Fails("the model has no motion");
        };
        if orbit.class != class {
            return Way::Fails("the reference finds another class");
        }
        if let Some(time) = orbit.cycle_time {
            model.set_cycle_time(time);
        }
        let half_periods = if orbit.symmetric == Some(true) && period % 2 == 1 { period } else { 2 * period };
        let Ok((itinerary, seed)) = Itinerary::of(&*model, &orbit.strobe, half_periods) else {
            return Way::Fails("the motion ends");
        };
        let steps = if beyond { STEPS_BEYOND } else { STEPS };
        let limits = BranchLimits { steps, points: MOST_POINTS, to_curve: true, halt: self.halt };
        let parts = match follow_on(&*model, &itinerary, &seed, parameter, (range, rises), &limits) {
            Ok(parts) => parts,
            Err(_) => return Way::Fails("the equations of the cycle have no solution"),
        };
        let seeds: Vec<Seed> = parts
            .iter()
            .flat_map(|part| part.special.iter().filter_map(|special| Seed::of(part, special)))
            .collect();
        let last = parts.last().and_then(|part| Some((part, part.points.last()?)));
        let arrives = last.is_some_and(|(part, point)| {
            let is_there = (point.value - end).abs() < (point.value - value(from)).abs();
            part.end == BranchEnd::Range && is_there && point.is_stable()
        });
        match (arrives, seeds.is_empty()) {
            (true, true) => Way::Continues,
            (_, false) => Way::Meets(seeds),
            (false, true) => Way::Fails("the cycle changes in a way that is no curve here"),
        }
    }

    /// Returns the sides of pairs whose cycles continue to the other cell, of each word only the first ones along each axis and direction: beyond
    /// the border of their basin they end, too.
    fn continuing(&mut self, open: &[Pair], ways: &[[Way; 2]]) -> Vec<(Pair, bool)> {
        let mut all = Vec::new();
        for (pair, ways) in open.iter().zip(ways) {
            for (side, way) in ways.iter().enumerate() {
                let hash = self.class(pair.cells[side]).1.word_hash;
                let count = self.followed.entry((hash, pair.axis, side == 1)).or_default();
                if matches!(way, Way::Continues) && *count < BEYOND_BASINS {
                    *count += 1;
                    all.push((*pair, side == 1));
                }
            }
        }
        all
    }

    /// Follows the curves of seeds that lie on none yet. A seed has the cell of its branch, and the axis along which the branch was followed.
    fn trace(&mut self, seeds: Vec<(Seed, usize, usize)>) {
        let mut open: Vec<(Kind, Seed, usize, usize)> = seeds
            .into_iter()
            .filter_map(|(seed, cell, axis)| Some((Kind::of(&seed)?, seed, cell, axis)))
            .filter(|(kind, ..)| self.search.kinds.is_empty() || self.search.kinds.contains(kind))
            .collect();
        while !open.is_empty()
            && self.found.curves.len() < self.search.most_curves
            && !self.halt.load(Ordering::Relaxed)
        {
            open.retain(|(kind, seed, cell, axis)| {
                let place = self.place(seed, *cell, *axis);
                !self.is_on_curve(*kind, place) && !self.has_failed(*kind, place)
            });
            // Seeds of the same kind and word are often on the same curve, so only one of them is followed at a time.
            let (mut words, mut rest) = (Vec::new(), Vec::new());
            for seed in std::mem::take(&mut open) {
                let word = (seed.0, seed.1.word.clone());
                if open.len() == SEEDS || words.contains(&word) {
                    rest.push(seed);
                } else {
                    words.push(word);
                    open.push(seed);
                }
            }
            let limits = BranchLimits {
                steps: [1e-3, 1e-9, LARGEST_STEP],
                points: self.search.most_points,
                to_curve: false,
                halt: self.halt,
            };
            let traced: Vec<_> = open
                .par_iter()
                .map(|(_, seed, cell, axis)| {
                    let model = self.plan.model(*cell as u32);
                    curve(&*model, seed, self.parameters[*axis].0, self.parameters, &limits)
                })
                .collect();
            for ((kind, seed, cell, axis), arms) in open.iter().zip(traced) {
                let place = self.place(seed, *cell, *axis);
                match arms {
                    Ok(_) if self.is_on_curve(*kind, place) => {}
                    Ok(arms) if arms.iter().flatten().all(|part| part.points.len() < 2) => {
                        self.found.failures.push((*kind, place, "the curve has no second point".to_owned()));
                    }
                    Ok(arms) => self.add(*kind, seed, &arms),
                    Err(error) => self.found.failures.push((*kind, place, error.to_string())),
                }
            }
            open = rest;
        }
    }

    /// Returns the values of the axes at a seed.
    fn place(&self, seed: &Seed, cell: usize, axis: usize) -> [f64; 2] {
        let indices = self.plan.indices(cell as u32);
        let value = |i: usize| if i == axis { seed.value() } else { self.scene.axes()[i].value(indices[i]) };
        [value(0), value(1)]
    }

    /// Returns the values of the axes relative to their ranges.
    fn relative(&self, values: [f64; 2]) -> [f64; 2] {
        let of = |i: usize| {
            let [low, high] = self.parameters[i].1;
            (values[i] - low) / (high - low)
        };
        [of(0), of(1)]
    }

    fn is_on_curve(&self, kind: Kind, place: [f64; 2]) -> bool {
        let at = self.relative(place);
        let near = |pair: &[CurvePoint]| {
            let [a, b] = [self.relative(pair[0].values), self.relative(pair[1].values)];
            let (along, to) = ([b[0] - a[0], b[1] - a[1]], [at[0] - a[0], at[1] - a[1]]);
            let square = along[0] * along[0] + along[1] * along[1];
            let share = if square > 0.0 { (to[0] * along[0] + to[1] * along[1]) / square } else { 0.0 }
                .clamp(0.0, 1.0);
            (to[0] - share * along[0]).hypot(to[1] - share * along[1]) < ON_CURVE
        };
        self.found.curves.iter().any(|curve| curve.kind == kind && curve.points.windows(2).any(near))
    }

    /// Whether a seed of the same kind in the same cell could not be followed.
    fn has_failed(&self, kind: Kind, place: [f64; 2]) -> bool {
        let cell =
            |values: [f64; 2]| [0, 1].map(|i| cell_place(&self.scene.axes()[i], values[i]).round() as i64);
        self.found.failures.iter().any(|(other, at, _)| *other == kind && cell(*at) == cell(place))
    }

    /// Adds a curve from its two arms.
    fn add(&mut self, kind: Kind, seed: &Seed, arms: &[Vec<Branch>; 2]) {
        let number = self.found.curves.len() + 1;
        let mut points = Vec::new();
        let length: f64 = arms[0].iter().map(|part| part.length()).sum();
        for (arm, sign) in arms.iter().zip([-1.0, 1.0]) {
            let mut before = 0.0;
            let mut found = Vec::new();
            for part in arm {
                let of = |point: &BranchPoint| curve_point(point, length + sign * (before + point.arclength));
                found.extend(part.points.iter().map(of));
                for special in &part.special {
                    self.found.meetings.push(Meeting {
                        curve: number,
                        with: special.kind,
                        at: of(&special.at),
                    });
                }
                before += part.length();
            }
            if sign < 0.0 {
                found.reverse();
            } else if !found.is_empty() {
                found.remove(0);
            }
            points.extend(found);
        }
        let ends = arms.each_ref().map(|arm| arm.last().map_or("", |part| reason(&part.end)));
        self.cross(&points);
        let (word, period) = (seed.word.clone(), seed.period());
        self.found.curves.push(Curve { kind, word, period, points, ends });
    }

    /// Marks the pairs of cells that a curve passes between.
    fn cross(&mut self, points: &[CurvePoint]) {
        let place = |point: &CurvePoint| {
            let of = |i: usize| cell_place(&self.scene.axes()[i], point.values[i]);
            [of(0), of(1)]
        };
        let places: Vec<[f64; 2]> = points.iter().map(place).collect();
        let [columns, rows] = self.plan.counts();
        for pair in places.windows(2) {
            let [a, b] = [pair[0], pair[1]];
            for axis in 0..2 {
                // The curve crosses the line through the centres of a row or a column of cells.
                let other = 1 - axis;
                let (low, high) = (a[other].min(b[other]), a[other].max(b[other]));
                for line in low.ceil() as usize..=high.floor().max(0.0) as usize {
                    let share = (line as f64 - a[other]) / (b[other] - a[other]);
                    let at = if share.is_finite() { a[axis] + share * (b[axis] - a[axis]) } else { a[axis] };
                    for at in [at - SLACK, at + SLACK] {
                        let [i, j] = if axis == 0 { [at, line as f64] } else { [line as f64, at] };
                        if i < 0.0 || j < 0.0 || i >= columns as f64 || j >= rows as f64 {
                            continue;
                        }
                        let cell = i as usize + columns * j as usize;
                        self.crossed.insert((cell, cell + if axis == 0 { 1 } else { columns }));
                    }
                }
            }
        }
    }

    /// Counts the pairs of two short cycles.
    fn tally(&mut self, pairs: &[Pair], undecided: Vec<(Pair, [Way; 2])>) {
        let of_cycles = |pair: &Pair| pair.cells.iter().all(|&cell| self.is_short(self.class(cell).0));
        let ways: HashMap<(usize, usize), [Way; 2]> =
            undecided.into_iter().map(|(pair, ways)| ((pair.cells[0], pair.cells[1]), ways)).collect();
        let (mut tally, mut unexplained) = (Pairs::default(), Vec::new());
        for pair in pairs.iter().filter(|pair| of_cycles(pair)) {
            let found = ways.get(&(pair.cells[0], pair.cells[1]));
            if self.is_crossed(pair) {
                tally.explained += 1;
            } else if let Some([Way::Continues, Way::Continues]) = found {
                tally.basins += 1;
            } else if let Some(found) = found {
                tally.unexplained += 1;
                let reason = found.iter().find_map(|way| match way {
                    Way::Fails(reason) => Some(*reason),
                    Way::Meets(_) => Some("the curve of what the cycle meets passes elsewhere"),
                    Way::Continues => None,
                });
                let place = |cell: usize| {
                    let indices = self.plan.indices(cell as u32);
                    [0, 1].map(|i| self.scene.axes()[i].value(indices[i]))
                };
                unexplained.push(Unexplained { cells: pair.cells.map(place), reason: reason.unwrap_or("") });
            }
        }
        (self.found.pairs, self.found.unexplained) = (tally, unexplained);
    }
}

/// Returns the place of a value on an axis, in cells from the first centre.
fn cell_place(axis: &Axis, value: f64) -> f64 {
    let (mut low, mut high) = (0, axis.count() - 1);
    while high - low > 1 {
        let middle = (low + high) / 2;
        if axis.value(middle) <= value { low = middle } else { high = middle }
    }
    let [from, to] = [axis.value(low), axis.value(high)];
    low as f64 + (value - from) / (to - from)
}

fn curve_point(point: &BranchPoint, arclength: f64) -> CurvePoint {
    let values = point.solution.values();
    CurvePoint {
        values: [values[values.len() - 2], values[values.len() - 1]],
        arclength,
        state: point.solution.state(),
        multipliers: point.multipliers.clone(),
        stable: point.is_stable(),
    }
}

/// Describes why a curve ends.
fn reason(end: &BranchEnd) -> &'static str {
    match end {
        BranchEnd::Range => "border of the map",
        BranchEnd::Border => "the sequence of flights changes",
        BranchEnd::Failed(CycleError::Diverges) => "Newton's method fails at the shortest step",
        BranchEnd::Failed(_) => "the model has no motion beyond",
        BranchEnd::Closed => "closed",
        BranchEnd::TurnsBack => "turns back",
        BranchEnd::Points => "largest number of points",
        BranchEnd::Curve | BranchEnd::Halted => "interrupted",
    }
}
