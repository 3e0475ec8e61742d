//! What happened in a forcing period, as a number.
//!
//! The strobe map is smooth as long as the same events follow one another: its branches are told
//! apart by their itineraries.

use crate::flow::Flow;
use crate::model::Side;
use crate::reference::{Happening, Observer};

/// The events of one forcing period in their order, with their walls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Itinerary(u64);

/// Takes down the itinerary of a period.
#[derive(Clone, Copy, Debug)]
pub(super) struct Recorder {
    walls: [f64; 2],
    pub(super) itinerary: Itinerary,
}

impl Recorder {
    pub(super) fn new(flow: &Flow) -> Recorder {
        Recorder { walls: flow.walls, itinerary: Itinerary::default() }
    }

    /// The itineraries of consecutive periods.
    pub(super) fn list(flow: &Flow, met: &[Happening], start: u64, periods: u32) -> Vec<Itinerary> {
        let mut list = vec![Recorder::new(flow); periods as usize];
        met.iter().for_each(|happening| list[(happening.period - start) as usize].event(happening));
        list.into_iter().map(|recorder| recorder.itinerary).collect()
    }
}

impl Observer for Recorder {
    #[inline]
    fn event(&mut self, happening: &Happening) {
        let wall = self.walls[usize::from(happening.side == Side::Left)];
        // Meshing that ends before the wall is reached is another branch.
        let is_on_wall = happening.before[0] == wall;
        let code = 1
            + u64::from(happening.side == Side::Right)
            + 2 * u64::from(is_on_wall)
            + 4 * happening.kind as u64;
        let Itinerary(before) = self.itinerary;
        // An odd factor and a rotation: order matters, and no event is lost.
        self.itinerary = Itinerary((before ^ code).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23));
    }
}
