//! Newton's method on the strobe map, and the pitchfork where a symmetric orbit loses its
//! stability.

use nalgebra::{Matrix4, Vector4};

use super::{Cycle, Image, StrobeMap, multipliers};
use crate::flow::Flow;
use crate::model::{GearPair, State};
use crate::reference::Trajectory;

const NEWTON_CAP: u32 = 40;

/// Lengths of a Newton step that are tried, each half the last one, until one reduces the residual.
const DAMPING_CAP: u32 = 12;

/// And those allowed on the way to a fixed point that is near.
const NEAR_CAP: u32 = 10;
const NEAR_DAMPING_CAP: u32 = 2;

/// Singular values of `P' - I` below this, relative to the largest, are cut off: the
/// direction along which a family of orbits runs near a saddle-node or pitchfork.
const SINGULAR_CUTOFF: f64 = 1e-10;

/// Sweeps of the singular value iteration allowed.
const SVD_CAP: usize = 1000;

/// Residuals below this, relative to the state, are rounding.
const CONVERGED: f64 = 1e-13;

/// And so are these where no step reduces them.
const NEARLY_CONVERGED: f64 = 1e-10;

/// Refines the state of `seed`, a trajectory at phase 0, to a fixed point of `map`; none if
/// Newton does not converge.
///
/// Nothing is said about stability: plain Newton likes unstable orbits as much.
pub fn refine(seed: &Trajectory<'_>, map: StrobeMap) -> Option<Cycle> {
    newton(seed, map, [NEWTON_CAP, DAMPING_CAP], |_| true)
}

/// [`refine`] for a fixed point that is near or none: none, too, as soon as a whole step would lead
/// to a state that is not `within` reach, or where convergence is slow.
pub(crate) fn refine_near(
    seed: &Trajectory<'_>,
    map: StrobeMap,
    within: impl Fn(&State) -> bool,
) -> Option<Cycle> {
    newton(seed, map, [NEAR_CAP, NEAR_DAMPING_CAP], within)
}

fn newton(
    seed: &Trajectory<'_>,
    map: StrobeMap,
    [steps, lengths]: [u32; 2],
    within: impl Fn(&State) -> bool,
) -> Option<Cycle> {
    let mut y = Vector4::from(seed.state());
    let mut image = map.apply(seed, seed.state()).ok()?;
    let mut residual = Vector4::from(image.state) - y;
    for _ in 0..steps {
        let size = size_of(seed, &y);
        if residual.amax() <= CONVERGED * size {
            break;
        }
        let step = newton_step(&image.derivative(), &residual)?;
        if !within(&(y + step).into()) {
            return None;
        }
        // There, halving a step only tries rounding's luck.
        let tries = if residual.amax() <= NEARLY_CONVERGED * size { 1 } else { lengths };
        match damped(seed, map, &y, &residual, &step, tries) {
            Some((next, next_image)) => {
                residual = Vector4::from(next_image.state) - next;
                (y, image) = (next, next_image);
            }
            // No step reduces the residual: rounding has been reached, or a dead end.
            None => break,
        }
    }
    let size = size_of(seed, &y);
    if residual.amax() <= NEARLY_CONVERGED * size { cycle(map, y.into(), &image) } else { None }
}

/// What residuals are measured by: the state, or the walls' distance where it is small.
fn size_of(seed: &Trajectory<'_>, y: &Vector4<f64>) -> f64 {
    let flow = seed.flow();
    y.amax().max(0.5 * (flow.walls[0] - flow.walls[1]) * flow.omega.max(1.0))
}

/// Solves `(P' - I) step = -residual` in the sense of least squares.
fn newton_step(derivative: &Matrix4<f64>, residual: &Vector4<f64>) -> Option<Vector4<f64>> {
    let matrix = derivative - Matrix4::identity();
    if !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    let svd = matrix.try_svd(true, true, f64::EPSILON, SVD_CAP)?;
    let cutoff = SINGULAR_CUTOFF * svd.singular_values.max();
    svd.solve(&-residual, cutoff).ok()
}

fn damped(
    seed: &Trajectory<'_>,
    map: StrobeMap,
    y: &Vector4<f64>,
    residual: &Vector4<f64>,
    step: &Vector4<f64>,
    tries: u32,
) -> Option<(Vector4<f64>, Image)> {
    let mut share = 1.0;
    for _ in 0..tries {
        let next = y + step * share;
        if let Ok(image) = map.apply(seed, next.into())
            && (Vector4::from(image.state) - next).amax() < residual.amax()
        {
            return Some((next, image));
        }
        share *= 0.5;
    }
    None
}

fn cycle(map: StrobeMap, state: State, image: &Image) -> Option<Cycle> {
    let (scaled, log_scale) = map.monodromy(image);
    let scaled_multipliers = multipliers(&scaled)?;
    let [re, im] = scaled_multipliers[0];
    let scale = log_scale.exp();
    Some(Cycle {
        state,
        period: map.cycle_periods(),
        symmetric: matches!(map, StrobeMap::MirroredHalves(_)),
        multipliers: scaled_multipliers.iter().map(|m| m.map(|x| x * scale)).collect(),
        log_radius: re.hypot(im).ln() + log_scale,
        monodromy: scaled * scale,
        near_grazing: image.near_grazing,
    })
}

/// The value of `parameter` in `[lo, hi]` at which the symmetric period-1 orbit of `pair`
/// loses its symmetry: where a multiplier of the half-period map crosses -1, that is
/// `det(Q' + I) = 0`. The orbit is followed from `guess`, its state at `lo`.
///
/// None if the orbit is lost on the way or the determinant does not change sign.
pub fn pitchfork(pair: &GearPair, parameter: &str, lo: f64, hi: f64, guess: State) -> Option<f64> {
    let mut state = guess;
    let mut test = |value: f64| -> Option<f64> {
        let mut pair = *pair;
        pair.set(parameter, value).ok()?;
        let flow = Flow::new(&pair.oscillator().ok()?);
        let map = StrobeMap::MirroredHalves(1);
        let seed = Trajectory::new(&flow, pair.law(), state);
        let cycle = refine(&seed, map)?;
        state = cycle.state;
        let image = map.apply(&seed, state).ok()?;
        Some((image.derivative() + Matrix4::identity()).determinant())
    };
    let (mut a, mut b) = (lo, hi);
    let (mut at_a, mut at_b) = (test(a)?, test(b)?);
    if at_a * at_b > 0.0 {
        return None;
    }
    // Regula falsi with the Illinois rule: a bracket at every step, superlinear.
    for _ in 0..100 {
        if (b - a).abs() <= 1e-12 * b.abs().max(1e-12) {
            break;
        }
        let c = (a * at_b - b * at_a) / (at_b - at_a);
        let at_c = test(c)?;
        if at_c == 0.0 || (c - b).abs() <= 1e-13 {
            return Some(c);
        }
        if at_c * at_b < 0.0 {
            (a, at_a) = (b, at_b);
        } else {
            at_a *= 0.5;
        }
        (b, at_b) = (c, at_c);
    }
    Some(b)
}
