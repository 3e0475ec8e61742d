//! One cell, and what the reference can be asked about it.

use std::sync::atomic::AtomicBool;

use nalgebra::{Matrix4, Vector4};

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
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Law, Model, State};
use rattlemap_dynamics::orbit::{Budget, Class, Status, measure_until};
use rattlemap_dynamics::reference::{Allowance, Trajectory};
use rattlemap_dynamics::stability::{UNIT, multipliers};

/// What a precision resolves of a motion or a parameter, relative to its size: some roundings, since errors gather
/// over the steps of a period.
pub(super) fn resolution(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 1e-6,
        Precision::F64 => 1e-12,
    }
}

/// No rounding moves the meshing speed by more than this share, however fast the motion is.
const MOST_OF_MESH_SPEED: f64 = 2e-3;

/// Motions that show what the resolution makes of a cycle, and how much farther a lane may be off: it rounds at
/// every step.
const TURNS: u64 = 6;
pub(super) const FACTOR: f64 = 8.0;

/// A cycle that is approached slowly is followed for so many times the budget: to be seen near it is not to reach it.
const FOLLOWED: u32 = 8;

/// A cell of a finished map.
pub(super) struct Cell<'a> {
    pub(super) record: &'a Record,
    model: Box<dyn Model>,
    pub(super) flow: Box<Flow>,
    pub(super) law: Law,
    pub(super) start: State,
    budget: Budget,
    pub(super) bars: Bars<'a>,
    pub(super) precision: Precision,
    resolution: f64,
    seed: u64,
    /// Once it is raised, answers are of no use.
    pub(super) halt: &'a AtomicBool,
}

/// A cell that is the same within the engine's resolution.
pub(super) struct Moved<'a> {
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
        let flow = Box::new(Flow::new(&plan.oscillator(cell.flow)));
        let budget = *plan.budget();
        Cell {
            record: &subject.records[id as usize],
            model: plan.model(id),
            law: plan.law(cell.law),
            start: plan.start(id, subject.records),
            budget,
            bars: Bars::new(subject.precision, flow.period, &budget),
            precision: subject.precision,
            resolution: resolution(subject.precision),
            seed: u64::from(id) << 32,
            flow,
            halt,
        }
    }

    /// The same in a map of basins.
    pub(super) fn in_basins(mut self, basins: Option<&'a Basins>, id: u32) -> Cell<'a> {
        self.bars.labels = basins.map(|basins| Labels { basins, id: id as usize, own: self.record.strobe });
        self
    }

    /// The plan's budget, all of it: a cell stops before in no case, and one that is undecided takes what the plan
    /// gives undecided cells.
    fn whole_budget(&self, times: u32) -> Budget {
        let mut budget = Budget { early_stop: false, ..self.budget };
        let observed = budget.settings.observed_periods;
        let periods = budget.periods().saturating_mul(times);
        budget.settings.transient_periods = periods.saturating_sub(observed);
        budget
    }

    /// Whether a record holds the numbers that it claims to hold.
    pub(super) fn is_finite(&self, record: &Record) -> bool {
        not_finite(record, &self.budget).is_none()
    }

    /// Forcing periods that the plan allows one run.
    pub(super) fn longest(&self) -> u32 {
        self.budget.longest()
    }

    /// What the engine of the reference says of the cell, early stops and all.
    pub(super) fn again(&self, needs: &Needs) -> Record {
        let measured = measure_until(&self.flow, self.law, self.start, &self.budget, self.halt);
        measured.map_or(Record::default(), |measured| measured_record(&measured, needs))
    }

    /// A budget of so many periods.
    fn budget_of(&self, periods: u32) -> Budget {
        let mut budget = Budget { early_stop: false, ..self.budget };
        let observed = budget.settings.observed_periods.min(periods / 2);
        budget.settings.observed_periods = observed;
        budget.settings.max_period = budget.settings.max_period.min(observed / 2).max(1);
        budget.settings.transient_periods = periods - observed;
        budget
    }

    /// What the cell's start reaches within the whole budget.
    pub(super) fn truth(&self) -> Answer {
        self.reached(&self.flow, self.law, self.start)
    }

    fn reached(&self, flow: &Flow, law: Law, start: State) -> Answer {
        let answer = answer(flow, law, start, &self.whole_budget(1), self.halt);
        let followed = || self::answer(flow, law, start, &self.whole_budget(FOLLOWED), self.halt);
        match classify(&answer.record) {
            Class::Periodic { .. } if status(&answer.record) == Status::Slow => {
                let later = followed();
                if classify(&later.record) == classify(&answer.record) { answer } else { later }
            }
            Class::Undecided => {
                self::answer(flow, law, start, &self.budget_of(self.budget.longest()), self.halt)
            }
            _ => answer,
        }
    }

    /// What its start reaches by another law.
    pub(super) fn obeying(&self, law: Law) -> Answer {
        self.reached(&self.flow, law, self.start)
    }

    /// What another start of the same cell reaches.
    pub(super) fn starting_at(&self, start: State) -> Answer {
        self.reached(&self.flow, self.law, start)
    }

    /// What it reaches from where it is the same within the resolution; `shaken` where every period rounds.
    pub(super) fn moved_truth(&self, k: u64, shaken: bool) -> Option<Answer> {
        let mut moved = self.moved(k)?;
        if shaken {
            moved.start = moved.shaken(self.budget.settings.transient_periods)?;
        }
        Some(self.reached(&moved.flow, moved.law, moved.start))
    }

    /// The same after so many periods.
    pub(super) fn moved_after(&self, k: u64, periods: u32) -> Option<Answer> {
        let moved = self.moved(k)?;
        Some(answer(&moved.flow, moved.law, moved.start, &self.budget_of(periods), self.halt))
    }

    /// The same when it may take far longer than the plan allows.
    pub(super) fn moved_at_leisure(&self, k: u64) -> Option<Answer> {
        let moved = self.moved(k)?;
        Some(answer(&moved.flow, moved.law, moved.start, &self.whole_budget(FOLLOWED), self.halt))
    }

    /// Averages over the periods that a record of chaos averages, from a start that is the same within the resolution.
    pub(super) fn averages(&self, k: u64, periods: u32) -> Option<Record> {
        let moved = self.moved(k)?;
        let mut budget = self.budget_of(periods);
        let from = self.budget.exponent_from().min(periods / 2);
        (budget.settings.transient_periods, budget.settings.observed_periods) = (from, periods - from);
        Some(answer(&moved.flow, moved.law, moved.start, &budget, self.halt).record)
    }

    /// Where the reference is after so many periods, and where it is from starts that are the same within the
    /// resolution if every period rounds.
    pub(super) fn states(&self, count: u64, periods: u32) -> Option<(State, Vec<State>)> {
        let mut trajectory = Trajectory::<0>::new(&self.flow, self.law, self.start)
            .allowing(Allowance::UNLIMITED.until(self.halt));
        (0..periods).try_for_each(|_| trajectory.advance_period(&mut ())).ok()?;
        let moved = (0..count).filter_map(|k| self.moved(k)?.shaken(periods));
        Some((trajectory.state(), moved.collect()))
    }

    /// Whether a cycle through a state closes before so many periods, by no more than the resolution makes of it.
    pub(super) fn closes_earlier(&self, state: State, period: u32) -> bool {
        let mut trajectory =
            Trajectory::<0>::new(&self.flow, self.law, state).allowing(Allowance::UNLIMITED.until(self.halt));
        let mut earlier = f64::INFINITY;
        for n in 1..period {
            if trajectory.advance_period(&mut ()).is_err() {
                return false;
            }
            if period.is_multiple_of(n) {
                earlier = earlier.min(self.apart(&trajectory.state(), &state));
            }
        }
        let ends = self.turned::<0>(state, period, []).map(|end| end.state());
        let spread = ends.map(|end| self.apart(&end, &state)).fold(self.resolution, farther);
        spread.is_finite() && earlier <= FACTOR * spread
    }

    /// Logarithms of the largest multiplier of so many periods from a state, if every period rounds.
    pub(super) fn multipliers_from(&self, state: State, period: u32) -> Vec<f64> {
        let log_radius = |end: Trajectory<'_, 4>| {
            let columns = end.tangents().map(Vector4::from);
            let [re, im] = *multipliers(&Matrix4::from_columns(&columns))?.first()?;
            Some(re.hypot(im).ln() + end.log_scale())
        };
        self.turned(state, period, UNIT).filter_map(log_radius).collect()
    }

    /// Where a few motions are after so many periods from a state, if every period rounds.
    fn turned<const N: usize>(
        &self,
        state: State,
        periods: u32,
        tangents: [State; N],
    ) -> impl Iterator<Item = Trajectory<'_, N>> {
        (0..TURNS).filter_map(move |k| {
            let mut random = Random::new(self.seed ^ k);
            let begun = Trajectory::<0>::new(&self.flow, self.law, state)
                .allowing(Allowance::UNLIMITED.until(self.halt));
            let mut trajectory = begun.carrying(tangents);
            for _ in 0..periods {
                trajectory.advance_period(&mut ()).ok()?;
                trajectory.perturb(shares(&mut random, self.resolution));
            }
            Some(trajectory)
        })
    }

    /// The distance of two states relative to the size of the motion, but not less than the scale of length.
    pub(super) fn apart(&self, a: &State, b: &State) -> f64 {
        let [position, velocity] = self.units(a);
        let by = |i: usize| distance::apart(a[i], b[i]) / [position, velocity][i % 2];
        (0..4).map(by).fold(0.0, farther)
    }

    fn units(&self, y: &State) -> [f64; 2] {
        let position = y[0].abs().max(y[2].abs()).max(self.flow.length);
        [position, y[1].abs().max(y[3].abs()).max(self.flow.omega * position)]
    }

    /// The `k`th cell, at random, that is the same within the resolution: every parameter and the start are moved.
    fn moved(&self, k: u64) -> Option<Moved<'_>> {
        let mut random = Random::new(self.seed ^ k);
        let mut model = self.model.clone();
        let units = self.units(&self.record.strobe);
        for index in 0..self.model.parameters().len() {
            let value = self.model.value(index);
            // At the end of its range a parameter stays where it is.
            let _ = model.set_at(index, value * (1.0 + self.resolution * (2.0 * random.unit() - 1.0)));
        }
        // Leaving speeds carry the rounding of the whole motion's velocity, at both walls alike: what is symmetric stays so.
        let draw = 2.0 * Random::new(!(self.seed ^ k)).unit() - 1.0;
        let mut law = model.law();
        for speed in &mut law.mesh_speed {
            let share = self.resolution * units[1].max(*speed) / speed.max(f64::MIN_POSITIVE);
            *speed *= 1.0 + share.min(MOST_OF_MESH_SPEED) * draw;
        }
        let units = self.units(&self.start);
        let mut start = self.start;
        for (i, x) in start.iter_mut().enumerate().take(self.model.state_names().len()) {
            *x += self.resolution * units[i % 2] * (2.0 * random.unit() - 1.0);
        }
        let flow = Box::new(Flow::new(&model.oscillator().ok()?));
        Some(Moved { flow, law, start, resolution: self.resolution, random, halt: self.halt })
    }
}

impl Moved<'_> {
    /// Where it is after so many periods if the state is moved within the resolution at each.
    fn shaken(&mut self, periods: u32) -> Option<State> {
        let mut trajectory = Trajectory::<0>::new(&self.flow, self.law, self.start)
            .allowing(Allowance::UNLIMITED.until(self.halt));
        for _ in 0..periods {
            trajectory.advance_period(&mut ()).ok()?;
            trajectory.perturb(shares(&mut self.random, self.resolution));
        }
        Some(trajectory.state())
    }
}

/// By what a period rounds.
fn shares(random: &mut Random, resolution: f64) -> [f64; 4] {
    std::array::from_fn(|_| resolution * (2.0 * random.unit() - 1.0))
}

fn answer(flow: &Flow, law: Law, start: State, budget: &Budget, halt: &AtomicBool) -> Answer {
    let Some(measured) = measure_until(flow, law, start, budget, halt) else {
        return Answer::new(Record::default(), None);
    };
    Answer::new(measured_record(&measured, &Needs::EVERYTHING), measured.word.as_ref())
}
