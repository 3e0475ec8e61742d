//! Random machines, with walls near the amplitudes of their gaps.

use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::model::{
    Contact, Drive, DryFriction, Forces, GapRow, NonlinearSpring, Oscillator, Restitution, Side, Spring,
    Timing, Wall,
};

use super::super::independent::random::Random;

/// Sizes and features of a random machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    pub(crate) coordinates: usize,
    pub(crate) gaps: usize,
    /// Largest number of harmonics.
    pub(crate) harmonics: usize,
    pub(crate) stages: usize,
    /// Largest number of elements with dry friction.
    pub(crate) friction: usize,
    /// Largest number of walls on a side.
    pub(crate) walls: usize,
}

#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) machine: Oscillator,
    /// `(x1, v1, x2, v2, ...)`, with all gaps between their walls.
    pub(crate) start: Vec<f64>,
}

/// A structure that random machines may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Structure {
    Any,
    /// Nothing holds it in one direction. If it is not damped there, its momentum is conserved.
    Drifting {
        is_damped: bool,
    },
    /// It is its own mirror image half a period later.
    Symmetric,
    /// It has so many more gaps, whose rows depend on those of the others.
    Dependent(usize),
}

type Vector = DVector<f64>;
type Matrix = DMatrix<f64>;

/// Least eigenvalue of the Gram matrix of unit rows that are not too close to each other.
const INDEPENDENT: f64 = 0.1;

fn vector(random: &mut Random, n: usize, reach: f64) -> Vector {
    Vector::from_fn(n, |_, _| random.even(reach))
}

/// Returns a positive definite matrix: a chain in which each coordinate is coupled to the next one and to the ground.
fn chain(random: &mut Random, ground: &[f64], coupling: f64) -> Matrix {
    let n = ground.len();
    let mut m = Matrix::from_diagonal(&Vector::from_row_slice(ground));
    for i in 1..n {
        let k = coupling * random.unit() * (ground[i - 1] * ground[i]).sqrt();
        m[(i - 1, i - 1)] += k;
        m[(i, i)] += k;
        m[(i - 1, i)] -= k;
        m[(i, i - 1)] -= k;
    }
    m
}

fn are_independent(rows: &[Vector]) -> bool {
    let unit: Vec<Vector> = rows.iter().map(|row| row.clone().normalize()).collect();
    let gram = Matrix::from_fn(rows.len(), rows.len(), |i, j| unit[i].dot(&unit[j]));
    gram.symmetric_eigenvalues().min() > INDEPENDENT
}

/// Returns a row of one, two or all coordinates.
fn row(random: &mut Random, n: usize) -> Vector {
    let mut row = Vector::zeros(n);
    let first = random.below(n);
    row[first] = if random.chance(0.7) { 1.0 } else { random.between(0.5, 2.0) };
    match random.below(3) {
        0 if n > 1 => row[(first + 1) % n] = -1.0,
        1 if n > 1 && random.chance(0.5) => row += vector(random, n, 0.5),
        _ => {}
    }
    row
}

/// Returns the mean and the amplitude of a gap in motion without walls.
fn reach(machine: &Oscillator, row: &Vector, rest: &Vector) -> [f64; 2] {
    let (n, forces) = (machine.degrees(), &machine.stages[0]);
    let solved = |m: Matrix, f: Vector| m.lu().solve(&f).unwrap_or_else(|| Vector::zeros(f.len()));
    let mean = row.dot(rest);
    let of = |drive: &Drive| {
        let rate = f64::from(drive.order) * machine.omega;
        let (dynamic, damping) = (&forces.stiffness - &machine.mass * (rate * rate), &forces.damping * rate);
        let mut m = Matrix::zeros(2 * n, 2 * n);
        for (at, part) in [((0, 0), &dynamic), ((n, n), &dynamic), ((0, n), &damping), ((n, 0), &-&damping)] {
            m.view_mut(at, (n, n)).copy_from(part);
        }
        let force: Vec<f64> = drive.cos.iter().chain(&drive.sin).copied().collect();
        let x = solved(m, Vector::from_vec(force));
        row.dot(&x.rows(0, n)).hypot(row.dot(&x.rows(n, n)))
    };
    [mean, machine.drives.iter().map(of).sum()]
}

/// Returns the walls on a side, the first one at a distance from the middle. All but the last are elastic.
fn walls(random: &mut Random, machine: &Oscillator, count: usize, at: f64, s: f64, speed: f64) -> Vec<Wall> {
    let mut walls = Vec::new();
    let mut at = at;
    for nth in 0..count {
        let is_last = nth + 1 == count;
        let contact = match random.below(if is_last { 5 } else { 1 }) {
            0 => Contact::Elastic,
            1 => Contact::Pushing,
            2 => Contact::Impact,
            _ => Contact::Rigid,
        };
        let force: f64 = machine.drives.iter().map(|drive| drive.cos.amax()).fold(0.0, f64::max);
        let has_preload = contact.is_elastic() && is_last && random.chance(0.4);
        let spring = Spring {
            stiffness: random.logarithmic(20.0, 1e3),
            damping: if random.chance(0.3) { 0.0 } else { random.logarithmic(0.1, 5.0) },
            preload: has_preload.then(|| random.even(0.3 * force)),
        };
        let of_stage = |random: &mut Random| Spring {
            stiffness: spring.stiffness * random.logarithmic(0.6, 1.6),
            damping: spring.damping * random.logarithmic(0.6, 1.6),
            preload: Some(random.between(0.5, 1.5)).and_then(|factor| Some(spring.preload? * factor)),
        };
        let springs =
            (0..machine.stages.len()).map(|i| if i == 0 { spring } else { of_stage(random) }).collect();
        let restitution = match random.below(8) {
            0 | 1 => Restitution::Constant(0.0),
            2 => Restitution::BySpeed {
                constant: random.between(0.5, 0.95),
                factor: -random.between(0.02, 0.2) / speed.max(0.1),
                power: [0.2, 0.5, 1.0, 2.0][random.below(4)],
            },
            _ => Restitution::Constant(random.between(0.05, 0.9)),
        };
        let mesh_speed = if random.chance(0.4) { 0.0 } else { speed * random.logarithmic(1e-3, 0.3) };
        walls.push(Wall { at, contact, restitution, mesh_speed, springs });
        at += s * random.logarithmic(0.02, 0.5) * speed / machine.omega;
    }
    walls
}

/// Returns the machine of a seed.
pub(crate) fn case(seed: u64, shape: Shape) -> Case {
    case_of(Structure::Any, seed, shape)
}

/// Returns the machine of a seed with a structure.
pub(crate) fn case_of(structure: Structure, seed: u64, shape: Shape) -> Case {
    let is_symmetric = structure == Structure::Symmetric;
    let random = &mut Random(seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ 0x5851_f42d_4c95_7f2d);
    let n = shape.coordinates;
    let masses: Vec<f64> = (0..n).map(|_| random.logarithmic(0.5, 2.0)).collect();
    let stiff: Vec<f64> = masses.iter().map(|mass| mass * random.logarithmic(1.0, 30.0)).collect();
    let damp: Vec<f64> = (masses.iter().zip(&stiff))
        .map(|(mass, stiff)| 2.0 * random.logarithmic(0.02, 0.3) * (mass * stiff).sqrt())
        .collect();
    let mass = if random.chance(0.5) {
        Matrix::from_diagonal(&Vector::from_vec(masses))
    } else {
        chain(random, &masses, 0.5)
    };
    let (stiffness, mut damping) = (chain(random, &stiff, 1.0), chain(random, &damp, 1.0));
    if random.chance(0.15) {
        damping *= -0.2 * random.unit();
    }
    if random.chance(0.3) {
        let skew = Matrix::from_fn(n, n, |_, _| random.even(1.0));
        damping += &skew - skew.transpose();
    }
    let load = if random.chance(0.5) { Vector::zeros(n) } else { vector(random, n, 4.0) };
    let first = Forces { damping, stiffness, load };
    let mut stages = vec![first.clone()];
    for _ in 1..shape.stages {
        let (stiffer, slower) = (random.logarithmic(0.6, 1.6), random.logarithmic(0.6, 1.6));
        stages.push(Forces {
            damping: &first.damping * slower,
            stiffness: &first.stiffness * stiffer,
            load: &first.load + if random.chance(0.5) { Vector::zeros(n) } else { vector(random, n, 4.0) },
        });
    }
    let direction = matches!(structure, Structure::Drifting { .. }).then(|| match random.chance(0.5) {
        true => Vector::from_element(n, 1.0),
        false => Vector::from_fn(n, |_, _| random.between(0.5, 2.0) * [1.0, -1.0][random.below(2)]),
    });
    let across = direction.map(|d| Matrix::identity(n, n) - &d * d.transpose() / d.norm_squared());
    let projected = |x: &Vector| across.as_ref().map_or_else(|| x.clone(), |across| across * x);
    if let Some(across) = &across {
        for Forces { damping, stiffness, load } in &mut stages {
            let free = across * &*stiffness * across;
            *stiffness = 0.5 * (&free + free.transpose());
            if structure == (Structure::Drifting { is_damped: false }) {
                (*damping, *load) = (across * &*damping * across, across * &*load);
            }
        }
    }
    if is_symmetric {
        stages.iter_mut().for_each(|forces| forces.load.fill(0.0));
    }
    let schedule = match shape.stages {
        1 => Vec::new(),
        count if is_symmetric => {
            let mut phases: Vec<f64> = (0..count).map(|_| random.between(0.0, 0.5)).collect();
            phases.sort_by(f64::total_cmp);
            let half =
                |by: f64| phases.iter().enumerate().map(move |(i, phase)| (phase + by, (i + 1) % count));
            half(0.0).chain(half(0.5)).collect()
        }
        count => {
            let mut phases: Vec<f64> = (0..count + random.below(3)).map(|_| random.unit()).collect();
            if random.chance(0.4) {
                phases[0] = 0.0;
            }
            phases.sort_by(f64::total_cmp);
            phases.iter().enumerate().map(|(i, &phase)| (phase, (i + 1) % count)).collect()
        }
    };
    let mut orders: Vec<u32> =
        (1..1 + random.below(shape.harmonics)).map(|_| 2 + random.below(5) as u32).collect();
    orders.push(1);
    orders.sort_unstable();
    orders.dedup();
    orders.retain(|order| !is_symmetric || order % 2 == 1);
    let drive = |order: u32| Drive {
        order,
        cos: vector(random, n, 8.0),
        sin: if random.chance(0.3) { Vector::zeros(n) } else { vector(random, n, 8.0) },
    };
    let drives = orders.into_iter().map(drive).collect();
    let omega = random.logarithmic(0.8, 5.0);
    let mut machine = Oscillator {
        omega,
        mass,
        stages,
        schedule,
        drives,
        gaps: Vec::new(),
        friction: Vec::new(),
        springs: Vec::new(),
        signals: Vec::new(),
        timing: Timing::Forced,
    };
    let mut rows: Vec<Vector> = Vec::new();
    while rows.len() < shape.gaps {
        rows.push(projected(&row(random, n)));
        if rows[rows.len() - 1].norm() < 0.2 || !are_independent(&rows) {
            rows.pop();
        }
    }
    let leading = rows.clone();
    if let Structure::Dependent(more) = structure {
        for _ in 0..more {
            let [a, b] = [0; 2].map(|_| &rows[random.below(rows.len())] * [1.0, -1.0, 0.5][random.below(3)]);
            rows.push(if (&a + &b).norm() > 0.2 { a + b } else { a });
        }
    }
    let forces = &machine.stages[0];
    let rest = match &across {
        None => forces.stiffness.clone().lu().solve(&forces.load).expect("a stiffness"),
        Some(across) => {
            let svd = forces.stiffness.clone().svd(true, true);
            svd.solve(&(across * &forces.load), 1e-9).expect("both factors")
        }
    };
    let mut speeds = 0.0f64;
    for row in &rows {
        let [mean, amplitude] = reach(&machine, row, &rest);
        // Not every gap has a large part in the motion.
        let amplitude = amplitude.max(0.05);
        let speed = amplitude * omega;
        speeds = speeds.max(speed / row.norm());
        let has = [[true, true], [true, true], [true, false], [false, true]][random.below(4)];
        let of = |side: Side| {
            let at = mean + side.sign() * amplitude * random.between(0.15, 0.9);
            let count = if has[side.index()] { 1 + random.below(shape.walls) } else { 0 };
            walls(random, &machine, count, at, side.sign(), speed)
        };
        let mut walls = Side::BOTH.map(of);
        if is_symmetric {
            let from = usize::from(walls[0].is_empty());
            walls[1 - from] = walls[from].iter().map(|wall| Wall { at: -wall.at, ..wall.clone() }).collect();
        }
        machine.gaps.push(GapRow { row: row.clone(), walls });
    }
    add_friction(random, &mut machine, shape.friction, &leading, speeds);
    for friction in &mut machine.friction {
        if structure == (Structure::Drifting { is_damped: false }) {
            friction.row = projected(&friction.row);
        }
        if is_symmetric {
            friction.speed = 0.0;
        }
    }
    machine.friction.retain(|friction| friction.row.norm() > 0.2);
    machine.validate().unwrap_or_else(|error| panic!("{seed}: {error}: {machine:?}"));
    let start =
        (0..2 * n).map(|i| if i % 2 == 0 { rest[i / 2] } else { random.even(0.7 * speeds) }).collect();
    Case { machine, start }
}

/// Adds elements along gap rows, or along rows that are independent of all gap rows.
fn add_friction(random: &mut Random, machine: &mut Oscillator, most: usize, gaps: &[Vector], speed: f64) {
    let n = machine.degrees();
    let force = machine.drives.iter().map(|drive| drive.cos.amax()).fold(0.0, f64::max);
    let mut all = gaps.to_vec();
    let mut free: Vec<&Vector> = gaps.iter().collect();
    for _ in 0..if most > 0 { 1 + random.below(most) } else { 0 } {
        let is_new = all.len() < n && random.chance(0.6);
        let row = if is_new {
            loop {
                let row = row(random, n);
                all.push(row.clone());
                if are_independent(&all) {
                    break row;
                }
                all.pop();
            }
        } else if !free.is_empty() {
            free.swap_remove(random.below(free.len())) * [0.5, 1.0, -1.0][random.below(3)]
        } else {
            return;
        };
        let size = row.norm();
        let (force, speed) = (random.logarithmic(0.02, 0.6) * force / size, speed * size);
        let speed = if random.chance(0.75) { 0.0 } else { random.even(0.5 * speed) };
        machine.friction.push(DryFriction::new(row, force, speed));
    }
}

/// Shapes of all sizes.
const SHAPES: [Shape; 10] = [
    Shape { coordinates: 1, gaps: 1, harmonics: 1, stages: 1, friction: 0, walls: 1 },
    Shape { coordinates: 2, gaps: 1, harmonics: 2, stages: 2, friction: 1, walls: 2 },
    Shape { coordinates: 2, gaps: 2, harmonics: 1, stages: 1, friction: 0, walls: 1 },
    Shape { coordinates: 3, gaps: 2, harmonics: 3, stages: 1, friction: 0, walls: 2 },
    Shape { coordinates: 3, gaps: 3, harmonics: 1, stages: 2, friction: 0, walls: 1 },
    Shape { coordinates: 3, gaps: 1, harmonics: 1, stages: 1, friction: 2, walls: 1 },
    Shape { coordinates: 4, gaps: 2, harmonics: 2, stages: 1, friction: 2, walls: 2 },
    Shape { coordinates: 5, gaps: 3, harmonics: 4, stages: 2, friction: 1, walls: 3 },
    Shape { coordinates: 6, gaps: 3, harmonics: 1, stages: 1, friction: 2, walls: 1 },
    Shape { coordinates: 8, gaps: 3, harmonics: 4, stages: 2, friction: 2, walls: 4 },
];

/// Shapes with more coordinates than gaps.
const STRUCTURED: [Shape; 8] = [
    Shape { coordinates: 2, gaps: 1, harmonics: 1, stages: 1, friction: 0, walls: 1 },
    Shape { coordinates: 2, gaps: 1, harmonics: 2, stages: 2, friction: 0, walls: 2 },
    Shape { coordinates: 2, gaps: 1, harmonics: 1, stages: 1, friction: 2, walls: 1 },
    Shape { coordinates: 3, gaps: 2, harmonics: 3, stages: 1, friction: 1, walls: 2 },
    Shape { coordinates: 3, gaps: 1, harmonics: 1, stages: 2, friction: 1, walls: 1 },
    Shape { coordinates: 4, gaps: 3, harmonics: 1, stages: 1, friction: 0, walls: 1 },
    Shape { coordinates: 5, gaps: 2, harmonics: 2, stages: 2, friction: 0, walls: 2 },
    Shape { coordinates: 8, gaps: 3, harmonics: 4, stages: 2, friction: 1, walls: 2 },
];

/// Returns the shape and the machine of a seed.
pub(crate) fn any_case(seed: u64) -> Case {
    case(seed, SHAPES[(seed % SHAPES.len() as u64) as usize])
}

/// Returns a machine with a light body on dampers, which has overdamped modes.
pub(crate) fn light_case(seed: u64) -> Case {
    let mut case = any_case(seed);
    let (machine, n) = (&mut case.machine, case.start.len() / 2);
    let light = seed as usize % n;
    machine.mass.row_mut(light).scale_mut(0.1);
    machine.mass.column_mut(light).scale_mut(0.1);
    for forces in &mut machine.stages {
        forces.damping[(light, light)] += 2.0;
    }
    case
}

/// Returns the machine of a seed: in turn one that drifts, a symmetric one, and any.
pub(crate) fn structured_case(seed: u64) -> Case {
    let shape = STRUCTURED[(seed / 3 % STRUCTURED.len() as u64) as usize];
    let structures =
        [Structure::Drifting { is_damped: seed.is_multiple_of(2) }, Structure::Symmetric, Structure::Any];
    case_of(structures[(seed % 3) as usize], seed, shape)
}

/// Shapes without their dependent gaps, and the number of these.
const DEPENDENT: [(Shape, usize); 8] = [
    (Shape { coordinates: 1, gaps: 1, harmonics: 1, stages: 1, friction: 0, walls: 1 }, 1),
    (Shape { coordinates: 2, gaps: 2, harmonics: 1, stages: 1, friction: 0, walls: 1 }, 1),
    (Shape { coordinates: 3, gaps: 2, harmonics: 2, stages: 2, friction: 1, walls: 2 }, 1),
    (Shape { coordinates: 3, gaps: 3, harmonics: 1, stages: 1, friction: 0, walls: 1 }, 3),
    (Shape { coordinates: 4, gaps: 4, harmonics: 1, stages: 1, friction: 1, walls: 1 }, 0),
    (Shape { coordinates: 5, gaps: 3, harmonics: 3, stages: 1, friction: 2, walls: 2 }, 2),
    (Shape { coordinates: 6, gaps: 5, harmonics: 1, stages: 2, friction: 0, walls: 2 }, 1),
    (Shape { coordinates: 8, gaps: 6, harmonics: 2, stages: 1, friction: 1, walls: 3 }, 0),
];

/// Returns the machine of a seed with up to six gaps, whose rows may depend on each other.
pub(crate) fn dependent_case(seed: u64) -> Case {
    let (shape, more) = DEPENDENT[(seed % DEPENDENT.len() as u64) as usize];
    case_of(Structure::Dependent(more), seed, shape)
}

/// Returns points of a force that is linear between them, with this number of pieces of lengths around `length`. Few pieces fall.
fn points(random: &mut Random, pieces: usize, first: [f64; 2], length: f64, slope: f64) -> Vec<[f64; 2]> {
    let mut points = vec![first];
    for nth in 1..=pieces {
        let factor = if nth < pieces && random.chance(0.2) { -0.5 * random.unit() } else { 1.0 };
        let (by, slope) =
            (length * random.logarithmic(0.3, 2.0), slope * factor * random.logarithmic(0.1, 3.0));
        let [at, force] = points[nth - 1];
        points.push([at + by, force + slope * by]);
    }
    points
}

/// Gives friction of a machine other forces at rest and at other rates, and some walls a curve, and adds nonlinear springs within the
/// amplitudes of their elongations along rows of gaps, or along any row.
fn bend(random: &mut Random, machine: &mut Oscillator, rest: &Vector, has_any_row: bool) {
    let (omega, is_symmetric) = (machine.omega, machine.mirror_symmetric());
    let reaches: Vec<[f64; 2]> = machine.gaps.iter().map(|gap| reach(machine, &gap.row, rest)).collect();
    let most = reaches.iter().map(|reach| reach[1]).fold(0.05, f64::max);
    for friction in &mut machine.friction {
        if random.chance(0.7) {
            friction.static_force *= random.between(1.0, 2.0);
        }
        let mut rate = 0.0;
        for _ in 0..random.below(4) {
            rate += most * omega * friction.row.norm() * random.logarithmic(0.03, 0.6);
            friction.at_speed.push([rate, friction.force * random.logarithmic(0.2, 3.0)]);
        }
    }
    for _ in 0..random.below(3) {
        let row = match has_any_row && random.chance(0.5) {
            true => row(random, machine.degrees()),
            false => machine.gaps[random.below(machine.gaps.len())].row.clone(),
        };
        let ([mean, amplitude], row) = (reach(machine, &row, rest), &row);
        let stiffness = row.dot(&(&machine.stages[0].stiffness * row)) / row.norm_squared().powi(2);
        let pieces = 1 + random.below(6);
        let length = 2.0 * amplitude.max(0.05) * random.between(0.7, 1.5) / pieces as f64;
        let first = [mean - 0.5 * length * pieces as f64, random.even(0.2) * stiffness * amplitude];
        let slope = stiffness * random.logarithmic(0.1, 2.0);
        let mut points = points(random, pieces, first, length, slope);
        if is_symmetric {
            let last = points[pieces];
            points.iter_mut().for_each(|point| (0..2).for_each(|i| point[i] -= last[i]));
            let mirrored: Vec<[f64; 2]> =
                points.iter().rev().skip(1).map(|point| point.map(|x| -x)).collect();
            points.extend(mirrored);
        }
        let factor = if is_symmetric || random.chance(0.5) { 1.0 } else { -1.0 };
        machine.springs.push(NonlinearSpring { row: row * factor, points, wall: None });
    }
    for (gap, reach) in reaches.iter().enumerate() {
        let bent = [0, 1].map(|_| random.chance(0.7));
        let (depth, slope) = (reach[1].max(0.05), random.logarithmic(10.0, 300.0));
        let pieces = 1 + random.below(6);
        let length = depth * random.logarithmic(0.02, 0.3);
        let force = points(random, pieces, [0.0, 0.0], length, slope);
        let pulls = random.chance(0.7);
        for side in Side::BOTH {
            let GapRow { row, walls } = &mut machine.gaps[gap];
            let Some(wall) = walls[side.index()].last_mut() else { continue };
            if !wall.contact.is_elastic() || !bent[if is_symmetric { 0 } else { side.index() }] {
                continue;
            }
            let pulls = pulls && force.iter().all(|point| point[1] >= 0.0);
            wall.contact = if pulls { Contact::Elastic } else { Contact::Pushing };
            wall.springs.iter_mut().for_each(|spring| (spring.stiffness, spring.preload) = (0.0, None));
            let points = force.iter().map(|[at, force]| [side.sign() * wall.at + at, *force]).collect();
            let wall = Some((gap, side));
            machine.springs.push(NonlinearSpring { row: &*row * side.sign(), points, wall });
        }
    }
    assert_eq!(machine.mirror_symmetric(), is_symmetric);
}

/// Returns the machine of a seed, with forces that are curves. Some have no drive.
pub(crate) fn bent_case(seed: u64) -> Case {
    let mut case = bent(any_case(seed), seed, true);
    if seed % 16 == 1 {
        case.machine.drives.clear();
    }
    case
}

/// Returns the machine of a seed, with forces that are curves: in turn one that drifts, a symmetric one, and any.
pub(crate) fn bent_structured_case(seed: u64) -> Case {
    bent(structured_case(seed), seed, false)
}

fn bent(mut case: Case, seed: u64, has_any_row: bool) -> Case {
    let rest = Vector::from_fn(case.machine.degrees(), |i, _| case.start[2 * i]);
    bend(&mut Random(seed ^ 0x6e5_1d3b), &mut case.machine, &rest, has_any_row);
    case.machine.validate().unwrap_or_else(|error| panic!("{seed}: {error}: {:?}", case.machine));
    case
}

/// Returns the largest difference of two states relative to the larger state, with velocities divided by a rate.
pub(crate) fn apart(a: &[f64], b: &[f64], rate: f64) -> f64 {
    let scale = |i: usize| if i.is_multiple_of(2) { 1.0 } else { 1.0 / rate };
    let most = |of: &dyn Fn(usize) -> f64| (0..a.len()).map(|i| scale(i) * of(i).abs()).fold(0.0, f64::max);
    let off = most(&|i| a[i] - b[i]);
    if off == 0.0 { 0.0 } else { off / most(&|i| a[i]).max(most(&|i| b[i])) }
}
