//! Work of single cells: does every cell of a map end soon for all parameters?
//!
//! Parameters are log-uniform within two decades of the defaults, restitution is uniform, and starts reach ten thousand
//! times the unit. Each cell runs as in a map: 528 periods, without early stops in one half of the cells. The measured time
//! is that of the thread, so that other programs do not count, and it is divided by that of a typical cell, so that the
//! verdict does not depend on the machine.

use cpu_time::ThreadTime;
use rayon::prelude::*;

use super::cells::flow_of;
use super::{Checks, SEED};
use rattlemap::map::random::Random;
use rattlemap_dynamics::model::{GearPair, Model, REST, State, state};
use rattlemap_dynamics::orbit::{Budget, Settings, measure};

/// Longest allowed time of a cell, in times of a typical cell: one to three seconds of a core. The slowest of the first
/// 1,000 cells is overdamped and takes 1,300 times.
const LONGEST: f64 = 2_000.0;

/// Compares the time of each of `count` cells with that of a typical one, on all cores.
pub(super) fn check(count: usize) -> Checks {
    let mut checks = Checks::default();
    let times: Vec<[f64; 2]> = (0..count).into_par_iter().with_max_len(1).map(|n| time(n as u64)).collect();
    let mut typical: Vec<f64> = times.iter().map(|time| time[1]).collect();
    typical.sort_by(f64::total_cmp);
    for (n, [seconds, _]) in times.iter().enumerate() {
        checks.add(*seconds, LONGEST * typical[count / 2], format!("seconds of cell {n}"));
    }
    checks
}

/// Measures the `n`th cell, and after it a typical one: the gear pair of the paper with e = 0.5, without early stops. Returns
/// both times in seconds of this machine's core.
fn time(n: u64) -> [f64; 2] {
    let mut random = Random::new(SEED ^ (n << 20));
    let (pair, start) = cell(&mut random);
    let budget = Budget {
        settings: Settings::default(),
        early_stop: n.is_multiple_of(2),
        undecided_periods: 0,
        confirm_chaos: 0,
        exponent: true,
        shows_exponent: true,
        quantities: false,
    };
    let timed = |pair: &GearPair, start, budget: &Budget| {
        let clock = ThreadTime::now();
        std::hint::black_box(measure(&flow_of(pair), pair.law(), start, budget));
        clock.elapsed().as_secs_f64()
    };
    [
        timed(&pair, start, &budget),
        timed(&GearPair::paper(0.5), REST, &Budget { early_stop: false, ..budget }),
    ]
}

/// Draws a random cell.
fn cell(random: &mut Random) -> (GearPair, State) {
    let mut pair = GearPair::paper(random.unit());
    for (index, parameter) in GearPair::PARAMETERS.iter().enumerate().filter(|(_, it)| it.name != "e") {
        let value = parameter.default.expect("only the restitution has no default");
        pair.assign(index, value * 10f64.powf(4.0 * random.unit() - 2.0));
    }
    // Undamped, elastic pairs keep the speed of their start.
    let undamped = GearPair { r1: 0.0, r2: 0.0, r: 0.0, e: 1.0 - 1e-3 * random.unit(), ..pair };
    let pair = if random.unit() < 0.1 { undamped } else { pair };
    let size = 10f64.powf(4.0 * random.unit());
    let rest = random.unit() < 0.5;
    let start: [f64; 4] =
        std::array::from_fn(|_| if rest { 0.0 } else { size * (2.0 * random.unit() - 1.0) });
    (pair, state(&start))
}
