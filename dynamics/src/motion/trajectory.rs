//! The motion of an oscillator, computed by the engine that its flow was prepared for.

use nalgebra::DMatrix;

use super::{Allowance, Engine, Flow, GapEvent, Observer, Remark, Stop, Sums, Work};
use crate::machine::{CarriedModes, MachineMotion, System};
use crate::model::{Law, MOST_COORDINATES, REST, Side, State, first_four, state};
use crate::pair::{PairMeter, PairMotion};

/// The motion of one oscillator. `N` is the number of tangent vectors: 0, 1 for a Lyapunov exponent, or 4 for a monodromy matrix. For a
/// machine, 4 means two vectors for each coordinate.
#[derive(Clone, Debug)]
pub struct Trajectory<'f, const N: usize = 0> {
    flow: &'f Flow,
    motion: Engines<'f, N>,
}

#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "the pair's motion is the hot path, without an indirection")]
enum Engines<'f, const N: usize> {
    Pair(PairMotion<'f, N>),
    Machine(Box<MachineMotion<'f>>),
}

/// Evaluates one expression with the motion of either engine.
macro_rules! each {
    ($self:ident, $motion:ident => $does:expr) => {
        match $self.motion {
            Engines::Pair(ref $motion) => $does,
            Engines::Machine(ref $motion) => $does,
        }
    };
    (mut $self:ident, $motion:ident => $does:expr) => {
        match $self.motion {
            Engines::Pair(ref mut $motion) => $does,
            Engines::Machine(ref mut $motion) => $does,
        }
    };
}

impl<'f> Trajectory<'f, 0> {
    /// Starts a trajectory at phase 0 in the state `y`.
    ///
    /// A gap behind a wall means meshing. A gap behind a rigid wall is moved onto the wall. A closing gap on a wall
    /// is a contact.
    pub fn new(flow: &'f Flow, law: Law, y: State) -> Self {
        Self::with_tangents(flow, law, y, [])
    }

    /// Starts a trajectory in lasting contact with the wall `meshing`, or in free motion. The state alone does not
    /// determine this for a pair: a gap just in front of a wall may be free or in contact onset.
    pub fn meshing_from(flow: &'f Flow, law: Law, y: State, meshing: Option<Side>) -> Self {
        match flow.engine() {
            Engine::Pair(of) => {
                let motion = PairMotion::meshing_from(of, law, first_four(&y), meshing);
                Trajectory { flow, motion: Engines::Pair(motion) }
            }
            Engine::Machine(_) => Trajectory::new(flow, law, y),
        }
    }

    /// Returns what the motion hands over at phase 0 to an oscillator with other values of the parameters.
    pub(crate) fn carried(&self) -> Carried {
        let modes = match &self.motion {
            Engines::Pair(_) => None,
            Engines::Machine(motion) => Some(motion.carried()),
        };
        Carried { state: self.unshifted_state(), meshing: self.meshing(), modes }
    }

    /// Continues a motion at phase 0 of an oscillator that differs in the values of its parameters. Displacements and velocities stay, but a
    /// gap at rest on a rigid wall follows the wall, and surfaces that stick follow each other. Contact that depends on a force is decided again.
    pub(crate) fn continued(
        flow: &'f Flow,
        law: Law,
        carried: &Carried,
        observer: &mut impl Observer,
    ) -> Self {
        let Carried { state, meshing, modes } = carried;
        let motion = match (flow.engine(), modes) {
            (Engine::Pair(of), _) => {
                Engines::Pair(PairMotion::continued(of, law, (first_four(state), *meshing), observer))
            }
            (Engine::Machine(system), Some(modes)) => {
                Engines::Machine(Box::new(MachineMotion::continued(system, state, modes, observer)))
            }
            (Engine::Machine(_), None) => return Trajectory::new(flow, law, *state),
        };
        Trajectory { flow, motion }
    }
}

/// What a motion hands over at phase 0: its state, and what the state does not tell.
#[derive(Clone, Debug)]
pub(crate) struct Carried {
    state: State,
    meshing: Option<Side>,
    modes: Option<CarriedModes>,
}

impl<'f, const N: usize> Trajectory<'f, N> {
    /// Starts a trajectory with tangent vectors in the coordinates of [`State`]. A machine ignores `law`.
    pub fn with_tangents(flow: &'f Flow, law: Law, y: State, tangents: [State; N]) -> Self {
        let motion = match flow.engine() {
            Engine::Pair(of) => {
                let tangents = tangents.map(|u| first_four(&u));
                Engines::Pair(PairMotion::with_tangents(of, law, first_four(&y), tangents))
            }
            Engine::Machine(system) => {
                let mut motion = MachineMotion::new(system, &y);
                motion.set_tangents(of_machine(system, tangents));
                Engines::Machine(Box::new(motion))
            }
        };
        Trajectory { flow, motion }
    }

    /// Copies the trajectory and replaces its tangent vectors, whose number may change.
    pub fn carrying<const M: usize>(&self, tangents: [State; M]) -> Trajectory<'f, M> {
        let motion = match &self.motion {
            Engines::Pair(motion) => Engines::Pair(motion.carrying(tangents.map(|u| first_four(&u)))),
            Engines::Machine(motion) => {
                let mut motion = motion.clone();
                motion.set_tangents(of_machine(motion.system(), tangents));
                Engines::Machine(motion)
            }
        };
        Trajectory { flow: self.flow, motion }
    }

    /// Starts a trajectory from another state at phase 0, in the domain of this one and with its remaining allowance.
    ///
    /// The state alone does not determine the domain: a gap just in front of a wall may be free or in contact onset.
    pub fn at<const M: usize>(&self, y: State, tangents: [State; M]) -> Trajectory<'f, M> {
        let motion = match &self.motion {
            Engines::Pair(motion) => {
                Engines::Pair(motion.at(first_four(&y), tangents.map(|u| first_four(&u))))
            }
            Engines::Machine(motion) => {
                Engines::Machine(Box::new(motion.at(&y, of_machine(motion.system(), tangents))))
            }
        };
        Trajectory { flow: self.flow, motion }
    }

    /// Starts a trajectory at phase 0 of another flow of the same machine, in the present state and modes. Returns nothing for a pair.
    pub(crate) fn in_flow<'g>(&self, flow: &'g Flow) -> Option<Trajectory<'g>>
    where
        'f: 'g,
    {
        let (Engines::Machine(motion), Engine::Machine(system)) = (&self.motion, flow.engine()) else {
            return None;
        };
        Some(Trajectory { flow, motion: Engines::Machine(Box::new(motion.in_system(system))) })
    }

    /// Returns the time derivative of the state of a machine, and 0 for a pair.
    pub(crate) fn velocity(&self) -> State {
        match &self.motion {
            Engines::Pair(_) => REST,
            Engines::Machine(motion) => motion.velocity(),
        }
    }

    /// Starts a trajectory at phase 0 from the mirror image of the present state, in the mirrored domain. Returns nothing for a machine: the
    /// mirror image of its modes is not known.
    pub(crate) fn mirrored<const M: usize>(&self, tangents: [State; M]) -> Option<Trajectory<'f, M>> {
        match &self.motion {
            Engines::Pair(motion) => {
                let motion = Engines::Pair(motion.mirrored(tangents.map(|u| first_four(&u))));
                Some(Trajectory { flow: self.flow, motion })
            }
            Engines::Machine(_) => None,
        }
    }

    /// Multiplies each coordinate of the engine by `1 + share()`, to simulate the rounding of a less precise engine. The coordinates are
    /// the gaps and the displacements that complete them. While a pair meshes, its first coordinate is the distance from the wall. The gap
    /// of a pair that is just leaving a wall does not change.
    pub fn perturb(&mut self, share: impl FnMut() -> f64) {
        each!(mut self, motion => motion.perturb(share));
    }

    /// Returns the flow.
    pub fn flow(&self) -> &'f Flow {
        self.flow
    }

    /// Returns the present state.
    pub fn state(&self) -> State {
        match &self.motion {
            Engines::Pair(motion) => state(&motion.state()),
            Engines::Machine(motion) => motion.state(),
        }
    }

    /// Returns the tangent vectors in the coordinates of [`State`], divided by the exponential of
    /// [`log_scale`](Self::log_scale).
    pub fn tangents(&self) -> [State; N] {
        match &self.motion {
            Engines::Pair(motion) => motion.tangents().map(|u| state(&u)),
            Engines::Machine(motion) => {
                let tangents = motion.tangents();
                // Four vectors mean all unit vectors. One coordinate has only two.
                std::array::from_fn(|i| tangents.get(i).copied().unwrap_or(REST))
            }
        }
    }

    /// Returns the matrix whose columns are the images of the unit vectors of all entries of a state, [`Flow::state_len`], divided by the exponential of
    /// [`log_scale`](Self::log_scale). The trajectory must carry four tangent vectors.
    pub fn unit_images(&self) -> DMatrix<f64> {
        let size = self.flow.state_len();
        match &self.motion {
            Engines::Pair(motion) => {
                let columns = motion.tangents();
                DMatrix::from_fn(size, size, |i, j| columns[j][i])
            }
            Engines::Machine(motion) => {
                let columns = motion.tangents();
                DMatrix::from_fn(size, size, |i, j| columns.get(j).map_or(0.0, |column| column[i]))
            }
        }
    }

    /// Returns the logarithm of the common factor of all tangent vectors, which keeps them in the range of f64.
    pub fn log_scale(&self) -> f64 {
        each!(self, motion => motion.log_scale())
    }

    /// Replaces the tangent vectors.
    pub fn set_tangents(&mut self, tangents: [State; N]) {
        match &mut self.motion {
            Engines::Pair(motion) => motion.set_tangents(tangents.map(|u| first_four(&u))),
            Engines::Machine(motion) => motion.set_tangents(of_machine(motion.system(), tangents)),
        }
    }

    /// Returns the side of the first gap's lasting contact, if there is one.
    pub fn meshing(&self) -> Option<Side> {
        match &self.motion {
            Engines::Pair(motion) => motion.meshing(),
            Engines::Machine(motion) => motion.contact(0),
        }
    }

    /// Whether no gap is in lasting contact.
    pub(crate) fn is_free(&self) -> bool {
        match &self.motion {
            Engines::Pair(motion) => motion.meshing().is_none(),
            Engines::Machine(motion) => motion.is_free(),
        }
    }

    /// Whether a gap in free motion passed a wall less than `time` ago, or will reach one within `time`.
    pub(crate) fn passes_wall(&self, time: f64) -> bool {
        each!(self, motion => motion.passes_wall(time))
    }

    /// Begins to measure flights at phase 0, at the present state.
    pub(crate) fn flights(&self) -> Flights<'f> {
        match &self.motion {
            Engines::Pair(motion) => Flights(Some(PairMeter::new(motion))),
            Engines::Machine(_) => Flights(None),
        }
    }

    /// Returns the number of completed forcing periods.
    pub fn period(&self) -> u64 {
        each!(self, motion => motion.period())
    }

    /// Returns the time since the last phase 0.
    pub fn time_in_period(&self) -> f64 {
        each!(self, motion => motion.time_in_period())
    }

    /// Returns the total time during which at least one contact lasted.
    pub fn meshing_time(&self) -> f64 {
        match &self.motion {
            Engines::Pair(motion) => motion.meshing_time(),
            Engines::Machine(motion) => motion.contact_time(),
        }
    }

    /// Returns the total time during which an element with dry friction stuck.
    pub fn sticking_time(&self) -> f64 {
        match &self.motion {
            Engines::Pair(_) => 0.0,
            Engines::Machine(motion) => motion.sticking_time(),
        }
    }

    /// Returns the present state without the shifts along rigid-body modes at earlier phases 0: its displacements are continuous.
    pub fn unshifted_state(&self) -> State {
        self.flow.rigid_modes.shifted(self.state(), &self.travelled())
    }

    /// Forgets the shifts so far, so that displacements continue from the present state.
    pub(crate) fn forget_shifts(&mut self) {
        each!(mut self, motion => motion.forget_shifts());
    }

    /// Returns the sums of all shifts along rigid-body modes since the start.
    pub(crate) fn travelled(&self) -> [f64; MOST_COORDINATES] {
        match &self.motion {
            Engines::Pair(motion) => {
                std::array::from_fn(|nth| if nth == 0 { motion.travelled() } else { 0.0 })
            }
            Engines::Machine(motion) => motion.travelled(),
        }
    }

    /// Returns the number of elements with dry friction that have not slid since the start.
    pub(crate) fn never_slid(&self) -> usize {
        match &self.motion {
            Engines::Pair(_) => 0,
            Engines::Machine(motion) => motion.never_slid(),
        }
    }

    /// Returns what makes the motion since the start doubtful.
    pub(crate) fn remark(&self) -> Option<Remark> {
        match &self.motion {
            Engines::Pair(_) => None,
            Engines::Machine(motion) => motion.remark(),
        }
    }

    /// Whether any event was so near to grazing that the linearisation is not reliable.
    pub fn near_grazing(&self) -> bool {
        each!(self, motion => motion.near_grazing())
    }

    /// Clears the flag of earlier near-grazing events.
    pub fn clear_near_grazing(&mut self) {
        each!(mut self, motion => motion.clear_near_grazing());
    }

    /// Returns the counters of work.
    pub fn work(&self) -> Work {
        each!(self, motion => motion.work())
    }

    /// Sets the work that the trajectory may take from here on.
    pub fn allowing(mut self, allowance: Allowance<'f>) -> Self {
        each!(mut self, motion => motion.allow(allowance));
        self
    }

    pub(crate) fn allowance(&self) -> Allowance<'f> {
        each!(self, motion => motion.allowance())
    }

    /// Whether another trajectory has the same mode and comes from the same wall.
    pub(crate) fn has_mode_and_origin_of(&self, other: &Trajectory<'_, N>) -> bool {
        match (&self.motion, &other.motion) {
            (Engines::Pair(motion), Engines::Pair(other)) => motion.has_mode_and_origin_of(other),
            (Engines::Machine(motion), Engines::Machine(other)) => motion.is_where(other),
            _ => false,
        }
    }

    /// Whether another trajectory is in the same domain. Contact onset and sustained contact count as different,
    /// unless the gap lies on the wall.
    pub(crate) fn is_in_domain_of(&self, other: &Trajectory<'_, N>) -> bool {
        match (&self.motion, &other.motion) {
            (Engines::Pair(motion), Engines::Pair(other)) => motion.is_in_domain_of(other),
            (Engines::Machine(motion), Engines::Machine(other)) => motion.is_in_modes_of(other),
            _ => false,
        }
    }

    /// Integrates to the next phase 0.
    ///
    /// # Errors
    /// A [`Stop`] if the trajectory cannot be continued.
    #[inline]
    pub fn advance_period(&mut self, observer: &mut impl Observer) -> Result<(), Stop> {
        #[cfg(target_arch = "wasm32")]
        let observer = &mut (observer as &mut dyn Observer);
        each!(mut self, motion => motion.advance_period(observer))
    }

    /// Integrates to the time `until`, which is measured from the last phase 0 and at most the forcing period.
    ///
    /// # Errors
    /// A [`Stop`] if the trajectory cannot be continued.
    #[inline]
    pub fn advance_to(&mut self, until: f64, observer: &mut impl Observer) -> Result<(), Stop> {
        #[cfg(target_arch = "wasm32")]
        let observer = &mut (observer as &mut dyn Observer);
        each!(mut self, motion => motion.advance_to(until, observer))
    }
}

/// Measures the flights of a pair from its events. A machine adds its flights to an observer's [`Sums`] by itself.
#[derive(Clone, Debug)]
pub(crate) struct Flights<'f>(Option<PairMeter<'f>>);

impl Flights<'_> {
    /// Receives an event of the trajectory.
    pub(crate) fn event(&mut self, event: &GapEvent, sums: &mut Sums) {
        match &mut self.0 {
            Some(pair) => pair.event(event, sums),
            None if event.has_impact => sums.approach(event.side, event.side.sign() * event.before[1]),
            None => {}
        }
    }

    /// Continues the present flight to phase 0 of `period`.
    pub(crate) fn complete_periods(&mut self, period: u64, sums: &mut Sums) {
        if let Some(pair) = &mut self.0 {
            pair.complete_periods(period, sums);
        }
    }
}

/// Returns the tangents of a machine. Four vectors mean the unit vectors of all coordinates.
fn of_machine<const M: usize>(system: &System, tangents: [State; M]) -> Vec<State> {
    if M == 4 { MachineMotion::unit_tangents(system) } else { tangents.to_vec() }
}
