//! Momentum and energy at impacts: how well rounded numbers obey equation (22).
//!
//! A contact conserves the momentum `m1 v1 + m2 v2` and dissipates the energy `(1 - e^2) m1 m2 / (m1 + m2) w^2 / 2`. Engines
//! store the rates `w = v1 - v2` and `v2`, so they know the velocity of gear 1 to a rounding of `|w| + |v2|`. For a heavy
//! gear 1 that hardly moves this is less precise than a rounding of its own velocity. Deviations are given in unit
//! roundoffs of the engine, relative to `m1 (|w| + |v2|) + m2 |v2|` and `m1 (|w| + |v2|)^2 + m2 v2^2`. The reference reports
//! the states at every event. Lanes run a variant of the shader that ends at the first contact and returns the velocities
//! before and after.

use rayon::prelude::*;
use serde::Serialize;

use super::cells::{EngineName, flow_of, paper};
use super::lanes::{Lanes, Start};
use super::readout::{self, Contact};
use super::{Size, Verdict};
use rattlemap::gpu::{GpuError, LaneSettings};
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

/// The largest deviations of one pair on one engine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The engine.
    pub engine: EngineName,
    /// Restitution.
    pub e: f64,
    /// Mass of gear 1.
    pub m1: f64,
    /// Mass of gear 2.
    pub m2: f64,
    /// Number of contacts.
    pub contacts: u64,
    /// Largest change of momentum, in unit roundoffs.
    pub momentum_error: f64,
    /// Largest deviation of the dissipated energy, in unit roundoffs.
    pub energy_error: f64,
}

/// Collects the largest deviations of a pair.
struct Worst<'p> {
    pair: &'p GearPair,
    row: Row,
}

impl Worst<'_> {
    fn new(pair: &GearPair, engine: EngineName) -> Worst<'_> {
        let GearPair { e, m1, m2, .. } = *pair;
        Worst { pair, row: Row { engine, e, m1, m2, contacts: 0, momentum_error: 0.0, energy_error: 0.0 } }
    }

    /// Adds a contact with these rates `[w, v2]` before and after.
    fn add(&mut self, before: [f64; 2], after: [f64; 2]) {
        let GearPair { e, m1, m2, .. } = *self.pair;
        let unit = self.row.engine.unit_roundoff();
        let momentum = |[w, v2]: [f64; 2]| m1 * (w + v2) + m2 * v2;
        // The functions below return twice the energy.
        let energy = |[w, v2]: [f64; 2]| m1 * (w + v2) * (w + v2) + m2 * v2 * v2;
        let moduli = |rates: [f64; 2]| rates.map(f64::abs);
        let law = (1.0 - e * e) * (m1 * m2 / (m1 + m2)) * before[0] * before[0];
        let momentum_error =
            (momentum(after) - momentum(before)).abs() / (momentum(moduli(before)) + momentum(moduli(after)));
        let energy_error =
            (energy(before) - energy(after) - law).abs() / (energy(moduli(before)) + energy(moduli(after)));
        self.row.momentum_error = farther(self.row.momentum_error, momentum_error / unit);
        self.row.energy_error = farther(self.row.energy_error, energy_error / unit);
        self.row.contacts += 1;
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

/// Computes contacts of every pair on every engine.
///
/// # Errors
/// A [`GpuError`].
pub fn measure(size: Size, seed: u64, lanes: &mut Lanes) -> Result<Vec<Row>, GpuError> {
    let pairs: Vec<GearPair> = MASSES
        .iter()
        .flat_map(|&[m1, m2]| RESTITUTIONS.map(|e| GearPair { m1, m2, ..paper(e, 5.6) }))
        .collect();
    let horizon = size.pick(20, 200, 2000);
    let starts_per_pair = size.pick(8, 64, 1024);
    let mut rows: Vec<Row> = pairs.par_iter().map(|pair| on_reference(pair, horizon)).collect();
    let mut random = Random::new(seed);
    let starts: Vec<Start> = pairs
        .iter()
        .flat_map(|pair| std::iter::repeat_n(*pair, starts_per_pair))
        .map(|pair| (pair, closing(&pair, &mut random)))
        .collect();
    lanes.rewrite(readout::first_contact);
    for precision in lanes.precisions() {
        let records = lanes.run(precision, &starts, &LaneSettings::only(1))?;
        for (i, pair) in pairs.iter().enumerate() {
            let mut worst = Worst::new(pair, precision.into());
            for k in i * starts_per_pair..(i + 1) * starts_per_pair {
                if let Some(Contact { w, v2 }) = readout::contact(&starts[k], &records[k], None) {
                    worst.add([w[0], v2[0]], [w[1], v2[1]]);
                }
            }
            rows.push(worst.row);
        }
    }
    lanes.rewrite(readout::whole);
    Ok(rows)
}

fn on_reference(pair: &GearPair, horizon: u32) -> Row {
    let flow = flow_of(pair);
    let mut worst = Worst::new(pair, EngineName::Reference);
    let mut trajectory = Trajectory::new(&flow, pair.law(), state(&[0.0, 1.0, 0.0, -1.0]));
    for _ in 0..horizon {
        if trajectory.advance_period(&mut worst).is_err() {
            // Zero contacts make the verdict fail.
            worst.row.contacts = 0;
            break;
        }
    }
    worst.row
}

/// Returns a start between the walls that soon reaches one of them.
fn closing(pair: &GearPair, random: &mut Random) -> State {
    let mut number = |low: f64, high: f64| low + (high - low) * random.unit();
    let (gap, speed) = (number(-0.9, 0.9) * pair.b, number(1.0, 6.0));
    let (x2, v2) = (number(-1.0, 1.0), number(-3.0, 3.0));
    let w = if number(0.0, 1.0) < 0.5 { speed } else { -speed };
    state(&[gap + x2, w + v2, x2, v2])
}

/// Requires that there are contacts and that both laws hold to rounding.
pub fn judge(rows: &[Row]) -> Verdict {
    let holds = rows
        .iter()
        .all(|row| row.contacts > 0 && row.momentum_error <= ROUNDINGS && row.energy_error <= ROUNDINGS);
    let by_engine = EngineName::ALL.into_iter().filter_map(|engine| {
        let of_engine = || rows.iter().filter(move |row| row.engine == engine);
        of_engine().next()?;
        let worst = |of: fn(&Row) -> f64| of_engine().map(of).fold(0.0, farther);
        let contacts: u64 = of_engine().map(|row| row.contacts).sum();
        let (momentum, energy) = (worst(|row| row.momentum_error), worst(|row| row.energy_error));
        Some(format!("{} {momentum:.1} and {energy:.1} at {contacts} contacts", engine.name()))
    });
    let by_engine: Vec<String> = by_engine.collect();
    let hold = if holds { "hold" } else { "do NOT hold" };
    Verdict {
        holds,
        sentence: format!(
            "the laws of momentum and energy {hold} to rounding; largest deviations in unit roundoffs: {}",
            by_engine.join(", ")
        ),
    }
}
