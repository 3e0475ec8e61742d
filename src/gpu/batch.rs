//! Batches: buffers, dispatches and reading back.

use super::device::{BEGIN, CONCLUDE, EntryPoint, Pipelines, SWEEP};
use super::layout::{Cell, Finding, Motion, Reading, Settings, Tally};
use super::reading::record;
use super::stage::{Clock, Stage};
use super::tables::Tables;
use super::transfer::{buffer, from_reals, landing, read, reals, upload};
use super::{Gpu, GpuError, Lane, LaneSettings};
use crate::orbit::Status;
use crate::record::Record;

/// Dispatches between two looks at how many lanes are still running.
const DISPATCHES_PER_LOOK: u32 = 4;

/// Bytes of a look: lanes left, room, two timestamps.
const LOOK: u64 = 24;
const TIMES: u64 = 8;

/// Batches hold no more lanes than this: below 1 GB on the device.
const LARGEST_BATCH: usize = 1 << 20;

/// Longest period that a lane can look for: a byte per lag.
const LONGEST_PERIOD: u32 = 64;

/// Blocks whose means give the exponent's standard error.
const EXPONENT_BLOCKS: u32 = 32;

pub(super) async fn run(
    gpu: &Gpu,
    pipelines: &Pipelines,
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
        let out_of_memory = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        // What is made of a buffer that is not there is refused, which says no more.
        let refused = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let buffers = Batch::new(gpu, pipelines, tables, batch, settings);
        let (refused, out_of_memory) = (refused.pop(), out_of_memory.pop());
        let (refused, out_of_memory) = (refused.await, out_of_memory.await);
        if out_of_memory.is_some() {
            return Err(GpuError::OutOfMemory { lanes: batch.len() });
        }
        if let Some(error) = refused {
            return Err(gpu.failure(GpuError::Refused { what: "a batch", message: error.to_string() }));
        }
        records.extend(buffers.run(gpu, pipelines, tables, batch).await?);
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

/// Periods per block of the exponent.
fn exponent_block(settings: &LaneSettings) -> u32 {
    (settings.periods.saturating_sub(settings.exponent_from) / EXPONENT_BLOCKS).max(1)
}

/// One batch on the device.
struct Batch {
    live: wgpu::Buffer,
    /// Copies of `live` that the host reads, one while the other is written, and the device's
    /// time if it is asked for.
    looks: [wgpu::Buffer; 2],
    /// Readings and findings, and where the host reads them.
    results: [(wgpu::Buffer, wgpu::Buffer); 2],
    begin: wgpu::BindGroup,
    sweep: wgpu::BindGroup,
    conclude: wgpu::BindGroup,
    groups: [u32; 2],
}

impl Batch {
    fn new(
        gpu: &Gpu,
        pipelines: &Pipelines,
        tables: &Tables,
        lanes: &[Lane],
        settings: &LaneSettings,
    ) -> Batch {
        let groups = grid(gpu, lanes.len(), settings.workgroup);
        let uniform = upload(gpu, "settings", bytemuck::bytes_of(&uniform(lanes.len(), groups, settings)));
        let (cells, starts): (Vec<Cell>, Vec<[f64; 4]>) =
            lanes.iter().map(|lane| start(tables, lane)).unzip();
        let cells = upload(gpu, "cells", bytemuck::cast_slice(&cells));
        let starts = upload(gpu, "starts", &reals(&starts, gpu.precision));
        let of_reals = |label, bytes: usize| {
            buffer(gpu, label, lanes.len() * bytes / size_of::<f64>() * gpu.precision.bytes())
        };
        let motions = of_reals("motions", size_of::<Motion>());
        let tallies = buffer(gpu, "tallies", lanes.len() * size_of::<Tally>());
        let live = buffer(gpu, "live", 4);
        let readings = of_reals("readings", size_of::<Reading>());
        let findings = buffer(gpu, "findings", lanes.len() * size_of::<Finding>());
        let buffers = [
            &uniform,
            &tables.flows,
            &tables.shapes,
            &tables.phasors,
            &tables.laws,
            &cells,
            &motions,
            &tallies,
            &live,
            &starts,
            &readings,
            &findings,
        ];
        let bind = |pipeline: &wgpu::ComputePipeline, entry_point: EntryPoint| {
            let entry = |&binding: &u32| wgpu::BindGroupEntry {
                binding,
                resource: buffers[binding as usize].as_entire_binding(),
            };
            let entries: Vec<_> = [0].iter().chain(entry_point.storage).map(entry).collect();
            let layout = &pipeline.get_bind_group_layout(0);
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout,
                entries: &entries,
            })
        };
        Batch {
            looks: [landing(gpu, "look", LOOK), landing(gpu, "look", LOOK)],
            begin: bind(&pipelines.begin, BEGIN),
            sweep: bind(&pipelines.sweep, SWEEP),
            conclude: bind(&pipelines.conclude, CONCLUDE),
            results: [readings, findings].map(|buffer| {
                let landing = landing(gpu, "results", buffer.size());
                (buffer, landing)
            }),
            live,
            groups,
        }
    }

    /// Integrates the lanes to their ends and reads their records.
    async fn run(
        self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        tables: &Tables,
        lanes: &[Lane],
    ) -> Result<Vec<Record>, GpuError> {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        self.dispatch(&mut encoder, &pipelines.begin, &self.begin, None);
        gpu.queue.submit([encoder.finish()]);
        gpu.tell(Stage::Uploaded);
        let device_seconds = self.sweep_all(gpu, pipelines).await?;
        gpu.tell(Stage::Integrated { device_seconds });
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        self.dispatch(&mut encoder, &pipelines.conclude, &self.conclude, None);
        for (buffer, landing) in &self.results {
            encoder.copy_buffer_to_buffer(buffer, 0, landing, 0, buffer.size());
        }
        let submission = gpu.queue.submit([encoder.finish()]);
        let [readings, findings] = &self.results;
        let readings: Vec<Reading> =
            read(gpu, &readings.1, submission.clone(), |bytes| from_reals(bytes, gpu.precision)).await?;
        let findings: Vec<Finding> = read(gpu, &findings.1, submission, bytemuck::pod_collect_to_vec).await?;
        let record = |(lane, (reading, finding)): (&Lane, (&Reading, &Finding))| {
            record(tables.constants[lane.flow as usize].as_ref(), reading, finding)
        };
        let records = lanes.iter().zip(readings.iter().zip(&findings)).map(record).collect();
        gpu.tell(Stage::Read);
        Ok(records)
    }

    /// Dispatches until no lane is running. The next dispatches are under way while the host
    /// looks at the last ones; a lane that has ended costs them next to nothing.
    /// Returns the device's own time where somebody measures.
    async fn sweep_all(&self, gpu: &Gpu, pipelines: &Pipelines) -> Result<Option<f64>, GpuError> {
        let clock = gpu.watcher.as_ref().and_then(|_| Clock::new(&gpu.device, &gpu.queue));
        let mut seconds = 0.0;
        let mut before = None;
        for (slot, look) in (0..2).zip(&self.looks).cycle() {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            for nth in 0..DISPATCHES_PER_LOOK {
                encoder.clear_buffer(&self.live, 0, None);
                let is_last = nth + 1 == DISPATCHES_PER_LOOK;
                let writes = clock.as_ref().and_then(|clock| clock.writes(slot, nth == 0, is_last));
                self.dispatch(&mut encoder, &pipelines.sweep, &self.sweep, writes);
            }
            if let Some(clock) = &clock {
                clock.copy(&mut encoder, slot, look, TIMES);
            }
            encoder.copy_buffer_to_buffer(&self.live, 0, look, 0, 4);
            let submission = gpu.queue.submit([encoder.finish()]);
            if let Some((look, submission)) = before.replace((look, submission)) {
                let take = |bytes: &[u8]| {
                    let took = clock.as_ref().map_or(0.0, |clock| clock.seconds(&bytes[TIMES as usize..]));
                    (bytes[..4] == [0; 4], took)
                };
                let (is_done, took) = read(gpu, look, submission, take).await?;
                seconds += took;
                if is_done {
                    break;
                }
            }
        }
        Ok(clock.map(|_| seconds))
    }

    fn dispatch(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pipeline: &wgpu::ComputePipeline,
        bindings: &wgpu::BindGroup,
        timestamp_writes: Option<wgpu::ComputePassTimestampWrites<'_>>,
    ) {
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, bindings, &[]);
        pass.dispatch_workgroups(self.groups[0], self.groups[1], 1);
    }
}

fn uniform(lanes: usize, groups: [u32; 2], settings: &LaneSettings) -> Settings {
    let LaneSettings { periods, early_stop, .. } = *settings;
    let more = if early_stop { settings.undecided_periods } else { 0 };
    // Lanes that stop early may do so before a long transient is over.
    let transient_periods = if early_stop {
        settings.transient_periods.min(settings.exponent_from)
    } else {
        settings.transient_periods
    };
    Settings {
        lanes: lanes as u32,
        periods,
        longest: periods.saturating_add(more),
        chaos_from: settings.chaos_from,
        trips: settings.trips,
        passes_per_period: settings.passes_per_period,
        events_per_period: settings.events_per_period,
        row: groups[0] * settings.workgroup,
        transient_periods,
        exponent_from: settings.exponent_from,
        exponent_block: exponent_block(settings),
        max_period: settings.max_period.min(LONGEST_PERIOD),
        early_stop: u32::from(early_stop),
    }
}

/// Workgroups in two dimensions for so many lanes.
fn grid(gpu: &Gpu, lanes: usize, workgroup: u32) -> [u32; 2] {
    let groups = (lanes as u32).div_ceil(workgroup).max(1);
    let widest = gpu.device.limits().max_compute_workgroups_per_dimension;
    let rows = groups.div_ceil(widest);
    [groups.div_ceil(rows), rows]
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
