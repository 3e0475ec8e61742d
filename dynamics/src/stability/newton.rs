//! Newton's method on the strobe map, and the pitchfork where a symmetric orbit loses its
//! stability.

use nalgebra::{Matrix4, Vector4};

use super::unit_circle::lies_within_unit_circle;
use super::{Cycle, Image, StrobeMap, balanced, multipliers};
use crate::flow::Flow;
use crate::model::{Model, State};
use crate::reference::{Trajectory, Work};

/// How long Newton's method tries.
#[derive(Clone, Copy, Debug)]
struct Patience {
    steps: u32,
    /// Trials of a step that does not reduce the residual, each half as long as the last.
    trials: u32,
    /// Whether an unstable orbit is left where it is seen to.
    leaves_unstable: bool,
}

/// For an orbit that is wanted wherever it lies.
const PATIENT: Patience = Patience { steps: 40, trials: 12, leaves_unstable: false };

/// For one that the motion is about to reach: of 343 found in 400 cells along a map's borders, 4
/// took more. Failed Newton searches, half of them without an end, were seven tenths of all periods.
const HASTY: Patience = Patience { steps: 12, trials: 3, leaves_unstable: true };

/// Where the map expands by more than this, no orbit close by is stable.
pub(crate) const LARGEST_MULTIPLIER: f64 = 2.0;

/// Singular values of `P' - I` below this, relative to the largest, are cut off: the
/// direction along which a family of orbits runs near a saddle-node or pitchfork.
const SINGULAR_CUTOFF: f64 = 1e-10;

/// Pivots no smaller than this, relative to the largest, leave nothing to cut off.
const WELL_CONDITIONED: f64 = 1e-6;

/// Sweeps of the singular value iteration allowed.
const SVD_CAP: usize = 1000;

/// Residuals below this, relative to the state, are rounding.
const CONVERGED: f64 = 1e-13;

/// Where a step has led below this, an orbit close by has the multipliers seen here, if they exceed 1 by ...
const CLOSE: f64 = 1e-3;

/// ... as much.
const UNSTABLE_EXPANSION: f64 = 1.25;

/// Refines the state of `seed`, a trajectory at phase 0, to a fixed point of `map`; none if
/// Newton does not converge.
///
/// Nothing is said about stability: plain Newton likes unstable orbits as much.
pub fn refine(seed: &Trajectory<'_>, map: StrobeMap) -> Option<Cycle> {
    Newton::default().refine(seed, map)
}

/// Newton's method, and what it has taken so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Newton {
    half_periods: u32,
    work: Work,
}

impl Newton {
    /// Forcing periods integrated with four tangent vectors, rounded up.
    pub(crate) fn periods(&self) -> u32 {
        self.half_periods.div_ceil(2)
    }

    /// Work that they took.
    pub(crate) fn work(&self) -> Work {
        self.work
    }

    /// [`refine`].
    pub(crate) fn refine(&mut self, seed: &Trajectory<'_>, map: StrobeMap) -> Option<Cycle> {
        let image = self.apply(map, seed, seed.state())?;
        self.search(seed, map, image, PATIENT, |_| true)
    }

    /// The same for a motion that will be checked again: gives up where no stable orbit
    /// seems to be near, since the motion will come nearer to one that is. The state of an unstable one
    /// may be off by a thousandth squared.
    pub(crate) fn refine_nearby(
        &mut self,
        seed: &Trajectory<'_>,
        map: StrobeMap,
        is_near: impl Fn(&State) -> bool,
    ) -> Option<Cycle> {
        let image = self.apply(map, seed, seed.state())?;
        if expands(&image)? { None } else { self.search(seed, map, image, HASTY, is_near) }
    }

    /// A map's image, if the trajectory can be continued, and within what all searches leave of its allowance.
    pub(crate) fn apply(&mut self, map: StrobeMap, seed: &Trajectory<'_>, y: State) -> Option<Image> {
        let allowance = seed.allowance();
        allowance.covers(self.work).ok()?;
        self.half_periods += map.half_periods();
        map.apply_counting(&seed.clone().allowing(allowance.after(self.work)), y, &mut self.work).ok()
    }

    /// Newton's method from the state of `seed` with its `image`, as long as its steps aim at states
    /// that are near.
    fn search(
        &mut self,
        seed: &Trajectory<'_>,
        map: StrobeMap,
        mut image: Image,
        patience: Patience,
        is_near: impl Fn(&State) -> bool,
    ) -> Option<Cycle> {
        let mut y = Vector4::from(seed.state());
        let rate = seed.flow().rate;
        let mut residual = Vector4::from(image.state) - y;
        for nth in 0..patience.steps {
            let now = size(&residual, rate) / size_of(seed, &y);
            if now <= CONVERGED {
                break;
            }
            let step = newton_step(&image, &residual)?;
            if patience.leaves_unstable && nth > 0 && now < CLOSE && is_unstable(&image) {
                return cycle(seed, map, (y + step).into(), &image);
            }
            if !is_near(&(y + step).into()) {
                return None;
            }
            match self.damped(seed, map, &y, &residual, &step, patience.trials) {
                Some((next, next_image)) => {
                    residual = Vector4::from(next_image.state) - next;
                    (y, image) = (next, next_image);
                }
                // No step reduces the residual: rounding has been reached, or a dead end.
                None => break,
            }
        }
        if size(&residual, rate) <= 1e3 * CONVERGED * size_of(seed, &y) {
            cycle(seed, map, y.into(), &image)
        } else {
            None
        }
    }

    fn damped(
        &mut self,
        seed: &Trajectory<'_>,
        map: StrobeMap,
        y: &Vector4<f64>,
        residual: &Vector4<f64>,
        step: &Vector4<f64>,
        trials: u32,
    ) -> Option<(Vector4<f64>, Image)> {
        let (rate, mut share) = (seed.flow().rate, 1.0);
        for _ in 0..trials {
            let next = y + step * share;
            if let Some(image) = self.apply(map, seed, next.into())
                && size(&(Vector4::from(image.state) - next), rate) < size(residual, rate)
            {
                return Some((next, image));
            }
            share *= 0.5;
        }
        None
    }
}

/// Whether an orbit that is close by is unstable.
fn is_unstable(image: &Image) -> bool {
    lies_within_unit_circle(&(image.derivative() / UNSTABLE_EXPANSION)) == Some(false)
}

/// Whether the derivative has a multiplier above [`LARGEST_MULTIPLIER`]; none if that cannot be told.
fn expands(image: &Image) -> Option<bool> {
    lies_within_unit_circle(&(image.derivative() / LARGEST_MULTIPLIER)).map(|within| !within)
}

/// What residuals are measured by: the state, or the scale of length where it is small.
fn size_of(seed: &Trajectory<'_>, y: &Vector4<f64>) -> f64 {
    let flow = seed.flow();
    size(y, flow.rate).max(flow.length * flow.omega / flow.rate)
}

/// The largest of displacements and of velocities over `rate`.
fn size(y: &Vector4<f64>, rate: f64) -> f64 {
    in_displacements(y, rate).amax()
}

/// A state whose velocities are divided by `rate`.
fn in_displacements(y: &Vector4<f64>, rate: f64) -> Vector4<f64> {
    Vector4::new(y[0], y[1] / rate, y[2], y[3] / rate)
}

/// Solves `(P' - I) step = -residual` in the sense of least squares.
fn newton_step(image: &Image, residual: &Vector4<f64>) -> Option<Vector4<f64>> {
    let step = balanced_step(&image.balanced(), &in_displacements(residual, image.rate))?;
    Some(in_displacements(&step, image.rate.recip()))
}

/// The same with velocities in units of displacements: what is small must not depend on the unit of time.
fn balanced_step(derivative: &Matrix4<f64>, residual: &Vector4<f64>) -> Option<Vector4<f64>> {
    let matrix = derivative - Matrix4::identity();
    if !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    let lu = matrix.full_piv_lu();
    let pivots = lu.u().diagonal().abs();
    if pivots.min() > WELL_CONDITIONED * pivots.max() {
        return lu.solve(&-residual);
    }
    let svd = matrix.try_svd(true, true, f64::EPSILON, SVD_CAP)?;
    let cutoff = SINGULAR_CUTOFF * svd.singular_values.max();
    svd.solve(&-residual, cutoff).ok()
}

fn cycle(seed: &Trajectory<'_>, map: StrobeMap, state: State, image: &Image) -> Option<Cycle> {
    let (scaled, log_scale) = map.monodromy(image);
    let mut scaled_multipliers = multipliers(&balanced(&scaled, image.rate))?;
    scaled_multipliers.truncate(2 * seed.flow().degrees);
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

/// The value of `parameter` in `[lo, hi]` at which the symmetric period-1 orbit of a model
/// loses its symmetry: where a multiplier of the half-period map crosses -1, that is
/// `det(Q' + I) = 0`. The orbit is followed from `guess`, its state at `lo`.
///
/// None if the orbit is lost on the way or the determinant does not change sign.
pub fn pitchfork(model: &dyn Model, parameter: &str, lo: f64, hi: f64, guess: State) -> Option<f64> {
    let mut state = guess;
    let mut test = |value: f64| -> Option<f64> {
        let mut model = model.clone_model();
        model.set(parameter, value).ok()?;
        let flow = Flow::of(&*model).ok()?;
        let map = StrobeMap::MirroredHalves(1);
        let seed = Trajectory::new(&flow, model.law(), state);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::GearPair;

    fn seed_of<'f>(flow: &'f Flow, pair: &GearPair, periods: u32) -> Trajectory<'f> {
        let mut seed = Trajectory::new(flow, pair.law(), [0.0; 4]);
        (0..periods).for_each(|_| seed.advance_period(&mut ()).unwrap());
        seed
    }

    /// On its way to a cycle a motion is led there by either search.
    #[test]
    fn hasty_searches_find_what_attracts_close_by() {
        for e in [0.06, 0.3, 0.45, 0.58] {
            let pair = GearPair::paper(e);
            let flow = Flow::new(&pair.oscillator().unwrap());
            let seed = seed_of(&flow, &pair, 40);
            let patient = refine(&seed, StrobeMap::Periods(1)).unwrap();
            let hasty = Newton::default().refine_nearby(&seed, StrobeMap::Periods(1), |_| true).unwrap();
            assert!(patient.spectral_radius() < 1.0, "e = {e}");
            for (a, b) in patient.state.into_iter().zip(hasty.state) {
                assert!((a - b).abs() < 1e-11, "e = {e}: {:?}, {:?}", patient.state, hasty.state);
            }
            let mut newton = Newton::default();
            assert!(newton.refine_nearby(&seed, StrobeMap::Periods(1), |_| false).is_none(), "e = {e}");
            assert_eq!(newton.periods(), 1, "e = {e}");
        }
    }

    /// As the multipliers have it, all along chaos.
    #[test]
    fn expansion_is_that_of_the_multipliers() {
        let pair = GearPair { omega: 2.8172, ..GearPair::paper(0.7224) };
        let flow = Flow::new(&pair.oscillator().unwrap());
        let (mut expanding, mut others) = (0, 0);
        for periods in 50..150 {
            let seed = seed_of(&flow, &pair, periods);
            let image = StrobeMap::Periods(1).apply(&seed, seed.state()).unwrap();
            let [re, im] = multipliers(&image.derivative()).unwrap()[0];
            let expands_much = re.hypot(im) > LARGEST_MULTIPLIER;
            assert_eq!(expands(&image), Some(expands_much), "after {periods} periods: {re} + {im} i");
            if expands_much { expanding += 1 } else { others += 1 }
        }
        assert!(expanding > 10 && others > 10, "{expanding} expand, {others} do not");
    }
}
