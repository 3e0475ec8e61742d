//! Lanes on a device. No adapter is a failure: install a software driver (see `scripts/test.sh`).

use rattlemap::engine::{self, Engine};
use rattlemap::gpu::{AdapterChoice, Gpu, Lane, LaneSettings, Precision};
use rattlemap::model::{GearPair, Law, Oscillator, State};
use rattlemap::plan::Plan;
use rattlemap::record::Record;

use super::REST;

/// A device of its own for the caller.
pub(crate) fn open(precision: Precision) -> Gpu {
    pollster::block_on(Gpu::open(precision, &AdapterChoice::default())).unwrap()
}

/// The engine of a plan's lanes.
pub(crate) fn engine(plan: &Plan, precision: Precision) -> Engine<'_> {
    Engine::Gpu(Box::new(pollster::block_on(engine::Gpu::new(plan, open(precision))).unwrap()))
}

/// A flow, a law and a lane for every cell and its start.
pub(crate) fn lanes(cells: &[(GearPair, State)]) -> (Vec<Oscillator>, Vec<Law>, Vec<Lane>) {
    let flows = cells.iter().map(|(pair, _)| pair.oscillator().unwrap()).collect();
    let laws = cells.iter().map(|(pair, _)| pair.law()).collect();
    let lanes = (0..).zip(cells).map(|(i, &(_, start))| Lane { flow: i, law: i, start }).collect();
    (flows, laws, lanes)
}

/// One record per cell and start.
pub(crate) fn run(gpu: &mut Gpu, cells: &[(GearPair, State)], settings: &LaneSettings) -> Vec<Record> {
    let (flows, laws, lanes) = lanes(cells);
    pollster::block_on(gpu.run(&flows, &laws, &lanes, settings)).unwrap()
}

/// One record per pair, from rest.
pub(crate) fn run_from_rest(gpu: &mut Gpu, pairs: &[GearPair], settings: &LaneSettings) -> Vec<Record> {
    let cells: Vec<_> = pairs.iter().map(|&pair| (pair, REST)).collect();
    run(gpu, &cells, settings)
}
