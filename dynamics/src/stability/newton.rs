//! Newton's method on the strobe map.

use nalgebra::allocator::Allocator;
use nalgebra::{
    DMatrix, DVector, DefaultAllocator, DimDiff, DimMin, DimSub, Matrix4, OMatrix, OVector, U1, Vector4,
};

use super::unit_circle::lies_within_unit_circle;
use super::{Cycle, Image, StrobeMap, multipliers};
use crate::model::{State, Timing, difference, state, sum};
use crate::motion::{Trajectory, Work};

/// Limits of one Newton search.
#[derive(Clone, Copy, Debug)]
struct SearchLimits {
    steps: u32,
    /// Trials of one step. Each trial halves the step, until the residual decreases.
    trials: u32,
    /// Whether the search ends as soon as the orbit is clearly unstable.
    stops_at_unstable: bool,
}

const FULL_SEARCH: SearchLimits = SearchLimits { steps: 40, trials: 12, stops_at_unstable: false };

/// Limits of a quick search for a stable orbit near the motion, which can be repeated later. Of 343 orbits found in
/// 400 cells along a map's borders, 4 needed more. Failed full searches took seven tenths of all periods.
const QUICK_SEARCH: SearchLimits = SearchLimits { steps: 12, trials: 3, stops_at_unstable: true };

/// If the map expands by more than this factor, no stable orbit is nearby.
pub(crate) const LARGEST_MULTIPLIER: f64 = 2.0;

/// Singular values of `P' - I` below this, relative to the largest, are treated as zero. Near a saddle-node or
/// pitchfork, they belong to the direction along which the orbits form a family.
const SINGULAR_CUTOFF: f64 = 1e-10;

/// If no pivot of `P' - I` is smaller than this, relative to the largest, no singular value is treated as zero.
const WELL_CONDITIONED: f64 = 1e-6;

/// Largest number of sweeps of the singular value iteration.
const SVD_CAP: usize = 1000;

/// Residuals below this, relative to the state, are rounding errors.
const CONVERGED: f64 = 1e-13;

/// Residual, relative to the state, below which the computed multipliers differ by at most a quarter from the multipliers of the orbit.
const MULTIPLIER_RESIDUAL: f64 = 1e-3;

/// Largest error of a multiplier that is 1.
const UNIT_ERROR: f64 = 1e-6;

/// Largest multiplier, at that residual, from which the orbit is certainly unstable.
const UNSTABLE_EXPANSION: f64 = 1.25;

/// Refines the state of `seed`, a trajectory at phase 0, to a fixed point of `map`. Returns none if Newton's method
/// does not converge. The fixed point may be stable or unstable.
pub fn refine(seed: &Trajectory<'_>, map: StrobeMap) -> Option<Cycle> {
    Newton::default().refine(seed, map)
}

/// Newton's method, with counters of its work.
#[derive(Clone, Debug, Default)]
pub(crate) struct Newton {
    half_periods: u32,
    work: Work,
}

impl Newton {
    /// Returns the number of forcing periods integrated with four tangent vectors, rounded up.
    pub(crate) fn periods(&self) -> u32 {
        self.half_periods.div_ceil(2)
    }

    pub(crate) fn work(&self) -> Work {
        self.work
    }

    /// Searches for a fixed point of `map`, like [`refine`].
    pub(crate) fn refine(&mut self, seed: &Trajectory<'_>, map: StrobeMap) -> Option<Cycle> {
        let image = self.apply(map, seed, seed.state())?;
        self.search(seed, map, image, FULL_SEARCH, |_| true)
    }

    /// Searches for a stable fixed point nearby with the limits of [`QUICK_SEARCH`]. It gives up early, because the
    /// motion comes closer to a stable orbit and the search can be repeated. An unstable fixed point may be returned
    /// with a relative error of `1e-6`.
    pub(crate) fn refine_nearby(
        &mut self,
        seed: &Trajectory<'_>,
        map: StrobeMap,
        is_near: impl Fn(&State) -> bool,
    ) -> Option<Cycle> {
        let image = self.apply(map, seed, seed.state())?;
        if expands(&image)? { None } else { self.search(seed, map, image, QUICK_SEARCH, is_near) }
    }

    /// Applies a map. Returns none if the trajectory cannot be continued, or if all searches together exceed the
    /// seed's allowance.
    pub(crate) fn apply(&mut self, map: StrobeMap, seed: &Trajectory<'_>, y: State) -> Option<Image> {
        let allowance = seed.allowance();
        allowance.covers(self.work).ok()?;
        self.half_periods += map.half_periods();
        map.apply_counting(&seed.clone().allowing(allowance.after(self.work)), y, &mut self.work).ok()
    }

    /// Runs Newton's method from the state of `seed`, whose image is `image`. Ends if a step leads to a state for
    /// which `is_near` is false.
    fn search(
        &mut self,
        seed: &Trajectory<'_>,
        map: StrobeMap,
        mut image: Image,
        limits: SearchLimits,
        is_near: impl Fn(&State) -> bool,
    ) -> Option<Cycle> {
        let mut y = seed.state();
        let rate = seed.flow().rate;
        let mut residual = difference(&image.state, &y);
        for nth in 0..limits.steps {
            let now = size(&residual, rate) / size_of(seed, &y);
            if now <= CONVERGED {
                break;
            }
            let step = newton_step(&image, &residual)?;
            if limits.stops_at_unstable && nth > 0 && now < MULTIPLIER_RESIDUAL && is_unstable(&image) {
                return cycle(seed, map, sum(&y, &step, 1.0), &image);
            }
            if !is_near(&sum(&y, &step, 1.0)) {
                return None;
            }
            match self.damped(seed, map, &y, &residual, &step, limits.trials) {
                Some((next, next_image)) => {
                    residual = difference(&next_image.state, &next);
                    (y, image) = (next, next_image);
                }
                // No step reduces the residual: it is rounding error, or the search has failed.
                None => break,
            }
        }
        if size(&residual, rate) <= 1e3 * CONVERGED * size_of(seed, &y) {
            cycle(seed, map, y, &image)
        } else {
            None
        }
    }

    /// Takes the longest of the step, its half, its quarter and so on that reduces the residual.
    fn damped(
        &mut self,
        seed: &Trajectory<'_>,
        map: StrobeMap,
        y: &State,
        residual: &State,
        step: &State,
        trials: u32,
    ) -> Option<(State, Image)> {
        let (rate, mut share) = (seed.flow().rate, 1.0);
        for _ in 0..trials {
            let next = sum(y, step, share);
            if let Some(image) = self.apply(map, seed, next)
                && size(&difference(&image.state, &next), rate) < size(residual, rate)
            {
                return Some((next, image));
            }
            share *= 0.5;
        }
        None
    }
}

/// Whether the derivative has a multiplier above [`UNSTABLE_EXPANSION`].
fn is_unstable(image: &Image) -> bool {
    lies_within(image, UNSTABLE_EXPANSION) == Some(false)
}

/// Whether the derivative has a multiplier above [`LARGEST_MULTIPLIER`]; none if it is not finite.
fn expands(image: &Image) -> Option<bool> {
    lies_within(image, LARGEST_MULTIPLIER).map(|within| !within)
}

/// Whether the modulus of all multipliers of the derivative is below `bound`; none if it is not finite.
fn lies_within(image: &Image, bound: f64) -> Option<bool> {
    let factor = image.log_scale.exp();
    lies_within_unit_circle(image.scaled.nrows(), |i, j| image.scaled[(i, j)] * factor / bound)
}

/// Returns the size that residuals are relative to: the size of the state, or the scale of length if it is larger.
fn size_of(seed: &Trajectory<'_>, y: &State) -> f64 {
    let flow = seed.flow();
    size(y, flow.rate).max(flow.length * flow.omega / flow.rate)
}

/// Returns the largest of displacements and of velocities divided by `rate`.
fn size(y: &State, rate: f64) -> f64 {
    let [first, others @ ..] = in_displacements(y, rate);
    others.iter().fold(first.abs(), |most, x| most.max(x.abs()))
}

/// Divides the velocities of a state by `rate`.
fn in_displacements(y: &State, rate: f64) -> State {
    std::array::from_fn(|i| if i % 2 == 1 { y[i] / rate } else { y[i] })
}

/// Solves `(P' - I) step = -residual` by least squares, with velocities divided by `rate`, so that the result does
/// not depend on the unit of time.
fn newton_step(image: &Image, residual: &State) -> Option<State> {
    let (size, residual) = (image.scaled.nrows(), in_displacements(residual, image.rate));
    let entry = image.balanced_entries();
    // With one or two coordinates, no heap memory is needed.
    let step = if size == 4 {
        let matrix = Matrix4::from_fn(entry) - Matrix4::identity();
        state(balanced_step(matrix, &Vector4::from_column_slice(&residual[..4]))?.as_slice())
    } else {
        let matrix = DMatrix::from_fn(size, size, entry) - DMatrix::identity(size, size);
        state(balanced_step(matrix, &DVector::from_column_slice(&residual[..size]))?.as_slice())
    };
    Some(in_displacements(&step, image.rate.recip()))
}

/// Solves `(P' - I) step + velocity time = -residual` for the smallest step and time. Returns none if an entry is not finite.
pub(crate) fn step_and_time(
    image: &Image,
    residual: &State,
    velocity: &State,
    omega: f64,
) -> Option<(State, f64)> {
    let (size, residual) = (image.scaled.nrows(), in_displacements(residual, image.rate));
    let (entry, velocity) = (image.balanced_entries(), in_displacements(velocity, image.rate));
    let matrix = DMatrix::from_fn(size, size + 1, |i, j| match j {
        _ if j == size => velocity[i] / omega,
        _ => entry(i, j) - f64::from(u8::from(i == j)),
    });
    if !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    let svd = matrix.try_svd(true, true, f64::EPSILON, SVD_CAP)?;
    let cutoff = SINGULAR_CUTOFF * svd.singular_values.max();
    let solved = svd.solve(&-DVector::from_column_slice(&residual[..size]), cutoff).ok()?;
    let step = in_displacements(&state(&solved.as_slice()[..size]), image.rate.recip());
    Some((step, solved[size] / omega))
}

/// Solves `matrix step = -residual` by least squares.
fn balanced_step<D>(matrix: OMatrix<f64, D, D>, residual: &OVector<f64, D>) -> Option<OVector<f64, D>>
where
    D: DimMin<D, Output = D> + DimSub<U1>,
    DefaultAllocator: Allocator<D, D> + Allocator<D> + Allocator<DimDiff<D, U1>> + Allocator<U1, D>,
{
    if !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    let lu = matrix.clone().full_piv_lu();
    let pivots = lu.u().diagonal().abs();
    if pivots.min() > WELL_CONDITIONED * pivots.max() {
        return lu.solve(&-residual);
    }
    let svd = matrix.try_svd(true, true, f64::EPSILON, SVD_CAP)?;
    let cutoff = SINGULAR_CUTOFF * svd.singular_values.max();
    svd.solve(&-residual, cutoff).ok()
}

/// Returns a matrix on the directions beside an eigenvector. A second eigenvalue equal to the eigenvector's keeps its digits: as one of a
/// double eigenvalue it would have the square root of the matrix's rounding errors.
fn without(matrix: &DMatrix<f64>, eigenvector: &DVector<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    let mut axis = eigenvector.normalize();
    axis[0] += axis[0].signum();
    axis.normalize_mut();
    let reflection = DMatrix::identity(n, n) - 2.0 * &axis * axis.transpose();
    (&reflection * matrix * &reflection).view((1, 1), (n - 1, n - 1)).into_owned()
}

fn cycle(seed: &Trajectory<'_>, map: StrobeMap, state: State, image: &Image) -> Option<Cycle> {
    let (scaled, log_scale) = map.monodromy(image);
    let size = scaled.nrows();
    let entry = |i, j| super::in_displacements(scaled[(i, j)], image.rate, i, j);
    let matrix = DMatrix::from_fn(size, size, entry);
    let flow = seed.flow();
    // The choice of phase 0 on a cycle without force has the multiplier 1, and the velocity as its direction.
    let velocity = (flow.timing == Timing::Cycle).then(|| seed.at(state, []).velocity());
    let velocity = velocity.map(|rates| in_displacements(&flow.rigid_modes.shifted_back(rates), image.rate));
    let velocity = velocity.filter(|rates| rates.iter().any(|rate| *rate != 0.0));
    let mut scaled_multipliers = match &velocity {
        Some(velocity) => multipliers(&without(&matrix, &DVector::from_column_slice(&velocity[..size])))?,
        None => multipliers(&matrix)?,
    };
    // A shift along a rigid-body mode is undone: it has the multiplier 0. If momentum along the mode is conserved, its rate has the
    // multiplier 1. An element that never slides makes a family of cycles along its row, with the multiplier 1, too.
    let (rigid, conserved) = (flow.rigid_modes.modes.len(), flow.rigid_modes.conserved);
    scaled_multipliers.truncate(2 * flow.degrees - rigid - usize::from(velocity.is_some()));
    for _ in 0..conserved + image.never_slid {
        let off = |[re, im]: &[f64; 2]| (re * log_scale.exp() - 1.0).hypot(im * log_scale.exp());
        let nearest = scaled_multipliers.iter().enumerate().min_by(|a, b| off(a.1).total_cmp(&off(b.1)));
        let Some((along, _)) = nearest.filter(|(_, of)| rigid == 0 || off(of) < UNIT_ERROR) else { break };
        scaled_multipliers.remove(along);
    }
    let [re, im] = scaled_multipliers.first().copied().unwrap_or_default();
    let (radius, scale) = (re.hypot(im), log_scale.exp());
    // A radius below the rounding errors of the matrix is not distinguished from zero.
    let is_resolved = radius > f64::EPSILON * matrix.amax();
    Some(Cycle {
        state,
        period: map.cycle_periods(),
        symmetric: matches!(map, StrobeMap::MirroredHalves(_)),
        multipliers: scaled_multipliers.iter().map(|m| m.map(|x| x * scale)).collect(),
        log_radius: if is_resolved { radius.ln() + log_scale } else { f64::NEG_INFINITY },
        monodromy: scaled * scale,
        near_grazing: image.near_grazing,
        image: image.state,
        may_be_shorter: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{GearPair, REST};
    use crate::motion::Flow;

    fn seed_of<'f>(flow: &'f Flow, pair: &GearPair, periods: u32) -> Trajectory<'f> {
        let mut seed = Trajectory::new(flow, pair.law(), REST);
        (0..periods).for_each(|_| seed.advance_period(&mut ()).unwrap());
        seed
    }

    #[test]
    fn quick_and_full_searches_find_the_same_stable_cycle() {
        for e in [0.06, 0.3, 0.45, 0.58] {
            let pair = GearPair::paper(e);
            let flow = Flow::new(&pair.oscillator().unwrap());
            let seed = seed_of(&flow, &pair, 40);
            let full = refine(&seed, StrobeMap::Periods(1)).unwrap();
            let quick = Newton::default().refine_nearby(&seed, StrobeMap::Periods(1), |_| true).unwrap();
            assert!(full.spectral_radius() < 1.0, "e = {e}");
            for (a, b) in full.state.into_iter().zip(quick.state) {
                assert!((a - b).abs() < 1e-11, "e = {e}: {:?}, {:?}", full.state, quick.state);
            }
            let mut newton = Newton::default();
            assert!(newton.refine_nearby(&seed, StrobeMap::Periods(1), |_| false).is_none(), "e = {e}");
            assert_eq!(newton.periods(), 1, "e = {e}");
        }
    }

    /// Compares the test with the multipliers along a chaotic motion.
    #[test]
    fn expansion_agrees_with_the_multipliers() {
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
