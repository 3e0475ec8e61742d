//! Predicts how long a map takes: computes a sample of its cells with the chosen engine, and discards their records.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::map::engine::{Engine, EngineError};
use crate::map::plan::{Cell, Plan};
use rattlemap_dynamics::model::REST;
use rattlemap_dynamics::motion::{Allowance, Flow, Trajectory};

/// A sample that takes at least this long is the last one.
const LONG_ENOUGH: Duration = Duration::from_millis(1500);

/// Time limit of a sample. An unfinished sample gives a lower bound.
const LONGEST: Duration = Duration::from_secs(30);

/// Ratio of the sizes of successive samples.
const GROWTH: usize = 4;

/// Number of neighbouring cells in a tile of the sample. Engines compute neighbours together, as in a map.
const TILE: usize = 16;

/// An odd number near 2^32 times the golden section: multiples of it are spread evenly modulo 2^32.
const GOLDEN: u64 = 2_654_435_761;

/// Quantile of the normal distribution for an interval of 95 %.
const QUANTILE: f64 = 1.96;

/// Seconds for a cell from which on there is a warning.
const LONG_CELL: f64 = 2.0;

/// Time in which the motion of one cell is measured.
const PROBE: Duration = Duration::from_millis(200);

/// Returns a warning if a cell can take long: measures the forcing periods of one cell on a processor core, the later half of
/// those that fit into the probe, and multiplies by the largest number of periods.
pub fn long_cells(plan: &Plan) -> Option<String> {
    let model = plan.model((plan.cell_count() / 2) as u32);
    let (flow, halt, clock) = (Flow::of(&*model).ok()?, halted_after(PROBE), Instant::now());
    let mut trajectory = <Trajectory>::new(&flow, model.law(), REST);
    trajectory = trajectory.allowing(Allowance::UNLIMITED.until(&halt));
    let longest = plan.budget().longest();
    let mut ends = vec![0.0];
    while trajectory.advance_period(&mut ()).is_ok() && ends.len() <= longest as usize {
        ends.push(clock.elapsed().as_secs_f64());
    }
    if ends.len() == 1 && halt.load(Ordering::Relaxed) {
        ends.push(PROBE.as_secs_f64());
    }
    let (last, half) = (ends.len() - 1, (ends.len() - 1) / 2);
    let each = (ends[last] - ends[half]) / (last - half) as f64;
    let seconds = each * f64::from(longest);
    (seconds > LONG_CELL).then(|| {
        format!(
            "a cell can take about {seconds:.0} s of a core: {longest} forcing periods ([integration]) of {each:.1e} s each"
        )
    })
}

/// Predicted time of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// Seconds of integration.
    pub seconds: f64,
    /// 95 % interval of `seconds`, from the spread of forcing periods between cells. None if the sample did not end in
    /// time: the map takes longer than `seconds`.
    pub interval: Option<[f64; 2]>,
    /// Number of cells in the sample.
    pub sampled: usize,
}

impl Forecast {
    /// Predicts the time of `runs` runs of a plan. Samples grow until one takes long enough; the last one gives the rate.
    ///
    /// # Errors
    /// [`EngineError`] if the engine fails.
    pub fn of(plan: &Plan, engine: &mut Engine<'_>, runs: usize) -> Result<Forecast, EngineError> {
        if runs == 0 {
            return Ok(Forecast { seconds: 0.0, interval: Some([0.0; 2]), sampled: 0 });
        }
        let halt = halted_after(LONGEST);
        engine.stop_on(&halt);
        // Where cells follow their neighbours, a map computes one row at a time.
        let row = plan.policy().follows().then_some(plan.counts()[0]);
        let mut count = runs.min(row.unwrap_or(engine.least_batch()));
        let mut is_first = true;
        loop {
            let is_whole = count >= plan.run_count();
            let cell = |nth| if is_whole { plan.cell(plan.run_at(nth)) } else { spread(plan, nth) };
            let cells: Vec<Cell> = (0..count).map(cell).collect();
            let clock = Instant::now();
            let periods = compute(engine, &cells, row.unwrap_or((count / 2).max(engine.least_batch())))?;
            let seconds = clock.elapsed().as_secs_f64();
            let is_last = periods.len() < count
                || count == runs
                || seconds >= LONG_ENOUGH.as_secs_f64() && !is_first
                || seconds * GROWTH as f64 > 0.5 * LONGEST.as_secs_f64();
            if is_last {
                return Ok(Forecast::from_sample(seconds, &periods, count, runs));
            }
            // The first sample may include the compilation of a shader.
            is_first = false;
            count = (GROWTH * count).min(runs);
        }
    }

    /// Extrapolates from a sample of `count` cells. `periods` lists the forcing periods of the finished cells.
    fn from_sample(seconds: f64, periods: &[f64], count: usize, runs: usize) -> Forecast {
        let each = seconds / periods.len().max(1) as f64;
        let rest = each * runs.saturating_sub(periods.len()) as f64;
        let margin = QUANTILE * relative_error(periods) * rest;
        let total = seconds + rest;
        let interval = [(total - margin).max(seconds), total + margin];
        Forecast {
            seconds: total,
            interval: (periods.len() >= count).then_some(interval),
            sampled: periods.len(),
        }
    }
}

/// Computes cells as a map does, at most `most` at a time. Returns the forcing periods of each cell in order; fewer if
/// the halt flag is raised.
fn compute(engine: &mut Engine<'_>, cells: &[Cell], most: usize) -> Result<Vec<f64>, EngineError> {
    let (mut rest, mut under_way) = (cells, 0);
    let mut periods = HashMap::with_capacity(cells.len());
    while under_way > 0 || !rest.is_empty() {
        let next;
        (next, rest) = rest.split_at(rest.len().min(most.saturating_sub(under_way)).min(engine.room()));
        pollster::block_on(engine.begin(next))?;
        under_way += next.len();
        let until = if rest.is_empty() { 0 } else { under_way / 2 };
        let records = pollster::block_on(engine.advance(until))?;
        if records.is_empty() {
            break;
        }
        under_way -= records.len();
        periods.extend(records.into_iter().map(|(id, record)| (id, f64::from(record.periods_run))));
    }
    Ok(cells.iter().filter_map(|cell| periods.get(&cell.id).copied()).collect())
}

/// Standard error of the mean divided by the mean. Values within a tile are not independent, so each tile counts as one
/// value.
fn relative_error(values: &[f64]) -> f64 {
    let tiles: Vec<f64> =
        values.chunks(TILE).map(|tile| tile.iter().sum::<f64>() / tile.len() as f64).collect();
    let count = tiles.len() as f64;
    let mean = tiles.iter().sum::<f64>() / count;
    let square = tiles.iter().map(|tile| (tile - mean) * (tile - mean)).sum::<f64>() / (count - 1.0);
    let error = (square / count).sqrt() / mean;
    if error.is_finite() { error } else { 0.0 }
}

/// Returns a cell of the sample. Tiles are spread over the map; the order is the same for every engine.
fn spread(plan: &Plan, nth: usize) -> Cell {
    let all = plan.run_count();
    let (tile, within, tiles) = (nth / TILE, nth % TILE, (all / TILE).max(1) as u64);
    let place = ((tile as u64 * GOLDEN % (1 << 32) * tiles) >> 32) as usize * TILE + within;
    plan.cell(plan.run_at(place % all))
}

/// Returns a flag that is raised after some time.
fn halted_after(time: Duration) -> Arc<AtomicBool> {
    let halt = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&halt);
    let wait = move || {
        std::thread::sleep(time);
        raised.store(true, Ordering::Relaxed);
    };
    // Without a thread, nothing could end a sample that takes too long.
    halt.store(std::thread::Builder::new().spawn(wait).is_err(), Ordering::Relaxed);
    halt
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::engine::Fake;
    use crate::map::scene::{Purpose, Scene};
    use crate::record::Record;

    fn plan(sets: &[String]) -> Plan {
        let text = "[[axis]]\nparameter = 'e'\nmin = 0.0\nmax = 1.0\ncount = 40\n\
                    [[axis]]\nparameter = 'omega'\nmin = 1.0\nmax = 12.0\ncount = 30\n";
        Plan::new(&Scene::parse(text, "s", sets, Purpose::Map).unwrap())
    }

    #[test]
    fn a_quick_map_is_computed_whole() {
        for sets in [vec![], vec!["start.policy=up".to_owned()]] {
            let fake = Fake::new(|cell| Record { periods_run: 1 + cell.id, ..Record::default() });
            let forecast = Forecast::of(&plan(&sets), &mut Engine::Fake(fake), 1200).unwrap();
            assert_eq!(forecast.sampled, 1200);
            assert_eq!(forecast.interval, Some([forecast.seconds; 2]), "nothing is extrapolated");
        }
    }

    #[test]
    fn a_sample_consists_of_tiles_spread_over_the_map() {
        let plan = plan(&[]);
        let mut quarters = [0; 4];
        for tile in 0..64 {
            let [i, j] = plan.indices(spread(&plan, TILE * tile).id);
            quarters[usize::from(i >= 20) + 2 * usize::from(j >= 15)] += 1;
        }
        assert!(quarters.iter().all(|count| (10..=22).contains(count)), "{quarters:?}");
        let tile: Vec<[usize; 2]> = (0..TILE).map(|nth| plan.indices(spread(&plan, nth).id)).collect();
        assert!(tile.iter().all(|[i, j]| i.abs_diff(tile[0][0]).max(j.abs_diff(tile[0][1])) < 8), "{tile:?}");
    }

    #[test]
    fn the_interval_follows_from_the_spread_between_tiles() {
        // Tiles of one and of two periods per cell.
        let periods: Vec<f64> = (0..400).map(|i| (1 + i / TILE % 2) as f64).collect();
        let forecast = Forecast::from_sample(400.0, &periods, 400, 10_000);
        assert_eq!((forecast.seconds, forecast.sampled), (10_000.0, 400));
        let [low, high] = forecast.interval.unwrap();
        // 13 of 25 tiles have 1 and 12 have 2: the mean is 1.48, the variance 0.26.
        let margin = 1.96 * 9600.0 * (0.26_f64 / 25.0).sqrt() / 1.48;
        assert!((high - 10_000.0 - margin).abs() < 1e-6, "{high}");
        assert!((low + high - 20_000.0).abs() < 1e-6);
        assert_eq!(Forecast::from_sample(300.0, &periods[..300], 400, 10_000).interval, None);
    }
}
