//! Integrals and extremes of a motion, to which engines add flights and impacts.
//!
//! A flight is measured by Gauss-Legendre quadrature of order 16 over pieces of at most one Taylor step, where its error is below rounding,
//! and extremes are found at the zeros of the rate.

use crate::model::{MOST_COORDINATES, MOST_GAPS, MOST_SIGNALS, Side};

/// Nodes in `(0, 1)` and weights of the Gauss-Legendre quadrature on `[-1, 1]`; the other half is symmetric.
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

/// Largest number of iterations that locate an extreme.
const EXTREME_ITERATIONS: usize = 60;

/// Largest number of displacements, gaps and signals.
pub const DISPLACEMENTS: usize = MOST_COORDINATES + MOST_GAPS + MOST_SIGNALS;

/// Returns the place of a displacement in [`Quantities::displacements`](crate::orbit::Quantities::displacements).
pub fn place_of_displacement(i: usize) -> usize {
    if i < 2 { i } else { i + 1 }
}

/// Returns the place of a gap in [`Quantities::displacements`](crate::orbit::Quantities::displacements).
pub fn place_of_gap(i: usize) -> usize {
    if i == 0 { 2 } else { MOST_COORDINATES + i }
}

/// Returns the place of a signal in [`Quantities::displacements`](crate::orbit::Quantities::displacements).
pub fn place_of_signal(i: usize) -> usize {
    MOST_COORDINATES + MOST_GAPS + i
}

/// Approach speeds so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Contacts {
    pub(crate) count: u64,
    pub(crate) sum: f64,
    pub(crate) largest: f64,
}

impl Contacts {
    pub(crate) fn and(self, other: Contacts) -> Contacts {
        Contacts {
            count: self.count + other.count,
            sum: self.sum + other.sum,
            largest: self.largest.max(other.largest),
        }
    }
}

/// Integrals and extremes of a displacement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moments {
    pub(crate) value: f64,
    pub(crate) square: f64,
    pub(crate) cos: f64,
    pub(crate) sin: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Moments {
    pub(crate) const NONE: Moments =
        Moments { value: 0.0, square: 0.0, cos: 0.0, sin: 0.0, low: f64::INFINITY, high: f64::NEG_INFINITY };

    pub(crate) fn integrate(&mut self, weight: f64, value: f64, [cos, sin]: [f64; 2]) {
        self.value += weight * value;
        self.square += weight * value * value;
        self.cos += weight * value * cos;
        self.sin += weight * value * sin;
    }

    pub(crate) fn include(&mut self, value: f64) {
        self.low = self.low.min(value);
        self.high = self.high.max(value);
    }
}

/// A sum of energies, and that of the sizes to which their rounding errors are relative.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Energy {
    sum: f64,
    size: f64,
}

impl Energy {
    pub(crate) const NONE: Energy = Energy { sum: 0.0, size: 0.0 };

    /// Adds the difference of two energies.
    pub(crate) fn add(&mut self, before: f64, after: f64) {
        self.sum += before - after;
        self.size += before.abs() + after.abs();
    }

    /// Returns the sum; 0 if it is negative by rounding.
    pub(crate) fn sum(self) -> f64 {
        if self.sum < 0.0 && -self.sum <= SUM_ROUNDING * self.size { 0.0 } else { self.sum }
    }
}

/// Rounding error of a sum over a motion, relative to the sum of the sizes of its terms.
const SUM_ROUNDING: f64 = 1e-12;

/// Returns the share of a time. Rounding errors do not lead beyond the whole.
pub(crate) fn share(part: f64, whole: f64) -> f64 {
    match part / whole {
        share if (1.0..=1.0 + SUM_ROUNDING).contains(&share) => 1.0,
        share => share,
    }
}

/// Contacts of one gap so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GapSums {
    /// Impacts.
    pub(crate) impacts: u64,
    /// Time in lasting contact.
    pub(crate) contact_time: f64,
    /// Energy lost at its walls.
    pub(crate) lost: Energy,
    /// Force of its compliant contacts, and the time during which it acts.
    pub(crate) force: Moments,
    pub(crate) force_time: f64,
}

impl GapSums {
    const NONE: GapSums =
        GapSums { impacts: 0, contact_time: 0.0, lost: Energy::NONE, force: Moments::NONE, force_time: 0.0 };
}

/// A drift along a rigid-body mode, which displacements are measured without.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Drift {
    /// Its mean rate.
    pub(crate) rate: f64,
    /// How far the motion is ahead of the mean rate, without the position since the latest phase 0.
    pub(crate) ahead: f64,
}

/// Integrals and extremes so far.
#[derive(Clone, Debug)]
pub struct Sums {
    /// Approaches to right and left walls to which the law of restitution applies.
    pub(crate) contacts: [Contacts; 2],
    /// Energy lost in impacts and in springs of contacts that end.
    pub(crate) lost: Energy,
    /// Energy in springs and preloads of walls that only push, where their contact ends, without that where it begins.
    pub(crate) released: Energy,
    /// Energy that dampers dissipate.
    pub(crate) dissipated: f64,
    /// Displacements, gaps and signals, by their places.
    pub(crate) displacements: [Moments; DISPLACEMENTS],
    /// Forces of compliant contacts, and the time during which they act.
    pub(crate) force: Moments,
    pub(crate) contact_time: f64,
    /// Time during which an element with dry friction sticks, and energy that friction turns into heat.
    pub(crate) sticking_time: f64,
    pub(crate) heat: f64,
    /// Each gap of a machine.
    pub(crate) gaps: [GapSums; MOST_GAPS],
    /// Drifts along the rigid-body modes of a machine.
    pub(crate) drifts: [Drift; MOST_COORDINATES],
}

impl Sums {
    pub(crate) const NONE: Sums = Sums {
        contacts: [Contacts { count: 0, sum: 0.0, largest: 0.0 }; 2],
        lost: Energy::NONE,
        released: Energy::NONE,
        dissipated: 0.0,
        displacements: [Moments::NONE; DISPLACEMENTS],
        force: Moments::NONE,
        contact_time: 0.0,
        sticking_time: 0.0,
        heat: 0.0,
        gaps: [GapSums::NONE; MOST_GAPS],
        drifts: [Drift { rate: 0.0, ahead: 0.0 }; MOST_COORDINATES],
    };

    /// Counts an approach to a wall.
    pub(crate) fn approach(&mut self, side: Side, speed: f64) {
        let of_side = &mut self.contacts[side.index()];
        *of_side = of_side.and(Contacts { count: 1, sum: speed, largest: speed });
    }
}

/// Returns nodes and weights of the quadrature on `[0, 1]`.
pub(crate) fn nodes() -> [(f64, f64); 8] {
    std::array::from_fn(|i| {
        let (node, weight) = if i < 4 { GAUSS[3 - i] } else { GAUSS[i - 4] };
        (0.5 + 0.5 * if i < 4 { -node } else { node }, 0.5 * weight)
    })
}

/// Returns a zero of a function between two numbers at which it has opposite signs, by the method of regula falsi with Anderson and
/// Bjorck's weights (BIT 13, 1973).
pub(crate) fn root(mut a: f64, mut b: f64, of: impl Fn(f64) -> f64) -> f64 {
    let (mut fa, mut fb) = (of(a), of(b));
    let mut best = a;
    for _ in 0..EXTREME_ITERATIONS {
        let c = b - fb * (b - a) / (fb - fa);
        let fc = of(c);
        best = c;
        if fc == 0.0 || (c - b).abs() <= f64::EPSILON {
            break;
        }
        if fc * fb < 0.0 {
            (a, fa) = (b, fb);
        } else {
            let weight = 1.0 - fc / fb;
            fa *= if weight > 0.0 { weight } else { 0.5 };
        }
        (b, fb) = (c, fc);
    }
    best
}
