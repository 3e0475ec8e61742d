//! Oscillators of different shapes for the same motion, to compare their costs.

use rattlemap_dynamics::model::{Harmonic, Oscillator, Stage};

/// Number of higher harmonics and of stages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Harmonics beside the first.
    pub harmonics: usize,
    /// Stages; 1 without changes.
    pub stages: usize,
}

/// The shapes that are compared; the first one is plain.
pub const SHAPES: [Shape; 5] = [
    Shape { harmonics: 0, stages: 1 },
    Shape { harmonics: 1, stages: 1 },
    Shape { harmonics: 4, stages: 1 },
    Shape { harmonics: 0, stages: 2 },
    Shape { harmonics: 4, stages: 2 },
];

impl Shape {
    /// Adds tiny harmonics and equal stages to an oscillator, so that its motion stays nearly the same.
    pub fn of(self, plain: &Oscillator) -> Oscillator {
        let tiny = plain.force.map(|force| 1e-9 * force);
        let harmonic = |n: usize| Harmonic { order: n as u32 + 2, cos: tiny, sin: tiny };
        let further = self.stages - 1;
        let change = |stage: usize| (stage as f64 / self.stages as f64, stage);
        Oscillator {
            harmonics: (0..self.harmonics).map(harmonic).collect(),
            stages: vec![Stage { free: plain.free, meshing: plain.meshing }; further],
            schedule: if further > 0 { (0..self.stages).map(change).collect() } else { Vec::new() },
            ..plain.clone()
        }
    }
}
