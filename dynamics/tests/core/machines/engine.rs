//! The program's motions of machines, in the terms of the comparison.

use nalgebra::DMatrix;

use super::motion::Event;

/// What a motion does in a forcing period.
#[derive(Clone, Debug)]
pub(crate) struct Period {
    /// Events of gaps in order, with times from the start of the motion.
    pub(crate) events: Vec<Event>,
    /// Symbols `7` and `0` of friction, with times from the start of the motion.
    pub(crate) slips: Vec<(u8, f64)>,
    /// `(x1, v1, x2, v2, ...)` at the end of the period.
    pub(crate) state: Vec<f64>,
    /// Its derivative by the state at the start of the motion.
    pub(crate) derivative: DMatrix<f64>,
}

/// Advances a motion by a period, or says why it ends.
pub(crate) trait Follower {
    fn advance(&mut self) -> Result<Period, String>;
}

/// The program's motion of a machine. Names and signatures of the program occur only here.
#[cfg(any())]
pub(crate) mod program {
    use rattlemap_dynamics::machine::{Motion, Observer, System};
    use rattlemap_dynamics::model::Machine;
    use rattlemap_dynamics::reference::EventKind;

    use super::super::motion::{Event, What};
    use super::{Follower, Period};

    pub(crate) struct Engine<'a> {
        motion: Motion<'a>,
        degrees: usize,
        period: f64,
    }

    #[derive(Default)]
    struct Record {
        events: Vec<Event>,
        slips: Vec<(u8, f64)>,
        period: f64,
    }

    impl Observer for Record {
        fn event(&mut self, event: &rattlemap_dynamics::machine::Event) {
            let what = match event.kind {
                EventKind::Impact => What::Impact,
                EventKind::MeshStart => What::Begins,
                EventKind::MeshEnd => What::Ends,
            };
            let t = event.period as f64 * self.period + event.t;
            self.events.push(Event { gap: event.gap, what, side: event.side, symbol: event.symbol, t });
        }

        fn friction(&mut self, change: &rattlemap_dynamics::machine::FrictionChange) {
            self.slips.push((change.symbol, change.period as f64 * self.period + change.t));
        }
    }

    impl<'a> Engine<'a> {
        pub(crate) fn new(system: &'a System, machine: &Machine, start: &[f64]) -> Engine<'a> {
            let mut state = [0.0; 16];
            state[..start.len()].copy_from_slice(start);
            let motion = Motion::with_unit_tangents(system, &state);
            Engine { motion, degrees: machine.degrees(), period: machine.period() }
        }
    }

    impl Follower for Engine<'_> {
        fn advance(&mut self) -> Result<Period, String> {
            let mut record = Record { period: self.period, ..Record::default() };
            self.motion.advance_period(&mut record).map_err(|stop| stop.to_string())?;
            let size = 2 * self.degrees;
            Ok(Period {
                events: record.events,
                slips: record.slips,
                state: self.motion.state()[..size].to_vec(),
                derivative: self.motion.derivative().view((0, 0), (size, size)).into_owned(),
            })
        }
    }
}
