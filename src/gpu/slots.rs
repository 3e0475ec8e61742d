//! The buffers of a pool: the state of each slot on the device, and the transfers to and from the host.

use super::averaging::Averaging;
use super::device::{COMPACT, CONCLUDE, GATHER, Pipelines};
use super::layout::{COUNT_AT, Cell, Finding, Measured, Motion, QUEUE_HEAD, Reading, Settings, Tally};
use super::rounds::{bind, compacting, dispatch, row};
use super::tables::Tables;
use super::transfer::{buffer, from_reals, read, readback, upload};
use super::{Gpu, GpuError, LaneSettings, Precision};
use crate::record::limits::LONGEST_CYCLE;

/// Byte offset, in the shader's settings, of the flag that selects lanes for compaction.
const ENDED: u64 = std::mem::offset_of!(Settings, ended) as u64;

const COUNT_BYTES: u64 = size_of::<u32>() as u64;

/// The buffers for a number of slots.
pub(super) struct Slots {
    count: usize,
    workgroup: u32,
    pub(super) settings: wgpu::Buffer,
    pub(super) cells: wgpu::Buffer,
    pub(super) starts: wgpu::Buffer,
    pub(super) motions: wgpu::Buffer,
    pub(super) tallies: wgpu::Buffer,
    pub(super) queue: wgpu::Buffer,
    blocks: wgpu::Buffer,
    readings: wgpu::Buffer,
    findings: wgpu::Buffer,
    /// What was measured on lanes, and the buffer in which the host reads it; of one lane if nothing is measured.
    measured: [wgpu::Buffer; 2],
    /// Buffers in which the host reads `readings` and `findings`; and the number of results.
    readbacks: [wgpu::Buffer; 2],
    count_readback: wgpu::Buffer,
    /// Workgroups in a row of the grid.
    row: u32,
}

/// Returns the bytes of device memory that so many slots take; with those of measured quantities if `gathers`.
pub(super) fn bytes(slots: usize, precision: Precision, gathers: bool) -> u64 {
    let measured = if gathers { 2 * size_of::<Measured>() } else { 0 };
    let reals = size_of::<Reading>() + size_of::<[f64; 4]>() + size_of::<Motion>() + measured;
    let reals = reals / size_of::<f64>() * precision.bytes();
    let counts = size_of::<Finding>() + size_of::<Cell>() + size_of::<Tally>() + 3 * size_of::<u32>();
    (slots * (reals + counts)) as u64
}

impl Slots {
    pub(super) fn new(gpu: &Gpu, slots: usize, settings: &LaneSettings) -> Slots {
        let workgroup = settings.workgroup;
        let of_reals =
            |label, bytes: usize| buffer(gpu, label, bytes / size_of::<f64>() * gpu.precision.bytes());
        let readings = of_reals("readings", slots * size_of::<Reading>());
        let findings = buffer(gpu, "findings", slots * size_of::<Finding>());
        let places = if settings.gathers() { slots } else { 1 };
        let measured = of_reals("measured", places * size_of::<Measured>());
        Slots {
            count: slots,
            workgroup,
            settings: upload(gpu, "settings", bytemuck::bytes_of(&Settings::default())),
            cells: buffer(gpu, "cells", slots * size_of::<Cell>()),
            starts: of_reals("starts", slots * size_of::<[f64; 4]>()),
            motions: of_reals("motions", slots * size_of::<Motion>()),
            tallies: buffer(gpu, "tallies", slots * size_of::<Tally>()),
            queue: buffer(gpu, "queue", (QUEUE_HEAD + 2 * slots) * size_of::<u32>()),
            blocks: buffer(gpu, "blocks", slots * size_of::<u32>()),
            readbacks: [&readings, &findings].map(|buffer| readback(gpu, "results", buffer.size())),
            count_readback: readback(gpu, "count", COUNT_BYTES),
            measured: [measured.clone(), readback(gpu, "results", measured.size())],
            readings,
            findings,
            row: row(gpu, slots, workgroup),
        }
    }

    /// Returns all buffers, by binding.
    pub(super) fn bindings<'a>(&'a self, tables: &'a Tables) -> [&'a wgpu::Buffer; 14] {
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
            &self.measured[0],
        ]
    }

    /// Returns the workgroups for so many lanes.
    pub(super) fn grid(&self, lanes: u32) -> [u32; 2] {
        let groups = lanes.div_ceil(self.workgroup).max(1);
        [groups.min(self.row), groups.div_ceil(self.row)]
    }

    /// Uploads the active list, in the order in which its lanes began, and the settings. Lanes from place `first_new`
    /// on have yet to begin.
    pub(super) fn call(&self, gpu: &Gpu, active_list: &[u32], first_new: usize, settings: &LaneSettings) {
        let called = uniform(self, active_list.len(), first_new, settings, gpu.policy.late_tangent);
        gpu.write(&self.settings, 0, bytemuck::bytes_of(&called));
        let head = (QUEUE_HEAD * size_of::<u32>()) as u64;
        gpu.write(&self.queue, head, bytemuck::cast_slice(active_list));
    }

    /// Reads the results of the lanes that have ended, in the order of the active list.
    pub(super) async fn conclude(
        &self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        bindings: &[&wgpu::Buffer],
        active_lanes: usize,
        gathers: bool,
    ) -> Result<Vec<(Reading, Finding, Option<Measured>)>, GpuError> {
        let submission = gpu.call(|| {
            gpu.write(&self.settings, ENDED, bytemuck::bytes_of(&1_u32));
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            for (pass, (entry_point, pipeline)) in COMPACT.into_iter().zip(&pipelines.compact).enumerate() {
                let compact = bind(gpu, pipeline, entry_point, bindings);
                dispatch(gpu, &mut encoder, pipeline, &compact, compacting(pass, active_lanes as u32), None);
            }
            let concluding = bind(gpu, &pipelines.conclude, CONCLUDE, bindings);
            dispatch(
                gpu,
                &mut encoder,
                &pipelines.conclude,
                &concluding,
                self.grid(active_lanes as u32),
                None,
            );
            if gathers {
                let gathering = bind(gpu, &pipelines.gather, GATHER, bindings);
                dispatch(
                    gpu,
                    &mut encoder,
                    &pipelines.gather,
                    &gathering,
                    self.grid(active_lanes as u32),
                    None,
                );
            }
            encoder.copy_buffer_to_buffer(&self.queue, COUNT_AT, &self.count_readback, 0, COUNT_BYTES);
            gpu.submit(encoder)
        })?;
        let count = read(gpu, &self.count_readback, COUNT_BYTES, submission, |bytes| {
            bytemuck::pod_read_unaligned::<u32>(bytes) as usize
        })
        .await?
        .min(active_lanes);
        if count == 0 {
            return Ok(Vec::new());
        }
        let [readings, findings] = &self.readbacks;
        let numbers = (count * size_of::<Reading>() / size_of::<f64>() * gpu.precision.bytes()) as u64;
        let counts = (count * size_of::<Finding>()) as u64;
        let all_measured = if gathers {
            (count * size_of::<Measured>() / size_of::<f64>() * gpu.precision.bytes()) as u64
        } else {
            0
        };
        let [on_device, measured] = &self.measured;
        let submission = gpu.call(|| {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            if gathers {
                encoder.copy_buffer_to_buffer(on_device, 0, measured, 0, all_measured);
            }
            encoder.copy_buffer_to_buffer(&self.readings, 0, readings, 0, numbers);
            encoder.copy_buffer_to_buffer(&self.findings, 0, findings, 0, counts);
            gpu.submit(encoder)
        })?;
        let to_readings = |bytes: &[u8]| from_reals::<Reading>(bytes, gpu.precision);
        let readings = read(gpu, readings, numbers, submission.clone(), to_readings).await?;
        let to_findings = bytemuck::pod_collect_to_vec::<u8, Finding>;
        let findings = read(gpu, findings, counts, submission.clone(), to_findings).await?;
        let measured = if gathers {
            let to_measured = |bytes: &[u8]| from_reals::<Measured>(bytes, gpu.precision);
            read(gpu, measured, all_measured, submission, to_measured).await?
        } else {
            Vec::new()
        };
        let measured = measured.into_iter().map(Some).chain(std::iter::repeat(None));
        let results = readings.into_iter().zip(findings).zip(measured);
        Ok(results.map(|((reading, finding), measured)| (reading, finding, measured)).collect())
    }
}

fn uniform(
    slots: &Slots,
    active_lanes: usize,
    first_new: usize,
    settings: &LaneSettings,
    late_tangent: bool,
) -> Settings {
    let LaneSettings { periods, early_stop, .. } = *settings;
    let more = if early_stop { settings.undecided_periods } else { 0 };
    let decided_by = periods.saturating_add(more);
    let confirm_chaos = if settings.exponent { settings.confirm_chaos } else { 0 };
    // Lanes that stop early may stop before a long transient is over.
    let transient_periods = if early_stop {
        settings.transient_periods.min(settings.exponent_from)
    } else {
        settings.transient_periods
    };
    let averaging = Averaging::new(periods, settings.exponent_from);
    Settings {
        slots: slots.count as u32,
        active_lanes: active_lanes as u32,
        first_new: first_new as u32,
        periods,
        decided_by,
        longest: decided_by.saturating_add(confirm_chaos),
        chaos_from: settings.chaos_from,
        chaos_errors: settings.chaos_errors,
        iterations: settings.iterations,
        passes_per_period: settings.passes_per_period,
        events_per_period: settings.events_per_period,
        most_events: settings.most_events,
        row: slots.row * settings.workgroup,
        transient_periods,
        growth_from: if late_tangent { averaging.growth_from } else { 0 },
        exponent_from: averaging.exponent_from,
        exponent_block: averaging.block,
        max_period: settings.max_period.min(LONGEST_CYCLE),
        early_stop: u32::from(early_stop),
        measured_periods: settings.measures.map_or(0, |measures| measures.periods.max(1)),
        ended: 0,
    }
}
