//! Batches: buffers, dispatches and reading back.

use super::averaging::Averaging;
use super::device::{BEGIN, CONCLUDE, Pipelines};
use super::guard::guarded;
use super::layout::{Cell, Finding, Motion, Reading, Settings, Tally};
use super::reading::record;
use super::rounds::{Rounds, bind, dispatch, row};
use super::stage::Stage;
use super::tables::Tables;
use super::transfer::{buffer, from_reals, landing, read, reals, upload};
use super::{Gpu, GpuError, Lane, LaneSettings};
use crate::orbit::Status;
use crate::record::Record;

/// Batches hold no more lanes than this: below 1 GB on the device.
const LARGEST_BATCH: usize = 1 << 20;

/// Longest period that a lane can look for: a byte per lag.
const LONGEST_PERIOD: u32 = 64;

/// Numbers of the queue before its lanes.
const QUEUE_HEAD: usize = 3;

pub(super) async fn run(
    gpu: &Gpu,
    variants: &[&Pipelines],
    tables: &Tables,
    lanes: &[Lane],
    settings: &LaneSettings,
) -> Result<Vec<Record>, GpuError> {
    let (flows, laws) = (tables.constants.len(), tables.law_count);
    for (i, &Lane { flow, law, .. }) in lanes.iter().enumerate() {
        if flow as usize >= flows || law as usize >= laws {
            return Err(GpuError::NoSuchCell { lane: i, flow, law, flows, laws });
        }
    }
    let mut records = Vec::with_capacity(lanes.len());
    for batch in lanes.chunks(batch_lanes(gpu, settings)) {
        let make = || Batch::new(gpu, tables, batch, settings);
        let buffers = guarded(gpu, "lanes", batch.len(), make).await?;
        records.extend(buffers.run(gpu, variants, tables, batch, settings).await?);
    }
    Ok(records)
}

fn batch_lanes(gpu: &Gpu, settings: &LaneSettings) -> usize {
    let most = largest_batch(&gpu.device.limits());
    settings.batch.unwrap_or(most).clamp(1, most)
}

/// Lanes per batch that an adapter's limits allow.
pub(super) fn largest_batch(limits: &wgpu::Limits) -> usize {
    let largest = size_of::<Motion>().max(size_of::<Tally>()) as u64;
    let by_binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) / largest;
    let by_grid = u64::from(limits.max_compute_workgroups_per_dimension).pow(2);
    by_binding.min(by_grid).clamp(1, LARGEST_BATCH as u64) as usize
}

/// One batch on the device: its buffers.
struct Batch {
    settings: wgpu::Buffer,
    cells: wgpu::Buffer,
    starts: wgpu::Buffer,
    motions: wgpu::Buffer,
    tallies: wgpu::Buffer,
    queue: wgpu::Buffer,
    blocks: wgpu::Buffer,
    readings: wgpu::Buffer,
    findings: wgpu::Buffer,
    /// Where the host reads the last two.
    landings: [wgpu::Buffer; 2],
    /// Workgroups in a row of the grid.
    row: u32,
}

impl Batch {
    fn new(gpu: &Gpu, tables: &Tables, lanes: &[Lane], settings: &LaneSettings) -> Batch {
        let row = row(gpu, lanes.len(), settings.workgroup);
        let uniform = uniform(lanes.len(), row, settings);
        let (cells, starts): (Vec<Cell>, Vec<[f64; 4]>) =
            lanes.iter().map(|lane| start(tables, lane)).unzip();
        let of_reals = |label, bytes: usize| {
            buffer(gpu, label, lanes.len() * bytes / size_of::<f64>() * gpu.precision.bytes())
        };
        let readings = of_reals("readings", size_of::<Reading>());
        let findings = buffer(gpu, "findings", lanes.len() * size_of::<Finding>());
        Batch {
            settings: upload(gpu, "settings", bytemuck::bytes_of(&uniform)),
            cells: upload(gpu, "cells", bytemuck::cast_slice(&cells)),
            starts: upload(gpu, "starts", &reals(&starts, gpu.precision)),
            motions: of_reals("motions", size_of::<Motion>()),
            tallies: buffer(gpu, "tallies", lanes.len() * size_of::<Tally>()),
            queue: buffer(gpu, "queue", (QUEUE_HEAD + 2 * lanes.len()) * size_of::<u32>()),
            blocks: buffer(gpu, "blocks", lanes.len() * size_of::<u32>()),
            landings: [&readings, &findings].map(|buffer| landing(gpu, "results", buffer.size())),
            readings,
            findings,
            row,
        }
    }

    /// All buffers by binding.
    fn bindings<'a>(&'a self, tables: &'a Tables) -> [&'a wgpu::Buffer; 13] {
        [
            &self.settings,
            &tables.flows,
            &tables.shapes,
            &tables.phasors,
            &tables.laws,
            &self.cells,
            &self.motions,
            &self.tallies,
            &self.queue,
            &self.starts,
            &self.readings,
            &self.findings,
            &self.blocks,
        ]
    }

    /// Integrates the lanes to their ends, by one variant after the other, and reads their
    /// records.
    async fn run(
        self,
        gpu: &Gpu,
        variants: &[&Pipelines],
        tables: &Tables,
        lanes: &[Lane],
        settings: &LaneSettings,
    ) -> Result<Vec<Record>, GpuError> {
        let buffers = self.bindings(tables);
        let rounds = Rounds {
            gpu,
            settings: &self.settings,
            queue: &self.queue,
            buffers: &buffers,
            lanes: lanes.len() as u32,
            workgroup: settings.workgroup,
            most_trips: settings.trips,
            row: self.row,
        };
        let grid = rounds.grid(lanes.len() as u32);
        let (first, last) = (variants[0], variants[variants.len() - 1]);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        dispatch(&mut encoder, &first.begin, &bind(gpu, &first.begin, BEGIN, &buffers), grid, None);
        gpu.queue.submit([encoder.finish()]);
        gpu.tell(Stage::Uploaded);
        let device_seconds = rounds.run(variants).await?;
        gpu.tell(Stage::Integrated { device_seconds });
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        dispatch(&mut encoder, &last.conclude, &bind(gpu, &last.conclude, CONCLUDE, &buffers), grid, None);
        let [readings, findings] = &self.landings;
        for (buffer, landing) in [(&self.readings, readings), (&self.findings, findings)] {
            encoder.copy_buffer_to_buffer(buffer, 0, landing, 0, buffer.size());
        }
        let submission = gpu.queue.submit([encoder.finish()]);
        let readings: Vec<Reading> =
            read(gpu, readings, submission.clone(), |bytes| from_reals(bytes, gpu.precision)).await?;
        let findings: Vec<Finding> = read(gpu, findings, submission, bytemuck::pod_collect_to_vec).await?;
        let record = |(lane, (reading, finding)): (&Lane, (&Reading, &Finding))| {
            record(tables.constants[lane.flow as usize].as_ref(), reading, finding)
        };
        let records = lanes.iter().zip(readings.iter().zip(&findings)).map(record).collect();
        gpu.tell(Stage::Read);
        Ok(records)
    }
}

fn uniform(lanes: usize, row: u32, settings: &LaneSettings) -> Settings {
    let LaneSettings { periods, early_stop, .. } = *settings;
    let more = if early_stop { settings.undecided_periods } else { 0 };
    // Lanes that stop early may do so before a long transient is over.
    let transient_periods = if early_stop {
        settings.transient_periods.min(settings.exponent_from)
    } else {
        settings.transient_periods
    };
    let averaging = Averaging::new(periods, settings.exponent_from);
    Settings {
        lanes: lanes as u32,
        periods,
        longest: periods.saturating_add(more),
        chaos_from: settings.chaos_from,
        chaos_errors: settings.chaos_errors,
        trips: settings.trips,
        passes_per_period: settings.passes_per_period,
        events_per_period: settings.events_per_period,
        row: row * settings.workgroup,
        transient_periods,
        growth_from: averaging.growth_from,
        exponent_from: averaging.exponent_from,
        exponent_block: averaging.block,
        max_period: settings.max_period.min(LONGEST_PERIOD),
        early_stop: u32::from(early_stop),
    }
}

/// What a lane integrates, and where it starts in lane units.
fn start(tables: &Tables, lane: &Lane) -> (Cell, [f64; 4]) {
    let cell = Cell { flow_index: lane.flow, law_index: lane.law, refused: Status::Ok.code() };
    let refuse = |status: Status| (Cell { refused: status.code(), ..cell }, [0.0; 4]);
    match &tables.constants[lane.flow as usize] {
        None => refuse(Status::TooStiff),
        Some(_) if !lane.start.iter().all(|x| x.is_finite()) => refuse(Status::NonFinite),
        Some(constants) => (cell, constants.to_lane(lane.start)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{AdapterChoice, Precision};
    use crate::model::GearPair;

    #[test]
    fn a_lost_device_is_an_error_that_says_so() {
        let mut gpu = pollster::block_on(Gpu::open(Precision::F32, &AdapterChoice::default())).unwrap();
        gpu.device.destroy();
        let pair = GearPair::paper(0.5);
        let lanes = [Lane { flow: 0, law: 0, start: [0.0; 4] }];
        let flows = [pair.oscillator().unwrap()];
        let settings = LaneSettings::default();
        let error = pollster::block_on(gpu.run(&flows, &[pair.law()], &lanes, &settings)).unwrap_err();
        assert!(matches!(error, GpuError::Lost { .. }), "{error}");
        assert!(error.to_string().contains("lost"), "{error}");
    }
}
