//! Starts of motions.

use super::MachineMotion;
use crate::machine::domain::Carrier;
use crate::machine::modes::{AtRest, GapMode, Modes, Pieces, signed};
use crate::machine::watch::Roots;
use crate::machine::{Numbers, SIZE, System};
use crate::model::{Contact, MOST_COORDINATES, MOST_FRICTION, MOST_GAPS, Side};
use crate::motion::{Allowance, Clock, Observer, Work};
use crate::motion::{Slip, Slips};

/// Rounding error of a gap that lies on a wall, relative to the terms of the gap and the wall's position.
const GAP_ROUNDING: f64 = 4.0 * f64::EPSILON;

/// The modes of a motion, and the sides of its last events.
#[derive(Clone, Debug)]
pub(crate) struct CarriedModes {
    pub(super) modes: Modes,
    pub(super) origin: [Option<Side>; MOST_GAPS],
}

impl<'s> MachineMotion<'s> {
    /// Starts at phase 0 in the state `(x1, v1, x2, v2, ...)`.
    ///
    /// A gap behind a wall with a force is in contact. A gap behind a rigid wall is moved by
    /// [`put_on_walls`](crate::model::Oscillator::put_on_walls).
    pub fn new(system: &'s System, state: &[f64]) -> MachineMotion<'s> {
        let stage = system.machine.first_stage();
        let modes = Modes {
            stage,
            gaps: [GapMode::Beyond(0); MOST_GAPS],
            slips: Slips::default(),
            pieces: Pieces::default(),
        };
        let begins_now = system.schedule.first().is_some_and(|change| change.0 == 0.0);
        let point = system.point(&system.to_flow(&system.machine.put_on_walls(state)), 0.0);
        let mut motion = MachineMotion {
            system,
            modes,
            entered: modes,
            domain: system.domain(&modes),
            memory: None,
            stride: 0,
            carrier: Carrier::default(),
            point,
            clock: Clock::default(),
            goal: 0.0,
            period: 0,
            change: usize::from(begins_now),
            roots: Roots::default(),
            origin: [None; MOST_GAPS],
            has_slid: [false; MOST_FRICTION],
            tangents: Vec::new(),
            log_scale: 0.0,
            before: [0.0; SIZE],
            jumps: Vec::new(),
            passages: None,
            events_in_period: 0,
            steps_in_period: 0,
            contact_time: 0.0,
            sticking_time: 0.0,
            travelled: [0.0; MOST_COORDINATES],
            near_grazing: false,
            remark: None,
            work: Work::default(),
            allowance: Allowance::UNLIMITED,
        };
        motion.note_before();
        motion.enter();
        motion
    }

    /// Starts from another state at phase 0, in the modes of this motion and with its remaining allowance. The state alone does not determine
    /// the modes: a gap just in front of a wall may be free or in a contact onset.
    pub fn at(&self, state: &[f64], tangents: Vec<Numbers>) -> MachineMotion<'s> {
        let mut started = MachineMotion::new(self.system, state);
        started.take_modes(&self.carried());
        started.allowance = self.allowance();
        started.set_tangents(tangents);
        started
    }

    /// Starts at phase 0 of a system that differs in its clock only, in the present state and modes.
    pub(crate) fn in_system<'g>(&self, system: &'g System) -> MachineMotion<'g>
    where
        's: 'g,
    {
        let mut started = MachineMotion::new(system, &self.state());
        started.take_modes(&self.carried());
        started.allowance = self.allowance();
        started.remark = started.remark.max(self.remark);
        started
    }

    /// Returns what the state does not tell about the motion.
    pub(crate) fn carried(&self) -> CarriedModes {
        CarriedModes { modes: self.modes, origin: self.origin }
    }

    /// Starts at phase 0 in the state and in the modes of a motion of the same model with other values of its parameters. Modes that depend on
    /// forces are decided again, as where a stage begins.
    pub(crate) fn continued(
        system: &'s System,
        state: &[f64],
        carried: &CarriedModes,
        observer: &mut dyn Observer,
    ) -> MachineMotion<'s> {
        let mut started = MachineMotion::new(system, state);
        started.take_modes(carried);
        started.enter_stage(started.modes.stage, observer);
        started
    }

    pub(super) fn take_modes(&mut self, carried: &CarriedModes) {
        let (system, modes) = (self.system, &carried.modes);
        self.forget_watches();
        self.origin = carried.origin;
        for gap in 0..system.gaps() {
            let mode = modes.gaps[gap];
            let lasts = match mode {
                GapMode::Stuck(side) => {
                    self.point[gap] = system.last_wall(gap, side).at;
                    true
                }
                GapMode::Onset(side) => self.modes.gaps[gap] == system.before_last(gap, side),
                _ => false,
            };
            if lasts {
                (self.modes.gaps[gap], self.roots.at_wall[gap]) = (mode, None);
            }
        }
        self.modes.slips = modes.slips;
        for (element, slip) in system.elements.iter().zip(&mut self.modes.slips) {
            let [rate, size] = element.rate_and_size(&self.point[system.n..]);
            if *slip != Slip::Stick && rate.abs() > GAP_ROUNDING * size {
                // An element that slides may start in the other direction.
                *slip = Slip::of(rate);
            }
        }
        self.modes.pieces = system.pieces_at(&self.modes.slips, &self.point);
        self.has_slid = modes.slips.map(|slip| slip != Slip::Stick);
        self.roots.from_rate = [0; MOST_FRICTION];
        system.hold(&self.modes, &mut self.point, false);
    }

    /// Determines the modes of the start.
    fn enter(&mut self) {
        let (system, n) = (self.system, self.system.n);
        let state = self.state();
        for gap in 0..system.gaps() {
            let row = &system.machine.gaps[gap].row;
            let size: f64 = row.iter().enumerate().map(|(i, x)| (x * state[2 * i]).abs()).sum();
            for side in Side::BOTH {
                for (number, wall) in system.walls(gap, side).iter().enumerate() {
                    let is_on_wall =
                        (self.point[gap] - wall.at).abs() <= GAP_ROUNDING * (size + wall.at.abs());
                    let beyond = side.sign() * (self.point[gap] - wall.at);
                    if is_on_wall || beyond > 0.0 && wall.contact == Contact::Rigid {
                        self.point[gap] = wall.at;
                        self.origin[gap] = Some(side);
                        self.roots.at_wall[gap] = Some((side, 1));
                        break;
                    }
                    if beyond < 0.0 {
                        break;
                    }
                    self.origin[gap] = Some(side);
                    self.modes.gaps[gap] = match wall.contact {
                        Contact::Impact => GapMode::Pressed(side),
                        _ => GapMode::Beyond(signed(side, number + 1)),
                    };
                }
            }
        }
        let mut at_rest = AtRest::default();
        for (i, element) in system.elements.iter().enumerate() {
            let [rate, size] = element.rate_and_size(&self.point[n..]);
            at_rest.elements[i] = rate.abs() <= GAP_ROUNDING * size;
            self.modes.slips[i] = if at_rest.elements[i] { Slip::Stick } else { Slip::of(rate) };
            self.has_slid[i] = !at_rest.elements[i];
        }
        self.modes.pieces = system.pieces_at(&self.modes.slips, &self.point);
        (0..system.springs.len()).for_each(|spring| self.check_range(MOST_FRICTION + spring));
        self.refresh();
        for gap in 0..system.gaps() {
            if let Some(side) = system.pushed(&self.modes, gap) {
                let force = system.force(self.modes.stage, &self.modes.pieces, gap, side);
                if self.domain.first_derivative(&force, &self.point, 0).1 <= 0.0 {
                    self.modes.gaps[gap] = GapMode::Open(side);
                }
                self.start_from_force(gap, side);
            }
        }
        if let Some(chosen) = system.consistent(&self.modes, &at_rest, &self.point) {
            self.modes.slips = chosen.slips;
        }
        for i in 0..system.elements.len() {
            if at_rest.elements[i] && self.modes.slips[i] != Slip::Stick {
                self.has_slid[i] = true;
                self.roots.from_rate[i] = self.slide_order(i);
            }
        }
        for gap in 0..system.gaps() {
            let Some((side, _)) = self.roots.at_wall[gap] else { continue };
            let closing = side.sign() * self.rate(gap);
            if closing > 0.0 || closing == 0.0 && self.heads(gap, side) {
                // The motion starts with a contact.
                self.roots.at_wall[gap] = None;
            } else {
                self.leave(gap, side);
            }
        }
    }
}
