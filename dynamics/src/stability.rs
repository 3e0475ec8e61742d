//! Stability of periodic orbits: monodromy matrix, Floquet multipliers, Newton's method on the strobe map, and
//! Lyapunov exponents.
//!
//! The strobe map `P` maps the state at one phase 0 to the state at the next. Its derivative is the product of flow and saltation matrices,
//! and is integrated as one tangent vector for each entry of a state. For orbits that may be their own mirror image the half-period map
//! `Q(y) = -P_{T/2}(y)` is used instead. At a pitchfork a multiplier of `P` is `+1`. Since `P = Q^2`, this multiplier is `-1` for `Q`, so
//! `Q' - I` stays regular.

mod exponent;
mod matrix;
mod newton;
mod unit_circle;

pub use exponent::{CORRELATION_MARGIN, Exponent, FRESH_TANGENT, LEAST_FOR_ERROR, standard_error};
pub(crate) use matrix::{image_of, norm, times};
pub use newton::refine;
pub(crate) use newton::{LARGEST_MULTIPLIER, Newton, step_and_time};

use matrix::product;
use nalgebra::linalg::Schur;
use nalgebra::{Complex, DMatrix, Matrix4};

use crate::model::{State, state};
use crate::motion::{Stop, Trajectory, Work};

/// The unit vectors of two coordinates. As initial tangent vectors they become the columns of the derivative.
pub const UNIT: [State; 4] =
    [state(&[1.0]), state(&[0.0, 1.0]), state(&[0.0, 0.0, 1.0]), state(&[0.0, 0.0, 0.0, 1.0])];

/// A map on states at phase 0, whose fixed points are cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StrobeMap {
    /// `P^p`: `p` forcing periods.
    Periods(u32),
    /// `Q^p`, `Q(y) = -P_{T/2}(y)`: `p` half periods, `p` odd, each followed by a reflection.
    MirroredHalves(u32),
}

/// The image of a state and the derivative of the map there. The derivative has [`Flow::state_len`](crate::motion::Flow::state_len) rows and columns.
#[derive(Clone, Debug)]
pub struct Image {
    /// The image.
    pub state: State,
    /// The derivative divided by `exp(log_scale)`.
    pub scaled: DMatrix<f64>,
    /// Logarithm of the factor: over a long cycle derivatives leave the range of f64.
    pub log_scale: f64,
    /// Whether an event was so near to grazing that the derivative is not reliable.
    pub near_grazing: bool,
    /// Number of elements with dry friction that never slid.
    pub(crate) never_slid: usize,
    /// [`Flow::rate`](crate::motion::Flow).
    rate: f64,
}

impl Image {
    /// Returns the derivative on states whose velocities are divided by `rate`, so that its norm and pivots do not
    /// depend on the unit of time.
    pub(crate) fn balanced(&self) -> DMatrix<f64> {
        let size = self.scaled.nrows();
        DMatrix::from_fn(size, size, self.balanced_entries())
    }

    /// Returns the entries of [`Image::balanced`].
    fn balanced_entries(&self) -> impl Fn(usize, usize) -> f64 {
        let factor = self.log_scale.exp();
        move |i, j| in_displacements(self.scaled[(i, j)] * factor, self.rate, i, j)
    }

    /// Returns the derivative of the map; entries out of the range of f64 are zero or infinite.
    pub fn derivative(&self) -> DMatrix<f64> {
        &self.scaled * self.log_scale.exp()
    }
}

impl StrobeMap {
    /// Applies the map to a state at phase 0 in the domain of `seed`.
    ///
    /// # Errors
    /// A [`Stop`] if the trajectory cannot be continued.
    pub fn apply(self, seed: &Trajectory<'_>, y: State) -> Result<Image, Stop> {
        self.apply_counting(seed, y, &mut Work::default())
    }

    /// Applies the map and adds the work to `work`, also if it fails.
    pub(crate) fn apply_counting(
        self,
        seed: &Trajectory<'_>,
        y: State,
        work: &mut Work,
    ) -> Result<Image, Stop> {
        let rate = seed.flow().rate;
        let never_slid = usize::MAX;
        match self {
            StrobeMap::Periods(p) => {
                let mut trajectory = seed.at(y, UNIT);
                let ended = (0..p).try_for_each(|_| trajectory.advance_period(&mut ()));
                *work += trajectory.work();
                ended?;
                Ok(image_at(&trajectory, 1.0))
            }
            StrobeMap::MirroredHalves(p) => {
                let size = seed.flow().state_len();
                let scaled = DMatrix::identity(size, size);
                let mut image =
                    Image { state: y, scaled, log_scale: 0.0, near_grazing: false, never_slid, rate };
                // The points of the cycle may lie in different domains.
                let mut half = seed.at(y, UNIT);
                for turn in 0..p {
                    if turn > 0 {
                        half = half.mirrored(UNIT).expect("the flow has half-period maps");
                    }
                    let ended = half.advance_to(0.5 * seed.flow().period, &mut ());
                    *work += half.work();
                    ended?;
                    let step = image_at(&half, -1.0);
                    let (scaled, log_scale) =
                        unit_size(product(&step.scaled, &image.scaled), step.log_scale + image.log_scale);
                    image = Image {
                        state: step.state,
                        scaled,
                        log_scale,
                        near_grazing: image.near_grazing || step.near_grazing,
                        never_slid: image.never_slid.min(step.never_slid),
                        rate,
                    };
                }
                Ok(image)
            }
        }
    }

    /// Returns the monodromy matrix of the whole cycle and the logarithm of its factor, from the derivative of this
    /// map.
    fn monodromy(self, image: &Image) -> (DMatrix<f64>, f64) {
        match self {
            StrobeMap::Periods(_) => (image.scaled.clone(), image.log_scale),
            StrobeMap::MirroredHalves(_) => {
                unit_size(product(&image.scaled, &image.scaled), 2.0 * image.log_scale)
            }
        }
    }

    /// Returns the number of half forcing periods in one application.
    fn half_periods(self) -> u32 {
        match self {
            StrobeMap::Periods(p) => 2 * p,
            StrobeMap::MirroredHalves(p) => p,
        }
    }

    /// Whether this map is a power of `other`, so that every fixed point of `other` is one of this map.
    pub(crate) fn iterates(self, other: StrobeMap) -> bool {
        self.half_periods().is_multiple_of(other.half_periods())
    }

    /// Returns the number of forcing periods in a cycle.
    fn cycle_periods(self) -> u32 {
        match self {
            StrobeMap::Periods(p) | StrobeMap::MirroredHalves(p) => p,
        }
    }
}

/// Divides a matrix by its largest entry, so that products and eigenvalues stay in the range of f64.
fn unit_size(matrix: DMatrix<f64>, log_scale: f64) -> (DMatrix<f64>, f64) {
    let size = matrix.amax();
    if size > 0.0 && size.is_finite() { (matrix / size, log_scale + size.ln()) } else { (matrix, log_scale) }
}

/// Converts an entry of a matrix for states whose velocities are divided by `rate`, a power of two.
fn in_displacements(entry: f64, rate: f64, i: usize, j: usize) -> f64 {
    let unit = |i: usize| if i % 2 == 1 { rate } else { 1.0 };
    entry * (unit(j) / unit(i))
}

fn image_at(trajectory: &Trajectory<'_, 4>, sign: f64) -> Image {
    let (scaled, log_scale) = unit_size(trajectory.unit_images() * sign, trajectory.log_scale());
    Image {
        state: trajectory.state().map(|value| sign * value),
        scaled,
        log_scale,
        near_grazing: trajectory.near_grazing(),
        never_slid: trajectory.never_slid(),
        rate: trajectory.flow().rate,
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
    /// The monodromy matrix, the derivative of the strobe map over one cycle. It has [`Flow::state_len`](crate::motion::Flow::state_len)
    /// rows; with one degree of freedom, the rows and columns of the second displacement are 0.
    pub monodromy: DMatrix<f64>,
    /// Floquet multipliers `[re, im]`, largest modulus first; two for each degree of freedom. Where dry friction sticks for ever, the
    /// multiplier 1 along its row is left out.
    pub multipliers: Vec<[f64; 2]>,
    /// `ln |mu1|` of the largest multiplier, also if `mu1` is below the range of f64; minus infinity for a
    /// superstable orbit.
    pub log_radius: f64,
    /// Whether an event is so near to grazing that the multipliers are not reliable.
    pub near_grazing: bool,
    /// Image of the state under the map whose fixed point the search has found.
    pub(crate) image: State,
    /// Whether the error of the state does not tell the period from a divisor of it, as at a flip.
    pub(crate) may_be_shorter: bool,
}

impl Cycle {
    /// Returns the error of the state as a multiple of the error `residual` of its image and of the rounding errors over a cycle.
    pub(crate) fn error(&self, residual: f64) -> f64 {
        let from_one = |[re, im]: &[f64; 2]| (re - 1.0).hypot(*im);
        let least = self.multipliers.iter().map(from_one).fold(f64::INFINITY, f64::min);
        (residual + 4.0 * f64::EPSILON * norm(&self.monodromy).max(1.0)) / least
    }

    /// Returns the modulus of the largest multiplier. Below 1 the orbit is stable.
    pub fn spectral_radius(&self) -> f64 {
        self.log_radius.exp()
    }

    /// Whether the orbit is stable beyond rounding. Rounding may put a multiplier of 1 on either side of 1; a gear
    /// pair without supports has one.
    pub fn is_stable(&self) -> bool {
        self.log_radius < -NEUTRAL * f64::from(self.period)
    }

    /// Whether the largest multiplier has modulus 1 within its error.
    pub fn is_neutral(&self) -> bool {
        self.log_radius.abs() <= NEUTRAL * f64::from(self.period)
    }

    /// Returns the largest Lyapunov exponent, `ln |mu1| / (p T)`.
    pub fn exponent(&self, forcing_period: f64) -> f64 {
        self.log_radius / (f64::from(self.period) * forcing_period)
    }
}

fn modulus([re, im]: [f64; 2]) -> f64 {
    re.hypot(im)
}

/// Numerical error of `ln |mu|` per forcing period for a multiplier `mu` of 1: the square root of rounding, for a
/// double eigenvalue.
const NEUTRAL: f64 = 1e-7;

/// Largest number of sweeps of the QR iteration.
const EIGEN_CAP: usize = 1000;

/// Returns the eigenvalues `[re, im]`, largest modulus first; of a conjugate pair, positive imaginary part first.
/// Returns none if the matrix is not finite or the iteration does not converge.
pub fn multipliers(monodromy: &DMatrix<f64>) -> Option<Vec<[f64; 2]>> {
    if !monodromy.iter().all(|x| x.is_finite()) {
        return None;
    }
    // With four rows, the eigenvalues need no heap memory.
    let eigenvalues = |m: &Complex<f64>| [m.re, m.im];
    let mut list: Vec<[f64; 2]> = match monodromy.nrows() {
        4 => {
            let matrix = Matrix4::from_column_slice(monodromy.as_slice());
            let schur = Schur::try_new(matrix, f64::EPSILON, EIGEN_CAP)?;
            schur.complex_eigenvalues().iter().map(eigenvalues).collect()
        }
        _ => {
            let schur = Schur::try_new(monodromy.clone(), f64::EPSILON, EIGEN_CAP)?;
            schur.complex_eigenvalues().iter().map(eigenvalues).collect()
        }
    };
    list.sort_by(|a, b| modulus(*b).total_cmp(&modulus(*a)).then(b[1].total_cmp(&a[1])));
    Some(list)
}
