//! Tangent vectors across events: saltation matrices.

use super::Trajectory;
use crate::flow::Gap;

/// Speeds below this at an event, relative to the scale of length and the rate of free
/// motion, leave the linearisation without meaning.
pub const NO_SPEED: f64 = 1e-14;

/// Tangents larger than this or smaller than its inverse are rescaled.
const LARGE: f64 = 1e100;

impl<const N: usize> Trajectory<'_, N> {
    /// Takes a common factor out of the tangents where they leave the middle of the range.
    pub(super) fn rescale_tangents(&mut self) {
        let size = self.tangents.iter().flatten().fold(0.0f64, |size, x| size.max(x.abs()));
        if size > 0.0 && size.is_finite() && !(1.0 / LARGE..LARGE).contains(&size) {
            self.log_scale += size.ln();
            self.tangents = self.tangents.map(|u| u.map(|x| x / size));
        }
    }

    /// `S u = R u + (f+ - R f-) (n . u) / (n . f-)` for every tangent vector.
    ///
    /// `reset` is the jump matrix R, `normal` the gradient n of the event function, `rate`
    /// its rate `n . f-` (with the explicit time derivative, where it has one).
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
        let carried = reset(field_before);
        let jump: Gap = std::array::from_fn(|i| (field_after[i] - carried[i]) / rate);
        self.tangents = self.tangents.map(|u| {
            let along: f64 = normal.iter().zip(&u).map(|(n, u)| n * u).sum();
            let kept = reset(&u);
            std::array::from_fn(|i| kept[i] + jump[i] * along)
        });
    }
}
