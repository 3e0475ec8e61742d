//! The motion near any instant of a step, as a short Taylor polynomial.
//!
//! The grid stores the propagators of every sixteenth of the Taylor step, and of whole Taylor steps. One of each reaches within a
//! thirty-second of any instant. From there eight terms of the Taylor series are exact within rounding: `(1.6 * 0.035)^9 / 9! < 2e-17`. An
//! event needs one such polynomial, both to find the root and for the state there.

use wide::f64x4;

use super::columns::Columns;
use super::taylor::partial_sum;
use super::{Gap, Phasor};
use crate::fused::fma;

/// Parts of the Taylor step whose propagators are stored.
const PARTS: usize = 16;

/// Length of a part, in Taylor steps.
pub(super) const FINEST_PART: f64 = 1.0 / PARTS as f64;

/// The propagators of every fourth part and of the first three are sums of the series; the others are products of two
/// of these.
const COARSER: usize = 4;

/// Terms of the local series.
pub(crate) const TERMS: usize = 8;

/// Distance from a grid point up to which the local series is valid, in Taylor steps. It exceeds half a part, for
/// roots just beyond the middle between two grid points.
pub(crate) const EXPANSION_REACH: f64 = 0.035;

/// `1.5 * 2^52`: added to a small number, it leaves the nearest integer in the last bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
const MASK: u64 = 0xffff;

/// Coefficients of the series of `1 - sin(x) / x` and of `1 - cos(x)`, without signs.
const SIN: [f64; 3] = [1.0 / 6.0, 1.0 / 120.0, 1.0 / 5040.0];
const COS: [f64; 4] = [0.5, 1.0 / 24.0, 1.0 / 720.0, 1.0 / 40320.0];

/// Next coefficients of both series, for angles up to 0.2.
const SIN_TAIL: [f64; 2] = [1.0 / 362_880.0, 1.0 / 39_916_800.0];
const COS_TAIL: [f64; 2] = [1.0 / 3_628_800.0, 1.0 / 479_001_600.0];

/// Returns the phasor turned by an angle of up to 0.2.
#[inline(always)]
pub(crate) fn turned([cos, sin]: &Phasor, angle: f64) -> Phasor {
    let square = angle * angle;
    let fourth = square * square;
    let series = |a: f64, b: f64, c: f64, d: f64, e: f64| {
        fma(fourth, fma(fourth, e, fma(-square, d, c)), fma(-square, b, a))
    };
    let s = angle * fma(-square, series(SIN[0], SIN[1], SIN[2], SIN_TAIL[0], SIN_TAIL[1]), 1.0);
    let tail = fma(-square, COS_TAIL[1], COS_TAIL[0]);
    let less =
        -square * fma(fourth, fma(fourth, tail, fma(-square, COS[3], COS[2])), fma(-square, COS[1], COS[0]));
    [cos + fma(less, *cos, -s * sin), sin + fma(s, *cos, less * sin)]
}

/// Propagators of a grid of instants, minus the identity, and the terms of the Taylor series.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    parts: Vec<Columns>,
    wholes: Vec<Columns>,
    terms: [Columns; TERMS],
}

/// The motion near a grid point.
pub(crate) struct Expansion {
    /// Time from the start to the grid point, in Taylor steps.
    pub(crate) start: f64,
    /// Change of the state from the start to the grid point.
    change: f64x4,
    q: f64x4,
    terms: [f64x4; TERMS],
    phasor: Phasor,
}

impl Grid {
    pub(super) fn stored(&self) -> usize {
        self.parts.capacity() + self.wholes.capacity()
    }

    /// Builds the grid over `wholes` Taylor steps from the table of terms.
    pub(super) fn new(table: &[Columns], wholes: usize) -> Grid {
        // A part is a product of at most two sums, so errors do not accumulate.
        let sum = |i: usize| partial_sum(table, i as f64 / PARTS as f64);
        let mut parts = vec![table[0].cleared(); PARTS];
        for i in 1..PARTS {
            let fine = i % COARSER;
            parts[i] = if i < COARSER || fine == 0 { sum(i) } else { parts[fine].after(&parts[i - fine]) };
        }
        let mut whole = Vec::with_capacity(wholes + 1);
        whole.extend([table[0].cleared(), sum(PARTS)]);
        for i in 2..=wholes {
            whole.push(whole[i / 2].after(&whole[i - i / 2]));
        }
        Grid { parts, wholes: whole, terms: std::array::from_fn(|n| table[n].clone()) }
    }

    /// Returns the propagator, minus the identity, of a time `u` that is a multiple of [`FINEST_PART`].
    pub(super) fn propagator(&self, u: f64) -> Columns {
        let (_, whole, part) = self.nearest(u);
        self.parts[part].after(&self.wholes[whole])
    }

    /// Returns the grid point nearest to `u`, and its whole steps and parts.
    #[inline(always)]
    fn nearest(&self, u: f64) -> (f64, usize, usize) {
        let rounded = fma(u, PARTS as f64, ROUNDER);
        let i = (rounded.to_bits() & MASK) as usize;
        ((rounded - ROUNDER) * FINEST_PART, (i / PARTS).min(self.wholes.len() - 1), i % PARTS)
    }

    /// Expands the motion from a state about the grid point nearest to `u >= 0`, in Taylor steps.
    #[inline(always)]
    pub(crate) fn expansion(&self, q: &Gap, phasor: &Phasor, u: f64) -> Expansion {
        let (instant, whole, part) = self.nearest(u);
        let start = f64x4::from(*q);
        let (mut change, mut p) = (f64x4::ZERO, *phasor);
        let mut here = *q;
        if whole > 0 {
            let step = &self.wholes[whole];
            change = step.apply(&here, &p);
            p = step.carry_phasor(&p);
            here = (start + change).to_array();
        }
        let step = &self.parts[part];
        change += step.apply(&here, &p);
        p = step.carry_phasor(&p);
        let there = start + change;
        let here = there.to_array();
        let mut terms: [f64x4; TERMS] = std::array::from_fn(|n| self.terms[n].apply_lean(&here, &p));
        if self.terms[0].has_waves() {
            let waves = self.waves(p[0], p[1]);
            terms = std::array::from_fn(|n| terms[n] + waves[n]);
        }
        Expansion { start: instant, change, q: there, terms, phasor: p }
    }

    /// Returns the part of higher harmonics in the terms.
    #[cold]
    #[inline(never)]
    fn waves(&self, cos: f64, sin: f64) -> [f64x4; TERMS] {
        std::array::from_fn(|n| self.terms[n].waved(cos, sin))
    }

    /// Returns tangent vectors after `u` Taylor steps.
    #[inline(always)]
    pub(crate) fn carry<const N: usize>(&self, u: f64, tangents: [Gap; N]) -> [Gap; N] {
        let (instant, whole, part) = self.nearest(u);
        let v = u - instant;
        let mut here = tangents;
        if whole > 0 {
            here = here.map(|t| self.wholes[whole].carry_tangent(&t));
        }
        here = here.map(|t| self.parts[part].carry_tangent(&t));
        Columns::carry(&self.terms, v, here)
    }
}

impl Expansion {
    /// Returns the coefficients of the change of the gap since the start, in powers of the time from the grid point
    /// in Taylor steps.
    #[inline(always)]
    pub(crate) fn gap(&self) -> [f64; TERMS + 1] {
        let mut series = [self.change.to_array()[0]; TERMS + 1];
        for (coefficient, term) in series[1..].iter_mut().zip(&self.terms) {
            *coefficient = term.to_array()[0];
        }
        series
    }

    /// Returns the state `v` Taylor steps after the grid point.
    #[inline(always)]
    pub(crate) fn state(&self, v: f64) -> Gap {
        let t = &self.terms;
        let v = f64x4::splat(v);
        let square = v * v;
        // A tree has a shorter chain of operations than Horner's scheme, and the caller waits for the result.
        let pair = |i: usize| t[i + 1].mul_add(v, t[i]);
        let low = pair(2).mul_add(square, pair(0));
        let high = pair(6).mul_add(square, pair(4));
        high.mul_add(square * square, low).mul_add(v, self.q).to_array()
    }

    /// Returns the grid point's phasor turned by a small angle.
    #[inline(always)]
    pub(crate) fn phasor(&self, angle: f64) -> Phasor {
        let [cos, sin] = self.phasor;
        let square = angle * angle;
        let s = angle * fma(-square, fma(-square, fma(-square, SIN[2], SIN[1]), SIN[0]), 1.0);
        let less = square * fma(square, fma(-square, fma(-square, COS[3], COS[2]), COS[1]), -COS[0]);
        [cos + fma(less, cos, -s * sin), sin + fma(s, cos, less * sin)]
    }
}
