//! Random cells from the whole valid space. Cells at its edges are more frequent than by chance.

use super::super::cells::{REST, flow_of};
use super::super::lanes::Start;
use super::each;
use crate::stress::SEED;
use rattlemap::gpu::Constants;
use rattlemap::map::random::Random;
use rattlemap_dynamics::model::{GearPair, State, state};
use rattlemap_dynamics::motion::Trajectory;

/// Limit of bounded cells: steps per forcing period on the finest grid they need, and steps and root iterations of the
/// reference in each of the first periods. If the backlash is tiny compared to the motion, a period may have a million
/// impacts.
const ITERATIONS: u64 = 2000;
const TRIAL_PERIODS: u32 = 3;
/// Checks per period of a trial.
const CHECKS: u32 = 32;

/// Limit of wild cells: the fastest rate times the forcing period, in radians. The reference needs about as many steps.
/// Without a limit it would take its maximum of 2 * 10^8 steps per period before it stops.
const WILD_RADIANS: f64 = 1e6;

/// Returns `10^x` with x uniform in `[low, high]`.
fn logarithmic(random: &mut Random, low: f64, high: f64) -> f64 {
    10f64.powf(low + (high - low) * random.unit())
}

/// Returns zero with probability `share`, else a logarithmic number.
fn or_none(random: &mut Random, share: f64, low: f64, high: f64) -> f64 {
    if random.unit() < share { 0.0 } else { logarithmic(random, low, high) }
}

fn restitution(random: &mut Random) -> f64 {
    match random.unit() {
        x if x < 0.15 => 0.0,
        x if x < 0.25 => 1.0,
        x if x < 0.35 => 1.0 - logarithmic(random, -9.0, -1.0),
        x if x < 0.4 => logarithmic(random, -9.0, -1.0),
        _ => random.unit(),
    }
}

/// Returns the steps per forcing period of a lane that is always in its stiffest domain; `None` if lanes cannot compute the
/// cell.
pub(super) fn iterations(pair: &GearPair) -> Option<u64> {
    let constants = Constants::new(&pair.oscillator().ok()?, None)?;
    let finest = constants.pair()?.flow.domains.iter().map(|domain| domain.substeps).fold(1.0, f64::max);
    Some((f64::from(constants.steps) * finest) as u64)
}

/// Number of candidates that are checked together.
const BLOCK: usize = 1024;

/// Draws `count` cells of bounded work and their starts.
pub(super) fn all_bounded(count: usize) -> Vec<Start> {
    let mut random = Random::new(SEED);
    let mut cells = Vec::with_capacity(count);
    while cells.len() < count {
        let candidates: Vec<Start> = (0..BLOCK).map(|_| candidate(&mut random)).collect();
        let bounded = each(&candidates, is_bounded);
        cells.extend(candidates.into_iter().zip(bounded).filter_map(|(cell, fits)| fits.then_some(cell)));
    }
    cells.truncate(count);
    cells
}

/// Draws `count` cells of any magnitude.
pub(super) fn all_wild(count: usize) -> Vec<GearPair> {
    let mut random = Random::new(!SEED);
    (0..count).map(|_| wild(&mut random)).collect()
}

/// Draws a cell that may need too much work.
fn candidate(random: &mut Random) -> Start {
    let pair = GearPair {
        m1: logarithmic(random, -2.0, 2.0),
        m2: logarithmic(random, -2.0, 2.0),
        r1: or_none(random, 0.2, -3.0, 2.0),
        r2: or_none(random, 0.2, -3.0, 2.0),
        k1: or_none(random, 0.15, -1.0, 4.0),
        k2: or_none(random, 0.15, -1.0, 4.0),
        r: or_none(random, 0.1, -3.0, 3.0),
        k: or_none(random, 0.05, 0.0, 7.0),
        force: or_none(random, 0.05, -3.0, 4.0) * if random.unit() < 0.5 { 1.0 } else { -1.0 },
        omega: logarithmic(random, -1.0, 2.0),
        b: logarithmic(random, -4.0, 2.0),
        e: restitution(random),
        mesh_speed: or_none(random, 0.2, -6.0, 2.0),
    };
    (pair, start(&pair, random))
}

/// Whether the work of a cell is within the limit, in lanes and on the reference.
fn is_bounded((pair, start): &Start) -> bool {
    if iterations(pair).is_none_or(|iterations| iterations >= ITERATIONS) {
        return false;
    }
    let flow = flow_of(pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), *start);
    let mut before = 0;
    for _ in 0..TRIAL_PERIODS {
        for check in 1..=CHECKS {
            let until = flow.period * f64::from(check) / f64::from(CHECKS);
            let ended = trajectory.advance_to(until, &mut ());
            let work = trajectory.work();
            if ended.is_err() || work.steps + work.root_iterations - before > ITERATIONS {
                return false;
            }
        }
        if trajectory.advance_period(&mut ()).is_err() {
            return false;
        }
        before = trajectory.work().steps + trajectory.work().root_iterations;
    }
    true
}

/// Draws a start: at rest, between the walls, on a wall or behind it.
fn start(pair: &GearPair, random: &mut Random) -> State {
    let kind = random.unit();
    if kind < 0.5 {
        return REST;
    }
    let mut uniform = |reach: f64| reach * (2.0 * random.unit() - 1.0);
    let gap = match kind {
        kind if kind < 0.8 => uniform(pair.b),
        kind if kind < 0.9 => pair.b.copysign(uniform(1.0)),
        _ => uniform(2.0 * pair.b),
    };
    let speed = pair.omega * pair.b;
    let (x2, w, v2) = (uniform(pair.b), uniform(4.0 * speed), uniform(4.0 * speed));
    state(&[gap + x2, w + v2, x2, v2])
}

/// Draws a cell of any magnitude.
fn wild(random: &mut Random) -> GearPair {
    loop {
        let mut any = |share: f64| match random.unit() {
            x if x < share => 0.0,
            x if x < 0.5 => logarithmic(random, -3.0, 3.0),
            x if x < 0.8 => logarithmic(random, -12.0, 12.0),
            _ => logarithmic(random, -120.0, 120.0),
        };
        let (m1, m2, omega, b) = (any(0.0), any(0.0), any(0.0), any(0.0));
        let [r1, r2, k1, k2, r, k, force, mesh_speed] = std::array::from_fn(|_| any(0.15));
        let force = if random.unit() < 0.5 { force } else { -force };
        let e = restitution(random);
        let pair = GearPair { m1, m2, r1, r2, k1, k2, r, k, force, omega, b, e, mesh_speed };
        let frequency = ((k1 + k) / m1 + (k2 + k) / m2).sqrt();
        let rate = frequency + (r1 + r) / m1 + (r2 + r) / m2;
        if rate / omega < WILD_RADIANS && pair.oscillator().is_ok() {
            return pair;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_is_valid_and_edges_are_frequent() {
        let bounded = all_bounded(2000);
        let wild = all_wild(500);
        let pairs = || bounded.iter().map(|(pair, _)| pair);
        assert!(pairs().chain(&wild).all(|pair| pair.oscillator().is_ok()));
        for (what, count) in [
            ("plastic", pairs().filter(|pair| pair.e == 0.0).count()),
            ("elastic", pairs().filter(|pair| pair.e == 1.0).count()),
            ("without a meshing speed", pairs().filter(|pair| pair.mesh_speed == 0.0).count()),
            ("without support", pairs().filter(|pair| pair.k1 == 0.0 && pair.k2 == 0.0).count()),
            ("unforced", pairs().filter(|pair| pair.force == 0.0).count()),
            ("stiff", pairs().filter(|pair| pair.k > 1e5).count()),
            ("behind a wall", bounded.iter().filter(|(pair, y)| (y[0] - y[2]).abs() > pair.b).count()),
        ] {
            assert!(count >= 10, "{what}: {count}");
        }
        assert!(wild.iter().any(|pair| pair.b < 1e-50) && wild.iter().any(|pair| pair.force > 1e50));
    }
}
