//! Forces and signals of an oscillator in one state.

use super::domain::DomainKey;
use super::domains::System;
use super::modes::Pieces;
use crate::model::{Contact, MOST_GAPS, Side};
use crate::motion::{Slip, Slips};

/// Forces and signals of an oscillator in one state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outputs {
    /// For each gap, the force of its contacts, positive where it pushes the gap off its wall. A rigid wall pushes while the gap rests on it.
    pub contacts: Vec<f64>,
    /// For each element with dry friction, its force: `force` or `-force` while it slides, and the force that holds it while it sticks.
    pub friction: Vec<f64>,
    /// The signals.
    pub signals: Vec<f64>,
}

/// What a state alone does not tell.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// Time since phase 0.
    pub time: f64,
    /// The side of each gap's lasting contact.
    pub contacts: &'a [Option<Side>],
    /// Modes of dry friction, one for each of [`Oscillator::friction`](crate::model::Oscillator::friction).
    pub slips: Slips,
    /// Whether the state is that after an event, and not before it. It matters for a gap exactly on one of several walls of a side.
    pub is_after: bool,
}

impl System {
    /// Returns the forces and signals in a state `(x1, v1, ...)`.
    pub fn outputs(&self, state: &[f64], situation: &Situation<'_>) -> Outputs {
        let y = self.to_flow(state);
        let key = self.key_of(&y, situation);
        let (domain, point) = (self.domain_at(key), self.point(&y, situation.time));
        let contact = |gap: usize| {
            let push = domain.pushes[gap].as_ref().map_or(0.0, |push| push.dot(&point));
            if key.engaged[gap] == 0 { push } else { push + self.compliant_force(&key, gap).dot(&point) }
        };
        let mut friction = vec![0.0; self.machine().friction.len()];
        for (i, element) in self.elements.iter().enumerate() {
            friction[element.index] = match key.slips[i] {
                Slip::Stick => domain.holds[i].as_ref().map_or(0.0, |hold| hold.dot(&point)),
                slip => slip.sign() * element.curve.at(self.argument(i, &key.slips).dot(&point)),
            };
        }
        let signals = self.machine().signals.iter();
        Outputs {
            contacts: (0..self.gaps()).map(contact).collect(),
            friction,
            signals: signals.map(|signal| self.signal_row(signal, domain).dot(&point)).collect(),
        }
    }

    fn key_of(&self, y: &[f64], situation: &Situation<'_>) -> DomainKey {
        let begun = self.schedule.iter().rev().find(|change| change.0 <= situation.time);
        let mut key = DomainKey {
            stage: begun.or(self.schedule.last()).map_or(0, |change| change.1),
            engaged: [0; MOST_GAPS],
            held: [None; MOST_GAPS],
            slips: Slips::default(),
            pieces: Pieces::default(),
        };
        for (i, element) in self.elements.iter().enumerate() {
            key.slips[i] = situation.slips[element.index];
        }
        let pieces = self.pieces_at(&key.slips, &self.point(y, situation.time));
        key.pieces = pieces;
        for (gap, contact) in situation.contacts.iter().enumerate().take(self.gaps()) {
            let Some(side) = *contact else { continue };
            let (walls, outward) = (self.walls(gap, side), side.sign() * y[self.n + gap]);
            let is_passed = |at: f64| match side.sign() * (y[gap] - at) {
                0.0 => outward != 0.0 && (outward > 0.0) == situation.is_after,
                depth => depth > 0.0,
            };
            let passed = walls.iter().enumerate().filter(|(i, wall)| *i == 0 || is_passed(wall.at)).count();
            let sign = if side == Side::Right { 1 } else { -1 };
            key.engaged[gap] = sign * passed as i8;
            let is_rigid = walls.last().is_some_and(|wall| wall.contact == Contact::Rigid);
            // Rounding of the state may leave a gap at rest just in front of the last of several walls.
            let rests = is_rigid && (walls.len() == 1 || passed == walls.len() || outward == 0.0);
            let is_open = || {
                let force = self.pushing(gap, side).map(|_| self.force(key.stage, &pieces, gap, side));
                passed > 1 && force.is_some_and(|force| force.dot(&self.point(y, situation.time)) <= 0.0)
            };
            if rests {
                key.held[gap] = Some(side);
                key.engaged[gap] = sign * (walls.len() - 1) as i8;
            } else if passed == walls.len() && is_open() {
                key.engaged[gap] = sign * (passed - 1) as i8;
            }
        }
        key
    }
}
