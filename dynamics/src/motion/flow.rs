//! An oscillator, prepared for its motions.

use crate::machine::System;
use crate::model::{
    Contact, Form, Law, Model, ModelError, NonImpacting, Oscillator, Pair, RigidMode, RigidModes, Signal,
    State, Timing, first_four, state,
};
use crate::pair::PairFlow;
use crate::pair::flow::power_of_two;

/// The data that an engine prepares for an oscillator.
#[derive(Clone, Debug)]
pub enum Engine {
    /// The exact flow of a pair.
    Pair(Box<PairFlow>),
    /// The equations of motion of a machine.
    Machine(Box<System>),
}

/// The flow of one oscillator.
///
/// The flow of a pair does not depend on the contact law, so cells that differ only in restitution or meshing speed share one flow.
#[derive(Clone, Debug)]
pub struct Flow {
    /// Forcing period `2 pi / omega`.
    pub period: f64,
    /// Excitation frequency.
    pub omega: f64,
    /// Scale of length, [`Oscillator::length_scale`].
    pub length: f64,
    /// Displacement beyond which the motion has escaped: infinite if only the force can increase the energy.
    pub escape: f64,
    /// The largest power of two up to `omega`. Velocities divided by it are comparable with displacements, and the
    /// division is exact.
    pub(crate) rate: f64,
    pub(crate) degrees: usize,
    symmetric: bool,
    non_impacting: Option<NonImpacting>,
    /// What `period` is.
    pub timing: Timing,
    /// Rigid-body modes. The motion is shifted back along them at each phase 0.
    pub rigid_modes: RigidModes,
    engine: Engine,
}

impl Flow {
    /// Computes the flow of a model.
    ///
    /// # Errors
    /// [`ModelError`] if a parameter, the oscillator or the contact law is not valid.
    pub fn of(model: &dyn Model) -> Result<Flow, ModelError> {
        model.oscillator().map(|oscillator| Flow::new(&oscillator))
    }

    /// Computes the flow of an oscillator that [`Oscillator::validate`] accepts.
    pub fn new(oscillator: impl Into<Form>) -> Flow {
        match oscillator.into() {
            Form::Pair(pair) => Flow::of_pair(&pair),
            Form::Machine(machine) => Flow::of_machine(&machine),
        }
    }

    fn of_pair(pair: &Pair) -> Flow {
        let flow = Box::new(PairFlow::new(pair));
        Flow {
            period: flow.period,
            omega: pair.omega,
            length: flow.length,
            escape: flow.escape,
            rate: flow.rate,
            degrees: pair.degrees,
            symmetric: pair.mirror_symmetric(),
            non_impacting: NonImpacting::new(pair).or_else(|| NonImpacting::with_one_at_rest(pair)),
            timing: Timing::Forced,
            rigid_modes: pair.rigid_modes(),
            engine: Engine::Pair(flow),
        }
    }

    fn of_machine(machine: &Oscillator) -> Flow {
        let system = Box::new(System::new(machine));
        let (length, _, escape) = system.units();
        Flow {
            period: machine.period(),
            omega: machine.omega,
            length,
            escape,
            rate: power_of_two(machine.omega),
            degrees: machine.degrees(),
            symmetric: machine.mirror_symmetric(),
            non_impacting: NonImpacting::of_machine(machine),
            timing: machine.timing,
            rigid_modes: system.rigid_modes().clone(),
            engine: Engine::Machine(system),
        }
    }

    /// Returns the data of the engine.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// Returns the exact flow of a pair; nothing for a machine.
    pub fn pair(&self) -> Option<&PairFlow> {
        match &self.engine {
            Engine::Pair(flow) => Some(flow),
            Engine::Machine(_) => None,
        }
    }

    /// Returns a lower bound of the number of steps in a forcing period.
    pub(crate) fn least_steps(&self) -> f64 {
        self.period
            / match &self.engine {
                Engine::Pair(flow) => flow.longest_step(),
                Engine::Machine(system) => system.longest_step,
            }
    }

    /// Returns the oscillator in the form that its engine takes.
    pub fn form(&self) -> Form {
        match &self.engine {
            Engine::Pair(flow) => Form::Pair(flow.oscillator.clone()),
            Engine::Machine(system) => Form::Machine(system.machine().clone()),
        }
    }

    /// Returns the flow whose phase 0 is this phase of the forcing, in turns.
    pub fn at_phase(&self, turns: f64) -> Flow {
        let phase = turns * std::f64::consts::TAU;
        match &self.engine {
            Engine::Pair(flow) => Flow::of_pair(&flow.oscillator.at_phase(phase)),
            Engine::Machine(system) => Flow::of_machine(&system.machine().at_phase(phase)),
        }
    }

    /// Returns the flow of a machine without force whose period is the time of a cycle.
    pub(crate) fn on_cycle(&self, time: f64) -> Option<Flow> {
        let Engine::Machine(system) = &self.engine else { return None };
        // The quotient `2 pi / omega` may differ from the time by rounding.
        Some(Flow { period: time, ..Flow::of_machine(&system.machine().clone().on_cycle(Some(time))) })
    }

    /// Returns the memory that the flow occupies, in bytes, without the domains of a machine, which are built on first use.
    pub fn bytes(&self) -> usize {
        size_of::<Flow>()
            + match &self.engine {
                Engine::Pair(flow) => flow.bytes(),
                Engine::Machine(_) => size_of::<System>(),
            }
    }

    /// Whether `(y, t) -> (-y, t + T/2)` maps solutions to solutions: both walls and their laws are alike. A machine ignores `law`.
    pub fn mirror_symmetric(&self, law: &Law) -> bool {
        self.symmetric && (self.pair().is_none() || law.is_symmetric())
    }

    /// Whether [`Trajectory::mirrored`](super::Trajectory) is available: for mirror-symmetric pairs without rigid-body modes. Modes of a machine
    /// cannot be mirrored.
    pub(crate) fn is_half_symmetric(&self, law: &Law) -> bool {
        self.pair().is_some() && self.rigid_modes.modes.is_empty() && self.mirror_symmetric(law)
    }

    /// Returns the stable steady motion that touches no wall, if there is one. Some coordinates may have to be at rest.
    pub fn non_impacting(&self) -> Option<&NonImpacting> {
        self.non_impacting.as_ref()
    }

    pub(crate) fn has_friction(&self) -> bool {
        match &self.engine {
            Engine::Pair(_) => false,
            Engine::Machine(system) => system.has_friction(),
        }
    }

    /// Whether a wall only pushes.
    pub fn has_pushing_walls(&self) -> bool {
        match &self.engine {
            Engine::Pair(_) => false,
            Engine::Machine(system) => {
                let mut walls = system.machine().gaps.iter().flat_map(|gap| gap.walls.iter().flatten());
                walls.any(|wall| wall.contact == Contact::Pushing)
            }
        }
    }

    /// Whether the motion between events is linear: there are no nonlinear springs, and no friction that depends on the sliding rate.
    pub(crate) fn is_linear_between_events(&self) -> bool {
        match &self.engine {
            Engine::Pair(_) => true,
            Engine::Machine(system) => {
                let machine = system.machine();
                machine.springs.is_empty() && machine.friction.iter().all(|one| one.at_speed.is_empty())
            }
        }
    }

    /// Returns the drift of a displacement, a gap or a signal, by its place, if a rigid-body mode shifts it. `rates`: those along the modes.
    pub(crate) fn drift(&self, place: usize, rates: &[f64]) -> Option<f64> {
        let along = |mode: &RigidMode| mode.along(place, self.signals());
        let rates = self.rigid_modes.modes.iter().zip(rates).map(|(mode, rate)| along(mode) * rate);
        self.rigid_modes.modes.iter().any(|mode| along(mode) != 0.0).then(|| rates.sum())
    }

    fn signals(&self) -> &[Signal] {
        match &self.engine {
            Engine::Pair(_) => &[],
            Engine::Machine(system) => &system.machine().signals,
        }
    }

    pub(crate) fn gap_count(&self) -> usize {
        match &self.engine {
            Engine::Pair(_) => 1,
            Engine::Machine(system) => system.gaps(),
        }
    }

    /// Returns the number of entries of a state that can differ from 0: two for each coordinate, and four at least.
    pub fn state_len(&self) -> usize {
        2 * self.degrees.max(2)
    }

    /// Moves the gap of a lane's state to the front of a wall if it lies behind the wall by a rounding error: a gap of a pair behind a
    /// wall means lasting contact.
    pub fn in_front(&self, y: State) -> State {
        match &self.engine {
            Engine::Pair(flow) => state(&flow.in_front(first_four(&y))),
            Engine::Machine(_) => y,
        }
    }
}
