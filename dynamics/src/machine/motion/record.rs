//! The record of what a motion passes.

use super::{CarriedModes, MachineMotion};
use crate::machine::passages::{End, Passage};
use crate::motion::Stop;

impl MachineMotion<'_> {
    /// Integrates over half forcing periods from phase 0, and returns what the motion passes.
    ///
    /// # Errors
    /// A [`Stop`] if the motion cannot be continued.
    pub(crate) fn passages(mut self, half_periods: u32) -> Result<Vec<Passage>, Stop> {
        self.passages = Some(Vec::new());
        for _ in 0..half_periods / 2 {
            self.advance_period(&mut ())?;
        }
        if half_periods % 2 == 1 {
            self.advance_to(0.5 * self.system.period, &mut ())?;
            self.pass(End::Half);
        }
        Ok(self.passages.unwrap_or_default())
    }

    /// Puts a motion that begins now in the modes of a flight. `before`: an earlier motion, from whose last events symbols follow.
    pub(crate) fn in_modes(mut self, passage: &Passage, before: Option<&Self>) -> Self {
        let origin = before.map_or(self.origin, |before| before.origin);
        self.take_modes(&CarriedModes { modes: passage.modes, origin });
        self
    }

    /// Records the end of a flight in the present state.
    pub(super) fn pass(&mut self, end: End) {
        let Some(mut passages) = self.passages.take() else { return };
        let (period, modes, state) = (self.period, self.modes, self.state());
        let turns = period as f64 + self.clock.time() / self.system.period;
        let mut passage = Passage { modes, end, period, turns, state, limit: None };
        passage.turns = self.system.known_turns(&passage);
        passages.push(passage);
        self.passages = Some(passages);
    }

    /// Adds the impacts to the record of an event. An event that changes nothing is no passage.
    pub(super) fn end_passage(&mut self) {
        let Some(passages) = &mut self.passages else { return };
        let Some(at) = passages.iter().rposition(|passage| matches!(passage.end, End::Event(..))) else {
            return;
        };
        let is_last = at + 1 == passages.len();
        if is_last && self.jumps.is_empty() && passages[at].modes.are(&self.modes, self.system.gaps()) {
            passages.pop();
        } else if let End::Event(_, impulses) = &mut passages[at].end {
            impulses.extend(self.jumps.iter().map(|(impulse, _)| *impulse));
        }
    }
}
