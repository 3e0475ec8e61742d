//! Work of single cells: does every cell of a map end soon for all parameters?
//!
//! Parameters are log-uniform within two decades of the defaults, restitution is uniform, and starts reach ten thousand
//! times the unit. Each cell runs as in a map: 528 periods, without early stops in one half of the cells. The measured time
//! is that of the thread, so that other programs do not count, and it is divided by that of a typical cell, so that the
//! verdict does not depend on the machine.

use cpu_time::ThreadTime;
use rayon::prelude::*;
use serde::Serialize;

use super::cells::flow_of;
use super::{Size, Verdict, Watch};
use rattlemap::map::random::Random;
use rattlemap_dynamics::model::{GearPair, Model, REST, State, state};
use rattlemap_dynamics::orbit::{Budget, Settings, Status, measure};

/// Longest allowed time of a cell, in times of a typical cell: one to three seconds of a core. The slowest of the first
/// 1,000 cells is overdamped and takes 1,300 times.
const LONGEST: f64 = 2_000.0;

/// Number of cells between two reports of progress.
const BLOCK: usize = 256;

/// Times of the cells with one status.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Name of the status, or `all`.
    pub status: &'static str,
    /// Number of cells.
    pub cells: usize,
    /// Median time in seconds of one core.
    pub median: f64,
    /// Time that one cell in 100 exceeds.
    pub p99: f64,
    /// Time that one cell in 1,000 exceeds.
    pub p999: f64,
    /// Longest time.
    pub worst: f64,
    /// Median time of a typical cell: the gear pair of the paper with e = 0.5, without early stops.
    pub typical: f64,
}

/// Measures every cell, on all cores.
pub fn measure_cells(size: Size, seed: u64, watch: &dyn Watch) -> Vec<Row> {
    let count = size.pick(200, 1_000, 100_000);
    let numbers: Vec<u64> = (0..count as u64).collect();
    let mut times: Vec<Times> = Vec::with_capacity(count);
    for block in numbers.chunks(BLOCK) {
        times.par_extend(block.par_iter().with_max_len(1).map(|&n| time(seed, n)));
        watch.progress("cells timed", times.len(), count);
    }
    let mut typical: Vec<f64> = times.iter().map(|cell| cell.typical).collect();
    typical.sort_by(f64::total_cmp);
    let typical = typical[count / 2];
    let all = row("all", typical, times.iter().map(|cell| cell.seconds).collect());
    let by_status = Status::ALL.iter().map(|&status| {
        let of = |cell: &Times| (cell.status == status).then_some(cell.seconds);
        row(status.name(), typical, times.iter().filter_map(of).collect())
    });
    [all].into_iter().chain(by_status).filter(|row| row.cells > 0).collect()
}

fn row(status: &'static str, typical: f64, mut seconds: Vec<f64>) -> Row {
    seconds.sort_by(f64::total_cmp);
    let quantile = |share: f64| {
        let place = (share * seconds.len() as f64) as usize;
        seconds.get(place.min(seconds.len().saturating_sub(1))).copied().unwrap_or(0.0)
    };
    Row {
        status,
        cells: seconds.len(),
        median: quantile(0.5),
        p99: quantile(0.99),
        p999: quantile(0.999),
        worst: quantile(1.0),
        typical,
    }
}

/// Times of a cell and of a typical one, in seconds of this machine's core.
struct Times {
    status: Status,
    seconds: f64,
    typical: f64,
}

/// Measures the `n`th cell, and a typical one after it.
fn time(seed: u64, n: u64) -> Times {
    let mut random = Random::new(seed ^ (n << 20));
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
        let status = measure(&flow_of(pair), pair.law(), start, budget).status;
        (status, clock.elapsed().as_secs_f64())
    };
    let (status, seconds) = timed(&pair, start, &budget);
    let (_, typical) = timed(&GearPair::paper(0.5), REST, &Budget { early_stop: false, ..budget });
    Times { status, seconds, typical }
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

/// Requires that no cell takes longer than `LONGEST` typical cells.
pub fn judge(rows: &[Row]) -> Verdict {
    let Some(all) = rows.first() else {
        return Verdict { holds: false, sentence: "no cell was timed".into() };
    };
    let statuses: Vec<String> = rows[1..].iter().map(|row| format!("{} {}", row.cells, row.status)).collect();
    Verdict {
        holds: all.cells > 0 && all.worst <= LONGEST * all.typical,
        sentence: format!(
            "{} random cells ({}): median {:.1} ms of a core, one in 100 above {:.0} ms, one in 1,000 above {:.0} ms, \
             the slowest {:.0} ms; a typical cell takes {:.2} ms",
            all.cells,
            statuses.join(", "),
            1e3 * all.median,
            1e3 * all.p99,
            1e3 * all.p999,
            1e3 * all.worst,
            1e3 * all.typical
        ),
    }
}
