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
pub(crate) mod program {
    use rattlemap_dynamics::machine::{Motion, System};
    use rattlemap_dynamics::model::Oscillator;
    use rattlemap_dynamics::motion::{EventKind, GapEvent, Observer, SlipEvent, States};

    use super::super::motion::{Event, What};
    use super::{Follower, Period};

    pub(crate) struct Engine<'a> {
        motion: Motion<'a>,
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

    impl Observer for Record {
        fn event(&mut self, event: &GapEvent, _: States<'_>) {
            let what = match event.kind {
                EventKind::Impact => What::Impact,
                EventKind::MeshStart => What::Begins,
                EventKind::MeshEnd => What::Ends,
            };
            let t = event.period as f64 * self.period + event.t;
            let of_gap = if self.several { 8 * (event.gap as u8 + 1) } else { 0 };
            let symbol = event.symbol.map(|symbol| symbol - of_gap);
            self.events.push(Event { gap: event.gap, what, side: event.side, symbol, t });
        }

        fn slip(&mut self, change: &SlipEvent) {
            let t = change.period as f64 * self.period + change.t;
            self.slips.extend(change.symbol.map(|symbol| (symbol, t)));
        }
    }

    impl<'a> Engine<'a> {
        pub(crate) fn new(system: &'a System, machine: &Oscillator, start: &[f64]) -> Engine<'a> {
            let mut motion = Motion::new(system, start);
            motion.set_tangents(Motion::unit_tangents(system));
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
}
