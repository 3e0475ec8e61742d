//! Random oscillators of every kind, by seed.

use crate::common::linear::unforced;
use rattlemap_dynamics::model::{Contact, Domain, Law, Pair, State, state};

/// SplitMix64 (Steele, Lea, Flood 2014).
pub(crate) struct Numbers(pub(crate) u64);

impl Numbers {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.next() >> 11) as f64 / (1u64 << 53) as f64)
    }

    pub(crate) fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.next() as usize % all.len()]
    }

    /// Returns a symmetric positive definite matrix of about the size `scale`.
    fn definite(&mut self, scale: f64) -> [[f64; 2]; 2] {
        let [a, b] = [self.between(0.3, 1.5), self.between(0.3, 1.5)];
        let c = self.one_of(&[0.0, 0.6]) * self.between(-1.0, 1.0) * (a * b).sqrt();
        [[scale * a, scale * c], [scale * c, scale * b]]
    }
}

/// Returns an oscillator with its law and a start. It has one or two displacements; one wall or two, each of any kind
/// with a law of its own; loads; full mass matrices; gap rows of which either entry may be the larger.
pub(crate) fn random_cell(seed: u64) -> (Pair, Law, State) {
    let mut draw = Numbers(seed);
    let degrees = draw.one_of(&[1, 2, 2]);
    let first = |m: [[f64; 2]; 2]| if degrees == 1 { [[m[0][0], 0.0], [0.0, 0.0]] } else { m };
    let mut mass = draw.definite(2.0);
    let mut gap = [draw.one_of(&[1.0, -1.0]) * draw.between(0.2, 1.5), draw.between(-1.5, 1.5)];
    let mut force = [draw.between(2.0, 8.0), draw.one_of(&[0.0, 1.0]) * draw.between(-3.0, 3.0)];
    let mut load = [0.0; 2].map(|_: f64| draw.one_of(&[0.0, 1.0]) * draw.between(-2.0, 2.0));
    let free =
        Domain { damping: first(draw.definite(0.6)), stiffness: first(draw.definite(6.0)), load: [0.0; 2] };
    if degrees == 1 {
        mass = [[mass[0][0], 0.0], [0.0, 1.0]];
        (gap[1], force[1], load[1]) = (0.0, 0.0, 0.0);
    }
    let free = Domain { load, ..free };
    let mut walls = [draw.between(0.1, 0.6), -draw.between(0.1, 0.6)];
    match draw.next() % 4 {
        0 => walls[0] = f64::INFINITY,
        1 => walls[1] = f64::NEG_INFINITY,
        _ => {}
    }
    let contacts = [0; 2].map(|_| draw.one_of(&[Contact::Impact, Contact::Rigid, Contact::Elastic]));
    let meshing = [0, 1].map(|side: usize| {
        let (k, c) = (draw.between(10.0, 400.0), draw.one_of(&[0.0, 1.0]) * draw.between(0.0, 4.0));
        // Rigid walls have no meshing domain.
        if contacts[side] == Contact::Rigid || walls[side].is_infinite() {
            return free;
        }
        let along = |a: [[f64; 2]; 2], by: f64| {
            [0, 1].map(|i: usize| [0, 1].map(|j: usize| a[i][j] + by * (gap[i] * gap[j])))
        };
        Domain {
            damping: along(free.damping, c),
            stiffness: along(free.stiffness, k),
            load: [0, 1].map(|i: usize| free.load[i] + k * walls[side] * gap[i]),
        }
    });
    let law = Law {
        restitution: [0; 2].map(|_| draw.one_of(&[0.0, 0.3, 0.5, 0.8])),
        mesh_speed: contacts.map(|contact| match contact {
            Contact::Rigid => draw.one_of(&[0.0, 0.0, 0.1]),
            Contact::Impact | Contact::Elastic | Contact::Pushing => 0.02,
        }),
    };
    let omega = draw.between(0.6, 4.0);
    let force_sin = [0.0; 2];
    let oscillator =
        Pair { mass, gap, walls, contacts, omega, force, force_sin, meshing, ..unforced(degrees, free) };
    let mut start = [0; 4].map(|_| draw.between(-0.4, 0.4));
    if degrees == 1 {
        start[2..].fill(0.0);
    }
    (oscillator, law, state(&start))
}
