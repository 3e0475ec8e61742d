//! Tangent vectors across events: saltation matrices.

use super::PairMotion;
use crate::motion::NO_SPEED;
use crate::pair::flow::Gap;

/// Tangents larger than this or smaller than its inverse are rescaled.
const LARGEST_TANGENT: f64 = 1e100;

impl<const N: usize> PairMotion<'_, N> {
    /// Divides the tangents by a common factor if they are very large or very small.
    pub(super) fn rescale_tangents(&mut self) {
        let size = self.tangents.iter().flatten().fold(0.0f64, |size, x| size.max(x.abs()));
        if size > 0.0 && size.is_finite() && !(1.0 / LARGEST_TANGENT..LARGEST_TANGENT).contains(&size) {
            self.log_scale += size.ln();
            self.tangents = self.tangents.map(|u| u.map(|x| x / size));
        }
    }

    /// Applies `S u = R u + (f+ - R f-) (n . u) / (n . f-)` to every tangent vector.
    ///
    /// `reset` is the jump matrix R, `normal` the gradient n of the event function, and `rate` its time derivative
    /// `n . f-`, plus the explicit time derivative if it has one.
    pub(super) fn saltate(
        &mut self,
        reset: impl Fn(&Gap) -> Gap,
        normal: &Gap,
        rate: f64,
        field_before: &Gap,
        field_after: &Gap,
    ) {
        self.rescale_tangents();
        if rate.abs() < NO_SPEED * self.flow.speed {
            self.near_grazing = true;
            self.tangents = self.tangents.map(|u| reset(&u));
            return;
        }
        let field_reset = reset(field_before);
        let jump: Gap = std::array::from_fn(|i| (field_after[i] - field_reset[i]) / rate);
        self.tangents = self.tangents.map(|u| {
            let along: f64 = normal.iter().zip(&u).map(|(n, u)| n * u).sum();
            let u = reset(&u);
            std::array::from_fn(|i| u[i] + jump[i] * along)
        });
    }
}
