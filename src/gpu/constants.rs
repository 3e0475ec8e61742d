//! Constants of a lane, derived in f64 from the model's description.

use bytemuck::Zeroable;
use nalgebra::{SMatrix, Vector2};

use super::layout::{Domain, Flow};
use crate::record::limits::MOST_STEPS;
use rattlemap_dynamics::model;
use rattlemap_dynamics::reference::CLOSING_ANGLE;

/// Largest angle, in radians, that the fastest mode may turn in one step: Taylor series and
/// certificate of the shaders are laid out for it.
pub const STEP_ANGLE: f64 = 1.0;

/// Where a wall stands that there is not, in scales of length: shaders have no infinity, and square distances.
const NOWHERE: f64 = 1e12;

/// Terms of the matrix exponential over one step; rates times steps are below 1.
const EXPONENTIAL_TERMS: u32 = 30;

type Generator = SMatrix<f64, 7, 7>;

/// The constants of one oscillator and the phasors of its steps.
#[derive(Clone, Debug)]
pub struct Constants {
    /// What the shader reads.
    pub flow: Flow,
    /// Free steps per forcing period.
    pub steps: u32,
    /// `(cos, sin)` at every step, the end included.
    pub phasors: Vec<[f64; 2]>,
    /// Whether the mirror image of a motion is a motion.
    pub mirror_symmetric: bool,
    gap: [f64; 2],
}

/// Second-order form `y'' = -stiffness y - damping y' + force cos + load` of a domain, in
/// the displacements `(z, x2)`.
struct Equations {
    stiffness: [[f64; 2]; 2],
    damping: [[f64; 2]; 2],
    force: [f64; 2],
    load: [f64; 2],
}

impl Constants {
    /// Free steps per forcing period: `asked` or as many as the motion needs. None if a lane
    /// would be refused for their number.
    pub fn steps(oscillator: &model::Oscillator, asked: Option<u32>) -> Option<u32> {
        let angle = oscillator.period() * rate(oscillator, &oscillator.free);
        let needed = (angle / STEP_ANGLE).ceil().max(8.0);
        // Even, so that half a period is a step, too.
        let steps = 2.0 * (0.5 * f64::from(asked.unwrap_or(0)).max(needed)).ceil();
        (steps <= f64::from(MOST_STEPS)).then_some(steps as u32)
    }

    /// Derives the constants for as many steps as [`Constants::steps`] says; none if it has none.
    pub fn new(oscillator: &model::Oscillator, asked: Option<u32>) -> Option<Constants> {
        let steps = Constants::steps(oscillator, asked)?;
        let period = oscillator.period();
        let h = period / f64::from(steps);
        let substeps = |domain: &model::Domain| {
            (h * rate(oscillator, domain) / STEP_ANGLE).max(1.0).log2().ceil().exp2()
        };
        let [right, left] = oscillator.meshing;
        let walls = walls(oscillator);
        let domain = |d: &model::Domain, wall: f64, substeps: f64| domain(oscillator, d, wall, h, substeps);
        let mut constants = Constants {
            flow: Zeroable::zeroed(),
            steps,
            phasors: phasors(steps),
            mirror_symmetric: oscillator.mirror_symmetric(),
            gap: oscillator.gap,
        };
        constants.flow = Flow {
            domains: [
                domain(&oscillator.free, 0.0, 1.0),
                domain(&right, walls[0], substeps(&right)),
                domain(&left, walls[1], substeps(&left)),
            ],
            walls,
            kick: kick(oscillator),
            h,
            speed: speed(oscillator) * h,
            closing: CLOSING_ANGLE / free_rate(oscillator) / h,
            steady: [0.0; 4],
            reach: -1.0,
            decay: 0.0,
        };
        if let Some(motion) = model::NonImpacting::new(oscillator) {
            let ([g0, g1], [m1, m2]) = (oscillator.gap, oscillator.masses());
            constants.flow.steady = constants.to_lane(motion.steady());
            // In units of the free domain's energy form.
            constants.flow.reach = h * ((g0 * g0 / m1 + g1 * g1 / m2) * motion.reach()).sqrt();
            constants.flow.decay = motion.exponent() * period / std::f64::consts::LN_2;
        }
        Some(constants)
    }

    /// Lane units `(z, z', x2, x2')` of a state `(x1, v1, x2, v2)`.
    pub fn to_lane(&self, y: model::State) -> [f64; 4] {
        let [g0, g1] = self.gap;
        let h = self.flow.h;
        [g0 * y[0] + g1 * y[2], h * (g0 * y[1] + g1 * y[3]), y[2], h * y[3]]
    }

    /// The state of lane units.
    pub fn to_state(&self, q: [f64; 4]) -> model::State {
        let [g0, g1] = self.gap;
        let (w, v) = (q[1] / self.flow.h, q[3] / self.flow.h);
        [(q[0] - g1 * q[2]) / g0, (w - g1 * v) / g0, q[2], v]
    }
}

/// Share of the contact impulse, per unit of gap rate, that the second displacement takes.
fn kick(oscillator: &model::Oscillator) -> f64 {
    let ([g0, g1], [m1, m2]) = (oscillator.gap, oscillator.masses());
    -(g1 / m2) / (g0 * g0 / m1 + g1 * g1 / m2)
}

fn phasors(steps: u32) -> Vec<[f64; 2]> {
    (0..=steps)
        .map(|n| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(n % steps) / f64::from(steps)).sin_cos();
            [cos, sin]
        })
        .collect()
}

/// A bound on all rates of a domain: the forcing, and the spectral norms of the mass-scaled
/// system. A mode that is damped until it no longer swings may decay as fast as all of the damping:
/// half of it would leave 9e-6 of such a mode to the terms that single precision leaves out.
fn rate(oscillator: &model::Oscillator, domain: &model::Domain) -> f64 {
    let (damping, frequency) = norms(oscillator, domain);
    (0.5 * damping + frequency.max(0.5 * damping)).max(oscillator.omega)
}

/// What speeds are measured by: the scale of length times the rate of free motion.
pub(super) fn speed(oscillator: &model::Oscillator) -> f64 {
    oscillator.length_scale() * free_rate(oscillator)
}

/// The walls, out of reach where there is none.
fn walls(oscillator: &model::Oscillator) -> [f64; 2] {
    let far = NOWHERE * oscillator.length_scale();
    oscillator.walls.map(|wall| wall.clamp(-far, far))
}

/// The rate of free motion that thresholds are measured by; the reference's, so that both mean the same.
fn free_rate(oscillator: &model::Oscillator) -> f64 {
    let (damping, frequency) = norms(oscillator, &oscillator.free);
    (damping + frequency).max(oscillator.omega)
}

/// Spectral norms of a domain's mass-scaled damping, and the root of that of its stiffness.
fn norms(oscillator: &model::Oscillator, domain: &model::Domain) -> (f64, f64) {
    let root = Vector2::from(oscillator.masses()).map(|m| m.sqrt().recip());
    let norm = |m: [[f64; 2]; 2]| {
        let scaled = [m[0][0] * root[0] * root[0], m[0][1] * root[0] * root[1], m[1][1] * root[1] * root[1]];
        let (mean, half) = (0.5 * (scaled[0] + scaled[2]), 0.5 * (scaled[0] - scaled[2]));
        mean.abs() + half.hypot(scaled[1])
    };
    (norm(domain.damping), norm(domain.stiffness).sqrt())
}

/// The equations in `(z, x2)`, the gap measured from `wall`.
fn equations(oscillator: &model::Oscillator, domain: &model::Domain, wall: f64) -> Equations {
    let ([g0, g1], m) = (oscillator.gap, oscillator.masses());
    // x1 = (z - g1 x2) / g0 turns columns, z = g . x turns rows.
    let turned = |a: [[f64; 2]; 2]| {
        let row = |i: usize| {
            let [p, q] = [a[i][0] / m[i], a[i][1] / m[i]];
            [p / g0, q - p * g1 / g0]
        };
        let (first, second) = (row(0), row(1));
        [[g0 * first[0] + g1 * second[0], g0 * first[1] + g1 * second[1]], second]
    };
    let projected = |f: [f64; 2]| [g0 * f[0] / m[0] + g1 * f[1] / m[1], f[1] / m[1]];
    let stiffness = turned(domain.stiffness);
    let load = projected(domain.load);
    Equations {
        damping: turned(domain.damping),
        force: projected(oscillator.force),
        load: [load[0] - stiffness[0][0] * wall, load[1] - stiffness[1][0] * wall],
        stiffness,
    }
}

fn domain(
    oscillator: &model::Oscillator,
    domain: &model::Domain,
    wall: f64,
    free_step: f64,
    substeps: f64,
) -> Domain {
    let h = free_step / substeps;
    let angle = oscillator.omega * h;
    let equations = equations(oscillator, domain, wall);
    let row = |i: usize| {
        let (k, c) = (equations.stiffness[i], equations.damping[i]);
        [
            -k[0] * h * h,
            -c[0] * h,
            -k[1] * h * h,
            -c[1] * h,
            equations.force[i] * h * h,
            equations.load[i] * h * h,
        ]
    };
    let (gap_row, x_row) = (row(0), row(1));
    let (energy, growth) = gap_bound(oscillator, domain, h);
    Domain {
        step: step(&gap_row, &x_row, angle),
        gap_row,
        x_row,
        energy,
        growth: growth * angle.powi(5),
        angle,
        turn_half: (0.5 * angle).tan(),
        turn_sin: angle.sin(),
        share: substeps.recip(),
        substeps,
    }
}

/// `exp(G) - 1` of the generator on `(z, z', x, x', cos, sin, 1)`, its first four rows.
pub(crate) fn step(gap_row: &[f64; 6], x_row: &[f64; 6], angle: f64) -> [f64; 28] {
    let propagator = propagator(gap_row, x_row, angle);
    std::array::from_fn(|i| propagator[(i / 7, i % 7)])
}

fn propagator(gap_row: &[f64; 6], x_row: &[f64; 6], angle: f64) -> Generator {
    let mut g = Generator::zeros();
    g[(0, 1)] = 1.0;
    g[(2, 3)] = 1.0;
    for (i, row) in [(1, gap_row), (3, x_row)] {
        for j in 0..5 {
            g[(i, j)] = row[j];
        }
        g[(i, 6)] = row[5];
    }
    g[(4, 5)] = -angle;
    g[(5, 4)] = angle;
    // Horner, so that small terms are added first.
    let mut sum = Generator::zeros();
    for n in (1..=EXPONENTIAL_TERMS).rev() {
        sum = g * (Generator::identity() + sum) / f64::from(n);
    }
    sum
}

/// The energy bound on derivatives of the gap, in units of the step.
///
/// `y^(n)` obeys the same equations with the force times `omega^n` and no load, and its
/// energy `2 E = sum m_i v_i^2 + x K x` grows by the force alone. So with
/// `c^2 = sum g_i^2 / m_i`
///
/// ```text
/// |z^(n+1)| <= c sqrt(2 E_n),   d sqrt(2 E_n) / dt <= omega^n sqrt(sum force_i^2 / m_i).
/// ```
///
/// Returns the form `c^2 2 E` on `(w^2, w v, v^2, z^2, z x, x^2)` and the growth of its
/// root per step, less the factor `angle^n`.
fn gap_bound(oscillator: &model::Oscillator, domain: &model::Domain, h: f64) -> ([f64; 6], f64) {
    let ([g0, g1], [m1, m2], k) = (oscillator.gap, oscillator.masses(), domain.stiffness);
    let compliance = g0 * g0 / m1 + g1 * g1 / m2;
    // A symmetric form on (x1, x2), written in (z, x2).
    let in_gap = |a: f64, b: f64, c: f64| {
        let slope = -g1 / g0;
        [a / (g0 * g0), 2.0 * (a * slope + b) / g0, a * slope * slope + 2.0 * b * slope + c]
    };
    let kinetic = in_gap(m1, 0.0, m2).map(|x| x * compliance);
    let potential = in_gap(k[0][0], k[0][1], k[1][1]).map(|x| x * compliance * h * h);
    let [f1, f2] = oscillator.force;
    let force = (f1 * f1 / m1 + f2 * f2 / m2).sqrt();
    let form = [kinetic[0], kinetic[1], kinetic[2], potential[0], potential[1], potential[2]];
    (form, compliance.sqrt() * force * h * h)
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix4;

    use super::*;
    use rattlemap_dynamics::model::GearPair;

    /// Underdamped, overdamped by the teeth and overdamped by a support.
    #[test]
    fn no_mode_turns_or_decays_by_more_than_a_step() {
        let paper = GearPair::paper(0.5);
        for pair in [paper, GearPair { r: 450.0, k: 2.4, ..paper }, GearPair { r1: 70.0, ..paper }] {
            let constants = Constants::new(&pair.oscillator().unwrap(), None).unwrap();
            for domain in constants.flow.domains {
                let (z, x) = (domain.gap_row, domain.x_row);
                let generator = Matrix4::from_row_slice(&[
                    0.0, 1.0, 0.0, 0.0, z[0], z[1], z[2], z[3], 0.0, 0.0, 0.0, 1.0, x[0], x[1], x[2], x[3],
                ]);
                let fastest =
                    generator.complex_eigenvalues().iter().fold(0.0f64, |size, l| size.max(l.norm()));
                assert!(fastest <= STEP_ANGLE * (1.0 + 1e-9), "{fastest} {pair:?}");
            }
        }
    }
}
