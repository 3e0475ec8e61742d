//! Machines of different shapes, to compare their costs.

use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::model::{
    Contact, Drive, Forces, GapRow, Oscillator, Restitution, Side, Spring, Timing, Wall,
};

fn counted(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// Sizes of a machine: a chain of masses with clearances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chain {
    /// Masses.
    pub coordinates: usize,
    /// Gaps with two walls: between the first mass and the second one, the second and the third, and so on.
    pub gaps: usize,
    /// Harmonics of the force.
    pub harmonics: usize,
    /// Stages of equal length; 1 without changes.
    pub stages: usize,
}

const fn chain(coordinates: usize, gaps: usize, harmonics: usize, stages: usize) -> Chain {
    Chain { coordinates, gaps, harmonics, stages }
}

/// The chains that are compared. The first one could also be an oscillator of the engine for two coordinates.
pub const CHAINS: [Chain; 12] = [
    chain(2, 1, 1, 1),
    chain(2, 2, 1, 1),
    chain(2, 1, 4, 1),
    chain(2, 1, 1, 2),
    chain(4, 1, 1, 1),
    chain(4, 2, 1, 1),
    chain(4, 3, 1, 1),
    chain(4, 2, 4, 2),
    chain(8, 1, 1, 1),
    chain(8, 2, 1, 1),
    chain(8, 3, 1, 1),
    chain(8, 3, 4, 2),
];

impl Chain {
    /// Returns its name, such as `4 coordinates, 2 gaps, 1 harmonic, 1 stage`.
    pub fn name(self) -> String {
        [
            (self.coordinates, "coordinate"),
            (self.gaps, "gap"),
            (self.harmonics, "harmonic"),
            (self.stages, "stage"),
        ]
        .map(|(n, what)| counted(n, what))
        .join(", ")
    }

    /// Returns machines over restitution in `[0.3, 0.9]` and frequency in `[0.8, 1.6]`, near the resonances.
    pub fn cells(self, side: usize) -> Vec<Oscillator> {
        let at = |i: usize, low: f64, high: f64| low + (high - low) * i as f64 / (side - 1) as f64;
        (0..side * side).map(|i| self.machine(at(i % side, 0.3, 0.9), at(i / side, 0.8, 1.6))).collect()
    }

    /// Returns equal masses on springs to the ground and to their neighbours, with a force on the first mass. Units are those in
    /// which a mass, its spring to the ground and the force are 1. The last gap of as many gaps as masses is that of the last mass
    /// and the ground.
    pub fn machine(self, restitution: f64, omega: f64) -> Oscillator {
        let n = self.coordinates;
        let neighbours = |i: usize| f64::from(u8::from(i > 0)) + f64::from(u8::from(i + 1 < n));
        // A spring of this stiffness between neighbours, and one to the ground.
        let chained = |coupling: f64, ground: f64| {
            DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
                0 => ground + coupling * neighbours(i),
                1 => -coupling,
                _ => 0.0,
            })
        };
        // The second stage is a little stiffer.
        let forces = |stage: usize| Forces {
            damping: chained(0.02, 0.02),
            stiffness: chained(0.5 + 0.05 * stage as f64, 1.0),
            load: DVector::zeros(n),
        };
        let on_first = |force: f64| DVector::from_fn(n, |i, _| if i == 0 { force } else { 0.0 });
        let drive = |order: usize| Drive {
            order: order as u32,
            cos: on_first((order as f64).powi(-3)),
            sin: DVector::zeros(n),
        };
        let wall = |side: Side| Wall {
            at: side.sign() * 0.2,
            contact: Contact::Impact,
            restitution: Restitution::Constant(restitution),
            mesh_speed: 0.01,
            springs: vec![Spring { stiffness: 100.0, damping: 1.0, preload: None }; self.stages],
        };
        let gap = |i: usize| GapRow {
            row: DVector::from_fn(n, |j, _| f64::from(u8::from(j == i)) - f64::from(u8::from(j == i + 1))),
            walls: Side::BOTH.map(|side| vec![wall(side)]),
        };
        let change = |stage: usize| (stage as f64 / self.stages as f64, stage);
        Oscillator {
            omega,
            mass: DMatrix::identity(n, n),
            stages: (0..self.stages).map(forces).collect(),
            schedule: if self.stages > 1 { (0..self.stages).map(change).collect() } else { Vec::new() },
            drives: (1..=self.harmonics).map(drive).collect(),
            gaps: (0..self.gaps).map(gap).collect(),
            friction: Vec::new(),
            springs: Vec::new(),
            signals: Vec::new(),
            timing: Timing::Forced,
        }
    }
}
