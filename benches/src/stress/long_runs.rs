//! Many periods on stable cycles: does the error grow?
//!
//! Eight cells with stable cycles of every kind (impacts, meshing, chatter, no contact) start near their cycles. Lanes run
//! each cell from eight starts for up to 10^5 periods, and the reference runs it for 10^6. The error of a lane is its
//! distance from the reference after as many periods. The error of the reference is its distance from the fixed point that
//! Newton's method finds.

use rayon::prelude::*;
use serde::Serialize;

use super::cells::{EngineName, flow_of, paper, state_after, state_distance};
use super::lanes::{Lanes, Start};
use super::{Size, Verdict, Watch};
use rattlemap::gpu::{GpuError, LaneSettings};
use rattlemap::record::classify::status;
use rattlemap::record::distance::{farther, is_within};
use rattlemap_dynamics::model::{GearPair, REST, State};
use rattlemap_dynamics::motion::Trajectory;
use rattlemap_dynamics::orbit::Status;
use rattlemap_dynamics::stability::{Cycle, StrobeMap, refine};

/// Restitution and frequency of the cells. Their cycles last one or two forcing periods.
const CELLS: [(f64, f64); 8] =
    [(0.56, 5.6), (0.06, 5.6), (0.0, 5.6), (0.2, 9.2), (0.56, 3.4), (0.2, 2.5), (0.56, 1.5), (0.5, 11.0)];

/// Forcing periods after which a cell is on its cycle.
const SETTLING: u32 = 2000;

/// Distance of the eight starts from their cycles.
const DISTANCE: f64 = 1e-3;

/// Size below which transients are negligible.
const NEGLIGIBLE: f64 = 1e-17;

/// Largest allowed growth of an error, relative to the first two horizons.
const GROWTH: f64 = 4.0;

/// Number of unit roundoffs of the motion that are allowed in addition.
const ROUNDINGS: f64 = 32.0;

/// The error of one cell at one time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Restitution.
    pub e: f64,
    /// Excitation frequency.
    pub omega: f64,
    /// The engine.
    pub engine: EngineName,
    /// Forcing periods since the start.
    pub periods: u32,
    /// Largest difference of a component of the state, over all starts.
    pub error: f64,
    /// Size of the motion: its largest component.
    pub size: f64,
}

struct Settled {
    pair: GearPair,
    cycle: Cycle,
    starts: Vec<State>,
}

/// Computes every cell on every engine.
///
/// # Errors
/// A [`GpuError`].
pub fn measure(size: Size, lanes: &mut Lanes, watch: &dyn Watch) -> Result<Vec<Row>, GpuError> {
    let horizons: &[u32] = size.pick(
        &[10, 30, 100],
        &[100, 300, 1000, 10_000],
        &[100, 300, 1000, 3000, 10_000, 30_000, 100_000],
    );
    let longest = size.pick(1000, 100_000, 1_000_000);
    let cells: Vec<Settled> = CELLS.par_iter().map(|&(e, omega)| settled(paper(e, omega))).collect();
    let starts: Vec<Start> =
        cells.iter().flat_map(|cell| cell.starts.iter().map(|&start| (cell.pair, start))).collect();
    let mut rows = Vec::new();
    let all = horizons.iter().map(|&horizon| horizon as usize).sum();
    let mut done = 0;
    for &horizon in horizons {
        let exact: Vec<State> = starts
            .par_iter()
            .map(|(pair, start)| state_after(pair, *start, horizon).expect("a stable cell"))
            .collect();
        for precision in lanes.precisions() {
            let records = lanes.run(precision, &starts, &LaneSettings::only(horizon))?;
            let per_cell = cells[0].starts.len();
            for (i, cell) in cells.iter().enumerate() {
                let of_cell = i * per_cell..(i + 1) * per_cell;
                let error = of_cell.map(|k| match status(&records[k]) {
                    Status::Ok => state_distance(&records[k].strobe, &exact[k]),
                    _ => f64::INFINITY,
                });
                rows.push(row(cell, precision.into(), horizon, error.fold(0.0, farther)));
            }
        }
        done += horizon as usize;
        watch.progress("periods of lanes", done, all);
    }
    rows.par_extend(cells.par_iter().flat_map_iter(|cell| on_reference(cell, longest)));
    Ok(rows)
}

fn row(cell: &Settled, engine: EngineName, periods: u32, error: f64) -> Row {
    let GearPair { e, omega, .. } = cell.pair;
    let size = cell.cycle.state.iter().fold(cell.pair.b, |m, x| m.max(x.abs()));
    Row { e, omega, engine, periods, error, size }
}

/// Returns a cell with its cycle and starts near it.
fn settled(pair: GearPair) -> Settled {
    let flow = flow_of(&pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), REST);
    for _ in 0..SETTLING {
        trajectory.advance_period(&mut ()).expect("a stable cell");
    }
    let map = [1, 2].map(StrobeMap::Periods);
    let near = |cycle: &Cycle| {
        state_distance(&cycle.state, &trajectory.state()) < 1e-6 && cycle.spectral_radius() < 1.0
    };
    let cycle = map.into_iter().filter_map(|map| refine(&trajectory, map)).find(near);
    let cycle = cycle.expect("the cell has a stable cycle of one or two periods");
    let starts = (0..8).map(|k| {
        let mut start = cycle.state;
        start[k % 4] += if k < 4 { DISTANCE } else { -DISTANCE };
        start
    });
    Settled { pair, starts: starts.collect(), cycle }
}

/// Returns distances from the cycle after 10^2, 10^3, ... periods, once the distance of the start is negligible.
fn on_reference(cell: &Settled, longest: u32) -> Vec<Row> {
    let flow = flow_of(&cell.pair);
    let mut trajectory = Trajectory::new(&flow, cell.pair.law(), cell.starts[0]);
    let mut rows = Vec::new();
    let mut horizon = 100;
    for period in 1..=longest {
        trajectory.advance_period(&mut ()).expect("a stable cell");
        if period < horizon {
            continue;
        }
        horizon *= 10;
        let turns = f64::from(period) / f64::from(cell.cycle.period);
        if DISTANCE * cell.cycle.spectral_radius().powf(turns) < NEGLIGIBLE {
            rows.push(row(
                cell,
                EngineName::Reference,
                period,
                state_distance(&trajectory.state(), &cell.cycle.state),
            ));
        }
    }
    rows
}

/// Requires that no error grows with time.
pub fn judge(rows: &[Row]) -> Verdict {
    let mut holds = true;
    let mut by_engine = Vec::new();
    for engine in EngineName::ALL {
        let of_engine: Vec<&Row> = rows.iter().filter(|row| row.engine == engine).collect();
        let Some(longest) = of_engine.iter().map(|row| row.periods).max() else { continue };
        for last in of_engine.iter().filter(|row| row.periods == longest) {
            let of_cell = || of_engine.iter().filter(|row| (row.e, row.omega) == (last.e, last.omega));
            let mut times: Vec<u32> = of_cell().map(|row| row.periods).collect();
            times.sort_unstable();
            let early = times.get(1).copied().unwrap_or(longest);
            let first = of_cell().filter(|row| row.periods <= early).map(|row| row.error).fold(0.0, farther);
            let bar = GROWTH * first + ROUNDINGS * engine.unit_roundoff() * last.size;
            holds &= of_cell().all(|row| is_within(row.error, bar));
        }
        let at = |periods: u32| {
            of_engine.iter().filter(|row| row.periods == periods).map(|row| row.error).fold(0.0, farther)
        };
        by_engine.push(format!("{} {:.1e} after {longest} periods", engine.name(), at(longest)));
    }
    let grows = if holds { "no error grows" } else { "an error GROWS" };
    Verdict { holds, sentence: format!("{grows} on 8 stable cycles: largest {}", by_engine.join(", ")) }
}
