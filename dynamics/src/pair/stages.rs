//! Changes of the stage at given phases.
//!
//! State and tangents are continuous there, because the phase of a change is the same for all neighbouring motions. A gap in front of a
//! wall stays in free motion, and a gap behind a wall stays in contact. A contact that depends on a force is decided again: a gap at rest
//! on a rigid wall, and a contact onset.

use super::{Mode, PairMotion};
use crate::motion::{EventKind, Observer};
use crate::pair::flow::{DomainKind, PairFlow};

impl<'f, const N: usize> PairMotion<'f, N> {
    /// Enters a stage, given its flow.
    #[cold]
    #[inline(never)]
    pub(super) fn enter_stage(&mut self, flow: &'f PairFlow, observer: &mut impl Observer) {
        self.flow = flow;
        self.short_flight = false;
        let levels = |kind: DomainKind| self.flow.domain(kind).levels - 1;
        let in_contact = if self.mode == Mode::Free { self.level[1] } else { levels(self.mode.domain()) };
        self.level = [self.level[0].min(levels(DomainKind::Free)), self.level[1].min(in_contact)];
        match self.mode {
            Mode::Stuck(side) if !self.presses(DomainKind::Meshing(side), side, &self.q) => {
                self.record(EventKind::MeshEnd, side, self.q, observer);
                self.leave(side);
            }
            Mode::Onset(side) => {
                let meshing = self.flow.domain(DomainKind::Meshing(side));
                if side.sign() * meshing.acceleration(&self.q, &self.phasor) <= 0.0 {
                    self.record(EventKind::MeshEnd, side, self.q, observer);
                    self.mode = Mode::Free;
                    // A contact that begins at this instant starts on its wall.
                    self.from_wall = self.from_wall.map(|_| (side, 1));
                }
            }
            _ => {}
        }
        // The gap is on a wall if an event occurs at this instant. At rest, the new acceleration decides.
        if let (Some((side, _)), 0.0) = (self.from_wall, self.q[1]) {
            self.from_wall = Some((side, self.rest_order(self.mode.domain())));
        }
    }
}
