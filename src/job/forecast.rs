//! How long will a map take? Some of its cells are computed in earnest, and thrown away.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::map::engine::{Engine, EngineError};
use crate::map::plan::{Cell, Plan};

/// What the last sample takes at least, unless the map is smaller.
const LONG_ENOUGH: Duration = Duration::from_millis(1500);

/// A sample that is not done by then tells the least that the map takes.
const LONGEST: Duration = Duration::from_secs(30);

/// From one sample to the next.
const GROWTH: usize = 4;

/// Neighbours that are taken together: side by side in a processor's or a card's registers they run together, as in a map.
const TILE: usize = 16;

/// Most of the odd multiples of this fall far from each other: near the golden section of 2^32.
const GOLDEN: u64 = 2_654_435_761;

/// Quantile of the normal distribution for 95 %.
const QUANTILE: f64 = 1.96;

/// What a map takes on an engine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Forecast {
    /// Seconds of computing.
    pub(crate) seconds: f64,
    /// The same at 95 %, as far as cells differ in the periods that they take; none if not all of the sample ended in time:
    /// the map takes longer than the seconds say.
    pub(crate) interval: Option<[f64; 2]>,
    /// Cells that it rests on.
    pub(crate) sampled: usize,
}

impl Forecast {
    /// Of `runs` runs of a plan, by cells spread over it. Samples grow until they are long enough; what the last two
    /// differ by is what a cell takes while many are under way, without what begins and ends every map.
    ///
    /// # Errors
    /// [`EngineError`] if the engine fails.
    pub(crate) fn of(plan: &Plan, engine: &mut Engine<'_>, runs: usize) -> Result<Forecast, EngineError> {
        if plan.before(plan.run_at(plan.run_count() - 1)).is_some() || plan.before(0).is_some() {
            return row_by_row(plan, engine, runs);
        }
        let halt = halted_after(LONGEST);
        engine.stop_on(&halt);
        let mut before: Option<Sample> = None;
        let mut count = runs.min(engine.least_batch());
        loop {
            let sample = Sample::take(plan, engine, count)?;
            let is_last = sample.ended() < count
                || count == runs
                || before.is_some() && sample.seconds >= LONG_ENOUGH.as_secs_f64()
                || sample.seconds * GROWTH as f64 > 0.5 * LONGEST.as_secs_f64();
            if is_last {
                return Ok(sample.extended(before.as_ref(), runs, count));
            }
            count = (GROWTH * count).min(runs);
            before = Some(sample);
        }
    }
}

/// Where every row of cells waits for the one before: by rows as long as the map's.
fn row_by_row(plan: &Plan, engine: &mut Engine<'_>, runs: usize) -> Result<Forecast, EngineError> {
    let halt = halted_after(LONGEST);
    engine.stop_on(&halt);
    let row = plan.axes()[0].count();
    let clock = Instant::now();
    let (mut asked, mut periods) = (0, Vec::new());
    while periods.len() == asked && (asked == 0 || clock.elapsed() < LONG_ENOUGH && asked < runs) {
        let cells: Vec<Cell> = (asked..asked + row).map(|nth| spread(plan, nth)).collect();
        asked += row;
        periods.extend(finish(engine, &cells, row)?);
    }
    let sample = Sample { seconds: clock.elapsed().as_secs_f64(), periods };
    Ok(sample.extended(None, runs, asked))
}

/// Cells that were computed.
struct Sample {
    seconds: f64,
    /// That each of them took, tile by tile if all have ended.
    periods: Vec<f64>,
}

impl Sample {
    /// Computes so many cells, as a map does: some under way, others begun as these end.
    fn take(plan: &Plan, engine: &mut Engine<'_>, count: usize) -> Result<Sample, EngineError> {
        let whole = count == plan.run_count();
        let cell = |nth| if whole { plan.cell(plan.run_at(nth)) } else { spread(plan, nth) };
        let cells: Vec<Cell> = (0..count).map(cell).collect();
        let clock = Instant::now();
        let periods = finish(engine, &cells, (count / 2).max(engine.least_batch()))?;
        Ok(Sample { seconds: clock.elapsed().as_secs_f64(), periods })
    }

    fn ended(&self) -> usize {
        self.periods.len()
    }

    /// To so many runs, where `asked` were to be computed.
    fn extended(&self, before: Option<&Sample>, runs: usize, asked: usize) -> Forecast {
        let each = |seconds: f64, cells: usize| seconds / cells.max(1) as f64;
        let plain = each(self.seconds, self.ended());
        // Noise may hide the difference; then all of it counts.
        let marginal = before
            .map(|before| each(self.seconds - before.seconds, self.ended().saturating_sub(before.ended())))
            .filter(|&marginal| marginal > 0.5 * plain && marginal < 1.5 * plain)
            .unwrap_or(plain);
        let seconds = self.seconds + runs.saturating_sub(self.ended()) as f64 * marginal;
        let spread = QUANTILE * relative_error(&self.periods) * (seconds - self.seconds).max(0.0);
        let interval = [(seconds - spread).max(self.seconds), seconds + spread];
        Forecast { seconds, interval: (self.ended() >= asked).then_some(interval), sampled: self.ended() }
    }
}

/// Computes cells with so many under way: the periods of each, in their order, or of fewer if time is up.
fn finish(engine: &mut Engine<'_>, cells: &[Cell], most: usize) -> Result<Vec<f64>, EngineError> {
    let (mut left, mut under_way) = (cells, 0);
    let mut ended = HashMap::with_capacity(cells.len());
    while under_way > 0 || !left.is_empty() {
        let (next, later) = left.split_at(left.len().min(most.saturating_sub(under_way)).min(engine.room()));
        pollster::block_on(engine.begin(next))?;
        left = later;
        under_way += next.len();
        let until = if left.is_empty() { 0 } else { under_way / 2 };
        let records = pollster::block_on(engine.advance(until))?;
        if records.is_empty() {
            break;
        }
        under_way -= records.len();
        ended.extend(records.into_iter().map(|(id, record)| (id, f64::from(record.periods_run))));
    }
    Ok(cells.iter().filter_map(|cell| ended.get(&cell.id).copied()).collect())
}

/// The standard error of a mean over the mean, of values that are alike within a tile.
fn relative_error(values: &[f64]) -> f64 {
    let tiles: Vec<f64> =
        values.chunks(TILE).map(|tile| tile.iter().sum::<f64>() / tile.len() as f64).collect();
    let count = tiles.len() as f64;
    let mean = tiles.iter().sum::<f64>() / count;
    let square = tiles.iter().map(|tile| (tile - mean) * (tile - mean)).sum::<f64>() / (count - 1.0);
    let error = (square / count).sqrt() / mean;
    if error.is_finite() { error } else { 0.0 }
}

/// Cells of tiles at places far from each other, the same ones for every engine.
fn spread(plan: &Plan, nth: usize) -> Cell {
    let all = plan.run_count();
    let (tile, within, tiles) = (nth / TILE, nth % TILE, (all / TILE).max(1) as u64);
    let place = ((tile as u64 * GOLDEN % (1 << 32) * tiles) >> 32) as usize * TILE + within;
    plan.cell(plan.run_at(place % all))
}

fn halted_after(time: Duration) -> Arc<AtomicBool> {
    let halt = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&halt);
    std::thread::spawn(move || {
        std::thread::sleep(time);
        raised.store(true, Ordering::Relaxed);
    });
    halt
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::engine::Fake;
    use crate::map::scene::{Purpose, Scene};
    use crate::record::Record;

    fn plan(sets: &[&str]) -> Plan {
        let text = "[[axis]]\nparameter = 'e'\nmin = 0.0\nmax = 1.0\ncount = 40\n\
                    [[axis]]\nparameter = 'omega'\nmin = 1.0\nmax = 12.0\ncount = 30\n";
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        Plan::new(&Scene::parse(text, "s", &sets, Purpose::Map).unwrap())
    }

    fn fake() -> Engine<'static> {
        Engine::Fake(Fake::new(|cell| Record { periods_run: 1 + cell.id, ..Record::default() }))
    }

    #[test]
    fn a_map_that_is_soon_done_is_done() {
        let plan = plan(&[]);
        let forecast = Forecast::of(&plan, &mut fake(), 1200).unwrap();
        assert_eq!(forecast.sampled, 1200);
        assert_eq!(forecast.interval, Some([forecast.seconds; 2]), "nothing is left to guess");
        let rows = self::plan(&["start.policy=up"]);
        assert_eq!(Forecast::of(&rows, &mut fake(), 1200).unwrap().sampled, 1200);
    }

    #[test]
    fn a_sample_is_spread_over_the_map() {
        let plan = plan(&[]);
        let mut quarters = [0; 4];
        for tile in 0..64 {
            let [i, j] = plan.indices(spread(&plan, TILE * tile).id);
            quarters[usize::from(i >= 20) + 2 * usize::from(j >= 15)] += 1;
        }
        assert!(quarters.iter().all(|count| (10..=22).contains(count)), "{quarters:?}");
        // Neighbours.
        let tile: Vec<[usize; 2]> = (0..TILE).map(|nth| plan.indices(spread(&plan, nth).id)).collect();
        assert!(tile.iter().all(|[i, j]| i.abs_diff(tile[0][0]).max(j.abs_diff(tile[0][1])) < 8), "{tile:?}");
    }

    /// Ten seconds to begin and to end, one for each cell.
    #[test]
    fn what_begins_every_map_counts_once() {
        // Tiles of one period a cell and of two.
        let periods = |cells: usize| (0..cells).map(|i| (1 + i / TILE % 2) as f64).collect();
        let sample = |cells: usize| Sample { seconds: 50.0 + cells as f64, periods: periods(cells) };
        let forecast = sample(400).extended(Some(&sample(100)), 10_000, 400);
        assert_eq!((forecast.seconds, forecast.sampled), (10_050.0, 400));
        let [low, high] = forecast.interval.unwrap();
        // Of 25 tiles 13 take 1 and 12 take 2: their mean is 1.48, their variance 0.26.
        let error = 9600.0 * (0.26_f64 / 25.0).sqrt() / 1.48;
        assert!((high - 10_050.0 - 1.96 * error).abs() < 1e-6, "{high}");
        assert!((low + high - 20_100.0).abs() < 1e-6);
        // Not all of them in time: no less than this.
        assert_eq!(sample(300).extended(Some(&sample(100)), 10_000, 400).interval, None);
    }
}
