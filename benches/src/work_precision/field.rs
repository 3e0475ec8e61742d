//! Equations of motion of a gear pair in gap coordinates `(z, w, x, v)`: the gap `x1 - x2` and its rate, and displacement and velocity of
//! gear 2. In these coordinates a gap can be set exactly to a wall.

use rattlemap_dynamics::model::{GearPair, Side, State, state};
use rattlemap_dynamics::pair::Gap;

/// Converts a state `(x1, v1, x2, v2)` to gap coordinates.
pub fn to_gap(y: &State) -> Gap {
    [y[0] - y[2], y[1] - y[3], y[2], y[3]]
}

/// Converts gap coordinates to a state.
pub fn to_state([z, w, x, v]: &Gap) -> State {
    state(&[z + x, w + v, *x, *v])
}

/// The equations of motion of one domain, solved for the accelerations: (11), or (12) and (13) of the paper.
#[derive(Clone, Debug)]
pub struct Equations {
    /// Coefficients of `(z, w, x, v)` in the accelerations of the gap and of gear 2.
    rows: [[f64; 4]; 2],
    /// Factor of the cosine of the forcing's phase in the acceleration of the gap.
    force: f64,
    /// Constant parts of the accelerations.
    load: [f64; 2],
}

impl Equations {
    /// Builds the equations of free motion, or of meshing on a side.
    pub fn new(p: &GearPair, meshing: Option<Side>) -> Equations {
        let (side, k, r) = meshing.map_or((0.0, 0.0, 0.0), |side| (side.sign(), p.k, p.r));
        let both = 1.0 / p.m1 + 1.0 / p.m2;
        let [k1, r1, k2, r2] = [p.k1 / p.m1, p.r1 / p.m1, p.k2 / p.m2, p.r2 / p.m2];
        Equations {
            rows: [[-k1 - k * both, -r1 - r * both, k2 - k1, r2 - r1], [k / p.m2, r / p.m2, -k2, -r2]],
            force: p.force / p.m1,
            load: [side * k * p.b * both, -side * k * p.b / p.m2],
        }
    }

    /// Returns the accelerations of the gap and of gear 2, given the cosine of the forcing's phase.
    #[inline(always)]
    pub fn accelerations(&self, q: &Gap, cos: f64) -> [f64; 2] {
        let [gap, second] = [0, 1].map(|i| {
            let r = &self.rows[i];
            (r[0] * q[0] + r[1] * q[1]) + (r[2] * q[2] + r[3] * q[3]) + self.load[i]
        });
        [gap + self.force * cos, second]
    }

    /// Returns an upper bound of the undamped frequencies.
    pub fn rate(&self) -> f64 {
        let [gap, second] = self.rows.map(|row| row[0].abs() + row[2].abs());
        gap.max(second).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_equations_are_those_of_the_paper() {
        let p = GearPair { m1: 2.0, m2: 0.7, ..GearPair::paper(0.5) };
        let y = state(&[0.3, -1.2, 0.9, 2.1]);
        let q = to_gap(&y);
        assert!((0..4).all(|i| (to_state(&q)[i] - y[i]).abs() < 1e-15));
        for meshing in [None, Some(Side::Right), Some(Side::Left)] {
            let contact = meshing.map_or(0.0, |side| p.r * q[1] + p.k * (q[0] - side.sign() * p.b));
            let first = (0.6 * p.force - p.r1 * y[1] - p.k1 * y[0] - contact) / p.m1;
            let second = (contact - p.r2 * y[3] - p.k2 * y[2]) / p.m2;
            let found = Equations::new(&p, meshing).accelerations(&q, 0.6);
            for (found, exact) in found.into_iter().zip([first - second, second]) {
                assert!((found - exact).abs() < 1e-12 * exact.abs(), "{meshing:?}: {found} {exact}");
            }
        }
    }
}
