//! Bifurcation curves of a map: the borders between its regions, as lines.
//!
//! Neighbouring cells with different motions are the seeds. The cycle of one of them is followed along the axis to the other one; what it
//! passes on the way, a fold, a flip, a pitchfork or a graze, is a point of a curve. The curve is then followed over both axes.

use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use crate::map::plan::Plan;
use crate::map::random::Random;
use crate::map::scene::{Axis, Scene};
use crate::record::classify::classify;
use crate::record::measures::{Measure, Measured};
use crate::record::{Record, Records, Spelling};
use rattlemap_dynamics::cycle::{
    Branch, BranchEnd, BranchLimits, BranchPoint, Condition, CycleError, CycleFunction, Itinerary, Seed,
    Solution, Special, SpecialPoint, curve, follow_on,
};
use rattlemap_dynamics::machine::Touched;
use rattlemap_dynamics::model::{Model, State, Timing};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::named;
use rattlemap_dynamics::orbit::{Class, EVENT_PERIODS, LONGEST_WINDOW, analyse_until, quantities_on};
use rattlemap_dynamics::word::Word;

/// Steps along the way between two cells: the first, least and largest one, relative to the way, and the largest number of points.
const STEPS: [f64; 3] = [0.25, 1e-6, 0.5];
const MOST_POINTS: usize = 30;

/// Steps from a cell to the end of an axis.
const STEPS_BEYOND: [f64; 3] = [0.01, 1e-6, 0.1];

/// Largest step of a curve, relative to the axes.
const LARGEST_STEP: f64 = 0.05;

/// Number of straight pieces between two points of a curve. They are parts of a cubic, and their error is below [`ON_CURVE`].
const PIECES: usize = 8;

/// Largest length of the slopes at two points, relative to their distance, with which a cubic connects them.
const LONGEST_SLOPE: f64 = 3.0;

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
        /// The force of a contact touches 0, or an impact is at the limit of those after which contact lasts.
        MeshingBorder = "meshing_border",
        /// The motion without events touches a wall.
        ContactEnd = "contact_end",
        /// A sliding rate or a holding force is at its limit.
        Sticking = "sticking",
        /// A quantity has a given value.
        Condition = "condition",
    }
}

impl Serialize for Kind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Kind {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Kind, D::Error> {
        Kind::named(&String::deserialize(deserializer)?)
            .ok_or_else(|| de::Error::custom("there is no such kind"))
    }
}

/// Words as their symbols in order of time.
mod spelled {
    use super::*;

    pub(super) fn serialize<S: Serializer>(word: &Word, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&word.time_order())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Word, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
    }
}

impl Kind {
    /// Returns the kind of the curve of a seed; none of a border between pieces of a smooth law.
    fn of(seed: &Seed) -> Option<Kind> {
        match seed.condition {
            Condition::Fold => Some(Kind::Fold),
            Condition::Flip if seed.is_half() => Some(Kind::Pitchfork),
            Condition::Flip => Some(Kind::Flip),
            Condition::Touch if seed.events() == 0 && seed.touched() == Some(Touched::Wall) => {
                Some(Kind::ContactEnd)
            }
            Condition::Touch => Kind::touching(seed.touched()?),
            Condition::Value => Some(Kind::Condition),
        }
    }

    /// Returns the kind of the curve on which a motion with events touches something.
    fn touching(touched: Touched) -> Option<Kind> {
        match touched {
            Touched::Wall => Some(Kind::Grazing),
            Touched::Contact => Some(Kind::MeshingGrazing),
            Touched::Force | Touched::Limit => Some(Kind::MeshingBorder),
            Touched::Friction => Some(Kind::Sticking),
            Touched::Piece => None,
        }
    }
}

/// What else holds at a point of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum With {
    /// The condition of another kind of curve.
    Kind(Kind),
    /// The sequence of flights changes in a way that has no kind.
    Border,
    /// A parameter has a requested value.
    Value,
}

impl With {
    fn of(special: &SpecialPoint) -> With {
        let kind = match special.kind {
            Special::Fold => Some(Kind::Fold),
            Special::Flip => Some(Kind::Flip),
            Special::Pitchfork => Some(Kind::Pitchfork),
            Special::Grazing | Special::Border => special.meets.and_then(Kind::touching),
            Special::Value => return With::Value,
        };
        kind.map_or(With::Border, With::Kind)
    }

    /// Returns its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            With::Kind(kind) => kind.name(),
            With::Border => "border",
            With::Value => "value",
        }
    }
}

/// A cycle on a curve.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Values of the two axes.
    pub values: [f64; 2],
    /// Length of the curve from its first point, in scaled unknowns.
    pub arclength: f64,
    /// Changes of the values of the axes per arclength.
    pub slope: [f64; 2],
    /// State at phase 0.
    pub state: State,
    /// Floquet multipliers, largest modulus first: of half a cycle that is its own mirror image, those of the reflected map.
    pub multipliers: Vec<[f64; 2]>,
    /// Whether all multipliers but the critical one lie within the unit circle.
    pub stable: bool,
}

/// A point at which something else holds, too.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Meeting {
    /// Number of the curve, from 1.
    pub curve: usize,
    /// What else holds.
    pub with: With,
    /// The cycle.
    pub at: CurvePoint,
}

/// A bifurcation curve.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Curve {
    /// What happens on it.
    pub kind: Kind,
    /// Word of the cycle at which it was found.
    #[serde(with = "spelled")]
    pub word: Word,
    /// Period of the cycles, in forcing periods.
    pub period: u32,
    /// The cycles, in order.
    pub points: Vec<CurvePoint>,
    /// Why it ends, at the first and at the last point.
    pub ends: [String; 2],
}

impl CurvePoint {
    /// Returns values of the axes on the way to the next point of a curve, and at it, from the cubic that has the slopes of both.
    pub fn way_to(&self, next: &CurvePoint) -> impl Iterator<Item = [f64; 2]> {
        let apart = next.arclength - self.arclength;
        let chord = [0, 1].map(|i| next.values[i] - self.values[i]);
        // The ranges of the axes may differ by orders of magnitude: each slope is compared with the larger of both ends' slopes.
        let scale = |i: usize| self.slope[i].abs().max(next.slope[i].abs()).max(f64::MIN_POSITIVE);
        let length = |of: [f64; 2]| (of[0] / scale(0)).hypot(of[1] / scale(1));
        let is_smooth = apart * length(self.slope).min(length(next.slope)) <= LONGEST_SLOPE * length(chord);
        let at = move |t: f64, i: usize| {
            let (from, to) = (self.values[i], next.values[i]);
            let [first, last] = [self.slope[i], next.slope[i]].map(|slope| slope * apart - (to - from));
            let line = from + t * (to - from);
            if is_smooth { line + t * (1.0 - t) * ((1.0 - t) * first - t * last) } else { line }
        };
        (1..=PIECES).map(move |k| [0, 1].map(|i| at(k as f64 / PIECES as f64, i)))
    }
}

impl Curve {
    /// Returns values of the axes along the curve: its points, and points of cubics between them.
    pub fn line(&self) -> Vec<[f64; 2]> {
        let first = self.points.first().map(|point| point.values);
        first.into_iter().chain(self.points.windows(2).flat_map(|pair| pair[0].way_to(&pair[1]))).collect()
    }
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
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Curves {
    /// The curves.
    pub curves: Vec<Curve>,
    /// Points where two conditions meet.
    pub meetings: Vec<Meeting>,
    /// What lies between neighbouring cells; none if only some curves are searched.
    #[serde(skip)]
    pub pairs: Option<Pairs>,
    /// Pairs without a curve.
    #[serde(skip)]
    pub unexplained: Vec<Unexplained>,
    /// Seeds that could not be followed, with their kinds and places.
    pub failures: Vec<(Kind, [f64; 2], String)>,
    /// Why a search from given values met nothing in a direction.
    #[serde(skip)]
    pub nothing: Option<&'static str>,
}

/// What is searched for.
#[derive(Clone, Debug)]
pub struct Search<'a> {
    /// Longest cycles, in forcing periods.
    pub longest: u32,
    /// Kinds of curves; all if empty.
    pub kinds: &'a [Kind],
    /// Word of the cycles that are followed; none follows all.
    pub word: Option<&'a Spelling>,
    /// Whether cycles are followed on beyond their first change, where they are unstable, to the end of the axis.
    pub unstable: bool,
    /// A quantity that the map has, and the value that it has on curves of [`Kind::Condition`].
    pub condition: Option<(Measure, f64)>,
    /// Axes, and values at which the points of curves are located.
    pub through: &'a [(usize, f64)],
    /// Values of the axes at which curves are searched: along both axes, from the cycle there. None searches between the map's cells.
    pub from: Option<[f64; 2]>,
    /// Largest number of curves.
    pub most_curves: usize,
    /// Largest number of points of each part of a curve.
    pub most_points: usize,
}

impl Search<'_> {
    /// Whether curves of a kind are searched.
    fn wants(&self, kind: Kind) -> bool {
        self.kinds.is_empty() || self.kinds.contains(&kind)
    }

    /// Whether all curves between cells are searched. Otherwise the share of pairs with a curve says nothing.
    fn is_whole(&self) -> bool {
        self.kinds.is_empty() && self.word.is_none() && self.from.is_none() && !self.unstable
    }
}

/// Runs of two neighbouring cells from the same start, and the axis along which the cells differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Pair {
    cells: [usize; 2],
    axis: usize,
}

/// A seed that a branch has met.
struct Met {
    seed: Seed,
    /// The model at the start of the branch, and the axis of the branch.
    model: Box<dyn Model>,
    axis: usize,
}

/// Where a branch of cycles begins and ends.
struct Course {
    model: Box<dyn Model>,
    start: State,
    axis: usize,
    end: f64,
    reach: Reach,
}

/// How far a branch is followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reach {
    /// To its first change, or to the other cell.
    Cell,
    /// To its first change, or to the end of the axis.
    Axis,
    /// Through all changes to the end of the axis.
    Whole,
    /// To the value of the condition, or to the other cell.
    Condition,
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
    /// How many cycles of a word and a period were followed beyond their basins, along an axis in a direction.
    followed: HashMap<(u64, u32, usize, bool), usize>,
    found: Curves,
    /// The lines of the curves that are found.
    lines: Vec<Vec<[f64; 2]>>,
}

/// What watches a search.
pub struct Watch<'a> {
    /// Gets the number of pairs of cells that are done, and of all.
    pub progress: &'a dyn Fn(usize, usize),
    /// Gets what is found so far.
    pub found: &'a dyn Fn(&Curves),
    /// Ends the search.
    pub halt: &'a AtomicBool,
}

/// Finds the bifurcation curves of a finished map over two parameters. `known`: what an interrupted search has found.
///
/// # Panics
/// If the axes of the scene are not two parameters.
pub fn curves(
    scene: &Scene,
    plan: &Plan,
    records: &dyn Records,
    search: &Search<'_>,
    known: Curves,
    watch: &Watch<'_>,
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
        halt: watch.halt,
        crossed: HashSet::new(),
        followed: HashMap::new(),
        lines: known.curves.iter().map(Curve::line).collect(),
        found: known,
    };
    let lines = std::mem::take(&mut finder.lines);
    lines.iter().for_each(|line| finder.cross(line));
    finder.lines = lines;
    finder.run(watch);
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

    /// Whether a neighbouring cell has the same motion, from any start.
    fn has_like(&self, run: usize) -> bool {
        let ([columns, rows], [i, j]) = (self.plan.counts(), self.plan.indices(run as u32));
        let (class, record) = self.class(run);
        let cell = run % self.plan.cell_count();
        let is_like = |other: usize| {
            (other..self.records.count()).step_by(self.plan.cell_count()).any(|run| {
                let (next, there) = self.class(run);
                class == next && (record.word_hash, record.symmetric) == (there.word_hash, there.symmetric)
            })
        };
        (i > 0 && is_like(cell - 1))
            || (i + 1 < columns && is_like(cell + 1))
            || (j > 0 && is_like(cell - columns))
            || (j + 1 < rows && is_like(cell + columns))
    }

    /// Returns all pairs of neighbouring runs from the same start.
    fn neighbours(&self) -> Vec<Pair> {
        let [columns, rows] = self.plan.counts();
        let of = |cell: usize| {
            let [i, j] = self.plan.indices(cell as u32);
            let right = (i + 1 < columns).then_some(Pair { cells: [cell, cell + 1], axis: 0 });
            let above = (j + 1 < rows).then_some(Pair { cells: [cell, cell + columns], axis: 1 });
            right.into_iter().chain(above)
        };
        (0..self.records.count()).flat_map(of).collect()
    }

    /// Returns all pairs of neighbours with different motions, of which at least one is a short cycle.
    fn pairs(&self) -> Vec<Pair> {
        let mut pairs = self.neighbours();
        pairs.retain(|pair| {
            let [cell, other] = pair.cells;
            let ((class, record), (next, there)) = (self.class(cell), self.class(other));
            let differ =
                class != next || (record.word_hash, record.symmetric) != (there.word_hash, there.symmetric);
            // A cycle in one cell alone, amid other motion, shows no region.
            let is_region = |cell: usize, class: Class| self.is_short(class) && self.has_like(cell);
            differ
                && ((self.is_short(class) && self.is_short(next))
                    || is_region(cell, class)
                    || is_region(other, next))
        });
        pairs
    }

    fn run(&mut self, watch: &Watch<'_>) {
        if let Some(values) = self.search.from {
            self.run_from(values, watch.progress);
            return;
        }
        let only_condition = self.search.kinds == [Kind::Condition];
        let mut pairs = if only_condition { Vec::new() } else { self.pairs() };
        let count = pairs.len();
        Random::new(1).draw(&mut pairs, count);
        // Pairs of two cycles say more about curves than the borders of chaos.
        pairs.sort_by_cached_key(|pair| !self.is_of_cycles(pair));
        let mut undecided = Vec::new();
        for (nth, batch) in pairs.chunks(BATCH).enumerate() {
            if self.halt.load(Ordering::Relaxed) {
                break;
            }
            (watch.progress)(nth * BATCH, count);
            let open: Vec<Pair> = batch.iter().copied().filter(|pair| !self.is_crossed(pair)).collect();
            let ways: Vec<[Way; 2]> = open
                .par_iter()
                .map(|pair| [false, true].map(|side| self.way(pair, side, Reach::Cell)))
                .collect();
            let continuing = self.continuing(&open, &ways);
            let reach = if self.search.unstable { Reach::Whole } else { Reach::Axis };
            let beyond: Vec<Way> =
                continuing.par_iter().map(|(pair, side)| self.way(pair, *side, reach)).collect();
            // What was cut short says nothing.
            if self.halt.load(Ordering::Relaxed) {
                break;
            }
            let mut seeds = Vec::new();
            for ((pair, side), way) in continuing.iter().zip(beyond) {
                let Way::Meets(met) = way else { continue };
                let cell = pair.cells[usize::from(*side)];
                seeds.extend(met.into_iter().map(|seed| self.met(seed, cell, pair.axis)));
            }
            for (pair, ways) in open.iter().zip(ways) {
                for (way, from) in ways.iter().zip(pair.cells) {
                    let Way::Meets(met) = way else { continue };
                    seeds.extend(met.iter().map(|seed| self.met(seed.clone(), from, pair.axis)));
                }
                undecided.push((*pair, ways));
            }
            self.trace(seeds);
            (watch.found)(&self.found);
        }
        (watch.progress)(count, count);
        if self.search.is_whole() {
            self.tally(&pairs, undecided);
        }
        self.run_condition(watch);
    }

    /// Searches curves of the condition between neighbouring cells with the same cycle.
    fn run_condition(&mut self, watch: &Watch<'_>) {
        let Some((measure, value)) = self.search.condition else { return };
        if !self.search.wants(Kind::Condition) {
            return;
        }
        // Other curves may pass between cells with the same cycle.
        self.crossed.clear();
        let of = |cell: usize| measure.of(&self.class(cell).1).unwrap_or(f64::NAN) - value;
        let is_same = |cell: usize, other: usize| {
            let ((class, record), (next, there)) = (self.class(cell), self.class(other));
            self.is_short(class)
                && class == next
                && (record.word_hash, record.symmetric) == (there.word_hash, there.symmetric)
        };
        let mut pairs = self.neighbours();
        pairs.retain(|pair| {
            let [cell, other] = pair.cells;
            of(cell) * of(other) < 0.0 && is_same(cell, other)
        });
        let count = pairs.len();
        Random::new(1).draw(&mut pairs, count);
        for batch in pairs.chunks(SEEDS) {
            let open: Vec<Pair> = batch.iter().copied().filter(|pair| !self.is_crossed(pair)).collect();
            let ways: Vec<Way> =
                open.par_iter().map(|pair| self.way(pair, false, Reach::Condition)).collect();
            if self.halt.load(Ordering::Relaxed) {
                break;
            }
            let mut seeds = Vec::new();
            for (pair, way) in open.iter().zip(ways) {
                let Way::Meets(met) = way else { continue };
                seeds.extend(met.into_iter().map(|seed| self.met(seed, pair.cells[0], pair.axis)));
            }
            self.trace(seeds);
            (watch.found)(&self.found);
        }
    }

    /// Returns by how much a cycle differs from the condition.
    fn off_condition(&self, model: &dyn Model, solution: &Solution, period: u32) -> f64 {
        let of = || {
            let (measure, value) = self.search.condition?;
            let flow = Flow::of(model).ok()?;
            let quantities = quantities_on(&flow, model.law(), solution.state(), period)?;
            let quantities = Some(&quantities);
            let cycle_time = (flow.timing == Timing::Cycle).then_some(flow.period);
            let numbers = Measured { quantities, multiplier: None, cycle_time }.numbers();
            Some(numbers[measure.place]? - value)
        };
        of().unwrap_or(f64::NAN)
    }

    /// Searches along both axes, in both directions, from the cycle at given values.
    fn run_from(&mut self, values: [f64; 2], progress: &dyn Fn(usize, usize)) {
        let mut model = self.plan.model(0);
        (0..2).for_each(|i| model.assign(self.parameters[i].0, values[i]));
        let (start, axes) = (self.plan.start(0, self.records), self.scene.axes());
        for (nth, (axis, rises)) in [(0, false), (0, true), (1, false), (1, true)].into_iter().enumerate() {
            progress(nth, 4);
            let end = if rises { axes[axis].max() } else { axes[axis].min() };
            let reach = if self.search.unstable { Reach::Whole } else { Reach::Axis };
            let course = Course { model: model.clone_model(), start, axis, end, reach };
            match self.follow(course, None) {
                Way::Meets(met) => {
                    let of = |seed| Met { seed, model: model.clone_model(), axis };
                    self.trace(met.into_iter().map(of).collect());
                }
                Way::Fails(reason) => self.found.nothing = Some(reason),
                Way::Continues => {}
            }
        }
        progress(4, 4);
    }

    fn met(&self, seed: Seed, cell: usize, axis: usize) -> Met {
        Met { seed, model: self.plan.model(cell as u32), axis }
    }

    /// Whether both cells of a pair have short cycles.
    fn is_of_cycles(&self, pair: &Pair) -> bool {
        pair.cells.iter().all(|&cell| self.is_short(self.class(cell).0))
    }

    fn is_crossed(&self, pair: &Pair) -> bool {
        let [from, to] = pair.cells.map(|run| run % self.plan.cell_count());
        self.crossed.contains(&(from, to))
    }

    /// Follows the cycle of one cell of a pair towards the other one.
    fn way(&self, pair: &Pair, swapped: bool, reach: Reach) -> Way {
        let [from, to] = if swapped { [pair.cells[1], pair.cells[0]] } else { pair.cells };
        let (class, _) = self.class(from);
        let axis = &self.scene.axes()[pair.axis];
        let value = |cell: usize| axis.value(self.plan.indices(cell as u32)[pair.axis]);
        let end = match (reach, value(to) > value(from)) {
            (Reach::Cell | Reach::Condition, _) => value(to),
            (Reach::Axis | Reach::Whole, false) => axis.min(),
            (Reach::Axis | Reach::Whole, true) => axis.max(),
        };
        let (model, start) = (self.plan.model(from as u32), self.plan.start(from as u32, self.records));
        self.follow(Course { model, start, axis: pair.axis, end, reach }, Some(class))
    }

    /// Follows the cycle at the start of a course, whose class may be known.
    fn follow(&self, course: Course, known: Option<Class>) -> Way {
        if known.is_some_and(|class| !self.is_short(class)) {
            return Way::Fails("no short cycle");
        }
        let Course { mut model, start, axis, end, reach } = course;
        let parameter = self.parameters[axis].0;
        let value = model.value(parameter);
        let (range, rises) = ([value.min(end), value.max(end)], end > value);
        let settings = self.scene.orbit_settings();
        let found =
            analyse_until(&*model, start, &settings, LONGEST_WINDOW, EVENT_PERIODS, self.halt, &|_, _| ());
        let Ok(Some(orbit)) = found else {
            return Way::Fails("the model has no motion");
        };
        if known.is_some_and(|class| class != orbit.class) {
            return Way::Fails("the reference finds another class");
        }
        let Class::Periodic { period } = orbit.class else { return Way::Fails("no cycle") };
        if !self.is_short(orbit.class) {
            return Way::Fails("no short cycle");
        }
        if self.search.word.is_some_and(|word| *word != Spelling::new(&orbit.word)) {
            return Way::Fails("the cycle has another word");
        }
        if let Some(time) = orbit.cycle_time {
            model.set_cycle_time(time);
        }
        let half_periods = if orbit.symmetric == Some(true) && period % 2 == 1 { period } else { 2 * period };
        let Ok((itinerary, seed)) = Itinerary::of(&*model, &orbit.strobe, half_periods) else {
            return Way::Fails("the motion ends");
        };
        let condition = |model: &dyn Model, solution: &Solution| self.off_condition(model, solution, period);
        let condition = [CycleFunction(&condition)];
        let is_condition =
            reach == Reach::Condition || self.search.from.is_some() && self.search.wants(Kind::Condition);
        let limits = BranchLimits {
            steps: if matches!(reach, Reach::Cell | Reach::Condition) { STEPS } else { STEPS_BEYOND },
            points: if reach == Reach::Whole { self.search.most_points } else { MOST_POINTS },
            to_curve: reach != Reach::Whole,
            through: if is_condition { &condition } else { &[] },
            ..BranchLimits::new(self.halt)
        };
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
            let is_there = (point.value - end).abs() < (point.value - value).abs();
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
                let (class, record) = self.class(pair.cells[side]);
                // Cycles of different periods may have the same word.
                let Class::Periodic { period } = class else { continue };
                let key = (record.word_hash, period, pair.axis, side == 1);
                let count = self.followed.entry(key).or_default();
                let goes_on =
                    matches!(way, Way::Continues) || self.search.unstable && matches!(way, Way::Meets(_));
                if goes_on && *count < BEYOND_BASINS {
                    *count += 1;
                    all.push((*pair, side == 1));
                }
            }
        }
        all
    }

    /// Follows the curves of seeds that lie on none yet.
    fn trace(&mut self, seeds: Vec<Met>) {
        let mut open: Vec<(Kind, Met)> = seeds
            .into_iter()
            .filter_map(|met| Some((Kind::of(&met.seed)?, met)))
            .filter(|(kind, ..)| self.search.wants(*kind))
            .collect();
        while !open.is_empty()
            && self.found.curves.len() < self.search.most_curves
            && !self.halt.load(Ordering::Relaxed)
        {
            open.retain(|(kind, met)| {
                let place = self.place(met);
                !self.is_on_curve(*kind, place) && !self.has_failed(*kind, place)
            });
            // Seeds of the same kind and word are often on the same curve, so only one of them is followed at a time.
            let (mut words, mut rest) = (Vec::new(), Vec::new());
            for seed in std::mem::take(&mut open) {
                let word = (seed.0, seed.1.seed.word.clone());
                if open.len() == SEEDS || words.contains(&word) {
                    rest.push(seed);
                } else {
                    words.push(word);
                    open.push(seed);
                }
            }
            let traced: Vec<_> = open
                .par_iter()
                .map(|(_, Met { seed, model, axis })| {
                    let condition = |model: &dyn Model, solution: &Solution| {
                        self.off_condition(model, solution, seed.period())
                    };
                    let of_axis = |&(axis, value): &(usize, f64)| {
                        move |_: &dyn Model, solution: &Solution| {
                            let values = solution.values();
                            values[values.len() - 2 + axis] - value
                        }
                    };
                    let of_axes: Vec<_> = self.search.through.iter().map(of_axis).collect();
                    let through: Vec<CycleFunction<'_>> =
                        of_axes.iter().map(|test| CycleFunction(test)).collect();
                    let limits = BranchLimits {
                        steps: [1e-3, 1e-9, LARGEST_STEP],
                        points: self.search.most_points,
                        to_curve: false,
                        through: &through,
                        value: Some(CycleFunction(&condition)),
                        halt: self.halt,
                    };
                    let arm = |forward: bool| {
                        let parameter = self.parameters[*axis].0;
                        curve(&**model, seed, parameter, (self.parameters, forward), &limits)
                    };
                    let (first, second) = rayon::join(|| arm(false), || arm(true));
                    let (first, second) = (first?, second?);
                    // A closed curve has all its points already.
                    let is_closed = first.last().is_some_and(|part| part.end == BranchEnd::Closed);
                    Ok::<_, CycleError>([first, if is_closed { Vec::new() } else { second }])
                })
                .collect();
            for ((kind, met), arms) in open.iter().zip(traced) {
                let place = self.place(met);
                match arms {
                    Ok(_) if self.is_on_curve(*kind, place) => {}
                    Ok(arms) if arms.iter().flatten().all(|part| part.points.len() < 2) => {
                        self.found.failures.push((*kind, place, "the curve has no second point".to_owned()));
                    }
                    Ok(arms) => self.add(*kind, &met.seed, &arms),
                    Err(CycleError::Halted) => {}
                    Err(error) => self.found.failures.push((*kind, place, error.to_string())),
                }
            }
            open = rest;
        }
    }

    /// Returns the values of the axes at a seed.
    fn place(&self, Met { seed, model, axis }: &Met) -> [f64; 2] {
        [0, 1].map(|i| if i == *axis { seed.value() } else { model.value(self.parameters[i].0) })
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
        let near = |pair: &[[f64; 2]]| {
            let [a, b] = [self.relative(pair[0]), self.relative(pair[1])];
            let (along, to) = ([b[0] - a[0], b[1] - a[1]], [at[0] - a[0], at[1] - a[1]]);
            let square = along[0] * along[0] + along[1] * along[1];
            let share = if square > 0.0 { (to[0] * along[0] + to[1] * along[1]) / square } else { 0.0 }
                .clamp(0.0, 1.0);
            (to[0] - share * along[0]).hypot(to[1] - share * along[1]) < ON_CURVE
        };
        let curves = self.found.curves.iter().zip(&self.lines).filter(|(curve, _)| curve.kind == kind);
        curves.into_iter().any(|(_, line)| line.windows(2).any(near))
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
        let ranges = self.parameters.map(|(_, range)| range);
        let mut points = Vec::new();
        let length: f64 = arms[0].iter().map(|part| part.length()).sum();
        for (arm, sign) in arms.iter().zip([-1.0, 1.0]) {
            let mut before = 0.0;
            let mut found = Vec::new();
            for part in arm {
                let of = |point: &BranchPoint| {
                    curve_point(point, (ranges, sign), length + sign * (before + point.arclength))
                };
                found.extend(part.points.iter().map(of));
                for special in &part.special {
                    self.found.meetings.push(Meeting {
                        curve: number,
                        with: With::of(special),
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
        let ends = arms.each_ref().map(|arm| arm.last().map_or("", reason).to_owned());
        let (word, period) = (seed.word.clone(), seed.period());
        let curve = Curve { kind, word, period, points, ends };
        let line = curve.line();
        self.cross(&line);
        self.lines.push(line);
        self.found.curves.push(curve);
    }

    /// Marks the pairs of cells that a curve passes between.
    fn cross(&mut self, line: &[[f64; 2]]) {
        let place = |values: &[f64; 2]| [0, 1].map(|i| cell_place(&self.scene.axes()[i], values[i]));
        let places: Vec<[f64; 2]> = line.iter().map(place).collect();
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
        let ways: HashMap<(usize, usize), [Way; 2]> =
            undecided.into_iter().map(|(pair, ways)| ((pair.cells[0], pair.cells[1]), ways)).collect();
        let (mut tally, mut unexplained) = (Pairs::default(), Vec::new());
        for pair in pairs.iter().filter(|pair| self.is_of_cycles(pair)) {
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
        (self.found.pairs, self.found.unexplained) = (Some(tally), unexplained);
    }
}

/// Returns the place of a value on an axis, in cells from the first centre.
pub fn cell_place(axis: &Axis, value: f64) -> f64 {
    let (mut low, mut high) = (0, axis.count() - 1);
    while high - low > 1 {
        let middle = (low + high) / 2;
        if axis.value(middle) <= value { low = middle } else { high = middle }
    }
    let [from, to] = [axis.value(low), axis.value(high)];
    low as f64 + (value - from) / (to - from)
}

/// `sign`: whether the arclength of the curve rises or falls along the branch.
fn curve_point(point: &BranchPoint, (ranges, sign): ([[f64; 2]; 2], f64), arclength: f64) -> CurvePoint {
    let (values, heading) = (point.solution.values(), point.heading(2));
    CurvePoint {
        values: [values[values.len() - 2], values[values.len() - 1]],
        arclength,
        slope: [0, 1].map(|i| sign * heading[i] * (ranges[i][1] - ranges[i][0])),
        state: point.solution.state(),
        multipliers: point.multipliers.clone(),
        stable: point.is_stable(),
    }
}

/// Describes why a curve ends.
fn reason(part: &Branch) -> &'static str {
    match &part.end {
        BranchEnd::Range => "border of the map",
        BranchEnd::Border => match part.special.last().map(With::of) {
            Some(With::Kind(Kind::Grazing)) => "another wall is touched",
            Some(With::Kind(Kind::MeshingGrazing)) => "a contact touches its wall",
            Some(With::Kind(Kind::MeshingBorder)) => "another contact begins or ends",
            Some(With::Kind(Kind::Sticking)) => "sticking begins or ends",
            _ => "the sequence of flights changes",
        },
        BranchEnd::Failed(CycleError::Diverges) => "Newton's method fails at the shortest step",
        BranchEnd::Failed(CycleError::Halted) => "interrupted",
        BranchEnd::Failed(_) => "the model has no motion beyond",
        BranchEnd::Closed => "closed",
        BranchEnd::TurnsBack => "turns back",
        BranchEnd::Points => "largest number of points",
        BranchEnd::Curve | BranchEnd::Halted => "interrupted",
    }
}
