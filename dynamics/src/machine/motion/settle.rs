//! Modes that depend on forces: those of friction, gaps at rest, contact onsets, and walls that only push.

use super::MachineMotion;
use super::act::RELEASE_ORDER;
use crate::machine::domain::DomainKey;
use crate::machine::modes::{AtRest, GapMode, MOST_CURVES, Modes};
use crate::model::{Contact, MOST_FRICTION, MOST_GAPS, Side};
use crate::motion::Slip;
use crate::motion::{EventKind, Observer, SlipKind, Sums};

/// Largest number of decisions on elements at rest after one event.
const MOST_DECISIONS: usize = 16;

impl MachineMotion<'_> {
    /// Processes a sliding rate that vanishes.
    pub(super) fn end_sliding(&mut self, i: usize, observer: &mut dyn Observer) {
        let mut at_rest = self.at_rest();
        at_rest.elements[i] = true;
        let before = self.modes.slips[i];
        let chosen = self.system.consistent(&self.modes, &at_rest, &self.point);
        let next = chosen.unwrap_or(self.modes);
        if next.slips[i] == before {
            // The rate only touches 0, or begins with the wrong sign.
            self.near_grazing = true;
            self.count_event();
            self.roots.from_rate[i] = self.slide_order(i);
            return;
        }
        self.change_modes(&next, Some(i), observer);
    }

    /// Returns the order of the root of a sliding rate.
    pub(super) fn slide_order(&mut self, i: usize) -> usize {
        self.refresh().first_derivative(&self.system.rate_row(i), &self.point, 1).0
    }

    /// Processes an element that breaks away.
    pub(super) fn begin_sliding(&mut self, i: usize, next: Slip, observer: &mut dyn Observer) {
        let system = self.system;
        let kept: [bool; MOST_GAPS] =
            std::array::from_fn(|gap| gap < system.gaps() && self.moment().is_kept(gap));
        let before = self.modes;
        (self.modes.slips[i], self.modes.pieces[i]) = (next, 0);
        let domain = self.refresh();
        // The accelerations jump if friction is larger at rest than while sliding.
        let jumps = system.elements[i].falls();
        let release_order = if jumps { RELEASE_ORDER - 1 } else { RELEASE_ORDER };
        let freed = || (0..system.gaps()).filter(|&gap| kept[gap] && !domain.is_still[gap]);
        for gap in freed() {
            if let (Some((side, _)), GapMode::Beyond(_)) = (self.roots.at_wall[gap], self.modes.gaps[gap])
                && let Some((own, number)) = self.system.wall_ahead(&self.modes, gap, side)
                && own == side
                && self.system.walls(gap, side)[number].contact == Contact::Rigid
                && side.sign() * domain.first_derivative(&domain.unit_row(gap), &self.point, release_order).1
                    > 0.0
            {
                // The wall holds the gap from here on.
                self.modes = before;
                self.record(gap, EventKind::MeshStart, side, number, Some(side), observer);
                self.modes.gaps[gap] = GapMode::Stuck(side);
                self.roots.at_wall[gap] = None;
                return;
            }
        }
        self.roots.from_rate[i] = if jumps { 1 } else { 2 };
        self.has_slid[i] = true;
        self.record_slip(i, SlipKind::Slip, observer);
        for gap in freed() {
            self.roots.at_wall[gap] = self.roots.at_wall[gap].map(|(side, _)| (side, release_order));
            if let GapMode::Onset(_) = self.modes.gaps[gap] {
                self.roots.from_force[gap] = release_order - 2;
            }
        }
    }

    /// Returns all elements at rest: gaps on rigid walls, and elements that stick.
    fn at_rest(&self) -> AtRest {
        let mut at_rest = AtRest::default();
        for gap in 0..self.system.gaps() {
            at_rest.gaps[gap] = match (self.modes.gaps[gap], self.roots.at_wall[gap]) {
                (GapMode::Beyond(_), Some((side, _))) if self.moment().is_kept(gap) => {
                    let ahead = self.system.wall_ahead(&self.modes, gap, side);
                    let is_rigid =
                        |number: usize| self.system.walls(gap, side)[number].contact == Contact::Rigid;
                    ahead.is_some_and(|(own, number)| own == side && is_rigid(number)).then_some(side)
                }
                (mode, _) => mode.rest(),
            };
        }
        for i in 0..self.system.elements.len() {
            at_rest.elements[i] = self.modes.slips[i] == Slip::Stick || self.moment().is_yielding(i);
        }
        at_rest
    }

    /// Whether a mode depends on forces: of friction, of a gap at rest, of a contact onset, or at a wall that only pushes.
    fn depends_on_forces(&self) -> bool {
        let of_gap = |gap: usize| match self.modes.gaps[gap] {
            GapMode::Pressed(_) => false,
            GapMode::Beyond(_) => {
                self.roots.at_wall[gap].is_some() && self.moment().is_kept(gap)
                    || self.system.pushed(&self.modes, gap).is_some()
            }
            _ => true,
        };
        !self.system.elements.is_empty() || (0..self.system.gaps()).any(of_gap)
    }

    /// Decides all modes that depend on forces again, after a jump of forces or rates. The modes in `exempt` have just been decided.
    pub(super) fn settle(&mut self, exempt: &AtRest, observer: &mut dyn Observer) {
        for _ in 0..MOST_DECISIONS {
            self.refresh();
            if !self.depends_on_forces() {
                break;
            }
            if self.settle_pushing(observer) {
                continue;
            }
            let mut at_rest = self.at_rest();
            for gap in 0..MOST_GAPS {
                at_rest.gaps[gap] = at_rest.gaps[gap].filter(|_| exempt.gaps[gap].is_none());
            }
            for i in 0..MOST_FRICTION {
                at_rest.elements[i] &= !exempt.elements[i];
            }
            if self.system.is_consistent(&self.modes, &at_rest, &self.point, false) {
                break;
            }
            match self.system.consistent(&self.modes, &at_rest, &self.point) {
                Some(chosen) if chosen == self.modes => break,
                Some(chosen) => self.change_modes(&chosen, None, observer),
                None => {
                    self.near_grazing = true;
                    break;
                }
            }
        }
        // The rate or acceleration of a gap on its wall may have changed.
        for gap in 0..self.system.gaps() {
            if let Some((side, order)) = self.roots.at_wall[gap]
                && (order < RELEASE_ORDER || self.rate(gap) != 0.0)
            {
                self.leave(gap, side);
            }
        }
    }

    /// Decides the modes of contact onsets and of walls that only push again. Returns whether a mode has changed.
    fn settle_pushing(&mut self, observer: &mut dyn Observer) -> bool {
        for gap in 0..self.system.gaps() {
            if self.roots.from_force[gap] > 0 {
                continue;
            }
            let (domain, pushed) = (self.domain, self.system.pushed(&self.modes, gap));
            let mode = self.modes.gaps[gap];
            match mode {
                GapMode::Onset(side)
                    if !self.moment().is_kept(gap)
                        && side.sign() * domain.departure(gap, &self.point).1 <= 0.0 =>
                {
                    self.end_contact(gap, side, observer);
                    self.roots.at_wall[gap] = self.roots.at_wall[gap].map(|_| (side, 1));
                    return true;
                }
                GapMode::Open(side) if self.derivative_of_force(gap, side, 0).1 > 0.0 => {
                    self.begin_force(gap, side, observer);
                    self.start_from_force(gap, side);
                    return true;
                }
                GapMode::Beyond(_) => {
                    let pulls = |side: &Side| self.derivative_of_force(gap, *side, 0).1 < 0.0;
                    if let Some(side) = pushed.filter(pulls) {
                        self.end_contact(gap, side, observer);
                        self.modes.gaps[gap] = GapMode::Open(side);
                        self.start_from_force(gap, side);
                        return true;
                    }
                }
                _ => {}
            }
        }
        false
    }

    /// Enters new modes of elements at rest and reports the changes. Changes of friction come first if the element `stopped` has just
    /// stopped sliding.
    pub(super) fn change_modes(&mut self, next: &Modes, stopped: Option<usize>, observer: &mut dyn Observer) {
        if stopped.is_some() {
            self.change_slips(next, stopped, observer);
        }
        for gap in 0..self.system.gaps() {
            match (self.modes.gaps[gap], next.gaps[gap]) {
                (GapMode::Stuck(side), GapMode::Beyond(_)) => {
                    self.end_contact(gap, side, observer);
                    self.roots.at_wall[gap] = Some((side, 1));
                }
                (GapMode::Beyond(_), GapMode::Stuck(side)) => {
                    let last = self.system.walls(gap, side).len() - 1;
                    self.record(gap, EventKind::MeshStart, side, last, Some(side), observer);
                    self.roots.at_wall[gap] = None;
                }
                _ => {}
            }
            self.modes.gaps[gap] = next.gaps[gap];
        }
        if stopped.is_none() {
            self.change_slips(next, stopped, observer);
        }
        self.refresh();
        self.system.hold(&self.modes, &mut self.point, false);
        for gap in 0..self.system.gaps() {
            if let Some((side, 1)) = self.roots.at_wall[gap] {
                self.leave(gap, side);
            }
        }
        for i in 0..self.system.elements.len() {
            if self.roots.from_rate[i] > 0 {
                self.roots.from_rate[i] = self.slide_order(i);
            }
        }
    }

    /// Enters new modes of friction and reports the changes.
    fn change_slips(&mut self, next: &Modes, stopped: Option<usize>, observer: &mut dyn Observer) {
        let before = std::mem::replace(&mut self.modes.slips, next.slips);
        self.modes.pieces = next.pieces;
        self.roots.at_border = [None; MOST_CURVES];
        for (i, (before, after)) in
            before.into_iter().zip(next.slips).enumerate().take(self.system.elements.len())
        {
            if after == before {
                continue;
            }
            self.has_slid[i] |= after != Slip::Stick;
            let reverses = before != Slip::Stick && after != Slip::Stick;
            // An element that has just stopped has a small rate, because its time has a rounding error.
            let is_at_rest = stopped == Some(i) || self.system.rate_row(i).vanishes(&self.point);
            self.roots.from_rate[i] = usize::from(after != Slip::Stick && is_at_rest);
            match before {
                Slip::Stick => self.record_slip(i, SlipKind::Slip, observer),
                _ if !reverses => self.record_slip(i, SlipKind::Stick, observer),
                _ if stopped == Some(i) => self.record_slip(i, SlipKind::Reversal, observer),
                _ => {}
            }
        }
    }

    /// Enters a stage and decides the modes that depend on forces again.
    pub(super) fn enter_stage(&mut self, stage: usize, observer: &mut dyn Observer) {
        let before = self.modes.key(self.system);
        self.modes.stage = stage;
        self.note_before();
        self.forget_watches();
        self.refresh();
        self.settle(&AtRest::default(), observer);
        if let Some(sums) = observer.sums() {
            self.measure_change(&before, sums);
        }
        for gap in 0..self.system.gaps() {
            if let (Some((side, _)), true) = (self.roots.at_wall[gap], self.rate(gap) == 0.0) {
                self.leave(gap, side);
            }
        }
    }

    /// Measures the energy of contacts that a change of the stage has ended or begun.
    fn measure_change(&self, before: &DomainKey, sums: &mut Sums) {
        let (system, after) = (self.system, self.modes.key(self.system));
        for gap in 0..system.gaps() {
            let [from, to] = [before.engaged[gap], after.engaged[gap]];
            if from == to {
                continue;
            }
            // Only contact with the outermost wall depends on its force.
            let side = if from + to > 0 { Side::Right } else { Side::Left };
            let (wall, last) = (system.last_wall(gap, side), system.walls(gap, side).len() - 1);
            let stored = |stage: usize| system.stored(stage, gap, side, last, self.point[gap]);
            let [held, holds] =
                if from.abs() > to.abs() { [stored(before.stage), 0.0] } else { [0.0, stored(after.stage)] };
            if wall.contact == Contact::Pushing {
                sums.released.add(held, holds);
            } else {
                sums.lost.add(held, holds);
                sums.gaps[gap].lost.add(held, holds);
            }
        }
    }
}
