//! Oscillators in the coordinates of lanes: the gap `z` and one displacement `x`.

use rattlemap_dynamics::model::{Domain, Pair, REST, State};

/// Choice of the displacement `x`, and the effect of a force along the gap.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coordinates {
    gap: [f64; 2],
    mass: [[f64; 2]; 2],
    /// Index of the displacement `x`: the one with the smaller factor in the gap.
    pub(super) other: usize,
}

/// Second-order form of a domain's equations in `(z, x)`: `y'' = -stiffness y - damping y' + cos + sin + load`, where `cos`
/// and `sin` multiply cosine and sine of the phase.
pub(super) struct Equations {
    pub(super) stiffness: [[f64; 2]; 2],
    pub(super) damping: [[f64; 2]; 2],
    pub(super) cos: [f64; 2],
    pub(super) sin: [f64; 2],
    pub(super) load: [f64; 2],
}

impl Coordinates {
    pub(super) fn new(oscillator: &Pair) -> Coordinates {
        let Pair { gap, mass, .. } = *oscillator;
        let other = usize::from(gap[0].abs() >= gap[1].abs());
        Coordinates { gap, mass, other }
    }

    /// Returns `M^-1 f`.
    fn accelerated(&self, f: [f64; 2]) -> [f64; 2] {
        let [[m1, m], [_, m2]] = self.mass;
        if m == 0.0 {
            return [f[0] / m1, f[1] / m2];
        }
        let determinant = m1 * m2 - m * m;
        [(m2 * f[0] - m * f[1]) / determinant, (m1 * f[1] - m * f[0]) / determinant]
    }

    /// Returns `g M^-1 f`.
    fn along(&self, f: [f64; 2]) -> f64 {
        let [[m1, m], [_, m2]] = self.mass;
        let [g0, g1] = self.gap;
        if m == 0.0 {
            return g0 * f[0] / m1 + g1 * f[1] / m2;
        }
        let [a, b] = self.accelerated(f);
        g0 * a + g1 * b
    }

    /// Returns the acceleration of the gap per unit of force along it.
    pub(super) fn compliance(&self) -> f64 {
        self.along(self.gap)
    }

    /// Returns the change of the rate of `x` by an impulse that reduces the gap's rate by 1.
    pub(super) fn kick(&self) -> f64 {
        -self.accelerated(self.gap)[self.other] / self.compliance()
    }

    /// Returns a state in lane units `(z, z', x, x')`, with rates per step of `h`.
    pub(super) fn to_lane(self, y: State, h: f64) -> [f64; 4] {
        let [g0, g1] = self.gap;
        let x = [y[2 * self.other], y[2 * self.other + 1]];
        [g0 * y[0] + g1 * y[2], h * (g0 * y[1] + g1 * y[3]), x[0], h * x[1]]
    }

    /// Converts a state from lane units.
    pub(super) fn to_state(self, q: [f64; 4], h: f64) -> State {
        let (o, p) = (self.other, 1 - self.other);
        let (w, v) = (q[1] / h, q[3] / h);
        let mut y = REST;
        [y[2 * p], y[2 * p + 1]] =
            [(q[0] - self.gap[o] * q[2]) / self.gap[p], (w - self.gap[o] * v) / self.gap[p]];
        [y[2 * o], y[2 * o + 1]] = [q[2], v];
        y
    }

    /// Returns both displacements of the model as factors of `(z, x)`.
    pub(super) fn displacements(&self) -> [[f64; 2]; 2] {
        let (o, p) = (self.other, 1 - self.other);
        let mut rows = [[0.0, 1.0]; 2];
        rows[p] = [1.0 / self.gap[p], -self.gap[o] / self.gap[p]];
        rows
    }

    /// Returns the equations in `(z, x)`, with the gap measured from `wall`.
    pub(super) fn equations(&self, oscillator: &Pair, domain: &Domain, wall: f64) -> Equations {
        let (o, p) = (self.other, 1 - self.other);
        let [g0, g1] = self.gap;
        // x_p = (z - g_o x_o) / g_p transforms columns, z = g . x transforms rows.
        let turned = |a: [[f64; 2]; 2]| {
            let columns = [0, 1].map(|j| self.accelerated([a[0][j], a[1][j]]));
            let row = |i: usize| {
                let (gap, other) = (columns[p][i], columns[o][i]);
                [gap / self.gap[p], other - gap * self.gap[o] / self.gap[p]]
            };
            let (first, second) = (row(0), row(1));
            let along_gap = [g0 * first[0] + g1 * second[0], g0 * first[1] + g1 * second[1]];
            [along_gap, [first, second][o]]
        };
        let projected = |f: [f64; 2]| [self.along(f), self.accelerated(f)[o]];
        let stiffness = turned(domain.stiffness);
        let load = projected(domain.load);
        Equations {
            damping: turned(domain.damping),
            cos: projected(oscillator.force),
            sin: projected(oscillator.force_sin),
            load: [load[0] - stiffness[0][0] * wall, load[1] - stiffness[1][0] * wall],
            stiffness,
        }
    }

    /// Returns a symmetric form on displacements, `a[0][0] x1^2 + ...`, as factors of `(z^2, z x, x^2)`.
    pub(super) fn form(&self, a: [[f64; 2]; 2]) -> [f64; 3] {
        let (o, p) = (self.other, 1 - self.other);
        let (g, slope) = (self.gap[p], -self.gap[o] / self.gap[p]);
        let (own, mixed, other) = (a[p][p], a[0][1], a[o][o]);
        [own / (g * g), 2.0 * (own * slope + mixed) / g, own * slope * slope + 2.0 * mixed * slope + other]
    }

    /// Returns `sqrt(f M^-1 f)`.
    pub(super) fn pull(&self, f: [f64; 2]) -> f64 {
        let [[m1, m], [_, m2]] = self.mass;
        if m == 0.0 {
            return (f[0] * f[0] / m1 + f[1] * f[1] / m2).sqrt();
        }
        let [a, b] = self.accelerated(f);
        (f[0] * a + f[1] * b).max(0.0).sqrt()
    }

    /// Returns the spectral norm of a domain's mass-scaled damping, and the square root of the norm of its mass-scaled stiffness.
    pub(super) fn norms(&self, domain: &Domain) -> (f64, f64) {
        let [[m1, m], [_, m2]] = self.mass;
        // Inverse `a 0; b c` of M's Cholesky factor.
        let a = m1.sqrt().recip();
        let c = if m == 0.0 { m2.sqrt().recip() } else { (m2 - m * m / m1).sqrt().recip() };
        let b = -m / m1 * c;
        let norm = |k: [[f64; 2]; 2]| {
            let scaled = [
                k[0][0] * a * a,
                k[0][0] * a * b + k[0][1] * a * c,
                k[0][0] * b * b + 2.0 * k[0][1] * b * c + k[1][1] * c * c,
            ];
            let (mean, half) = (0.5 * (scaled[0] + scaled[2]), 0.5 * (scaled[0] - scaled[2]));
            mean.abs() + half.hypot(scaled[1])
        };
        let [[_, d], [e, _]] = domain.damping;
        let gyroscopic = (0.5 * (d - e)).abs() * a * c;
        (norm(domain.dissipation()) + gyroscopic, norm(domain.stiffness).sqrt())
    }

    /// Returns the change of the accelerations of the gap and of `x`, per unit of gap rate, by a damper along the gap
    /// behind a wall.
    pub(super) fn damper(&self, free: &Domain, behind: &Domain) -> [f64; 2] {
        let (g, p) = (self.gap, 1 - self.other);
        let c = (behind.damping[p][p] - free.damping[p][p]) / (g[p] * g[p]);
        [c * self.compliance(), c * self.accelerated(g)[self.other]]
    }
}
