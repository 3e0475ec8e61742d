//! One cell of a finished map, and the computations of this cell on the reference.

use std::sync::atomic::AtomicBool;

use super::Subject;
use super::compare::{Answer, Bars, Labels};
use super::finite::not_finite;
use crate::findings::attractors::Basins;
use crate::gpu::Precision;
use crate::map::engine::measured_record;
use crate::map::plan::Needs;
use crate::map::random::Random;
use crate::record::Record;
use crate::record::classify::{classify, status};
use crate::record::distance::{self, farther};
use rattlemap_dynamics::model::{Law, Model, Oscillator, State, Wall};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{Allowance, Trajectory};
use rattlemap_dynamics::orbit::{self, Budget, Class, Status, measure_until};
use rattlemap_dynamics::stability::{UNIT, multipliers};

/// Returns the smallest relative difference of a state or parameter that an engine of this precision resolves: several rounding units,
/// because errors accumulate over the steps of a period.
pub(super) fn resolution(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 1e-6,
        Precision::F64 => 1e-12,
    }
}

/// Largest relative change of the meshing speed that rounding can explain.
const MOST_OF_MESH_SPEED: f64 = 2e-3;

/// Number of perturbed motions that measure the effect of rounding on a cycle.
const TURNS: u64 = 6;
/// Factor by which a lane may deviate farther than perturbed motions. A lane rounds at every step; perturbed motions are changed once per
/// period.
pub(super) const ROUNDING_FACTOR: f64 = 8.0;

/// Multiple of the budget over which a slow approach to a cycle is followed.
const FOLLOWED: u32 = 8;

/// A cell of a finished map.
pub(super) struct Cell<'a> {
    pub(super) record: Record,
    model: Box<dyn Model>,
    pub(super) flow: Box<Flow>,
    /// The flow of the map, if `flow` has the period of the cell's cycle without force.
    clock: Option<Box<Flow>>,
    pub(super) law: Law,
    pub(super) start: State,
    budget: Budget,
    pub(super) bars: Bars<'a>,
    pub(super) precision: Precision,
    resolution: f64,
    seed: u64,
    /// Once set, computations stop and their results must not be used.
    pub(super) halt: &'a AtomicBool,
}

/// A cell whose parameters and start are perturbed within the engine's resolution.
pub(super) struct Perturbed<'a> {
    flow: Box<Flow>,
    law: Law,
    start: State,
    resolution: f64,
    random: Random,
    halt: &'a AtomicBool,
}

impl<'a> Cell<'a> {
    pub(super) fn new(subject: &Subject<'a>, id: u32, halt: &'a AtomicBool) -> Cell<'a> {
        let plan = subject.plan;
        let cell = plan.cell(id);
        let record = subject.records.record(id as usize);
        let time = record.cycle_time();
        let form = plan.form(cell.flow);
        let clock = time.map(|_| Box::new(Flow::new(&form)));
        let flow = Box::new(Flow::new(form.on_cycle(time)));
        let budget = *plan.budget();
        Cell {
            record,
            model: plan.model(id).on_cycle(time),
            law: plan.law(cell.law),
            start: plan.start(id, subject.records),
            budget,
            bars: Bars::new(subject.precision, flow.period, &budget),
            precision: subject.precision,
            resolution: resolution(subject.precision),
            seed: u64::from(id) << 32,
            flow,
            clock,
            halt,
        }
    }

    /// Adds the attractors of a map of basins.
    pub(super) fn in_basins(mut self, basins: Option<&'a Basins>, id: u32) -> Cell<'a> {
        self.bars.labels = basins.map(|basins| Labels { basins, id: id as usize, own: self.record.strobe() });
        self
    }

    /// Returns the budget over which a slow approach to a cycle is followed.
    pub(super) fn long_budget(&self) -> Budget {
        self.whole_budget(FOLLOWED)
    }

    /// Returns `times` the plan's budget without early stops.
    fn whole_budget(&self, times: u32) -> Budget {
        let mut budget = Budget { early_stop: false, ..self.budget };
        let observed = budget.settings.observed_periods;
        let periods = budget.periods().saturating_mul(times);
        budget.settings.transient_periods = periods.saturating_sub(observed);
        budget
    }

    /// Whether all numbers of the record are finite that must be finite.
    pub(super) fn is_finite(&self, record: &Record) -> bool {
        not_finite(record, &self.budget).is_none()
    }

    /// Returns the largest number of forcing periods of one run.
    pub(super) fn longest(&self) -> u32 {
        self.budget.longest()
    }

    /// Computes the cell with the reference and early stops, as an engine does.
    pub(super) fn again(&self, needs: &Needs) -> Record {
        let flow = self.clock.as_ref().unwrap_or(&self.flow);
        let measured = measure_until(flow, self.law, self.start, &self.budget, self.halt);
        measured.map_or(Record::default(), |measured| measured_record(&measured, needs))
    }

    /// Computes the cell with early stops; chaos must last for this number of further periods.
    pub(super) fn followed(&self, periods: u32) -> Record {
        let confirm_chaos = self.budget.confirm_chaos.saturating_add(periods);
        let budget = Budget { early_stop: true, confirm_chaos, quantities: false, ..self.budget };
        self.within(&budget).record
    }

    /// Builds a budget of this number of periods without early stops.
    pub(super) fn budget_of(&self, periods: u32) -> Budget {
        let mut budget = Budget { early_stop: false, confirm_chaos: 0, ..self.budget };
        let observed = budget.settings.observed_periods.min(periods / 2);
        budget.settings.observed_periods = observed;
        budget.settings.max_period = budget.settings.max_period.min(observed / 2).max(1);
        budget.settings.transient_periods = periods - observed;
        budget
    }

    /// Computes the motion from the cell's start over the whole budget.
    pub(super) fn truth(&self) -> Answer {
        self.reached(&self.flow, self.law, self.start)
    }

    fn reached(&self, flow: &Flow, law: Law, start: State) -> Answer {
        let answer = answer(flow, law, start, &self.whole_budget(1), self.halt);
        let followed = || self::answer(flow, law, start, &self.long_budget(), self.halt);
        match classify(&answer.record) {
            Class::Periodic { .. } if status(&answer.record) == Status::Slow => {
                let later = followed();
                if classify(&later.record) == classify(&answer.record) { answer } else { later }
            }
            Class::Undecided => {
                self::answer(flow, law, start, &self.budget_of(self.budget.decided_by()), self.halt)
            }
            _ => answer,
        }
    }

    /// Returns the meshing speeds of all walls with impacts.
    pub(super) fn mesh_speeds(&self) -> Vec<f64> {
        let Ok(mut oscillator) = self.model.oscillator() else { return Vec::new() };
        impact_walls(&mut oscillator).map(|wall| wall.mesh_speed).collect()
    }

    /// Computes the cell with all meshing speeds multiplied by this factor.
    pub(super) fn with_mesh_speeds(&self, factor: f64) -> Answer {
        let Ok(mut oscillator) = self.model.oscillator() else { return Answer::new(Record::default(), None) };
        impact_walls(&mut oscillator).for_each(|wall| wall.mesh_speed *= factor);
        self.reached(&Flow::new(&oscillator), oscillator.law(), self.start)
    }

    /// Computes the cell from another start.
    pub(super) fn starting_at(&self, start: State) -> Answer {
        self.reached(&self.flow, self.law, start)
    }

    /// Computes the `k`th perturbed cell. With `every_period` the state is also perturbed after each transient period.
    pub(super) fn perturbed_truth(&self, k: u64, every_period: bool) -> Option<Answer> {
        let mut moved = self.perturbed(k)?;
        if every_period {
            moved.start = moved.state_after(self.budget.settings.transient_periods)?;
        }
        Some(self.reached(&moved.flow, moved.law, moved.start))
    }

    /// Computes the `k`th perturbed cell over a budget.
    pub(super) fn perturbed_within(&self, k: u64, budget: &Budget) -> Option<Answer> {
        let moved = self.perturbed(k)?;
        Some(answer(&moved.flow, moved.law, moved.start, budget, self.halt))
    }

    /// Computes the cell over a budget.
    pub(super) fn within(&self, budget: &Budget) -> Answer {
        answer(&self.flow, self.law, self.start, budget, self.halt)
    }

    /// Computes averages of the `k`th perturbed cell over the periods that a chaotic record averages.
    pub(super) fn averages(&self, k: u64, periods: u32) -> Option<Record> {
        let mut budget = self.budget_of(periods);
        let from = self.budget.exponent_from().min(periods / 2);
        (budget.settings.transient_periods, budget.settings.observed_periods) = (from, periods - from);
        Some(self.perturbed_within(k, &budget)?.record)
    }

    /// Begins the motion from a state, without limits but the flag.
    pub(super) fn trajectory(&self, state: State) -> Trajectory<'_, 0> {
        Trajectory::new(&self.flow, self.law, state).allowing(Allowance::UNLIMITED.until(self.halt))
    }

    /// Returns the reference's state after this number of periods, and the states of `count` perturbed cells whose state
    /// is also perturbed after each period.
    pub(super) fn states(&self, count: u64, periods: u32) -> Option<(State, Vec<State>)> {
        let mut trajectory = self.trajectory(self.start);
        (0..periods).try_for_each(|_| trajectory.advance_period(&mut ())).ok()?;
        let moved = (0..count).filter_map(|k| self.perturbed(k)?.state_after(periods));
        Some((trajectory.state(), moved.collect()))
    }

    /// Whether rounding in the engine's precision decides the period of a record's cycle.
    pub(super) fn rounding_decides(&self, record: &Record) -> bool {
        let Class::Periodic { period } = classify(record) else { return false };
        let epsilon = match self.precision {
            Precision::F32 => f64::from(f32::EPSILON),
            Precision::F64 => f64::EPSILON,
        };
        let allowance = Allowance::UNLIMITED.until(self.halt);
        let epsilon = ROUNDING_FACTOR * epsilon;
        orbit::rounding_decides(&self.flow, self.law, record.strobe(), period, epsilon, allowance)
    }

    /// Whether a cycle of `period` periods closes after fewer periods, within the effect of rounding.
    pub(super) fn closes_earlier(&self, state: State, period: u32) -> bool {
        let mut trajectory = self.trajectory(state);
        let mut earlier = f64::INFINITY;
        for n in 1..period {
            if trajectory.advance_period(&mut ()).is_err() {
                return false;
            }
            if period.is_multiple_of(n) {
                earlier = earlier.min(self.apart(&trajectory.state(), &state));
            }
        }
        let ends = self.perturbed_motions::<0>(state, period, []).map(|end| end.state());
        let spread = ends.map(|end| self.apart(&end, &state)).fold(self.resolution, farther);
        spread.is_finite() && earlier <= ROUNDING_FACTOR * spread
    }

    /// Returns logarithms of the largest multiplier over `period` periods. The motions are perturbed after each period.
    pub(super) fn multipliers_from(&self, state: State, period: u32) -> Vec<f64> {
        let log_radius = |end: Trajectory<'_, 4>| {
            let [re, im] = *multipliers(&end.unit_images())?.first()?;
            Some(re.hypot(im).ln() + end.log_scale())
        };
        self.perturbed_motions(state, period, UNIT).filter_map(log_radius).collect()
    }

    /// Follows a few motions from a state, each perturbed after each period.
    fn perturbed_motions<const N: usize>(
        &self,
        state: State,
        periods: u32,
        tangents: [State; N],
    ) -> impl Iterator<Item = Trajectory<'_, N>> {
        (0..TURNS).filter_map(move |k| {
            let mut random = Random::new(self.seed ^ k);
            let mut trajectory = self.trajectory(state).carrying(tangents);
            for _ in 0..periods {
                trajectory.advance_period(&mut ()).ok()?;
                trajectory.perturb(|| share(&mut random, self.resolution));
            }
            Some(trajectory)
        })
    }

    /// Returns the distance of two states relative to the size of the motion, which is at least the scale of length.
    pub(super) fn apart(&self, a: &State, b: &State) -> f64 {
        let [position, velocity] = self.units(a);
        let by = |i: usize| distance::apart(a[i], b[i]) / [position, velocity][i % 2];
        (0..self.flow.state_len()).map(by).fold(0.0, farther)
    }

    fn units(&self, y: &State) -> [f64; 2] {
        let largest = |from: usize| y[from..].iter().step_by(2).fold(0.0, |most: f64, x| most.max(x.abs()));
        let position = largest(0).max(self.flow.length);
        [position, largest(1).max(self.flow.omega * position)]
    }

    /// Builds the `k`th perturbed cell: every parameter and the start change at random within the resolution.
    fn perturbed(&self, k: u64) -> Option<Perturbed<'_>> {
        let mut random = Random::new(self.seed ^ k);
        let mut model = self.model.clone();
        let units = self.units(&self.record.strobe());
        for index in 0..self.model.parameters().len() {
            let value = self.model.value(index);
            // A parameter at the end of its range keeps its value.
            let _ = model.set_at(index, value * (1.0 + self.resolution * (2.0 * random.unit() - 1.0)));
        }
        // The meshing speed is compared with velocities, so it is perturbed by their rounding errors. Both walls get the
        // same change, so that a symmetric law stays symmetric.
        let draw = 2.0 * Random::new(!(self.seed ^ k)).unit() - 1.0;
        let perturb = |speed: &mut f64| {
            let share = self.resolution * units[1].max(*speed) / speed.max(f64::MIN_POSITIVE);
            *speed *= 1.0 + share.min(MOST_OF_MESH_SPEED) * draw;
        };
        let mut oscillator = model.oscillator().ok()?;
        impact_walls(&mut oscillator).for_each(|wall| perturb(&mut wall.mesh_speed));
        let law = oscillator.law();
        let units = self.units(&self.start);
        let mut start = self.start;
        for (i, x) in start.iter_mut().enumerate().take(self.model.state_names().len()) {
            *x += self.resolution * units[i % 2] * (2.0 * random.unit() - 1.0);
        }
        let flow = Box::new(Flow::new(&oscillator));
        Some(Perturbed { flow, law, start, resolution: self.resolution, random, halt: self.halt })
    }
}

impl Perturbed<'_> {
    /// Returns the state after this number of periods, perturbed within the resolution after each.
    fn state_after(&mut self, periods: u32) -> Option<State> {
        let mut trajectory = Trajectory::<0>::new(&self.flow, self.law, self.start)
            .allowing(Allowance::UNLIMITED.until(self.halt));
        for _ in 0..periods {
            trajectory.advance_period(&mut ()).ok()?;
            trajectory.perturb(|| share(&mut self.random, self.resolution));
        }
        Some(trajectory.state())
    }
}

/// Returns the walls that have a law of impact.
fn impact_walls(oscillator: &mut Oscillator) -> impl Iterator<Item = &mut Wall> {
    let walls = oscillator.gaps.iter_mut().flat_map(|gap| gap.walls.iter_mut().flatten());
    walls.filter(|wall| !wall.contact.is_elastic())
}

/// Draws a random relative change, as rounding over one period may cause it.
fn share(random: &mut Random, resolution: f64) -> f64 {
    resolution * (2.0 * random.unit() - 1.0)
}

fn answer(flow: &Flow, law: Law, start: State, budget: &Budget, halt: &AtomicBool) -> Answer {
    let Some(measured) = measure_until(flow, law, start, budget, halt) else {
        return Answer::new(Record::default(), None);
    };
    Answer::new(measured_record(&measured, &Needs::EVERYTHING), measured.word.as_ref())
}
