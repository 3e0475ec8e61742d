//! Adapts the program's motions to the interface of the comparison.

use nalgebra::DMatrix;

use super::motion::Event;

/// Events and final state of a motion in one forcing period.
#[derive(Clone, Debug)]
pub(crate) struct Period {
    /// Events of gaps in order, with times from the start of the motion.
    pub(crate) events: Vec<Event>,
    /// Symbols `7` and `0` of friction, with times from the start of the motion.
    pub(crate) slips: Vec<(u8, f64)>,
    /// `(x1, v1, x2, v2, ...)` at the end of the period.
    pub(crate) state: Vec<f64>,
    /// Derivative of this state with respect to the start of the motion.
    pub(crate) derivative: DMatrix<f64>,
}

/// Advances a motion by a period, or returns the reason why it ends.
pub(crate) trait Follower {
    fn advance(&mut self) -> Result<Period, String>;
}

/// The program's motions of machines, and of models with one gap. Names and signatures of the program occur only here.
pub(crate) mod program {
    use nalgebra::DMatrix;
    use rattlemap_dynamics::machine::{MachineMotion, System};
    use rattlemap_dynamics::model::{Law, Oscillator, Side, State};
    use rattlemap_dynamics::motion::{EventKind, Flow, GapEvent, Observer, SlipEvent, States, Trajectory};

    use super::super::motion::{Event, What};
    use super::{Follower, Period};

    pub(crate) struct Engine<'a> {
        motion: MachineMotion<'a>,
        degrees: usize,
        period: f64,
        several: bool,
    }

    #[derive(Default)]
    struct Record {
        events: Vec<Event>,
        slips: Vec<(u8, f64)>,
        period: f64,
        several: bool,
    }

    impl Record {
        fn add(&mut self, gap: usize, kind: EventKind, side: Side, symbol: Option<u8>, t: f64) {
            let what = match kind {
                EventKind::Impact => What::Impact,
                EventKind::MeshStart => What::Begins,
                EventKind::MeshEnd => What::Ends,
            };
            let of_gap = if self.several { 8 * (gap as u8 + 1) } else { 0 };
            self.events.push(Event { gap, what, side, symbol: symbol.map(|symbol| symbol - of_gap), t });
        }
    }

    impl Observer for Record {
        fn event(&mut self, e: &GapEvent, _: States<'_>) {
            self.add(e.gap, e.kind, e.side, e.symbol, e.period as f64 * self.period + e.t);
        }

        fn slip(&mut self, change: &SlipEvent) {
            let t = change.period as f64 * self.period + change.t;
            self.slips.extend(change.symbol.map(|symbol| (symbol, t)));
        }
    }

    impl<'a> Engine<'a> {
        pub(crate) fn new(system: &'a System, machine: &Oscillator, start: &[f64]) -> Engine<'a> {
            let mut motion = MachineMotion::new(system, start);
            motion.set_tangents(MachineMotion::unit_tangents(system));
            let several = machine.gaps.len() > 1;
            Engine { motion, degrees: machine.degrees(), period: machine.period(), several }
        }
    }

    impl Follower for Engine<'_> {
        fn advance(&mut self) -> Result<Period, String> {
            let mut record = Record { period: self.period, several: self.several, ..Record::default() };
            self.motion.advance_period(&mut record).map_err(|stop| stop.to_string())?;
            let size = 2 * self.degrees;
            Ok(Period {
                events: record.events,
                slips: record.slips,
                state: self.motion.state()[..size].to_vec(),
                derivative: self.motion.derivative(),
            })
        }
    }

    /// The engine of models with one or two coordinates and one gap.
    pub(crate) struct OneGap<'a> {
        trajectory: Trajectory<'a, 4>,
        degrees: usize,
    }

    impl<'a> OneGap<'a> {
        pub(crate) fn new(flow: &'a Flow, degrees: usize, law: Law, start: State) -> OneGap<'a> {
            let columns = std::array::from_fn(|i| {
                let mut column = [0.0; rattlemap_dynamics::model::STATE];
                column[i] = 1.0;
                column
            });
            OneGap { trajectory: Trajectory::with_tangents(flow, law, start, columns), degrees }
        }
    }

    impl Follower for OneGap<'_> {
        fn advance(&mut self) -> Result<Period, String> {
            let mut record = Record { period: self.trajectory.flow().period, ..Record::default() };
            self.trajectory.advance_period(&mut record).map_err(|stop| stop.to_string())?;
            let (size, columns) = (2 * self.degrees, self.trajectory.tangents());
            let scale = self.trajectory.log_scale().exp();
            Ok(Period {
                events: record.events,
                slips: record.slips,
                state: self.trajectory.state()[..size].to_vec(),
                derivative: DMatrix::from_fn(size, size, |i, j| columns[j][i] * scale),
            })
        }
    }
}
