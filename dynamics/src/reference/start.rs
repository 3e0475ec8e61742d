//! Where a trajectory begins: free, in contact or meshing.

use super::clock::Clock;
use super::{Allowance, Mode, Trajectory, Work};
use crate::flow::{DomainKind, Flow};
use crate::model::{Contact, Law, Side, State};

/// A gap this near to a wall, relative to its position or the scale of length, lies on it.
const ON_WALL: f64 = 1e-9;

impl<'f> Trajectory<'f, 0> {
    /// A trajectory that starts at phase 0 in the state `y`.
    ///
    /// A start beyond a wall is meshing on it, beyond a rigid one it begins on it; on a wall and closing it is
    /// a contact.
    pub fn new(flow: &'f Flow, law: Law, y: State) -> Self {
        Self::with_tangents(flow, law, y, [])
    }

    /// The same where the teeth are known to mesh, or not: a gap just short of a wall may be
    /// in the contact onset.
    pub fn meshing_from(flow: &'f Flow, law: Law, y: State, meshing: Option<Side>) -> Self {
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
}

impl<'f, const N: usize> Trajectory<'f, N> {
    /// A trajectory that carries tangent vectors, given in the coordinates of [`State`].
    pub fn with_tangents(flow: &'f Flow, law: Law, y: State, tangents: [State; N]) -> Self {
        let levels =
            [DomainKind::Free, DomainKind::Meshing(Side::Right)].map(|d| flow.domain(d).taylor_level);
        let mut trajectory = Trajectory {
            flow,
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
            level: levels,
            tangents: tangents.map(|u| flow.tangent_to_gap(u)),
            log_scale: 0.0,
            events_in_period: 0,
            steps_in_period: 0,
            meshing_time: 0.0,
            near_grazing: false,
            work: Work::default(),
            allowance: Allowance::UNLIMITED,
        };
        trajectory.enter();
        trajectory
    }

    /// The same trajectory from here on with other tangent vectors.
    pub fn carrying<const M: usize>(&self, tangents: [State; M]) -> Trajectory<'f, M> {
        Trajectory {
            flow: self.flow,
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
            meshing_time: self.meshing_time,
            near_grazing: self.near_grazing,
            work: self.work,
            allowance: self.allowance,
        }
    }

    /// A trajectory from another state at phase 0, in the domain that this one is in.
    ///
    /// A state alone does not say whether a gap just short of a wall is free or in the contact onset
    /// at the start of meshing; neighbours of a motion that is have to be told. It is allowed what is left of this
    /// one's work.
    pub fn at<const M: usize>(&self, y: State, tangents: [State; M]) -> Trajectory<'f, M> {
        self.placed(self.mode, self.origin, y, tangents)
    }

    /// The same in a domain that need not be this one's.
    fn placed<const M: usize>(
        &self,
        mode: Mode,
        origin: Option<Side>,
        y: State,
        tangents: [State; M],
    ) -> Trajectory<'f, M> {
        let mut placed = Trajectory::with_tangents(self.flow, self.law, y, tangents);
        placed.allowance = self.allowance();
        // Behind an elastic wall is where the gap is, whatever its neighbours do.
        let is_elastic = |side: Side| self.flow.contacts[side.index()] == Contact::Elastic;
        if let Mode::Sustained(side) = placed.mode
            && is_elastic(side)
        {
            return placed;
        }
        let mode = match mode {
            Mode::Sustained(side) if is_elastic(side) => Mode::Free,
            mode => mode,
        };
        if let Mode::Stuck(side) = mode {
            placed.stand_on(side);
        } else {
            (placed.mode, placed.from_wall, placed.pending) = (mode, None, None);
        }
        placed.origin = origin;
        placed
    }

    /// Whether it is in the same domain as another one, and comes from the same wall.
    pub(crate) fn stands_as(&self, other: &Trajectory<'_, N>) -> bool {
        (self.mode, self.origin, self.from_wall) == (other.mode, other.origin, other.from_wall)
    }

    /// Whether it is in the same domain as another one, contact onset and sustained contact told apart where the gap does
    /// not lie on the wall between them.
    pub(crate) fn is_in_domain_of(&self, other: &Trajectory<'_, N>) -> bool {
        let is_between = |side: Side| {
            let wall = self.flow.wall(side);
            (self.q[0] - wall).abs() <= ON_WALL * wall.abs().max(self.flow.length)
        };
        self.mode == other.mode || self.meshing() == other.meshing() && self.meshing().is_some_and(is_between)
    }

    /// A trajectory from the mirror image of the present state at phase 0, in the mirrored domain:
    /// half a period on, a motion goes on as this one does.
    pub(crate) fn mirrored<const M: usize>(&self, tangents: [State; M]) -> Trajectory<'f, M> {
        let y = self.state().map(|value| -value);
        self.placed(self.mode.mirrored(), self.origin.map(Side::mirrored), y, tangents)
    }
}
