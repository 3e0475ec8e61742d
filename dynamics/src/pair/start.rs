//! Starts of trajectories: free, in contact or meshing.

use super::{DomainKind, Mode, PairFlow, PairMotion, PairState, Schedule};
use crate::model::{Contact, Law, Side};
use crate::motion::{Allowance, Clock, Observer, Work};

/// Distance of a gap that lies on a wall, relative to the wall's position or the scale of length.
const START_ON_WALL: f64 = 1e-9;

impl<'f> PairMotion<'f, 0> {
    /// Starts a trajectory at phase 0 in the state `y`.
    ///
    /// A gap behind a wall means meshing. A gap behind a rigid wall is moved onto the wall. A closing gap on a wall
    /// is a contact.
    pub(crate) fn new(flow: &'f PairFlow, law: Law, y: PairState) -> Self {
        Self::with_tangents(flow, law, y, [])
    }

    /// Starts a trajectory in lasting contact with the wall `meshing`, or in free motion. The state alone does not
    /// determine this: a gap just in front of a wall may be free or in contact onset.
    pub(crate) fn meshing_from(flow: &'f PairFlow, law: Law, y: PairState, meshing: Option<Side>) -> Self {
        let mut trajectory = Self::new(flow, law, y);
        let contact = meshing.map(|side| flow.contacts[side.index()]);
        if let (Some(side), Some(Contact::Rigid)) = (meshing, contact) {
            trajectory.stand_on(side);
        } else if let (Mode::Free, Some(side), Some(Contact::Impact)) = (trajectory.mode, meshing, contact) {
            trajectory.mode = Mode::Onset(side);
            trajectory.origin = Some(side);
            trajectory.from_wall = None;
            trajectory.pending = None;
        }
        trajectory
    }

    /// Starts a trajectory like [`PairMotion::meshing_from`], and decides contact that depends on a force again, as where a stage begins.
    pub(crate) fn continued(
        flow: &'f PairFlow,
        law: Law,
        (y, meshing): (PairState, Option<Side>),
        observer: &mut impl Observer,
    ) -> Self {
        let mut trajectory = PairMotion::meshing_from(flow, law, y, meshing);
        trajectory.enter_stage(trajectory.flow, observer);
        trajectory
    }
}

impl<'f, const N: usize> PairMotion<'f, N> {
    /// Starts a trajectory with tangent vectors in the coordinates of [`PairState`].
    pub(crate) fn with_tangents(
        flow: &'f PairFlow,
        law: Law,
        y: PairState,
        tangents: [PairState; N],
    ) -> Self {
        let (schedule, flow) = Schedule::new(flow);
        let mut trajectory = PairMotion {
            flow,
            schedule,
            law,
            mode: Mode::Free,
            origin: None,
            from_wall: None,
            short_flight: false,
            pending: None,
            q: flow.to_gap(y),
            phasor: [1.0, 0.0],
            clock: Clock::default(),
            goal: 0.0,
            period: 0,
            level: [DomainKind::Free, DomainKind::Meshing(Side::Right)].map(|d| flow.domain(d).taylor_level),
            tangents: tangents.map(|u| flow.tangent_to_gap(u)),
            log_scale: 0.0,
            events_in_period: 0,
            steps_in_period: 0,
            travelled: 0.0,
            meshing_time: 0.0,
            near_grazing: false,
            work: Work::default(),
            allowance: Allowance::UNLIMITED,
        };
        trajectory.enter();
        trajectory
    }

    /// Copies the trajectory and replaces its tangent vectors, whose number may change.
    pub(crate) fn carrying<const M: usize>(&self, tangents: [PairState; M]) -> PairMotion<'f, M> {
        PairMotion {
            flow: self.flow,
            schedule: self.schedule,
            law: self.law,
            mode: self.mode,
            origin: self.origin,
            from_wall: self.from_wall,
            short_flight: self.short_flight,
            pending: self.pending,
            q: self.q,
            phasor: self.phasor,
            clock: self.clock,
            goal: self.goal,
            period: self.period,
            level: self.level,
            tangents: tangents.map(|u| self.flow.tangent_to_gap(u)),
            log_scale: 0.0,
            events_in_period: self.events_in_period,
            steps_in_period: self.steps_in_period,
            travelled: self.travelled,
            meshing_time: self.meshing_time,
            near_grazing: self.near_grazing,
            work: self.work,
            allowance: self.allowance,
        }
    }

    /// Starts a trajectory from another state at phase 0, in the domain of this one and with its remaining allowance.
    ///
    /// The state alone does not determine the domain: a gap just in front of a wall may be free or in contact onset.
    pub(crate) fn at<const M: usize>(&self, y: PairState, tangents: [PairState; M]) -> PairMotion<'f, M> {
        self.start_in(self.mode, self.origin, y, tangents)
    }

    /// Starts a trajectory in a given mode.
    fn start_in<const M: usize>(
        &self,
        mode: Mode,
        origin: Option<Side>,
        y: PairState,
        tangents: [PairState; M],
    ) -> PairMotion<'f, M> {
        let mut started = PairMotion::with_tangents(self.schedule.whole, self.law, y, tangents);
        started.allowance = self.allowance();
        // At an elastic wall the state alone determines the mode.
        let is_elastic = |side: Side| started.flow.contacts[side.index()].is_elastic();
        if let Mode::Sustained(side) = started.mode
            && is_elastic(side)
        {
            return started;
        }
        let mode = match mode {
            Mode::Sustained(side) if is_elastic(side) => Mode::Free,
            mode => mode,
        };
        if let Mode::Stuck(side) = mode {
            started.stand_on(side);
        } else {
            (started.mode, started.from_wall, started.pending) = (mode, None, None);
        }
        started.origin = origin;
        started
    }

    /// Whether another trajectory has the same mode and comes from the same wall.
    pub(crate) fn has_mode_and_origin_of(&self, other: &PairMotion<'_, N>) -> bool {
        (self.mode, self.origin, self.from_wall) == (other.mode, other.origin, other.from_wall)
    }

    /// Whether another trajectory is in the same domain. Contact onset and sustained contact count as different,
    /// unless the gap lies on the wall.
    pub(crate) fn is_in_domain_of(&self, other: &PairMotion<'_, N>) -> bool {
        let is_between = |side: Side| {
            let wall = self.flow.wall(side);
            (self.q[0] - wall).abs() <= START_ON_WALL * wall.abs().max(self.flow.length)
        };
        self.mode == other.mode || self.meshing() == other.meshing() && self.meshing().is_some_and(is_between)
    }

    /// Starts a trajectory at phase 0 from the mirror image of the present state, in the mirrored domain.
    pub(crate) fn mirrored<const M: usize>(&self, tangents: [PairState; M]) -> PairMotion<'f, M> {
        let y = self.state().map(|value| -value);
        self.start_in(self.mode.mirrored(), self.origin.map(Side::mirrored), y, tangents)
    }
}
