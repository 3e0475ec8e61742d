//! Linear motion of one degree of freedom in closed form, and oscillators with walls.

use rattlemap_dynamics::model::{Contact, Domain, Harmonic, Oscillator, Pair, Side, Stage};

/// `x'' + 2 gamma x' + square x = force cos(omega t) + load`, not critically damped.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Linear {
    pub(crate) gamma: f64,
    pub(crate) square: f64,
    pub(crate) force: f64,
    pub(crate) load: f64,
    pub(crate) omega: f64,
}

impl Linear {
    /// Returns amplitude and phase lag of the steady response.
    pub(crate) fn response(&self) -> [f64; 2] {
        let (real, imaginary) = (self.square - self.omega * self.omega, 2.0 * self.gamma * self.omega);
        [self.force / real.hypot(imaginary), imaginary.atan2(real)]
    }

    /// Returns displacement and velocity of the steady response.
    pub(crate) fn steady(&self, t: f64) -> [f64; 2] {
        let [amplitude, lag] = self.response();
        let (sin, cos) = (self.omega * t - lag).sin_cos();
        [self.load / self.square + amplitude * cos, -self.omega * amplitude * sin]
    }

    /// Returns the fundamental matrix of free motion over a time `tau`, by rows.
    pub(crate) fn fundamental(&self, tau: f64) -> [[f64; 2]; 2] {
        let split = self.square - self.gamma * self.gamma;
        let own = split.abs().sqrt();
        let angle = own * tau;
        let (sin, cos) = if split > 0.0 { angle.sin_cos() } else { (angle.sinh(), angle.cosh()) };
        let (decay, lean) = ((-self.gamma * tau).exp(), self.gamma / own * sin);
        [[decay * (cos + lean), decay * sin / own], [-decay * self.square / own * sin, decay * (cos - lean)]]
    }

    /// Returns the state a time `tau` after the state at the time `t`.
    pub(crate) fn flow(&self, [x, v]: [f64; 2], t: f64, tau: f64) -> [f64; 2] {
        let ([p, q], [p_end, q_end]) = (self.steady(t), self.steady(t + tau));
        let [[a, b], [c, d]] = self.fundamental(tau);
        let (x, v) = (x - p, v - q);
        [p_end + a * x + b * v, q_end + c * x + d * v]
    }

    pub(crate) fn acceleration(&self, [x, v]: [f64; 2], t: f64) -> f64 {
        self.force * (self.omega * t).cos() + self.load - 2.0 * self.gamma * v - self.square * x
    }

    /// Returns the oscillator of one degree of freedom and unit mass, without walls.
    pub(crate) fn oscillator(&self) -> Pair {
        let first = |value: f64| [[value, 0.0], [0.0, 0.0]];
        let free = Domain {
            damping: first(2.0 * self.gamma),
            stiffness: first(self.square),
            load: [self.load, 0.0],
        };
        Pair { omega: self.omega, force: [self.force, 0.0], ..unforced(1, free) }
    }
}

/// Returns an oscillator of unit masses without force and walls. Its gap is the first displacement.
pub(crate) fn unforced(degrees: usize, free: Domain) -> Pair {
    Pair {
        degrees,
        mass: [[1.0, 0.0], [0.0, 1.0]],
        gap: [1.0, 0.0],
        walls: [f64::INFINITY, f64::NEG_INFINITY],
        contacts: [Contact::Rigid; 2],
        omega: 1.0,
        force: [0.0; 2],
        force_sin: [0.0; 2],
        harmonics: Vec::new(),
        stages: Vec::new(),
        schedule: Vec::new(),
        free,
        meshing: [free; 2],
    }
}

pub(crate) fn product(a: [[f64; 2]; 2], b: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j]))
}

/// Returns trace and determinant of a matrix.
pub(crate) fn invariants([[a, b], [c, d]]: [[f64; 2]; 2]) -> [f64; 2] {
    [a + d, a * d - b * c]
}

/// Returns trace and determinant of a matrix with these two eigenvalues.
pub(crate) fn invariants_of(multipliers: &[[f64; 2]]) -> [f64; 2] {
    let [[a, b], [c, d]] = multipliers else { panic!("not two eigenvalues: {multipliers:?}") };
    [a + c, a * c - b * d]
}

/// Returns an oscillator with other domains and forces, in all stages and harmonics.
pub(crate) fn transformed(
    o: &Pair,
    domain: impl Fn(&Domain) -> Domain,
    force: impl Fn([f64; 2]) -> [f64; 2],
) -> Pair {
    let both = |meshing: &[Domain; 2]| [domain(&meshing[0]), domain(&meshing[1])];
    let stage = |stage: &Stage| Stage { free: domain(&stage.free), meshing: both(&stage.meshing) };
    let harmonic = |h: &Harmonic| Harmonic { cos: force(h.cos), sin: force(h.sin), ..*h };
    Pair {
        force: force(o.force),
        force_sin: force(o.force_sin),
        free: domain(&o.free),
        meshing: both(&o.meshing),
        harmonics: o.harmonics.iter().map(harmonic).collect(),
        stages: o.stages.iter().map(stage).collect(),
        ..o.clone()
    }
}

/// Adds a wall to an oscillator, with a spring and a damper along the gap row behind it.
pub(crate) fn with_wall(
    oscillator: Pair,
    side: Side,
    at: f64,
    contact: Contact,
    [stiffness, damping]: [f64; 2],
) -> Pair {
    let ([g0, g1], free) = (oscillator.gap, oscillator.free);
    let along = [[g0 * g0, g0 * g1], [g0 * g1, g1 * g1]];
    let plus = |matrix: [[f64; 2]; 2], added: f64| -> [[f64; 2]; 2] {
        std::array::from_fn(|i| std::array::from_fn(|j| matrix[i][j] + added * along[i][j]))
    };
    let mut walled = oscillator;
    let i = usize::from(side == Side::Left);
    walled.walls[i] = at;
    walled.contacts[i] = contact;
    walled.meshing[i] = Domain {
        damping: plus(free.damping, damping),
        stiffness: plus(free.stiffness, stiffness),
        load: [free.load[0] + stiffness * at * g0, free.load[1] + stiffness * at * g1],
    };
    walled
}

/// Replaces the law of the first wall on a side, and its preload in the first stage.
pub(crate) fn with_law(mut o: Oscillator, side: Side, contact: Contact, preload: Option<f64>) -> Oscillator {
    let wall = &mut o.gaps[0].walls[side.index()][0];
    (wall.contact, wall.springs[0].preload) = (contact, preload);
    o
}
