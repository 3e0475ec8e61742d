//! The description that every model hands on.

/// One linear domain: `M x'' + damping x' + stiffness x = force cos(omega t) + load`.
///
/// Damping and stiffness are symmetric and positive semidefinite: the energy bounds of
/// the event certificate rest on that (see [`crate::flow`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Domain {
    /// Damping matrix.
    pub damping: [[f64; 2]; 2],
    /// Stiffness matrix.
    pub stiffness: [[f64; 2]; 2],
    /// Constant load.
    pub load: [f64; 2],
}

/// A forced piecewise-linear oscillator of up to two degrees of freedom between two walls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillator {
    /// Masses of the two degrees of freedom, > 0.
    pub masses: [f64; 2],
    /// Row `g` of the gap `z = g . x`; its first entry is not zero.
    pub gap: [f64; 2],
    /// Positions `z` of the right (upper) and left (lower) wall.
    pub walls: [f64; 2],
    /// Excitation frequency, > 0.
    pub omega: f64,
    /// Amplitude of the harmonic force `force cos(omega t)`, the same in every domain.
    pub force: [f64; 2],
    /// Motion between the walls.
    pub free: Domain,
    /// Motion in lasting contact with the right and with the left wall.
    pub meshing: [Domain; 2],
}

impl Oscillator {
    /// The forcing period `2 pi / omega`.
    pub fn period(&self) -> f64 {
        std::f64::consts::TAU / self.omega
    }

    /// Whether the walls and what lies behind them are mirror images of each other, so that
    /// `(y, t) -> (-y, t + T/2)` takes solutions to solutions.
    pub fn mirror_symmetric(&self) -> bool {
        let mirrored = |domain: &Domain| Domain { load: domain.load.map(|value| -value), ..*domain };
        self.walls[0] == -self.walls[1]
            && self.free == mirrored(&self.free)
            && self.meshing[0] == mirrored(&self.meshing[1])
    }
}

/// What happens at a wall: all that a cell needs beside its flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// Coefficient of restitution `e`, 0 to 1: `w+ = -e w-`.
    pub restitution: f64,
    /// Leaving speed `e |w-|` at or below which a pressed contact becomes meshing.
    pub mesh_speed: f64,
}
