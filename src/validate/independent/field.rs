//! Equations of motion in gap coordinates `(z, w, x, v)`: the gap and its rate, and the displacement with the smaller share
//! of the gap and its velocity.

use nalgebra::{Complex, Matrix2, Vector2};

use rattlemap_dynamics::model::{Domain, Harmonic, Pair, State, state};
use rattlemap_dynamics::pair::{Gap, Phasor};

/// Conversion between displacements and gap coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Coordinates {
    gap: [f64; 2],
    /// Index of the displacement that is a coordinate.
    other: usize,
    /// Change of its velocity by an impulse that changes the gap's rate by 1.
    kick: f64,
}

impl Coordinates {
    /// Builds the coordinates of an oscillator. If both displacements have equal shares of the gap, the second is used.
    pub fn new(oscillator: &Pair) -> Coordinates {
        let gap = oscillator.gap;
        let other = usize::from(gap[0].abs() >= gap[1].abs());
        let row = Vector2::from(gap);
        let along = inverse(oscillator.mass) * row;
        Coordinates { gap, other, kick: along[other] / row.dot(&along) }
    }

    /// Returns the change of `v` by an impulse that changes the gap's rate by 1.
    pub(super) fn kick(&self) -> f64 {
        self.kick
    }

    /// Converts a state to gap coordinates.
    pub fn gap(&self, y: &State) -> Gap {
        let [g0, g1] = self.gap;
        [g0 * y[0] + g1 * y[2], g0 * y[1] + g1 * y[3], y[2 * self.other], y[2 * self.other + 1]]
    }

    /// Converts gap coordinates to a state.
    pub fn state(&self, [z, w, x, v]: &Gap) -> State {
        let (own, rest) = (self.gap[self.other], self.gap[1 - self.other]);
        let (y, rate) = ((z - own * x) / rest, (w - own * v) / rest);
        state(&if self.other == 1 { [y, rate, *x, *v] } else { [*x, *v, y, rate] })
    }
}

fn inverse(m: [[f64; 2]; 2]) -> Matrix2<f64> {
    let [[a, b], [c, d]] = m;
    Matrix2::new(d, -b, -c, a) / (a * d - b * c)
}

/// Factors of cosine and sine of a harmonic of the force in the accelerations of gap and displacement.
#[derive(Clone, Copy, Debug)]
struct Drive {
    order: u32,
    factors: [[f64; 2]; 2],
}

/// The equations of motion of one domain in gap coordinates, solved for the accelerations.
#[derive(Clone, Debug)]
pub struct Equations {
    /// Coefficients of `(z, w, x, v)` in the accelerations of the gap and of the displacement.
    rows: [[f64; 4]; 2],
    /// Factors of cosine and sine of the forcing's phase.
    force: [[f64; 2]; 2],
    /// Further harmonics.
    harmonics: Vec<Drive>,
    load: [f64; 2],
}

impl Equations {
    /// Builds the equations of one domain.
    pub fn new(oscillator: &Pair, domain: &Domain) -> Equations {
        let Coordinates { gap, other, .. } = Coordinates::new(oscillator);
        // Matrices from displacements to `(z, x)` and back.
        let [own, rest] = if other == 1 { gap } else { [gap[1], gap[0]] };
        let to_gap = match other {
            1 => Matrix2::new(own, rest, 0.0, 1.0),
            _ => Matrix2::new(rest, own, 1.0, 0.0),
        };
        let from_gap = match other {
            1 => Matrix2::new(1.0 / own, -rest / own, 0.0, 1.0),
            _ => Matrix2::new(0.0, 1.0, 1.0 / own, -rest / own),
        };
        let per_mass = to_gap * inverse(oscillator.mass);
        let matrix =
            |m: [[f64; 2]; 2]| -per_mass * Matrix2::new(m[0][0], m[0][1], m[1][0], m[1][1]) * from_gap;
        let (k, c) = (matrix(domain.stiffness), matrix(domain.damping));
        let vector = |f: [f64; 2]| (per_mass * Vector2::from(f)).into();
        let drive =
            |&Harmonic { order, cos, sin }: &Harmonic| Drive { order, factors: [cos, sin].map(vector) };
        Equations {
            rows: [0, 1].map(|i| [k[(i, 0)], c[(i, 0)], k[(i, 1)], c[(i, 1)]]),
            force: [vector(oscillator.force), vector(oscillator.force_sin)],
            harmonics: oscillator.harmonics.iter().map(drive).collect(),
            load: vector(domain.load),
        }
    }

    /// Returns the equations with the gap held at rest by a wall that takes up its acceleration.
    pub(super) fn held(&self, coordinates: &Coordinates) -> Equations {
        let kick = coordinates.kick();
        let of = |pair: [f64; 2]| [0.0, pair[1] - kick * pair[0]];
        let [gap, kept] = self.rows;
        let row = std::array::from_fn(|j| kept[j] - kick * gap[j]);
        let drive = |drive: &Drive| Drive { factors: drive.factors.map(of), ..*drive };
        Equations {
            rows: [[0.0; 4], row],
            force: self.force.map(of),
            harmonics: self.harmonics.iter().map(drive).collect(),
            load: of(self.load),
        }
    }

    /// Returns the accelerations of gap and displacement, given the cosine and the sine of the forcing's phase.
    #[inline(always)]
    pub fn accelerations(&self, q: &Gap, [cos, sin]: Phasor) -> [f64; 2] {
        let [by_cos, by_sin] = &self.force;
        let plain = [0, 1].map(|i| {
            let r = &self.rows[i];
            let drive = by_cos[i] * cos + (self.load[i] + by_sin[i] * sin);
            (r[0] * q[0] + r[1] * q[1]) + (r[2] * q[2] + r[3] * q[3]) + drive
        });
        if self.harmonics.is_empty() { plain } else { self.with_harmonics(plain, [cos, sin], 0.0, 0) }
    }

    /// Adds the derivative of the given degree of the further harmonics to accelerations.
    fn with_harmonics(&self, mut sum: [f64; 2], [cos, sin]: Phasor, omega: f64, degree: u32) -> [f64; 2] {
        for Drive { order, factors: [by_cos, by_sin] } in &self.harmonics {
            // Each derivative of `exp(i n omega t)` is a factor of `i n omega`.
            let rate = Complex::new(0.0, f64::from(*order) * omega);
            let power = Complex::new(cos, sin).powu(*order) * rate.powu(degree);
            (0..2).for_each(|i| sum[i] += by_cos[i] * power.re + by_sin[i] * power.im);
        }
        sum
    }

    /// Returns the derivatives of first and second degree of the gap's acceleration by these equations, along the motion by
    /// the equations `along`.
    pub(super) fn gap_rates(&self, along: &Equations, q: &Gap, phasor: Phasor, omega: f64) -> [f64; 2] {
        let [cos, sin] = phasor;
        let change = |field: &Equations, rates: &Gap, [cos, sin]: Phasor, degree: u32| {
            let [by_cos, by_sin] = &field.force;
            let plain = [0, 1].map(|i| {
                let row = field.rows[i].iter().zip(rates);
                row.map(|(a, rate)| a * rate).sum::<f64>() + by_cos[i] * cos + by_sin[i] * sin
            });
            if field.harmonics.is_empty() {
                plain
            } else {
                field.with_harmonics(plain, phasor, omega, degree)
            }
        };
        let [a, b] = along.accelerations(q, phasor);
        let (rates, turned) = ([q[1], a, q[3], b], [-omega * sin, omega * cos]);
        let [c, d] = change(along, &rates, turned, 1);
        let second = change(self, &[a, c, b, d], [-omega * omega * cos, -omega * omega * sin], 2);
        [change(self, &rates, turned, 1)[0], second[0]]
    }

    /// Returns an upper bound of the undamped frequencies.
    pub(super) fn rate(&self) -> f64 {
        let [gap, kept] = self.rows.map(|row| row[0].abs() + row[2].abs());
        gap.max(kept).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::GearPair;

    /// Covers a full mass matrix and gaps in which either displacement has the larger share.
    #[test]
    fn any_gap_row_obeys_the_equations_of_motion() {
        let pair = Pair::of(&GearPair::paper(0.5).oscillator().unwrap()).unwrap();
        for gap in [[1.0, -1.0], [0.3, 2.0], [0.0, -1.5], [-2.0, 0.5]] {
            let oscillator =
                Pair { mass: [[2.0, 0.7], [0.7, 1.0]], gap, force_sin: [-20.0, 30.0], ..pair.clone() };
            let coordinates = Coordinates::new(&oscillator);
            let y = state(&[0.3, -1.2, 0.9, 2.1]);
            let q = coordinates.gap(&y);
            let back = coordinates.state(&q);
            let off = (0..4).map(|i| (back[i] - y[i]).abs()).fold(0.0, f64::max);
            assert!(off < 1e-15, "{gap:?}: {back:?}");
            for domain in [oscillator.free, oscillator.meshing[0]] {
                let [cos, sin] = [0.6, 0.8];
                let [a, b] = Equations::new(&oscillator, &domain).accelerations(&q, [cos, sin]);
                let x = coordinates.state(&[a, 0.0, b, 0.0]);
                let (acceleration, k, c) = ([x[0], x[2]], domain.stiffness, domain.damping);
                for i in 0..2 {
                    let inertia =
                        oscillator.mass[i][0] * acceleration[0] + oscillator.mass[i][1] * acceleration[1];
                    let rest = c[i][0] * y[1] + c[i][1] * y[3] + k[i][0] * y[0] + k[i][1] * y[2];
                    let drive = oscillator.force[i] * cos + oscillator.force_sin[i] * sin + domain.load[i];
                    let off = inertia + rest - drive;
                    assert!(off.abs() < 1e-11 * (1.0 + rest.abs()), "{gap:?}: {off:e}");
                }
            }
        }
    }
}
