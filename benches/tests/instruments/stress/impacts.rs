//! Momentum and energy at impacts: how well rounded numbers obey equation (22).
//!
//! A contact conserves the momentum `m1 v1 + m2 v2` and dissipates the energy `(1 - e^2) m1 m2 / (m1 + m2) w^2 / 2`. Engines
//! store the rates `w = v1 - v2` and `v2`, so they know the velocity of gear 1 to a rounding of `|w| + |v2|`. For a heavy
//! gear 1 that hardly moves this is less precise than a rounding of its own velocity. Deviations are given in unit
//! roundoffs of the engine, relative to `m1 (|w| + |v2|) + m2 |v2|` and `m1 (|w| + |v2|)^2 + m2 v2^2`. The reference reports
//! the states at every event. Lanes run a variant of the shader that ends at the first contact and returns the velocities
//! before and after.

use rayon::prelude::*;

use super::cells::{EngineName, flow_of, paper};
use super::lanes::{Lanes, Start};
use super::readout::{self, Contact};
use super::{Checks, SEED};
use rattlemap::gpu::LaneSettings;
use rattlemap::map::random::Random;
use rattlemap::record::distance::farther;
use rattlemap_dynamics::model::{GearPair, State, state};
use rattlemap_dynamics::motion::{GapEvent, Observer, States, Trajectory};
use rattlemap_dynamics::pair::Gap;

/// Restitutions and masses of the two gears.
const RESTITUTIONS: [f64; 7] = [0.0, 0.06, 0.3, 0.605, 0.9, 0.999, 1.0];
const MASSES: [[f64; 2]; 5] = [[2.0, 1.0], [1.0, 1.0], [0.3, 7.0], [1e-3, 1e3], [1e3, 1e-3]];

/// Largest allowed deviation in unit roundoffs. A state has four numbers, and the law takes about ten operations.
const ROUNDINGS: f64 = 16.0;

/// Forcing periods of the reference, and starts of lanes, per pair.
const PERIODS: u32 = 200;
const STARTS: usize = 64;

/// Collects the largest deviations of a pair on one engine, in unit roundoffs.
struct Worst<'p> {
    pair: &'p GearPair,
    engine: EngineName,
    contacts: u64,
    momentum: f64,
    energy: f64,
}

impl Worst<'_> {
    fn new(pair: &GearPair, engine: EngineName) -> Worst<'_> {
        Worst { pair, engine, contacts: 0, momentum: 0.0, energy: 0.0 }
    }

    /// Requires that there are contacts and that both laws hold to rounding.
    fn compare(&self, checks: &mut Checks) {
        let GearPair { e, m1, m2, .. } = *self.pair;
        let what = |what: &str| format!("{:?}, e = {e}, masses {m1} and {m2}, {what}", self.engine);
        checks.require(self.contacts > 0, what("no contact"));
        checks.add(self.momentum, ROUNDINGS, what("momentum"));
        checks.add(self.energy, ROUNDINGS, what("energy"));
    }

    /// Adds a contact with these rates `[w, v2]` before and after.
    fn add(&mut self, before: [f64; 2], after: [f64; 2]) {
        let GearPair { e, m1, m2, .. } = *self.pair;
        let unit = self.engine.unit_roundoff();
        let momentum = |[w, v2]: [f64; 2]| m1 * (w + v2) + m2 * v2;
        // The functions below return twice the energy.
        let energy = |[w, v2]: [f64; 2]| m1 * (w + v2) * (w + v2) + m2 * v2 * v2;
        let moduli = |rates: [f64; 2]| rates.map(f64::abs);
        let law = (1.0 - e * e) * (m1 * m2 / (m1 + m2)) * before[0] * before[0];
        let momentum_error =
            (momentum(after) - momentum(before)).abs() / (momentum(moduli(before)) + momentum(moduli(after)));
        let energy_error =
            (energy(before) - energy(after) - law).abs() / (energy(moduli(before)) + energy(moduli(after)));
        self.momentum = farther(self.momentum, momentum_error / unit);
        self.energy = farther(self.energy, energy_error / unit);
        self.contacts += 1;
    }
}

impl Observer for Worst<'_> {
    fn event(&mut self, event: &GapEvent, _: States<'_>) {
        let rates = |q: &Gap| [q[1], q[3]];
        // The end of meshing does not change the state.
        if event.before[1] != event.after[1] {
            self.add(rates(&event.before), rates(&event.after));
        }
    }
}

/// Compares contacts of every pair on every engine.
pub(super) fn check(lanes: &mut Lanes) -> Checks {
    let mut checks = Checks::default();
    let pairs: Vec<GearPair> = MASSES
        .iter()
        .flat_map(|&[m1, m2]| RESTITUTIONS.map(|e| GearPair { m1, m2, ..paper(e, 5.6) }))
        .collect();
    pairs
        .par_iter()
        .map(on_reference)
        .collect::<Vec<_>>()
        .iter()
        .for_each(|worst| worst.compare(&mut checks));
    let mut random = Random::new(SEED);
    let starts: Vec<Start> = pairs
        .iter()
        .flat_map(|pair| std::iter::repeat_n(*pair, STARTS))
        .map(|pair| (pair, closing(&pair, &mut random)))
        .collect();
    lanes.rewrite(readout::first_contact);
    for precision in lanes.precisions() {
        let records = lanes.run(precision, &starts, &LaneSettings::only(1));
        let of_pair = starts.chunks(STARTS).zip(records.chunks(STARTS));
        for (pair, (starts, records)) in pairs.iter().zip(of_pair) {
            let mut worst = Worst::new(pair, precision.into());
            for (start, record) in starts.iter().zip(records) {
                if let Some(Contact { w, v2 }) = readout::contact(start, record, None) {
                    worst.add([w[0], v2[0]], [w[1], v2[1]]);
                }
            }
            worst.compare(&mut checks);
        }
    }
    lanes.rewrite(readout::whole);
    checks
}

fn on_reference(pair: &GearPair) -> Worst<'_> {
    let flow = flow_of(pair);
    let mut worst = Worst::new(pair, EngineName::Reference);
    let mut trajectory = Trajectory::new(&flow, pair.law(), state(&[0.0, 1.0, 0.0, -1.0]));
    for _ in 0..PERIODS {
        trajectory.advance_period(&mut worst).expect("an ordinary motion");
    }
    worst
}

/// Returns a start between the walls that soon reaches one of them.
fn closing(pair: &GearPair, random: &mut Random) -> State {
    let mut number = |low: f64, high: f64| low + (high - low) * random.unit();
    let (gap, speed) = (number(-0.9, 0.9) * pair.b, number(1.0, 6.0));
    let (x2, v2) = (number(-1.0, 1.0), number(-3.0, 3.0));
    let w = if number(0.0, 1.0) < 0.5 { speed } else { -speed };
    state(&[gap + x2, w + v2, x2, v2])
}
