//! Constants of a lane, derived in f64 from the description of the model.

use super::features::Features;
use super::machine::MachineConstants;
use super::pair::PairConstants;
use rattlemap_dynamics::model::{Form, State};

/// Constants of one oscillator.
#[derive(Clone, Debug)]
pub struct Constants {
    /// Free steps per forcing period.
    pub steps: u32,
    /// Whether the mirror image of a motion obeys the same equations. For a pair, the caller also checks that both walls have the same law.
    pub mirror_symmetric: bool,
    /// Number of displacements.
    pub degrees: u32,
    /// Forcing period.
    pub(super) period: f64,
    pub(super) features: Features,
    pub(super) engine: Engine,
}

/// Constants for one of the two engines of lanes.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "constants of many pairs lie in one vector")]
pub(super) enum Engine {
    Pair(PairConstants),
    Machine(Box<MachineConstants>),
}

impl Constants {
    /// Returns the free steps per forcing period: `requested`, or as many as the motion needs. Returns `None` if
    /// there are too many for a lane.
    pub fn steps(oscillator: impl Into<Form>, requested: Option<u32>) -> Option<u32> {
        steps_of(&oscillator.into(), requested)
    }

    /// Derives the constants for the number of steps that [`Constants::steps`] returns.
    pub fn new(oscillator: impl Into<Form>, requested: Option<u32>) -> Option<Constants> {
        let form = oscillator.into();
        let (steps, features) = (steps_of(&form, requested)?, Features::of(&form));
        Some(match &form {
            Form::Pair(pair) => {
                let constants = PairConstants::new(pair, steps)?;
                Constants {
                    steps,
                    mirror_symmetric: pair.mirror_symmetric(),
                    degrees: pair.degrees as u32,
                    period: constants.flow.h * f64::from(steps),
                    features,
                    engine: Engine::Pair(constants),
                }
            }
            Form::Machine(machine) => Constants {
                steps,
                mirror_symmetric: machine.mirror_symmetric(),
                degrees: machine.degrees() as u32,
                period: machine.period(),
                features,
                engine: Engine::Machine(Box::new(MachineConstants::new(machine, steps))),
            },
        })
    }

    /// Returns the constants of a pair; nothing for a machine.
    pub fn pair(&self) -> Option<&PairConstants> {
        match &self.engine {
            Engine::Pair(pair) => Some(pair),
            Engine::Machine(_) => None,
        }
    }

    /// Returns the constants of a machine; nothing for a pair.
    pub(super) fn machine(&self) -> Option<&MachineConstants> {
        match &self.engine {
            Engine::Pair(_) => None,
            Engine::Machine(machine) => Some(machine),
        }
    }

    /// Sets the sizes of the machines for which a shader is compiled.
    pub fn widen(&mut self, features: Features) {
        if self.features.machine.is_some() && features.machine.is_some() {
            self.features.machine = features.machine;
        }
    }

    /// Returns the number of gaps.
    pub(super) fn gaps(&self) -> usize {
        self.features.machine.map_or(1, |shape| shape.gaps as usize)
    }

    /// Returns the numbers of a lane's start: its state, and its modes if it is a machine.
    pub(super) fn start_numbers(&self, y: State) -> Vec<f64> {
        match &self.engine {
            Engine::Pair(pair) => pair.start(y).to_vec(),
            Engine::Machine(machine) => machine.start(y, self.features.dim()),
        }
    }

    /// Converts a lane's state to a state of the model.
    pub(super) fn strobe(&self, q: &[f64]) -> State {
        match &self.engine {
            Engine::Pair(pair) => pair.to_state([q[0], q[1], q[2], q[3]]),
            Engine::Machine(machine) => machine.to_state(q),
        }
    }
}

fn steps_of(form: &Form, requested: Option<u32>) -> Option<u32> {
    match form {
        Form::Pair(pair) => PairConstants::steps(pair, requested),
        Form::Machine(machine) => MachineConstants::steps(machine, requested),
    }
}
