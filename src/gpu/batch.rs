//! Batches: buffers, dispatches and reading back.

use super::constants::Constants;
use super::layout::{Cell, FlowShape, MODE_FREE, MODE_PRESSED, Motion, SIDE_NONE, Settings, Tally};
use super::reading::{record, refused, send_on};
use super::shader::{Precision, Variant};
use super::signal::Signal;
use super::{Gpu, GpuError, Lane, LaneSettings, device, layout};
use crate::model::{Law, Oscillator};
use crate::orbit::Status;
use crate::record::Record;

/// Dispatches between two looks at how many lanes are still running.
const DISPATCHES_PER_LOOK: u32 = 4;

/// Batches hold no more lanes than this, so that results come back in portions.
const LARGEST_BATCH: usize = 1 << 20;

/// Batches are not made smaller than this for want of memory.
const SMALLEST_BATCH: usize = 1024;

/// Longest period that a lane can look for: a byte per lag.
const LONGEST_PERIOD: u32 = 64;

/// Blocks whose means give the exponent's standard error.
const EXPONENT_BLOCKS: u32 = 16;

/// What all batches of a run share.
struct Shared {
    constants: Vec<Option<Constants>>,
    flows: wgpu::Buffer,
    shapes: wgpu::Buffer,
    phasors: wgpu::Buffer,
    laws: wgpu::Buffer,
}

pub(super) async fn run(
    gpu: &mut Gpu,
    flows: &[Oscillator],
    laws: &[Law],
    lanes: &[Lane],
    settings: &LaneSettings,
) -> Result<Vec<Record>, GpuError> {
    for (i, lane) in lanes.iter().enumerate() {
        if lane.flow as usize >= flows.len() || lane.law as usize >= laws.len() {
            let (flow, law) = (lane.flow, lane.law);
            return Err(GpuError::NoSuchCell { lane: i, flow, law, flows: flows.len(), laws: laws.len() });
        }
    }
    let keep = gpu.info.device_type == wgpu::DeviceType::Cpu;
    let LaneSettings { workgroup, exponent, .. } = *settings;
    let variant = Variant { precision: gpu.precision, workgroup, exponent, keep };
    if !gpu.pipelines.contains_key(&variant) {
        let pipeline = device::pipeline(gpu, variant).await?;
        gpu.pipelines.insert(variant, pipeline);
    }
    let pipeline = &gpu.pipelines[&variant];
    let shared = shared(gpu, flows, laws, settings)?;
    let mut records = Vec::with_capacity(lanes.len());
    let mut size = batch_lanes(gpu, settings);
    while records.len() < lanes.len() {
        let rest = &lanes[records.len()..];
        let batch = &rest[..size.min(rest.len())];
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let buffers = Batch::new(gpu, &shared, batch, settings);
        if scope.pop().await.is_some() {
            // A smaller batch may fit: results do not depend on it.
            if batch.len() <= SMALLEST_BATCH {
                return Err(GpuError::OutOfMemory { lanes: batch.len() });
            }
            size = batch.len() / 2;
            continue;
        }
        records.extend(buffers.run(gpu, pipeline, &shared, batch, settings).await?);
    }
    Ok(records)
}

/// Lanes per batch that the adapter's limits allow.
fn batch_lanes(gpu: &Gpu, settings: &LaneSettings) -> usize {
    let limits = gpu.device.limits();
    let largest = size_of::<Motion>().max(size_of::<Tally>()) as u64;
    let by_binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) / largest;
    let by_grid = u64::from(limits.max_compute_workgroups_per_dimension).pow(2);
    let most = by_binding.min(by_grid).min(LARGEST_BATCH as u64) as usize;
    settings.batch.unwrap_or(most).clamp(1, most.max(1))
}

fn shared(
    gpu: &Gpu,
    flows: &[Oscillator],
    laws: &[Law],
    settings: &LaneSettings,
) -> Result<Shared, GpuError> {
    let constants: Vec<_> =
        flows.iter().map(|flow| Constants::new(flow, settings.steps_per_period)).collect();
    let (mut tables, mut shapes, mut phasors) = (Vec::new(), Vec::new(), Vec::new());
    for constants in &constants {
        match constants {
            Some(constants) => {
                shapes.push(FlowShape { steps: constants.steps, phasors: phasors.len() as u32 });
                tables.push(constants.flow);
                phasors.extend_from_slice(&constants.phasors);
            }
            // Its lanes are refused before they start.
            None => {
                shapes.push(FlowShape { steps: 1, phasors: 0 });
                tables.push(bytemuck::Zeroable::zeroed());
            }
        }
    }
    phasors.push([1.0, 0.0]);
    let laws: Vec<layout::Law> = laws
        .iter()
        .map(|law| layout::Law { restitution: law.restitution, mesh_speed: law.mesh_speed })
        .collect();
    let tables = reals(&tables, gpu.precision);
    let phasors = reals(&phasors, gpu.precision);
    let allowed = gpu.device.limits().max_storage_buffer_binding_size;
    let needed = tables.len().max(phasors.len()) as u64;
    if needed > allowed {
        return Err(GpuError::TooManyFlows { flows: flows.len(), needed, allowed });
    }
    Ok(Shared {
        flows: upload(gpu, "flows", &tables),
        shapes: upload(gpu, "shapes", bytemuck::cast_slice(&shapes)),
        phasors: upload(gpu, "phasors", &phasors),
        laws: upload(gpu, "laws", &reals(&laws, gpu.precision)),
        constants,
    })
}

/// Numbers of structs of reals in the variant's precision.
fn reals<T: bytemuck::Pod>(items: &[T], precision: Precision) -> Vec<u8> {
    let numbers: &[f64] = bytemuck::cast_slice(items);
    match precision {
        Precision::F64 => bytemuck::cast_slice(numbers).to_vec(),
        Precision::F32 => numbers.iter().flat_map(|&x| (x as f32).to_ne_bytes()).collect(),
    }
}

/// The reverse of [`reals`].
fn from_reals<T: bytemuck::Pod>(bytes: &[u8], precision: Precision) -> Vec<T> {
    let numbers: Vec<f64> = match precision {
        Precision::F64 => bytemuck::pod_collect_to_vec(bytes),
        Precision::F32 => {
            bytemuck::pod_collect_to_vec::<u8, f32>(bytes).iter().map(|&x| f64::from(x)).collect()
        }
    };
    bytemuck::cast_slice(&numbers).to_vec()
}

fn upload(gpu: &Gpu, label: &'static str, bytes: &[u8]) -> wgpu::Buffer {
    let usage = wgpu::BufferUsages::STORAGE
        | wgpu::BufferUsages::UNIFORM
        | wgpu::BufferUsages::COPY_DST
        | wgpu::BufferUsages::COPY_SRC;
    let size = bytes.len().max(16) as u64;
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage,
        mapped_at_creation: false,
    });
    gpu.queue.write_buffer(&buffer, 0, bytes);
    buffer
}

/// Periods per block of the exponent.
pub(super) fn exponent_block(settings: &LaneSettings) -> u32 {
    (settings.periods.saturating_sub(settings.exponent_from) / EXPONENT_BLOCKS).max(1)
}

/// The state of one batch on the device.
struct Batch {
    motions: wgpu::Buffer,
    tallies: wgpu::Buffer,
    live: wgpu::Buffer,
    look: wgpu::Buffer,
    bindings: wgpu::BindGroup,
    groups: [u32; 2],
}

impl Batch {
    fn new(gpu: &Gpu, shared: &Shared, lanes: &[Lane], settings: &LaneSettings) -> Batch {
        let cells: Vec<Cell> =
            lanes.iter().map(|lane| Cell { flow_index: lane.flow, law_index: lane.law }).collect();
        let (motions, tallies): (Vec<Motion>, Vec<Tally>) =
            lanes.iter().map(|lane| start(shared.constants[lane.flow as usize].as_ref(), lane)).unzip();
        let groups = grid(gpu, lanes.len(), settings.workgroup);
        let uniform = Settings {
            lanes: lanes.len() as u32,
            periods: settings.periods,
            trips: settings.trips,
            passes_per_period: settings.passes_per_period,
            events_per_period: settings.events_per_period,
            row: groups[0] * settings.workgroup,
            transient_periods: settings.transient_periods,
            exponent_from: settings.exponent_from,
            exponent_block: exponent_block(settings),
            max_period: settings.max_period.min(LONGEST_PERIOD),
            early_stop: u32::from(settings.early_stop),
        };
        let uniform = upload(gpu, "settings", bytemuck::bytes_of(&uniform));
        let cells = upload(gpu, "cells", bytemuck::cast_slice(&cells));
        let motions = upload(gpu, "motions", &reals(&motions, gpu.precision));
        let tallies = upload(gpu, "tallies", bytemuck::cast_slice(&tallies));
        let live = upload(gpu, "live", &[0; 4]);
        let look = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("look"),
            size: 4,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let buffers = [
            &uniform,
            &shared.flows,
            &shared.shapes,
            &shared.phasors,
            &shared.laws,
            &cells,
            &motions,
            &tallies,
            &live,
        ];
        let entries: Vec<_> = buffers
            .iter()
            .enumerate()
            .map(|(i, buffer)| wgpu::BindGroupEntry {
                binding: i as u32,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let bindings = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("lane"),
            layout: &gpu.layout,
            entries: &entries,
        });
        Batch { motions, tallies, live, look, bindings, groups }
    }

    /// Dispatches until no lane is running, then reads the records.
    async fn run(
        self,
        gpu: &Gpu,
        pipeline: &wgpu::ComputePipeline,
        shared: &Shared,
        lanes: &[Lane],
        settings: &LaneSettings,
    ) -> Result<Vec<Record>, GpuError> {
        let (motions, tallies) = loop {
            self.dispatch_all(gpu, pipeline).await?;
            let mut motions: Vec<Motion> = from_reals(&download(gpu, &self.motions).await?, gpu.precision);
            let mut tallies: Vec<Tally> = bytemuck::pod_collect_to_vec(&download(gpu, &self.tallies).await?);
            let mut sent_on = 0;
            for (motion, tally) in motions.iter_mut().zip(&mut tallies) {
                sent_on += usize::from(send_on(motion, tally, settings));
            }
            if sent_on == 0 {
                break (motions, tallies);
            }
            gpu.queue.write_buffer(&self.motions, 0, &reals(&motions, gpu.precision));
            gpu.queue.write_buffer(&self.tallies, 0, bytemuck::cast_slice(&tallies));
        };
        let read = |(lane, (motion, tally)): (&Lane, (&Motion, &Tally))| {
            let constants = shared.constants[lane.flow as usize].as_ref();
            constants.map_or_else(|| refused(tally), |constants| record(constants, motion, tally, settings))
        };
        Ok(lanes.iter().zip(motions.iter().zip(&tallies)).map(read).collect())
    }

    /// Dispatches until no lane is running.
    async fn dispatch_all(&self, gpu: &Gpu, pipeline: &wgpu::ComputePipeline) -> Result<(), GpuError> {
        loop {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            for _ in 0..DISPATCHES_PER_LOOK {
                encoder.clear_buffer(&self.live, 0, None);
                let mut pass = encoder.begin_compute_pass(&Default::default());
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, &self.bindings, &[]);
                pass.dispatch_workgroups(self.groups[0], self.groups[1], 1);
            }
            encoder.copy_buffer_to_buffer(&self.live, 0, &self.look, 0, 4);
            gpu.queue.submit([encoder.finish()]);
            if read(gpu, &self.look).await?[..4] == [0; 4] {
                return Ok(());
            }
        }
    }
}

/// Workgroups in two dimensions for so many lanes.
fn grid(gpu: &Gpu, lanes: usize, workgroup: u32) -> [u32; 2] {
    let groups = (lanes as u32).div_ceil(workgroup).max(1);
    let widest = gpu.device.limits().max_compute_workgroups_per_dimension;
    let rows = groups.div_ceil(widest);
    [groups.div_ceil(rows), rows]
}

/// Where a lane starts.
fn start(constants: Option<&Constants>, lane: &Lane) -> (Motion, Tally) {
    let tally = Tally { mode: MODE_FREE, origin: SIDE_NONE, tangent_count: 1, ..Tally::default() };
    let refuse = |status: Status| (Motion::default(), Tally { status: status.code(), ..tally });
    let Some(constants) = constants else { return refuse(Status::TooStiff) };
    if !lane.start.iter().all(|x| x.is_finite()) {
        return refuse(Status::NonFinite);
    }
    let mut motion = Motion { q: constants.to_lane(lane.start), phasor: [1.0, 0.0], ..Motion::default() };
    motion.tangents[..4].fill(0.5);
    let [right, left] = constants.flow.walls;
    let mut tally = tally;
    for (side, beyond) in [(0, motion.q[0] - right), (1, left - motion.q[0])] {
        if beyond > 0.0 {
            motion.q[0] -= constants.flow.walls[side as usize];
            tally.mode = MODE_PRESSED + side;
            tally.origin = side;
        }
    }
    (motion, tally)
}

async fn download(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
    let copy = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("download"),
        size: buffer.size(),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, buffer.size());
    gpu.queue.submit([encoder.finish()]);
    read(gpu, &copy).await
}

async fn read(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
    // A device that is lost tells so once; what follows from it says less.
    let lost = |message: String| GpuError::Lost { message: gpu.trouble.message().unwrap_or(message) };
    let (mapped, send) = Signal::new();
    buffer.map_async(wgpu::MapMode::Read, .., send);
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| lost(error.to_string()))?;
    if let Some(message) = gpu.trouble.message() {
        return Err(GpuError::Lost { message });
    }
    mapped.await.map_err(|error| lost(error.to_string()))?;
    let bytes = buffer.get_mapped_range(..).map_err(|error| lost(error.to_string()))?.to_vec();
    buffer.unmap();
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::AdapterChoice;
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
