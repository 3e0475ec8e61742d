//! The sequence of events in a forcing period, as a number.
//!
//! The strobe map is smooth as long as the sequence of events does not change. So the itinerary identifies a branch
//! of the strobe map.

use crate::motion::{Flow, GapEvent, Observer, SlipEvent, States};

/// Largest distance from phase 0, in turns, of an event that a slow approach may still move to the other side.
pub const NEAR_STROBE_TURNS: f64 = 1e-3;

/// A hash of the events of one forcing period in their order, with their walls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Itinerary(u64);

/// Computes the itinerary of a period.
#[derive(Clone, Copy, Debug)]
pub(super) struct Recorder {
    period: f64,
    pub(super) itinerary: Itinerary,
    /// Whether an event lies near phase 0, so that rounding or a slow approach may move it to the other side.
    pub(super) is_near_strobe: bool,
}

impl Recorder {
    pub(super) fn new(flow: &Flow) -> Recorder {
        Recorder { period: flow.period, itinerary: Itinerary::default(), is_near_strobe: false }
    }

    #[inline]
    fn add(&mut self, code: u64, t: f64) {
        let Itinerary(before) = self.itinerary;
        // Multiplication by an odd number and rotation are invertible, and they make the order count.
        self.is_near_strobe |= t.min(self.period - t) < NEAR_STROBE_TURNS * self.period;
        self.itinerary = Itinerary((before ^ code).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23));
    }
}

impl Observer for Recorder {
    #[inline]
    fn event(&mut self, event: &GapEvent, _: States<'_>) {
        self.add(event.code, event.t);
    }

    fn slip(&mut self, event: &SlipEvent) {
        let modes = event.slips.iter().fold(1, |code, &slip| 3 * code + slip as u64);
        self.add(16 * modes, event.t);
    }
}
