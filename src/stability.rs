//! Stability of periodic orbits: monodromy, Floquet multipliers, Newton on the strobe map,
//! and Lyapunov exponents.
//!
//! The strobe map `P` takes the state at one phase 0 to the next. Its derivative is the
//! product of flow and saltation matrices, carried along as four tangent vectors. For
//! orbits that may be their own mirror image the half-period map `Q(y) = -P_{T/2}(y)` is
//! used instead: `P = Q^2`, so at a pitchfork, where a multiplier of `P` is `+1`, that of
//! `Q` is `-1` and `Q' - I` stays regular.

mod exponent;
mod newton;

pub use exponent::Exponent;
pub use newton::{pitchfork, refine};

use nalgebra::{Matrix4, Vector4};

use crate::model::State;
use crate::reference::{Stop, Trajectory};

/// The unit vectors: tangents that become the columns of a derivative.
const UNIT: [State; 4] =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

/// Which map an orbit is a fixed point of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StrobeMap {
    /// `P^p`: `p` forcing periods.
    Periods(u32),
    /// `Q^p`, `Q(y) = -P_{T/2}(y)`: `p` half periods, `p` odd, each followed by the mirror.
    MirroredHalves(u32),
}

/// Image of a state and the derivative of the map there.
#[derive(Clone, Copy, Debug)]
pub struct Image {
    /// The image.
    pub state: State,
    /// The derivative.
    pub derivative: Matrix4<f64>,
    /// Whether an event on the way was too near to grazing for the derivative to mean much.
    pub near_grazing: bool,
}

impl StrobeMap {
    /// Applies the map to a state at phase 0 in the domain that `seed` is in.
    ///
    /// # Errors
    /// A [`Stop`] if the trajectory cannot be continued.
    pub fn apply(self, seed: &Trajectory<'_>, y: State) -> Result<Image, Stop> {
        let mut image = Image { state: y, derivative: Matrix4::identity(), near_grazing: false };
        match self {
            StrobeMap::Periods(p) => {
                let mut trajectory = seed.at(y, UNIT);
                for _ in 0..p {
                    trajectory.advance_period(&mut ())?;
                }
                image = read(&trajectory, 1.0);
            }
            StrobeMap::MirroredHalves(p) => {
                for _ in 0..p {
                    let mut half = seed.at(image.state, UNIT);
                    half.advance_to(0.5 * seed.flow().period, &mut ())?;
                    let step = read(&half, -1.0);
                    image = Image {
                        state: step.state,
                        derivative: step.derivative * image.derivative,
                        near_grazing: image.near_grazing || step.near_grazing,
                    };
                }
            }
        }
        Ok(image)
    }

    /// The monodromy matrix over the whole cycle, from the derivative of this map.
    fn monodromy(self, derivative: &Matrix4<f64>) -> Matrix4<f64> {
        match self {
            StrobeMap::Periods(_) => *derivative,
            StrobeMap::MirroredHalves(_) => derivative * derivative,
        }
    }

    /// Forcing periods in a cycle.
    fn cycle_periods(self) -> u32 {
        match self {
            StrobeMap::Periods(p) | StrobeMap::MirroredHalves(p) => p,
        }
    }
}

fn read(trajectory: &Trajectory<'_, 4>, sign: f64) -> Image {
    let columns = trajectory.tangents().map(|u| sign * Vector4::from(u));
    Image {
        state: trajectory.state().map(|value| sign * value),
        derivative: Matrix4::from_columns(&columns),
        near_grazing: trajectory.near_grazing(),
    }
}

/// A periodic orbit.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// State at phase 0.
    pub state: State,
    /// Forcing periods per cycle.
    pub period: u32,
    /// Whether the orbit is its own mirror image.
    pub symmetric: bool,
    /// The monodromy matrix: derivative of the strobe map over one cycle.
    pub monodromy: Matrix4<f64>,
    /// Floquet multipliers `[re, im]`, largest modulus first.
    pub multipliers: Vec<[f64; 2]>,
    /// Whether an event on it is too near to grazing for these to mean much.
    pub near_grazing: bool,
}

impl Cycle {
    /// Modulus of the largest multiplier: below 1 the orbit attracts.
    pub fn spectral_radius(&self) -> f64 {
        self.multipliers.first().map_or(0.0, |m| modulus(*m))
    }

    /// `ln |mu1| / (p T)`, the largest Lyapunov exponent.
    pub fn exponent(&self, forcing_period: f64) -> f64 {
        self.spectral_radius().ln() / (f64::from(self.period) * forcing_period)
    }
}

fn modulus([re, im]: [f64; 2]) -> f64 {
    re.hypot(im)
}

/// Eigenvalues `[re, im]`, largest modulus first, a conjugate pair with positive imaginary
/// part first.
pub fn multipliers(monodromy: &Matrix4<f64>) -> Vec<[f64; 2]> {
    let mut list: Vec<[f64; 2]> = monodromy.complex_eigenvalues().iter().map(|m| [m.re, m.im]).collect();
    list.sort_by(|a, b| modulus(*b).total_cmp(&modulus(*a)).then(b[1].total_cmp(&a[1])));
    list
}
