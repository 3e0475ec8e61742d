//! Contact types of walls, and the law of restitution of a pair.

/// The contact type of a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contact {
    /// An impact, `w+ = -e w-`. A pressed contact with a low leaving speed lasts, and then moves on a spring and a
    /// damper behind the wall.
    Impact,
    /// An impact on a rigid wall. A pressed contact that has come to rest sticks to the wall until the load pulls it
    /// off.
    Rigid,
    /// No impact: the motion continues behind the wall, and the state is continuous.
    Elastic,
    /// An elastic wall that only pushes: behind the wall, the force of spring, damper and preload acts while it is positive.
    Pushing,
}

impl Contact {
    /// Whether the motion continues behind the wall without an impact.
    pub fn is_elastic(self) -> bool {
        matches!(self, Contact::Elastic | Contact::Pushing)
    }
}

/// The law of restitution of a [`Pair`](super::Pair): the parameters of a cell that its flow does not depend on. A machine has a law for
/// each wall, in its description, and ignores this one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// Coefficient of restitution `e`, 0 to 1, of the right and the left wall: `w+ = -e w-`. Elastic walls ignore it.
    pub restitution: [f64; 2],
    /// Leaving speed `e |w-|`, >= 0, at or below which a pressed contact with the right or left wall lasts.
    pub mesh_speed: [f64; 2],
}

impl Law {
    /// Builds a law that is the same at both walls.
    pub fn both(restitution: f64, mesh_speed: f64) -> Law {
        Law { restitution: [restitution; 2], mesh_speed: [mesh_speed; 2] }
    }

    /// Whether both walls have the same law.
    pub fn is_symmetric(&self) -> bool {
        self.restitution[0] == self.restitution[1] && self.mesh_speed[0] == self.mesh_speed[1]
    }
}
