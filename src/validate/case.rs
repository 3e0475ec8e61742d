//! One cell under examination, and what the reference can be asked about it.

use super::Subject;
use super::answer::{Answer, Bars, Field};
use super::reading::counts;
use nalgebra::{Matrix4, Vector4};

use crate::classify::classify;
use crate::flow::Flow;
use crate::gpu::{Precision, rules};
use crate::model::{GearPair, Law, Parameter, Side, State};
use crate::orbit::{Budget, Class, Measured, Scatter, analyse_flow, measure};
use crate::random::Random;
use crate::record::{Record, valid};
use crate::reference::{Stop, Trajectory};
use crate::stability::{Exponent, FRESH_TANGENT, StrobeMap};

/// Parameters and starts moved by this much, relatively, are the same within rounding of a
/// lane. Some roundings of a precision: errors gather over the steps of a period.
pub(super) fn rounding(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 1e-6,
        Precision::F64 => 1e-12,
    }
}

/// No rounding moves the meshing speed by more than this share.
const MOST_OF_MESH_SPEED: f64 = 0.01;

/// Parameters are drawn from a stream of their own.
const OF_PARAMETERS: u64 = 0x7061_7261_6d65_7465;

/// A motion this far from where it was a cycle ago, relative to its size, is not on the cycle.
pub(super) const ELSEWHERE: f64 = 1e-2;

/// States this close, relative to the motion, are the same to lanes: what they take for its mirror image is no
/// farther off.
pub(super) const LANE_RESOLUTION: f64 = 2.5e-4;
const _: () = assert!(LANE_RESOLUTION >= rules::MIRROR);

/// A cell, its record, and the reference's answer within the same budget.
pub(super) struct Case<'a> {
    pub(super) pair: GearPair,
    pub(super) flow: Box<Flow>,
    pub(super) law: Law,
    pub(super) start: State,
    pub(super) budget: Budget,
    pub(super) record: &'a Record,
    /// The lane after a few periods, if it was run again.
    pub(super) lane: Option<&'a Record>,
    pub(super) precision: Precision,
    pub(super) is_lane: bool,
    /// Cells among which it is compared.
    pub(super) among: usize,
    pub(super) measured: Measured,
    pub(super) truth: Answer,
    pub(super) bars: Bars,
}

/// A cell that is the same within rounding.
pub(super) struct Nearby {
    pub(super) flow: Box<Flow>,
    pub(super) law: Law,
    pub(super) start: State,
}

impl Nearby {
    /// What the reference measures of it.
    pub(super) fn measured(&self, budget: &Budget) -> Measured {
        measure(&self.flow, self.law, self.start, budget)
    }
}

impl<'a> Case<'a> {
    pub(super) fn new(subject: &Subject<'a>, id: u32, lane: Option<&'a Record>, among: usize) -> Case<'a> {
        let plan = subject.plan;
        let cell = plan.cell(id);
        let flow = Box::new(Flow::new(&plan.oscillator(cell.flow)));
        let (law, start) = (plan.law(cell.law), plan.start(id, subject.records));
        let budget = *plan.budget();
        let measured = measure(&flow, law, start, &budget);
        Case {
            pair: plan.gear_pair(id),
            law,
            start,
            budget,
            record: &subject.records[id as usize],
            lane,
            precision: subject.precision,
            is_lane: subject.is_lane,
            among,
            truth: Answer::from(&measured),
            measured,
            bars: Bars::new(subject.precision, flow.period, &budget),
            flow,
        }
    }

    /// Whether an answer is the record's.
    pub(super) fn is_the_records(&self, answer: &Answer) -> bool {
        answer.agrees(self.record, &self.bars)
    }

    /// What the reference says of another start when it may take the time it needs.
    pub(super) fn at_leisure(&self, start: State) -> Answer {
        let orbit = analyse_flow(&self.flow, self.law, start, &self.budget.settings, 1);
        let is_cycle = matches!(orbit.class, Class::Periodic { .. } | Class::Failed);
        let mut answer = Answer::from(&orbit);
        if let (false, Some((error, scatter))) = (is_cycle, self.scatter(orbit.strobe)) {
            (answer.exponent, answer.scatter) = (Some([orbit.lyapunov, error]), Some(scatter));
        }
        answer
    }

    /// How averages over the observed periods scatter on the way from a state: the exponent's standard error, and the
    /// others.
    fn scatter(&self, from: State) -> Option<(f64, Scatter)> {
        let mut motion = Trajectory::<0>::new(&self.flow, self.law, from).carrying([FRESH_TANGENT]);
        let mut exponent = Exponent::default();
        let mut met = vec![counts(&motion)];
        let observed = self.budget.settings.observed_periods;
        for _ in 0..observed {
            motion.advance_period(&mut ()).ok()?;
            exponent.renormalise(&mut motion);
            met.push(counts(&motion));
        }
        let (_, error) = exponent.estimate(self.flow.period);
        Some((error, Scatter::of(&met, observed, self.flow.period)))
    }

    /// The pair with one parameter moved to either side by this much, relatively.
    pub(super) fn nudged_pairs(&self, amount: f64) -> impl Iterator<Item = GearPair> + '_ {
        GearPair::PARAMETERS.iter().flat_map(move |parameter| {
            let amount = self.share_of(parameter, amount);
            [amount, -amount].into_iter().filter_map(move |relative| {
                let mut pair = self.pair;
                let value = pair.get(parameter.name).ok()?;
                pair.set(parameter.name, value * (1.0 + relative)).ok()?;
                Some(pair)
            })
        })
    }

    /// By how much of itself a parameter moves where motion moves by `amount`.
    fn share_of(&self, parameter: &Parameter, amount: f64) -> f64 {
        if parameter.name != "mesh_speed" {
            return amount;
        }
        // Leaving speeds carry the rounding of the whole motion's velocity.
        let speed = self.units(&self.record.strobe)[1] / self.law.mesh_speed.max(f64::MIN_POSITIVE);
        (amount * speed.clamp(1.0, 1e4)).min(MOST_OF_MESH_SPEED)
    }

    /// Answers within the budget for starts and parameters that are the same within rounding.
    pub(super) fn nudged(&self) -> impl Iterator<Item = Answer> + '_ {
        let parameters = self.nudged_pairs(rounding(self.precision)).filter_map(|pair| {
            let flow = Box::new(Flow::new(&pair.oscillator().ok()?));
            Some(Answer::from(&measure(&flow, pair.law(), self.start, &self.budget)))
        });
        let starts = (0..8).map(move |k| {
            let start = self.nudged_start(k);
            Answer::from(&measure(&self.flow, self.law, start, &self.budget))
        });
        starts.chain(parameters)
    }

    /// Answers within the budget for random cells that are the same within rounding.
    pub(super) fn scattered(&self, count: usize) -> impl Iterator<Item = Answer> + '_ {
        self.scattered_cells(count).map(|cell| Answer::from(&cell.measured(&self.budget)))
    }

    /// Random starts, each with random parameters of its own, that are the same within rounding: contact that
    /// lasts forgets where a motion began.
    pub(super) fn scattered_cells(&self, count: usize) -> impl Iterator<Item = Nearby> + '_ {
        let mut random = Random::new(u64::from(self.record.periods_run) ^ OF_PARAMETERS);
        self.scattered_starts(count).filter_map(move |start| {
            let mut pair = self.pair;
            for parameter in GearPair::PARAMETERS {
                let share = self.share_of(parameter, rounding(self.precision)) * (2.0 * random.unit() - 1.0);
                // At the end of its range a parameter stays where it is.
                let _ = pair
                    .get(parameter.name)
                    .and_then(|value| pair.set(parameter.name, value * (1.0 + share)));
            }
            let flow = Box::new(Flow::new(&pair.oscillator().ok()?));
            Some(Nearby { flow, law: pair.law(), start })
        })
    }

    /// Random starts that are the same within rounding.
    pub(super) fn scattered_starts(&self, count: usize) -> impl Iterator<Item = State> + '_ {
        let mut random = Random::new(u64::from(self.record.periods_run));
        let moved: State = std::array::from_fn(|i| self.nudged_start(i)[i]);
        (0..count).map(move |_| {
            std::array::from_fn(|i| {
                let reach = moved[i] - self.start[i];
                self.start[i] + reach * (2.0 * random.unit() - 1.0)
            })
        })
    }

    /// The start moved within rounding along one coordinate, to either side.
    pub(super) fn nudged_start(&self, k: usize) -> State {
        let amount = rounding(self.precision) * if k < 4 { 1.0 } else { -1.0 };
        let reach = 0.5 * (self.flow.walls[0] - self.flow.walls[1]);
        let unit = if k.is_multiple_of(2) { reach } else { self.flow.omega * reach };
        let mut start = self.start;
        start[k % 4] += amount * unit.max(start[k % 4].abs());
        start
    }

    /// The reference, some periods after a start.
    pub(super) fn after(&self, start: State, periods: u32) -> Result<Trajectory<'_>, Stop> {
        let mut trajectory = Trajectory::new(&self.flow, self.law, start);
        for _ in 0..periods {
            trajectory.advance_period(&mut ())?;
        }
        Ok(trajectory)
    }

    /// The reference on a record's last strobe, in the domain of its own motion if that has come by there: a
    /// state alone does not tell how deep the dip at the start of meshing is, which may cross the whole gap.
    pub(super) fn standing(&self, on: State) -> Result<Trajectory<'_>, Stop> {
        match self.after(self.start, self.record.periods_run) {
            Ok(own) if self.apart(&on, &own.state()) < ELSEWHERE => Ok(own.at(on, [])),
            _ => self.in_dip(on).map_or_else(|| self.after(on, 0), Ok),
        }
    }

    /// The same in the dip at the start of meshing, if it is there that it comes back after the record's period.
    fn in_dip(&self, on: State) -> Option<Trajectory<'_>> {
        let Class::Periodic { period } = classify(self.record) else { return None };
        // It is no faster than it began.
        if self.flow.to_gap(on)[1].abs() > self.law.mesh_speed {
            return None;
        }
        let starts = [None, Some(Side::Right), Some(Side::Left)]
            .map(|side| Trajectory::meshing_from(&self.flow, self.law, on, side));
        let [free, dips @ ..] = starts.map(|start| (self.unrest(&start, period), start));
        dips.into_iter().find(|(unrest, _)| *unrest < ELSEWHERE && free.0 > ELSEWHERE).map(|(_, start)| start)
    }

    /// Where a motion is after `period` more periods.
    pub(super) fn after_cycle(&self, trajectory: &Trajectory<'_>, period: u32) -> Option<State> {
        let mut ahead = trajectory.clone();
        (0..period).try_for_each(|_| ahead.advance_period(&mut ())).ok()?;
        Some(ahead.state())
    }

    /// How far that is from where it is, relative to its size.
    pub(super) fn unrest(&self, trajectory: &Trajectory<'_>, period: u32) -> f64 {
        let image = self.after_cycle(trajectory, period);
        image.map_or(f64::INFINITY, |image| self.apart(&trajectory.state(), &image))
    }

    /// Where the strobe map, linearised about a motion, has its cycle: `y + (1 - M)^-1 (P(y) - y)`.
    pub(super) fn limit(&self, trajectory: &Trajectory<'_>, period: u32) -> Option<State> {
        let y = Vector4::from(trajectory.state());
        let image = StrobeMap::Periods(period).apply(trajectory, y.into()).ok()?;
        let residual = Vector4::from(image.state) - y;
        let step = (Matrix4::identity() - image.derivative()).lu().solve(&residual)?;
        Some((y + step).into()).filter(|limit: &State| limit.iter().all(|x| x.is_finite()))
    }

    /// The distance of two states relative to the size of the first and to the walls.
    pub(super) fn apart(&self, a: &State, b: &State) -> f64 {
        let [position, velocity] = self.units(a);
        let by = |i: usize| (a[i] - b[i]).abs();
        (by(0).max(by(2)) / position).max(by(1).max(by(3)) / velocity)
    }

    /// Units of position and velocity: the state's own, but not less than half the backlash
    /// and what that is as a velocity.
    pub(super) fn units(&self, y: &State) -> [f64; 2] {
        let reach = 0.5 * (self.flow.walls[0] - self.flow.walls[1]);
        let position = y[0].abs().max(y[2].abs()).max(reach);
        [position, y[1].abs().max(y[3].abs()).max(self.flow.omega * position)]
    }

    /// Where the record says that its motion was at last.
    pub(super) fn strobe(&self) -> Option<State> {
        let record = self.record;
        let known = record.valid & valid::STROBE != 0 && record.strobe.iter().all(|x| x.is_finite());
        known.then_some(record.strobe)
    }

    /// Whether no part of the record's period recurs: a multiple of a period always does.
    pub(super) fn is_least(&self) -> Option<bool> {
        let Class::Periodic { period } = classify(self.record) else { return Some(true) };
        let stands = self.standing(self.strobe()?).ok()?;
        let mut parts = (1..period).filter(|&part| period.is_multiple_of(part));
        Some(parts.all(|part| self.unrest(&stands, part) > LANE_RESOLUTION))
    }

    /// Whether impacts and meshing are those that are read where the record says that its motion was.
    pub(super) fn has_its_averages(&self) -> Option<bool> {
        let Class::Periodic { period } = classify(self.record) else { return Some(true) };
        let read = self.read_as_is(&self.standing(self.strobe()?).ok()?, period)?;
        let compared = read.compare(self.record, &self.bars);
        let is_average = |field: &Field| [Field::Impacts, Field::Mesh].contains(field);
        Some(compared.iter().all(|(field, differs)| !is_average(field) || differs.is_none()))
    }
}
