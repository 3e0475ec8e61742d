//! Converts a lane's measured sums to quantities in the model's units.

use nalgebra::{Complex, DMatrix, Matrix2, Matrix4};

use super::constants::{Constants, Engine};
use super::layout::{Measured, SUMS};
use rattlemap_dynamics::orbit::{Approaches, Displacement, Quantities};

/// A displacement of the model as factors of the gap and of x.
type GapFactors = [f64; 2];

/// Returns the quantities of a lane; none if it was not measured. `shaders/pair/measure.wgsl` has the places of the sums.
pub(super) fn quantities(constants: &Constants, measured: &[f64]) -> Option<Quantities> {
    let (Measured { totals, highs, lows, .. }, _) = Measured::split(measured);
    let [.., dissipated, force, contact, approach, lost, count, periods]: [f64; SUMS] = *totals;
    if periods < 1.0 {
        return None;
    }
    let pair = constants.pair()?;
    let h = pair.flow.h;
    let steps = periods * f64::from(constants.steps);
    // A rate of w per step has the energy w^2 in the shader's units.
    let energy = 1.0 / (2.0 * pair.compliance() * h * h);
    let force_unit = 2.0 * energy;
    let both = Approaches {
        count: count.round() as u64,
        mean: if count > 0.0 { approach / count / h } else { 0.0 },
        largest: highs[4] / h,
    };
    let rows = [pair.flow.displacements[0], pair.flow.displacements[1], [1.0, 0.0]];
    let displacement =
        |i: usize| displacement(rows[i], totals, steps, totals[2 + i], 0.5 * (highs[i] - lows[i]));
    Some(Quantities {
        approaches: [Approaches::default(), Approaches::default(), both],
        // A sum of what impacts and springs lose is not negative, but for rounding.
        impact_energy: (lost * energy / (steps * h)).max(0.0),
        release_energy: None,
        contact_force: (contact > 0.0)
            .then(|| [highs[3] * force_unit, (force / contact).max(0.0).sqrt() * force_unit]),
        displacements: std::array::from_fn(|i| if i < 3 { displacement(i) } else { Displacement::default() }),
        dissipated: dissipated * energy / (steps * h),
        friction: None,
        gaps: None,
    })
}

fn displacement(
    [a, b]: GapFactors,
    totals: &[f64; SUMS],
    steps: f64,
    square: f64,
    amplitude: f64,
) -> Displacement {
    let [z, x, _, _, _, zc, zs, xc, xs, ..] = *totals;
    let [cos, sin] = [a * zc + b * xc, a * zs + b * xs].map(|sum| 2.0 * sum / steps);
    Displacement {
        amplitude,
        mean: (a * z + b * x) / steps,
        drift: None,
        drift_error: None,
        rms: (square / steps).sqrt(),
        harmonic: [cos.hypot(sin), (-sin).atan2(cos)],
    }
}

/// Returns modulus and argument of the largest multiplier of a cycle. If a cycle was read, its columns are the monodromy matrix; otherwise
/// the motion is free of contact.
pub(super) fn multiplier(constants: &Constants, measured: &[f64]) -> [f64; 2] {
    let (measured, columns) = Measured::split(measured);
    let pair = match &constants.engine {
        Engine::Pair(pair) => pair,
        Engine::Machine(machine) if measured.has_read == 0.0 => {
            return largest(machine.contact_free_multiplier().into_iter());
        }
        Engine::Machine(machine) => {
            // The padding of a single coordinate has no columns.
            let (dim, n) = (columns.len().isqrt(), 2 * machine.degrees());
            return largest(
                DMatrix::from_fn(n, n, |i, j| columns[dim * j + i]).complex_eigenvalues().iter().copied(),
            );
        }
    };
    let (z, x) = (pair.flow.domains[0].gap_row, pair.flow.domains[0].x_row);
    let generator = [0.0, z[0], 0.0, x[0], 1.0, z[1], 0.0, x[1], 0.0, z[2], 0.0, x[2], 0.0, z[3], 1.0, x[3]];
    let (columns, steps) = match measured.has_read {
        0.0 => (generator, Some(f64::from(constants.steps))),
        _ => (columns.try_into().expect("an oscillator has four numbers"), None),
    };
    let eigenvalues = if constants.degrees == 1 {
        let block = Matrix2::new(columns[0], columns[4], columns[1], columns[5]);
        block.complex_eigenvalues().as_slice().to_vec()
    } else {
        Matrix4::from_column_slice(&columns).complex_eigenvalues().as_slice().to_vec()
    };
    let multipliers = eigenvalues.into_iter().map(|mu| steps.map_or(mu, |steps| (mu * steps).exp()));
    largest(multipliers)
}

fn largest(multipliers: impl Iterator<Item = Complex<f64>>) -> [f64; 2] {
    let largest = multipliers.max_by(|a, b| a.norm().total_cmp(&b.norm())).expect("a matrix has eigenvalues");
    // Of a complex pair, returns the multiplier in the upper half plane.
    [largest.norm(), largest.arg().abs()]
}
