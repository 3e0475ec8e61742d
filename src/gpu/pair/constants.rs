//! Constants of a pair, derived in f64.

use bytemuck::Zeroable;
use wide::f64x4;

use super::coordinates::Coordinates;
use crate::gpu::layout::{Domain, Flow};
use crate::record::limits::MOST_STEPS;
use rattlemap_dynamics::model::{self, Contact, Pair, Side};
use rattlemap_dynamics::motion::CLOSING_ANGLE;

/// Largest angle, in radians, by which the fastest mode turns in one step. The shaders' Taylor series and bounds are
/// designed for it.
const STEP_ANGLE: f64 = 1.0;

/// Position of a missing wall, in units of length. WGSL has no infinity, and the shaders square distances.
const NOWHERE: f64 = 1e12;

/// Number of terms of the matrix exponential over one step, in which the fastest mode turns by at most a radian.
const EXPONENTIAL_TERMS: u32 = 30;

/// Pairs of real numbers that the shader reads for each higher harmonic of a flow (`shaders/pair/harmonics.wgsl`).
pub(in crate::gpu) const PAIRS_PER_HARMONIC: usize = 21;

/// A change of the stage in a forcing period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::gpu) struct Change {
    /// Free steps since phase 0: whole ones, and the fraction of the next one.
    pub(in crate::gpu) step: u32,
    pub(in crate::gpu) theta: f64,
    /// The stage that begins.
    pub(in crate::gpu) stage: usize,
}

/// Constants of one pair.
#[derive(Clone, Debug)]
pub struct PairConstants {
    /// Constants that the shader reads in the first stage, apart from those of the higher harmonics.
    pub flow: Flow,
    /// The higher harmonics in the first stage, [`PAIRS_PER_HARMONIC`] for each.
    pub(in crate::gpu) harmonics: Vec<[f64; 2]>,
    /// The same constants in the further stages.
    pub(in crate::gpu) further: Vec<(Flow, Vec<[f64; 2]>)>,
    /// Kinds of the right and of the left wall.
    pub(in crate::gpu) contacts: [Contact; 2],
    /// Changes of the stage; none if there is only one stage.
    pub(in crate::gpu) changes: Vec<Change>,
    /// Whether contact-free motion also requires that the displacement `x` rests at 0.
    pub(in crate::gpu) must_rest: bool,
    /// Positions of the rigid walls on the right and on the left; infinite on a side without a rigid wall.
    bounds: [f64; 2],
    coordinates: Coordinates,
}

impl PairConstants {
    /// Returns the free steps per forcing period: `requested`, or as many as the motion needs. Returns `None` if
    /// there are too many for a lane.
    pub(in crate::gpu) fn steps(oscillator: &Pair, requested: Option<u32>) -> Option<u32> {
        let rates = oscillator.stages.iter().map(|stage| rate(oscillator, &stage.free));
        let angle = oscillator.period() * rates.fold(rate(oscillator, &oscillator.free), f64::max);
        let needed = (angle / STEP_ANGLE).ceil().max(8.0);
        // An even number, so that half a period is a whole number of steps.
        let steps = 2.0 * (0.5 * f64::from(requested.unwrap_or(0)).max(needed)).ceil();
        (steps <= f64::from(MOST_STEPS)).then_some(steps as u32)
    }

    /// Derives the constants for a number of steps.
    pub(in crate::gpu) fn new(oscillator: &Pair, steps: u32) -> Option<PairConstants> {
        let period = oscillator.period();
        let common = Common::new(oscillator, period / f64::from(steps));
        let coordinates = Coordinates::new(oscillator);
        let (flow, harmonics) = of_stage(oscillator, &common);
        let further = if oscillator.schedule.is_empty() { 1..1 } else { 1..oscillator.stage_count() };
        let mut constants = PairConstants {
            flow,
            harmonics,
            further: further.map(|stage| of_stage(&oscillator.in_stage(stage), &common)).collect(),
            contacts: oscillator.contacts,
            changes: changes_of(oscillator, steps),
            must_rest: false,
            bounds: Side::BOTH.map(|side| match oscillator.contacts[side.index()] {
                Contact::Rigid => oscillator.walls[side.index()],
                _ => side.sign() * f64::INFINITY,
            }),
            coordinates,
        };
        if let Some(motion) = non_impacting(oscillator) {
            constants.must_rest = motion.resting().is_some();
            constants.flow.steady = constants.to_lane(motion.steady());
            // In units of the free domain's energy form.
            constants.flow.contact_free_size = common.h * (coordinates.compliance() * motion.reach()).sqrt();
            constants.flow.transient_growth = motion.exponent() * period / std::f64::consts::LN_2;
        }
        Some(constants)
    }

    /// Returns a state in lane units `(z, z', x, x')`, where `x` is the displacement that lanes use besides the gap.
    pub fn to_lane(&self, y: model::State) -> [f64; 4] {
        self.coordinates.to_lane(y, self.flow.h)
    }

    /// Returns a start in lane units. A gap beyond a rigid wall is moved onto it.
    pub(in crate::gpu) fn start(&self, y: model::State) -> [f64; 4] {
        let mut q = self.to_lane(y);
        let [right, left] = self.bounds;
        q[0] = q[0].min(right).max(left);
        q
    }

    /// Returns the change of the gap's rate by a unit impulse of a contact.
    pub(in crate::gpu) fn compliance(&self) -> f64 {
        self.coordinates.compliance()
    }

    /// Converts a state from lane units.
    pub fn to_state(&self, q: [f64; 4]) -> model::State {
        self.coordinates.to_state(q, self.flow.h)
    }
}

/// Constants that all stages have in common.
#[derive(Clone, Copy)]
struct Common {
    /// Length of a free step.
    h: f64,
    /// Steps of contact with each wall per free step.
    substeps: [f64; 2],
    walls: [f64; 2],
    /// Scale of length.
    length: f64,
    /// Unit of speeds.
    speed: f64,
    escape: f64,
}

impl Common {
    fn new(oscillator: &Pair, h: f64) -> Common {
        let substeps = |side: Side| {
            // A gap at rest on a rigid wall moves with free steps.
            let i = side.index();
            if oscillator.contacts[i] == Contact::Rigid {
                return 1.0;
            }
            let stages = (0..oscillator.stage_count()).map(|stage| oscillator.stage(stage).meshing[i]);
            let rates = stages.map(|behind| rate(oscillator, &behind));
            (h * rates.fold(0.0, f64::max) / STEP_ANGLE).max(1.0).log2().ceil().exp2()
        };
        Common {
            h,
            substeps: Side::BOTH.map(substeps),
            walls: walls(oscillator),
            length: oscillator.length_scale(),
            speed: speed(oscillator),
            escape: Some(oscillator.escape()).filter(|size| size.is_finite()).unwrap_or(-1.0),
        }
    }

    fn domains(&self, oscillator: &Pair) -> [Domain; 3] {
        let behind =
            |side: usize| behind_wall(oscillator, side, self.walls[side], self.h, self.substeps[side]);
        let right = behind(0);
        // Without stages, only this stage counts.
        let is_mirrored = oscillator.schedule.is_empty() && oscillator.mirror_symmetric();
        let left = if is_mirrored { mirrored(right) } else { behind(1) };
        [domain(oscillator, &oscillator.free, 0.0, self.h, 1.0), right, left]
    }

    /// Returns the accelerations of a gap that rests on the right and on the left wall.
    fn pressing(&self, oscillator: &Pair) -> [[f64; 7]; 2] {
        self.walls.map(|wall| rows(oscillator, &oscillator.free, wall, self.h)[0])
    }
}

/// Derives the constants of an oscillator's first stage, and those of its higher harmonics.
fn of_stage(oscillator: &Pair, common: &Common) -> (Flow, Vec<[f64; 2]>) {
    let (h, coordinates) = (common.h, Coordinates::new(oscillator));
    let damper = |behind: &model::Domain| coordinates.damper(&oscillator.free, behind).map(|rate| -h * rate);
    let mut domains = common.domains(oscillator);
    let mut harmonics = Vec::with_capacity(PAIRS_PER_HARMONIC * oscillator.harmonics.len());
    for &model::Harmonic { order, cos, sin } in &oscillator.harmonics {
        // A harmonic acts like the first one at a multiple of the frequency.
        let omega = oscillator.omega * f64::from(order);
        let none = Vec::new();
        let alone = Pair { omega, force: cos, force_sin: sin, harmonics: none, ..oscillator.clone() };
        let waves = common.domains(&alone);
        harmonics.push([f64::from(order), 0.0]);
        harmonics.extend(common.pressing(&alone).map(factors));
        for (domain, wave) in domains.iter_mut().zip(waves) {
            domain.growth += wave.growth;
            harmonics.extend([wave.gap_row, wave.x_row].map(factors));
            harmonics.extend([0, 1, 2, 3].map(|row| [wave.step[7 * row + 4], wave.step[7 * row + 5]]));
        }
    }
    let flow = Flow {
        domains,
        walls: common.walls,
        kick: coordinates.kick(),
        h,
        length: common.length,
        speed: common.speed * h,
        closing: CLOSING_ANGLE / free_rate(oscillator) / h,
        escape: common.escape,
        steady: [0.0; 4],
        contact_free_size: -1.0,
        transient_growth: 0.0,
        pressing: common.pressing(oscillator),
        damper: oscillator.meshing.each_ref().map(damper),
        springs: Side::BOTH.map(|side| springs(oscillator, side, h)),
        displacements: coordinates.displacements(),
    };
    (flow, harmonics)
}

/// Returns the factors of cosine and sine in an acceleration.
fn factors(row: [f64; 7]) -> [f64; 2] {
    [row[4], row[6]]
}

/// Returns the changes of the stage in a forcing period.
fn changes_of(oscillator: &Pair, steps: u32) -> Vec<Change> {
    let change = |&(turns, stage): &(f64, usize)| {
        let position = turns * f64::from(steps);
        // Rounding may give a whole period.
        let step = position.floor().min(f64::from(steps - 1));
        Change { step: step as u32, theta: position - step, stage }
    };
    oscillator.schedule.iter().map(change).collect()
}

/// Returns the motion without contacts. It may require that `x` is at rest; a lane can check this exactly.
fn non_impacting(oscillator: &Pair) -> Option<model::NonImpacting> {
    let other = Coordinates::new(oscillator).other;
    let beside_rest =
        || model::NonImpacting::with_one_at_rest(oscillator).filter(|motion| motion.resting() == Some(other));
    model::NonImpacting::new(oscillator).or_else(beside_rest)
}

/// Returns `(cos, sin)` of the phase at every step of a period, the end included.
pub(in crate::gpu) fn phasors(steps: u32) -> impl Iterator<Item = [f64; 2]> {
    (0..=steps).map(move |n| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(n % steps) / f64::from(steps)).sin_cos();
        [cos, sin]
    })
}

/// Returns a bound on all rates of a domain, from the forcing and the spectral norms of the mass-scaled system. An overdamped mode can
/// decay at the full damping rate. A bound with half of this rate would let single precision omit terms of 9e-6 of such a mode. Gyroscopic
/// modes and modes of negative stiffness can be faster than damping and stiffness alone.
fn rate(oscillator: &Pair, domain: &model::Domain) -> f64 {
    let (damping, frequency) = Coordinates::new(oscillator).norms(domain);
    let half = 0.5 * damping;
    let is_passive = domain.damping[0][1] == domain.damping[1][0] && oscillator.growth_rate(domain) == 0.0;
    let turning = if is_passive { frequency.max(half) } else { frequency.hypot(half) };
    (half + turning).max(fastest_force(oscillator))
}

/// Returns the frequency of the highest harmonic.
fn fastest_force(oscillator: &Pair) -> f64 {
    oscillator.omega * f64::from(oscillator.highest_order())
}

/// Returns the unit of speeds: the scale of length times the highest rate of free motion of all stages.
pub(in crate::gpu) fn speed(oscillator: &Pair) -> f64 {
    let further = (1..oscillator.stage_count()).map(|stage| free_rate(&oscillator.in_stage(stage)));
    oscillator.length_scale() * further.fold(free_rate(oscillator), f64::max)
}

/// Returns the positions of the walls. A missing wall is at [`NOWHERE`].
fn walls(oscillator: &Pair) -> [f64; 2] {
    let far = NOWHERE * oscillator.length_scale();
    oscillator.walls.map(|wall| wall.clamp(-far, far))
}

/// Returns the rate of free motion by which thresholds are scaled. The reference uses the same rate, so thresholds mean the same.
fn free_rate(oscillator: &Pair) -> f64 {
    let (damping, frequency) = Coordinates::new(oscillator).norms(&oscillator.free);
    (damping + frequency).max(fastest_force(oscillator))
}

/// Returns the accelerations of the gap and of the other displacement in units of a step `h`, with the gap measured
/// from `wall`.
fn rows(oscillator: &Pair, domain: &model::Domain, wall: f64, h: f64) -> [[f64; 7]; 2] {
    let equations = Coordinates::new(oscillator).equations(oscillator, domain, wall);
    [0, 1].map(|i| {
        let (k, c) = (equations.stiffness[i], equations.damping[i]);
        [
            -k[0] * h * h,
            -c[0] * h,
            -k[1] * h * h,
            -c[1] * h,
            equations.cos[i] * h * h,
            equations.load[i] * h * h,
            equations.sin[i] * h * h,
        ]
    })
}

/// Returns the domain of lasting contact. Constants of a missing wall are never read.
fn behind_wall(oscillator: &Pair, side: usize, wall: f64, free_step: f64, substeps: f64) -> Domain {
    if oscillator.walls[side].is_infinite() {
        return Domain::zeroed();
    }
    if oscillator.contacts[side] == Contact::Rigid {
        return held(oscillator, wall, free_step);
    }
    domain(oscillator, &oscillator.meshing[side], wall, free_step, substeps)
}

fn domain(oscillator: &Pair, domain: &model::Domain, wall: f64, free_step: f64, substeps: f64) -> Domain {
    let h = free_step / substeps;
    let angle = oscillator.omega * h;
    let [gap_row, x_row] = rows(oscillator, domain, wall, h);
    let (energy, growth) = gap_bound(oscillator, domain, h);
    Domain {
        step: step(&gap_row, &x_row, angle),
        gap_row,
        x_row,
        energy,
        growth: growth * angle.powi(5),
        swell: (oscillator.growth_rate(domain) * h).exp(),
        angle,
        turn_half: (0.5 * angle).tan(),
        turn_sin: angle.sin(),
        damping: power_form(oscillator, domain, free_step),
        share: substeps.recip(),
        substeps,
        unused: [0.0; 2],
    }
}

/// Returns the power of a domain's dampers as a form on rates per step `h`. A rate w of the gap has the energy w^2.
fn power_form(oscillator: &Pair, domain: &model::Domain, h: f64) -> [f64; 3] {
    let coordinates = Coordinates::new(oscillator);
    let unit = 2.0 * coordinates.compliance() * h;
    coordinates.form(domain.dissipation()).map(|x| x * unit)
}

/// Returns the contact force of a wall per displacement and per rate of the gap, with rates per step `h`. Forces are
/// accelerations of the gap per step squared.
fn springs(oscillator: &Pair, side: Side, h: f64) -> [f64; 2] {
    let [stiffness, damping] = oscillator.wall_stiffness_and_damping(side);
    let compliance = Coordinates::new(oscillator).compliance();
    [stiffness * compliance * h * h, damping * compliance * h]
}

/// Returns the domain of the other displacement while the gap sticks to a rigid wall. The wall's force cancels the gap's acceleration, and
/// also acts on the other displacement. No rate exceeds those of free motion, so the step is the same.
fn held(oscillator: &Pair, wall: f64, h: f64) -> Domain {
    let kick = Coordinates::new(oscillator).kick();
    let [gap, other] = rows(oscillator, &oscillator.free, wall, h);
    let shared: [f64; 7] = std::array::from_fn(|j| other[j] + kick * gap[j]);
    let x_row = [0.0, 0.0, shared[2], shared[3], shared[4], shared[5], shared[6]];
    let angle = oscillator.omega * h;
    // Rounding could make these numbers negative.
    let passive = oscillator.growth_rate(&oscillator.free) == 0.0;
    Domain {
        step: step(&[0.0; 7], &x_row, angle),
        gap_row: [0.0; 7],
        x_row,
        // Twice the energy of a derivative of x per mass: factors of its rate squared and of itself squared.
        energy: [0.0, 0.0, 1.0, 0.0, 0.0, if passive { (-shared[2]).max(0.0) } else { shared[2].abs() }],
        growth: 0.0,
        swell: if passive { 1.0 } else { (shared[3].max(0.0) + shared[2].max(0.0).sqrt()).exp() },
        angle,
        turn_half: (0.5 * angle).tan(),
        turn_sin: angle.sin(),
        damping: power_form(oscillator, &oscillator.free, h),
        share: 1.0,
        substeps: 1.0,
        unused: [0.0; 2],
    }
}

/// Returns the domain behind the other wall of a symmetric oscillator, where the load has the opposite sign.
fn mirrored(mut domain: Domain) -> Domain {
    let rows = [&mut domain.gap_row[5], &mut domain.x_row[5]];
    let column = domain.step.iter_mut().skip(6).step_by(7);
    // A zero stays +0.
    rows.into_iter().chain(column).for_each(|entry| *entry = 0.0 - *entry);
    domain
}

/// Returns the first four rows of `exp(G) - 1` for the generator G on `(z, z', x, x', cos, sin, 1)`.
fn step(gap_row: &[f64; 7], x_row: &[f64; 7], angle: f64) -> [f64; 28] {
    let unit = |j: usize| f64x4::from(std::array::from_fn(|i| f64::from(u8::from(i == j))));
    // Each row in two halves: the motion's columns, and those of (cos, sin, 1).
    let (zero, mut sum, mut turn) = (f64x4::ZERO, [[f64x4::ZERO; 2]; 4], [f64x4::ZERO; 2]);
    // Horner's scheme adds small terms first.
    for n in (1..=EXPONENTIAL_TERMS).rev() {
        let n = f64x4::splat(f64::from(n));
        (0..4).for_each(|i| sum[i][0] += unit(i));
        (0..2).for_each(|i| turn[i] += unit(i));
        let accelerated = |row: &[f64; 7]| {
            let motion = |half: usize| (0..4).fold(zero, |total, i| total + sum[i][half] * row[i]);
            // Without a sine the result is +0, whatever the signs of the factors.
            let forced = motion(1) + turn[0] * row[4] + turn[1] * (row[6] + 0.0) + unit(2) * row[5];
            [motion(0) / n, forced / n]
        };
        sum = [
            sum[1].map(|half| half / n),
            accelerated(gap_row),
            sum[3].map(|half| half / n),
            accelerated(x_row),
        ];
        turn = [turn[1] * -angle / n, turn[0] * angle / n];
    }
    let rows = sum.map(|halves| halves.map(f64x4::to_array));
    std::array::from_fn(|i| rows[i / 7][i % 7 / 4][i % 7 % 4])
}

/// Returns the energy bound on derivatives of the gap, in units of the step.
///
/// `y^(n)` obeys the equations of motion with the force times `omega^n` and no load. Its energy `2 E = v M v + x |K| x`
/// grows by the force, and by negative damping and stiffness as in [`Pair::growth_rate`]. Without these, and with
/// `c^2 = g M^-1 g`:
///
/// ```text
/// |z^(n+1)| <= c sqrt(2 E_n),   d sqrt(2 E_n) / dt <= omega^n sqrt(force M^-1 force + force_sin M^-1 force_sin).
/// ```
///
/// The result is the form `c^2 2 E` on `(w^2, w v, v^2, z^2, z x, x^2)`, and the growth of its root per step without
/// the factor `angle^n`.
fn gap_bound(oscillator: &Pair, domain: &model::Domain, h: f64) -> ([f64; 6], f64) {
    let coordinates = Coordinates::new(oscillator);
    let compliance = coordinates.compliance();
    let kinetic = coordinates.form(oscillator.mass).map(|x| x * compliance);
    let potential = coordinates.form(oscillator.energy_stiffness(domain)).map(|x| x * compliance * h * h);
    let form = [kinetic[0], kinetic[1], kinetic[2], potential[0], potential[1], potential[2]];
    let pull = coordinates.pull(oscillator.force).hypot(coordinates.pull(oscillator.force_sin));
    (form, compliance.sqrt() * pull * h * h)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix4, SMatrix};

    use super::*;
    use rattlemap_dynamics::model::GearPair;

    fn of(pair: GearPair) -> Pair {
        Pair::of(&pair.oscillator().unwrap()).unwrap()
    }

    fn constants(pair: &Pair) -> PairConstants {
        PairConstants::new(pair, PairConstants::steps(pair, None).unwrap()).unwrap()
    }

    /// Underdamped, overdamped by the teeth, and overdamped by a support.
    #[test]
    fn the_fastest_mode_turns_by_at_most_a_radian_per_step() {
        let paper = GearPair::paper(0.5);
        for pair in [paper, GearPair { r: 450.0, k: 2.4, ..paper }, GearPair { r1: 70.0, ..paper }] {
            let constants = constants(&of(pair));
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

    /// Oscillators with and without a sine, coupled by the masses, with stiff and with heavy parts.
    fn oscillators() -> Vec<Pair> {
        let paper = GearPair::paper(0.5);
        let pairs = [
            paper,
            GearPair { m1: 1e3, k: 1e6, ..paper },
            GearPair { r: 450.0, k1: 0.0, ..paper },
            GearPair { omega: 0.01, b: 1e-3, ..paper },
        ];
        let turned = |pair: GearPair| of(pair).at_phase(0.3);
        let coupled =
            |one: &Pair| Pair { mass: [[one.mass[0][0], 0.4], [0.4, one.mass[1][1]]], ..one.clone() };
        pairs.into_iter().map(turned).flat_map(|one| [coupled(&one), one]).collect()
    }

    /// Computes the exponential by Padé approximants of the whole matrix.
    #[test]
    fn steps_are_matrix_exponentials() {
        for oscillator in oscillators() {
            for Domain { step, gap_row, x_row, angle, .. } in constants(&oscillator).flow.domains {
                let mut generator = SMatrix::<f64, 7, 7>::zeros();
                for (i, row) in [(1, gap_row), (3, x_row)] {
                    generator[(i - 1, i)] = 1.0;
                    let [z, dz, x, dx, cos, load, sin] = row;
                    generator.row_mut(i).copy_from_slice(&[z, dz, x, dx, cos, sin, load]);
                }
                (generator[(4, 5)], generator[(5, 4)]) = (-angle, angle);
                let change = generator.exp() - SMatrix::identity();
                for (n, entry) in step.into_iter().enumerate() {
                    let (i, j) = (n / 7, n % 7);
                    let error = (entry - change[(i, j)]).abs();
                    let scale = change.row(i).amax().max(1.0);
                    assert!(error < 4.0 * f64::EPSILON * scale, "{i}, {j}: {entry}, {error} {oscillator:?}");
                }
            }
        }
    }

    #[test]
    fn a_symmetric_oscillator_has_mirrored_domains_to_the_bit() {
        for oscillator in oscillators() {
            for contact in [Contact::Impact, Contact::Rigid, Contact::Elastic] {
                let oscillator = Pair { contacts: [contact; 2], ..oscillator.clone() };
                assert!(oscillator.mirror_symmetric());
                let Flow { domains: [_, _, left], walls, h, .. } = constants(&oscillator).flow;
                let Common { substeps, .. } = Common::new(&oscillator, h);
                assert_eq!(left, behind_wall(&oscillator, 1, walls[1], h, substeps[1]));
            }
        }
    }
}
