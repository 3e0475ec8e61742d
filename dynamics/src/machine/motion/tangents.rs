//! Tangent vectors of a motion.

use nalgebra::DMatrix;
use wide::f64x4;

use super::MachineMotion;
use crate::machine::domain::{Carrier, Functional, LinearDomain};
use crate::machine::watch::Watch;
use crate::machine::{Numbers, PhasePoint, SIZE, System};
use crate::motion::NO_SPEED;

/// Tangents larger than this or smaller than its inverse are rescaled.
const LARGEST_TANGENT: f64 = 1e100;

impl MachineMotion<'_> {
    /// Replaces the tangent vectors, which are in the coordinates `(x1, v1, x2, v2, ...)`.
    pub fn set_tangents(&mut self, tangents: Vec<Numbers>) {
        self.log_scale = 0.0;
        self.tangents = tangents.iter().map(|tangent| self.system.to_flow(tangent)).collect();
        self.hold_tangents();
    }

    /// Returns the unit vectors of a state.
    pub fn unit_tangents(system: &System) -> Vec<Numbers> {
        (0..2 * system.degrees()).map(|i| std::array::from_fn(|j| f64::from(u8::from(i == j)))).collect()
    }

    /// Returns the tangent vectors, divided by the exponential of [`log_scale`](Self::log_scale).
    pub fn tangents(&self) -> Vec<Numbers> {
        self.tangents.iter().map(|tangent| self.system.to_state(tangent)).collect()
    }

    /// Returns the logarithm of the common factor of all tangent vectors.
    pub fn log_scale(&self) -> f64 {
        self.log_scale
    }

    /// Returns the matrix whose columns are the tangent vectors.
    pub fn derivative(&self) -> DMatrix<f64> {
        let columns = self.tangents();
        DMatrix::from_fn(2 * self.system.degrees(), columns.len(), |i, j| {
            columns[j][i] * self.log_scale.exp()
        })
    }

    /// Carries the tangents along a part of a step.
    pub(super) fn carry_tangents(&mut self, domain: &LinearDomain, time: f64) {
        if self.tangents.is_empty() {
            return;
        }
        let size = 2 * self.system.n;
        let carry = |tangents: &mut [Numbers], carrier: &Carrier| {
            tangents.iter_mut().for_each(|tangent| *tangent = carrier.carry(tangent, size));
        };
        if let Some(whole) = domain.whole(self.stride, time) {
            carry(&mut self.tangents, whole);
        } else {
            domain.set_carrier(&mut self.carrier, time, size);
            carry(&mut self.tangents, &self.carrier);
        }
        let sizes = self.tangents.iter().flat_map(|tangent| tangent.as_chunks().0);
        let size = sizes.fold(f64x4::ZERO, |size, &x| size + f64x4::new(x).abs()).reduce_add();
        if size > 0.0 && size.is_finite() && !(1.0 / LARGEST_TANGENT..LARGEST_TANGENT).contains(&size) {
            self.log_scale += size.ln();
            self.tangents.iter_mut().flatten().for_each(|x| *x /= size);
        }
    }

    /// Applies `S u = R u + (f+ - R f-) (n . u) / (n . f-)` to every tangent vector.
    pub(super) fn saltate(&mut self, watch: Watch, row: &Functional, field: &PhasePoint) {
        let n = self.system.n;
        let jumps = std::mem::take(&mut self.jumps);
        let jump = |u: &[f64]| {
            let mut after = [0.0; SIZE];
            after[..2 * n].copy_from_slice(&u[..2 * n]);
            for (impulse, change) in &jumps {
                let rate = after[n + impulse.gap];
                after[n..2 * n].iter_mut().zip(change).for_each(|(after, change)| *after -= change * rate);
            }
            after
        };
        let rate = row.dot(field);
        let least = if watch.is_distance() { NO_SPEED * self.system.speed } else { 0.0 };
        let next = self.refresh().derivative(&self.point);
        let carried = jump(field);
        let mut change: Numbers = std::array::from_fn(|i| if i < 2 * n { next[i] - carried[i] } else { 0.0 });
        if rate.abs() <= least {
            self.near_grazing |= !jumps.is_empty() || !matches!(watch, Watch::Wall(..) | Watch::Leaves(..));
            change = [0.0; SIZE];
        } else {
            change.iter_mut().for_each(|x| *x /= rate);
        }
        for tangent in &mut self.tangents {
            let along: f64 = row.0[..2 * n].iter().zip(&*tangent).map(|(row, x)| row * x).sum();
            *tangent = jump(tangent);
            tangent.iter_mut().zip(change).for_each(|(x, change)| *x += change * along);
        }
        self.jumps = jumps;
        self.hold_tangents();
    }

    /// Projects the tangents onto the constraints, because neighbouring motions rest, too.
    pub(super) fn hold_tangents(&mut self) {
        for tangent in &mut self.tangents {
            for (entry, mode) in tangent.iter_mut().zip(self.modes.gaps).take(self.system.gaps()) {
                if mode.rest().is_some() {
                    *entry = 0.0;
                }
            }
            self.system.hold(&self.modes, tangent, true);
        }
    }
}
