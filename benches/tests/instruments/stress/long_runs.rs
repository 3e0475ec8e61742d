//! Many periods on stable cycles: does the error grow?
//!
//! Eight cells with stable cycles of every kind (impacts, meshing, chatter, no contact) start near their cycles. Lanes run
//! each cell from eight starts for up to 10^4 periods, and the reference runs it for 10^5. The error of a lane is its
//! distance from the reference after as many periods. The error of the reference is its distance from the fixed point that
//! Newton's method finds.

use rayon::prelude::*;

use super::Checks;
use super::cells::{EngineName, flow_of, paper, state_after, state_distance};
use super::lanes::{Lanes, Start};
use rattlemap::gpu::LaneSettings;
use rattlemap::record::classify::status;
use rattlemap::record::distance::farther;
use rattlemap_dynamics::model::{GearPair, REST, State};
use rattlemap_dynamics::motion::Trajectory;
use rattlemap_dynamics::orbit::Status;
use rattlemap_dynamics::stability::{Cycle, StrobeMap, refine};

/// Restitution and frequency of the cells. Their cycles last one or two forcing periods.
const CELLS: [(f64, f64); 8] =
    [(0.56, 5.6), (0.06, 5.6), (0.0, 5.6), (0.2, 9.2), (0.56, 3.4), (0.2, 2.5), (0.56, 1.5), (0.5, 11.0)];

/// Forcing periods of lanes.
const HORIZONS: [u32; 4] = [100, 300, 1000, 10_000];
/// Longest run of the reference, in forcing periods.
const LONGEST: u32 = 100_000;

/// Forcing periods after which a cell is on its cycle.
const SETTLING: u32 = 2000;

/// Distance of the eight starts from their cycles.
const DISTANCE: f64 = 1e-3;
const STARTS: usize = 8;

/// Size below which transients are negligible.
const NEGLIGIBLE: f64 = 1e-17;

/// Largest allowed growth of an error, relative to the first two horizons.
const GROWTH: f64 = 4.0;

/// Number of unit roundoffs of the motion that are allowed in addition.
const ROUNDINGS: f64 = 32.0;

struct Settled {
    pair: GearPair,
    cycle: Cycle,
    starts: [State; STARTS],
}

impl Settled {
    /// Requires that errors at increasing times do not grow.
    fn compare(&self, engine: EngineName, errors: &[f64], checks: &mut Checks) {
        let size = self.cycle.state.iter().fold(self.pair.b, |m, x| m.max(x.abs()));
        let first = errors.iter().take(2).copied().fold(0.0, farther);
        let bar = GROWTH * first + ROUNDINGS * engine.unit_roundoff() * size;
        for (nth, &error) in errors.iter().enumerate() {
            let GearPair { e, omega, .. } = self.pair;
            checks.add(error, bar, format!("{engine:?}, e = {e}, omega = {omega}, horizon {nth}"));
        }
    }

    /// Returns distances of the reference from the cycle after 10^2, 10^3, ... periods, once the distance of the start is
    /// negligible.
    fn on_reference(&self) -> Vec<f64> {
        let flow = flow_of(&self.pair);
        let mut trajectory = Trajectory::new(&flow, self.pair.law(), self.starts[0]);
        let mut errors = Vec::new();
        let mut horizon = 100;
        for period in 1..=LONGEST {
            trajectory.advance_period(&mut ()).expect("a stable cell");
            if period < horizon {
                continue;
            }
            horizon *= 10;
            let turns = f64::from(period) / f64::from(self.cycle.period);
            if DISTANCE * self.cycle.spectral_radius().powf(turns) < NEGLIGIBLE {
                errors.push(state_distance(&trajectory.state(), &self.cycle.state));
            }
        }
        errors
    }
}

/// Compares every cell on every engine.
pub(super) fn check(lanes: &mut Lanes) -> Checks {
    let mut checks = Checks::default();
    let cells: Vec<Settled> = CELLS.par_iter().map(|&(e, omega)| settled(paper(e, omega))).collect();
    let starts: Vec<Start> =
        cells.iter().flat_map(|cell| cell.starts.map(|start| (cell.pair, start))).collect();
    let exact = HORIZONS.map(|horizon| {
        let end = |(pair, start): &Start| state_after(pair, *start, horizon).expect("a stable cell");
        starts.par_iter().map(end).collect::<Vec<State>>()
    });
    for precision in lanes.precisions() {
        let mut errors = vec![Vec::new(); cells.len()];
        for (horizon, exact) in HORIZONS.into_iter().zip(&exact) {
            let records = lanes.run(precision, &starts, &LaneSettings::only(horizon));
            let error = |k: usize| match status(&records[k]) {
                Status::Ok => state_distance(&records[k].strobe(), &exact[k]),
                _ => f64::INFINITY,
            };
            for (i, of_cell) in errors.iter_mut().enumerate() {
                of_cell.push((i * STARTS..(i + 1) * STARTS).map(error).fold(0.0, farther));
            }
        }
        for (cell, errors) in cells.iter().zip(&errors) {
            cell.compare(precision.into(), errors, &mut checks);
        }
    }
    let of_reference: Vec<Vec<f64>> = cells.par_iter().map(Settled::on_reference).collect();
    for (cell, errors) in cells.iter().zip(&of_reference) {
        checks.require(errors.len() >= 2, "no transient is left");
        cell.compare(EngineName::Reference, errors, &mut checks);
    }
    checks
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
    let starts = std::array::from_fn(|k| {
        let mut start = cycle.state;
        start[k % 4] += if k < 4 { DISTANCE } else { -DISTANCE };
        start
    });
    Settled { pair, starts, cycle }
}
