//! Random models of one or two coordinates with one gap.

use nalgebra::DVector;
use rattlemap_dynamics::model::{
    Contact, Domain, DryFriction, Harmonic, Law, Oscillator, Pair, Restitution, Side, Spring, Stage, Wall,
};

use super::super::machines::random::Case;
use crate::common::linear::{unforced, with_wall};
use crate::common::pairs::described;

/// A reproducible sequence of numbers: SplitMix64.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn chance(&mut self, share: f64) -> bool {
        self.unit() < share
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub(crate) fn even(&mut self, reach: f64) -> f64 {
        self.between(-reach, reach)
    }

    pub(crate) fn logarithmic(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    pub(crate) fn below(&mut self, count: usize) -> usize {
        (self.unit() * count as f64) as usize
    }
}

/// Features of a random model that a plain one lacks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    pub(crate) harmonics: bool,
    pub(crate) stages: bool,
    /// Further walls behind elastic ones.
    pub(crate) walls: bool,
    /// Elastic walls with a preload. Most of them only push.
    pub(crate) pushing: bool,
    /// Dry friction, and sometimes no walls.
    pub(crate) friction: bool,
    /// Wide ranges: any signs of damping and stiffness, skew damping, very large and very small rates.
    pub(crate) wide: bool,
}

/// A model with nothing but a force of one harmonic and at most one wall on a side.
pub(crate) const PLAIN: Shape =
    Shape { harmonics: false, stages: false, walls: false, pushing: false, friction: false, wide: false };

type Matrix = [[f64; 2]; 2];

/// Returns a symmetric matrix with this diagonal, positive if the diagonal is.
fn symmetric(random: &mut Random, [a, b]: [f64; 2]) -> Matrix {
    let coupling = if random.chance(0.5) { random.even(0.7) * (a * b).abs().sqrt() } else { 0.0 };
    [[a, coupling], [coupling, b]]
}

fn times(m: Matrix, factor: f64) -> Matrix {
    m.map(|row| row.map(|x| factor * x))
}

/// Returns the model of a seed.
pub(crate) fn case(seed: u64, shape: Shape) -> Case {
    let random = &mut Random(seed.wrapping_mul(0x2545_f491_4f6c_dd1d));
    let is_single = random.chance(0.5);
    let rates = if shape.wide { random.logarithmic(0.03, 30.0) } else { 1.0 };
    let masses = [random.logarithmic(0.5, 2.0), random.logarithmic(0.5, 2.0)];
    let stiff = [0, 1].map(|i| masses[i] * random.logarithmic(1.0, 40.0) * rates * rates);
    let ratio = [random.logarithmic(0.04, 0.4), random.logarithmic(0.04, 0.4)];
    let damp = [0, 1].map(|i| 2.0 * ratio[i] * (masses[i] * stiff[i]).sqrt());
    let mass = symmetric(random, masses);
    let (mut stiffness, mut damping) = (symmetric(random, stiff), symmetric(random, damp));
    if shape.wide {
        if random.chance(0.2) {
            damping = times(damping, -random.logarithmic(1e-3, 1.0));
        } else if random.chance(0.2) {
            damping = times(damping, random.logarithmic(1.0, 30.0));
        }
        if random.chance(0.2) {
            stiffness[0][0] *= -random.logarithmic(0.01, 1.0);
        }
        if random.chance(0.3) {
            let skew = random.even(2.0 * damp[0]);
            (damping[0][1], damping[1][0]) = (damping[0][1] + skew, damping[1][0] - skew);
        }
    }
    let omega = random.logarithmic(0.8, 5.0) * if shape.wide { random.logarithmic(0.01, 10.0) } else { 1.0 };
    let gap = match random.below(3) {
        0 => [1.0, -1.0],
        1 if !is_single => [0.0, random.between(1.0, 2.0)],
        _ => [random.between(1.0, 2.0), random.even(2.0)],
    };
    let none = [0.0; 2];
    let pair = |random: &mut Random, reach: f64| [random.even(reach), random.even(reach)];
    let load = if random.chance(0.4) { none } else { pair(random, 6.0) };
    let free = Domain { damping, stiffness, load };
    let contact = |random: &mut Random| [Contact::Impact, Contact::Rigid, Contact::Elastic][random.below(3)];
    let behind = |random: &mut Random| {
        let k = random.logarithmic(20.0, if shape.wide { 1e5 } else { 1e3 });
        [k, if random.chance(0.3) { 0.0 } else { random.logarithmic(0.1, 5.0) }]
    };
    let [right, left] = [random.between(0.05, 0.8), -random.between(0.05, 0.8)];
    let walls = match random.below(4) {
        0 => [right, f64::NEG_INFINITY],
        1 => [f64::INFINITY, left],
        _ => [right, left],
    };
    let mut oscillator = Pair {
        mass,
        gap,
        walls,
        contacts: [contact(random), contact(random)],
        omega,
        force: pair(random, 10.0),
        force_sin: if random.chance(0.5) { none } else { pair(random, 10.0) },
        ..unforced(2, free)
    };
    if shape.harmonics {
        let count = 1 + random.below(4);
        let highest = if random.chance(0.1) { 24 } else { 8 };
        let mut orders: Vec<u32> = (0..count).map(|_| 2 + random.below(highest - 1) as u32).collect();
        orders.sort_unstable();
        orders.dedup();
        let harmonic = |random: &mut Random, order| {
            let (cos, sin) = (pair(random, 8.0), pair(random, 8.0));
            Harmonic { order, cos, sin: if random.chance(0.3) { none } else { sin } }
        };
        oscillator.harmonics = orders.into_iter().map(|order| harmonic(random, order)).collect();
    }
    if is_single {
        single(&mut oscillator);
    }
    let first = [behind(random), behind(random)];
    let plain = oscillator.clone();
    let walled = |free: Domain, behind: [[f64; 2]; 2]| {
        let of_stage = Pair { free, meshing: [free; 2], ..plain.clone() };
        Side::BOTH.into_iter().filter(|side| walls[side.index()].is_finite()).fold(of_stage, |o, side| {
            with_wall(o, side, walls[side.index()], plain.contacts[side.index()], behind[side.index()])
        })
    };
    oscillator = walled(oscillator.free, first);
    if shape.stages {
        for _ in 0..1 + random.below(3) {
            let factors = [random.logarithmic(0.5, 2.0), random.logarithmic(0.6, 2.5)];
            let moved = if random.chance(0.3) { none } else { pair(random, 15.0) };
            let Domain { damping, stiffness, load, .. } = oscillator.free;
            let load = [load[0] + moved[0], if is_single { 0.0 } else { load[1] + moved[1] }];
            let (damping, stiffness) = (times(damping, factors[1]), times(stiffness, factors[0]));
            let stage = walled(
                Domain { damping, stiffness, load },
                first.map(|[k, c]| [k * factors[1], c * factors[0]]),
            );
            oscillator.stages.push(Stage { free: stage.free, meshing: stage.meshing });
        }
        let mut phases: Vec<f64> = (0..2 + random.below(4)).map(|_| random.unit()).collect();
        if random.chance(0.4) {
            phases[0] = 0.0;
        }
        phases.sort_by(f64::total_cmp);
        let count = oscillator.stage_count();
        oscillator.schedule = phases.iter().enumerate().map(|(i, &phase)| (phase, (i + 1) % count)).collect();
    }
    let mut machine = described(&oscillator, Law::both(0.0, 0.0));
    if shape.walls {
        add_walls(random, &mut machine);
    }
    if shape.pushing {
        preload_walls(random, &mut machine);
    }
    if shape.friction {
        add_friction(random, &mut machine);
    }
    machine.validate().unwrap_or_else(|error| panic!("{error}: {machine:?}"));
    let restitution = [0; 2].map(|_| if random.chance(0.25) { 0.0 } else { random.between(0.0, 0.9) });
    // Without a mesh speed, impacts can be infinitely many.
    let mesh_speed =
        restitution.map(|e| if e == 0.0 && random.chance(0.3) { 0.0 } else { random.logarithmic(0.01, 2.0) });
    for (i, walls) in machine.gaps[0].walls.iter_mut().enumerate() {
        for wall in walls {
            (wall.restitution, wall.mesh_speed) = (Restitution::Constant(restitution[i]), mesh_speed[i]);
        }
    }
    // The gap is half of the nearer wall.
    let inside = 0.5 * if walls[0].is_finite() { walls[0] } else { walls[1] };
    let mut start = vec![0.0, random.even(1.0), 0.0, random.even(1.0)];
    let other = oscillator.other();
    start[2 * (1 - other)] = inside / oscillator.gap[1 - other];
    start.truncate(2 * machine.degrees());
    Case { machine, start }
}

/// Adds one to three walls behind each wall, or behind one of them. All but the last of a side become elastic.
fn add_walls(random: &mut Random, o: &mut Oscillator) {
    let only = random.below(3);
    let stages = o.stages.len();
    for i in 0..2 {
        if o.gaps[0].walls[i].is_empty() || only == i && !o.gaps[0].walls[1 - i].is_empty() {
            continue;
        }
        let walls = &mut o.gaps[0].walls[i];
        let last = walls[0].clone();
        walls[0].contact = Contact::Elastic;
        let mut at = last.at;
        let count = 1 + random.below(3);
        for nth in 0..count {
            at += Side::BOTH[i].sign() * random.logarithmic(0.01, 0.5);
            let spring = |_| Spring {
                stiffness: random.logarithmic(20.0, 1e3),
                damping: if random.chance(0.3) { 0.0 } else { random.logarithmic(0.1, 5.0) },
                preload: None,
            };
            let springs = (0..stages).map(spring).collect();
            let contact = if nth + 1 == count { last.contact } else { Contact::Elastic };
            walls.push(Wall { at, contact, springs, ..last.clone() });
        }
    }
}

/// Makes the last wall of each side elastic, unless it is rigid. Most walls only push, and most have a preload.
fn preload_walls(random: &mut Random, o: &mut Oscillator) {
    for wall in o.gaps[0].walls.iter_mut().filter_map(|walls| walls.last_mut()) {
        let contact = if random.chance(0.8) { Contact::Pushing } else { Contact::Elastic };
        let sizes = [random.even(4.0), random.even(4.0)];
        let has_preload = random.chance(0.7);
        if wall.contact != Contact::Rigid {
            wall.contact = contact;
            for (stage, spring) in wall.springs.iter_mut().enumerate().filter(|_| has_preload) {
                spring.preload = Some(sizes[stage % 2]);
            }
        }
    }
}

/// Adds one element with dry friction, or two, and sometimes removes the walls.
fn add_friction(random: &mut Random, o: &mut Oscillator) {
    if random.chance(0.15) {
        o.gaps[0].walls = Default::default();
    }
    let (n, gap) = (o.degrees(), o.gap_row(0));
    let amplitude = o.drives.iter().map(|drive| drive.cos.amax().max(drive.sin.amax())).fold(0.0, f64::max);
    let mut last = o.gaps[0].walls.iter().filter_map(|walls| walls.last());
    let is_double = n == 2 && !last.any(|wall| wall.contact == Contact::Rigid) && random.chance(0.5);
    for _ in 0..1 + usize::from(is_double) {
        let mut row = match random.below(3) {
            0 => {
                let factor = [0.5, 1.0, -1.0][random.below(3)];
                [factor * gap[0], factor * gap[1]]
            }
            1 => [[1.0, 0.0], [0.0, 1.0]][random.below(n)],
            _ => [random.between(0.5, 2.0), if n == 2 { random.even(2.0) } else { 0.0 }],
        };
        if let Some((a, b)) = o.friction.first().map(|first| (first.row[0], first.row[1]))
            && (a * row[1] - b * row[0]).abs() < 0.2 * a.hypot(b) * row[0].hypot(row[1])
        {
            row = [-b, a];
        }
        let size = row[0].hypot(row[1]);
        let force = random.logarithmic(0.02, 0.8) * amplitude / size;
        let speed = if random.chance(0.75) { 0.0 } else { random.even(1.0) * size };
        o.friction.push(DryFriction::new(DVector::from_row_slice(&row[..n]), force, speed));
    }
}

/// Removes the second coordinate.
fn single(o: &mut Pair) {
    let first = |m: Matrix| [[m[0][0], 0.0], [0.0, 0.0]];
    let Domain { damping, stiffness, load, .. } = o.free;
    o.degrees = 1;
    o.mass = [[o.mass[0][0], 0.0], [0.0, 1.0]];
    o.gap[1] = 0.0;
    o.free = Domain { damping: first(damping), stiffness: first(stiffness), load: [load[0], 0.0] };
    (o.force[1], o.force_sin[1]) = (0.0, 0.0);
    for harmonic in &mut o.harmonics {
        (harmonic.cos[1], harmonic.sin[1]) = (0.0, 0.0);
    }
}
