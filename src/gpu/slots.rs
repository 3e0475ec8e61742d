//! The buffers of a pool: the state of each slot on the device, and the transfers to and from the host.

use rayon::prelude::*;

use super::adapter::{MOST_UNDER_WAY, most_slots};
use super::averaging::Averaging;
use super::device::{CONCLUDE, GATHER};
use super::dispatch_policy::DispatchPolicy;
use super::layout::{BLOCK, Cell, Finding, KEYS, List, QUEUE_HEAD, Reading, Settings, length_of};
use super::rounds::{Counted, Listed, Workgroups, bind, count_at, dispatch, making_lists, row};
use super::tables::Tables;
use super::transfer::{Download, buffer, from_reals, indirect, readback, upload};
use super::{Gpu, GpuError, LaneSettings, Precision, Variant};
use crate::record::limits::LONGEST_CYCLE;

/// Results of lanes: averages, findings, and measured quantities if any were measured.
pub(super) type Returned = (Vec<Reading>, Vec<Finding>, Vec<Box<[f64]>>);

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
    /// Measured quantities of lanes, and the buffer in which the host reads them. If nothing is measured, both have room for one lane.
    measured: [wgpu::Buffer; 2],
    /// Workgroups of dispatches over the lists.
    pub(super) workgroups: wgpu::Buffer,
    /// Buffers in which the host reads `readings` and `findings`; and the number of results.
    readbacks: [wgpu::Buffer; 2],
    count_readback: wgpu::Buffer,
    /// Workgroups in a row of the grid.
    row: u32,
}

/// Returns the size of a lane's counters on the device.
fn tally_bytes() -> usize {
    length_of("Tally", 0) * size_of::<u32>()
}

/// Returns the size of a lane's findings on the device.
fn finding_bytes(settings: &LaneSettings) -> usize {
    Finding::length(settings.word || settings.pattern) * size_of::<u32>()
}

/// Reads findings of `size` bytes each, with symbols of zero if they have none.
fn findings(bytes: &[u8], size: usize) -> Vec<Finding> {
    let widened = |bytes: &[u8]| {
        let mut finding = Finding::default();
        bytemuck::bytes_of_mut(&mut finding)[..size].copy_from_slice(bytes);
        finding
    };
    bytes.par_chunks_exact(size).map(widened).collect()
}

/// Splits the readings into those of single lanes. Entries that a state does not have are zero.
fn readings(numbers: &[f64], dim: usize) -> Vec<Reading> {
    let size = length_of("Reading", dim);
    let widened = |numbers: &[f64]| {
        let mut reading = Reading::default();
        let all: &mut [f64] = bytemuck::cast_slice_mut(std::slice::from_mut(&mut reading));
        all[..size].copy_from_slice(numbers);
        reading
    };
    numbers.par_chunks_exact(size).map(widened).collect()
}

/// Returns the number of bytes of device memory for a number of slots.
pub(super) fn bytes(slots: usize, precision: Precision, settings: &LaneSettings) -> u64 {
    let dim = settings.features.dim();
    let measured = if settings.gathers() { 2 * length_of("Measured", dim) } else { 0 };
    let reals = 2 * length_of("Reading", dim)
        + settings.features.start_numbers()
        + length_of("Motion", dim)
        + measured;
    let reals = reals * precision.bytes();
    let counts = 2 * finding_bytes(settings) + size_of::<Cell>() + tally_bytes() + 3 * size_of::<u32>();
    (slots * (reals + counts)) as u64
}

/// Largest number of bytes of a pool's lanes. A card is busy with far fewer lanes than it has memory for, and new lanes take the places of
/// those that have ended.
const MOST_BYTES: u64 = 110_000_000;

/// Returns the largest number of slots of a pool, unless the settings ask for another number.
pub(super) fn most(limits: &wgpu::Limits, precision: Precision, settings: &LaneSettings) -> usize {
    let fitting = (MOST_BYTES / bytes(1, precision, settings)) as usize;
    let most = most_slots(limits);
    settings.batch.unwrap_or(fitting.min(MOST_UNDER_WAY)).clamp(1, most)
}

impl Slots {
    pub(super) fn new(gpu: &Gpu, slots: usize, settings: &LaneSettings) -> Slots {
        let workgroup = settings.workgroup;
        let dim = settings.features.dim();
        let of_reals = |label, numbers: usize| buffer(gpu, label, numbers * gpu.precision.bytes());
        let readings = of_reals("readings", slots * length_of("Reading", dim));
        let findings = buffer(gpu, "findings", slots * finding_bytes(settings));
        let places = if settings.gathers() { slots } else { 1 };
        let measured = of_reals("measured", places * length_of("Measured", dim));
        Slots {
            count: slots,
            workgroup,
            settings: upload(gpu, "settings", bytemuck::bytes_of(&Settings::default())),
            cells: buffer(gpu, "cells", slots * size_of::<Cell>()),
            starts: of_reals("starts", slots * settings.features.start_numbers()),
            motions: of_reals("motions", slots * length_of("Motion", dim)),
            tallies: buffer(gpu, "tallies", slots * tally_bytes()),
            queue: buffer(gpu, "queue", (QUEUE_HEAD + 2 * slots) * size_of::<u32>()),
            blocks: buffer(gpu, "blocks", KEYS * slots.div_ceil(BLOCK as usize) * size_of::<u32>()),
            readbacks: [&readings, &findings].map(|buffer| readback(gpu, "results", buffer.size())),
            workgroups: indirect(gpu),
            count_readback: readback(gpu, "count", COUNT_BYTES),
            measured: [measured.clone(), readback(gpu, "results", measured.size())],
            readings,
            findings,
            row: row(gpu, slots, workgroup),
        }
    }

    /// Returns all buffers, by binding.
    pub(super) fn bindings<'a>(&'a self, tables: &'a Tables) -> [&'a wgpu::Buffer; 15] {
        [
            &self.settings,
            &tables.flows,
            &tables.shapes,
            &tables.pairs,
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
            &self.workgroups,
        ]
    }

    /// Returns the number of workgroups for a number of lanes.
    pub(super) fn grid(&self, lanes: u32) -> Workgroups<'static> {
        let groups = lanes.div_ceil(self.workgroup).max(1);
        Counted([groups.min(self.row), groups.div_ceil(self.row)])
    }

    /// Uploads the active list, in the order in which its lanes began, and the settings. Lanes from place `first_new`
    /// on have yet to begin.
    pub(super) fn call(&self, gpu: &Gpu, active_list: &[u32], first_new: usize, settings: &LaneSettings) {
        let called = uniform(self, active_list.len(), first_new, settings, &gpu.policy);
        gpu.write(&self.settings, 0, bytemuck::bytes_of(&called));
        let head = (QUEUE_HEAD * size_of::<u32>()) as u64;
        gpu.write(&self.queue, head, bytemuck::cast_slice(active_list));
    }

    /// Submits the copies of the results of all lanes that have ended, for the host to read.
    pub(super) fn conclude(
        &self,
        gpu: &Gpu,
        common: &Variant,
        bindings: &[&wgpu::Buffer],
        active_lanes: usize,
        settings: &LaneSettings,
    ) -> Result<Conclusion<'_>, GpuError> {
        let gathers = settings.gathers();
        let dim = settings.features.dim();
        let reals = |numbers: usize| (active_lanes * numbers * gpu.precision.bytes()) as u64;
        let sizes = [reals(length_of("Reading", dim)), (active_lanes * finding_bytes(settings)) as u64];
        let [on_device, measured] = &self.measured;
        let size_of_measured = if gathers { reals(length_of("Measured", dim)) } else { 0 };
        let submission = gpu.call(|| {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            for (pass, groups) in making_lists(gpu, common, bindings, active_lanes as u32) {
                dispatch(gpu, &mut encoder, &pass, groups, None);
            }
            for entry_point in [CONCLUDE, GATHER].into_iter().take(1 + usize::from(gathers)) {
                let concluding = bind(gpu, common, entry_point, bindings);
                dispatch(gpu, &mut encoder, &concluding, Listed(&self.workgroups, List::Ended), None);
            }
            let at = count_at(List::Ended);
            encoder.copy_buffer_to_buffer(&self.queue, at, &self.count_readback, 0, COUNT_BYTES);
            // The host does not know yet how many results there are.
            let results = [&self.readings, &self.findings].into_iter().zip(&self.readbacks).zip(sizes);
            for ((from, to), size) in
                results.chain(gathers.then_some(((on_device, measured), size_of_measured)))
            {
                encoder.copy_buffer_to_buffer(from, 0, to, 0, size);
            }
            gpu.submit(encoder)
        })?;
        let [readings, findings] = &self.readbacks;
        Ok(Conclusion {
            submission,
            active_lanes,
            dim,
            count: Download::new(gpu, &self.count_readback, COUNT_BYTES),
            readings: Download::new(gpu, readings, sizes[0]),
            findings: Download::new(gpu, findings, sizes[1]),
            measured: gathers.then(|| Download::new(gpu, measured, size_of_measured)),
        })
    }
}

/// Results of lanes on their way to the host.
pub(super) struct Conclusion<'s> {
    submission: wgpu::SubmissionIndex,
    active_lanes: usize,
    dim: usize,
    count: Download<'s>,
    readings: Download<'s>,
    findings: Download<'s>,
    measured: Option<Download<'s>>,
}

impl Conclusion<'_> {
    /// Waits for the results, in the order of the active list.
    pub(super) async fn read(self, gpu: &Gpu) -> Result<Returned, GpuError> {
        gpu.wait(self.submission)?;
        let count = self.count.take(gpu, |bytes| bytemuck::pod_read_unaligned::<u32>(bytes) as usize).await?;
        let first = |bytes: usize| bytes / self.active_lanes * count.min(self.active_lanes);
        let readings = self
            .readings
            .take(gpu, |all| readings(&from_reals(&all[..first(all.len())], gpu.precision), self.dim))
            .await?;
        let findings = self
            .findings
            .take(gpu, |all| findings(&all[..first(all.len())], all.len() / self.active_lanes))
            .await?;
        let measured = match self.measured {
            Some(measured) => {
                measured
                    .take(gpu, |all| {
                        let numbers = from_reals(&all[..first(all.len())], gpu.precision);
                        numbers.chunks_exact(length_of("Measured", self.dim)).map(Box::from).collect()
                    })
                    .await?
            }
            None => Vec::new(),
        };
        Ok((readings, findings, measured))
    }
}

fn uniform(
    slots: &Slots,
    active_lanes: usize,
    first_new: usize,
    settings: &LaneSettings,
    policy: &DispatchPolicy,
) -> Settings {
    let LaneSettings { periods, early_stop, hands_over, .. } = *settings;
    let more = if early_stop && !hands_over { settings.undecided_periods } else { 0 };
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
        longest: if hands_over { decided_by } else { decided_by.saturating_add(confirm_chaos) },
        hands_over: u32::from(hands_over),
        // Chaos that is confirmed later needs no early stop.
        chaos_from: if confirm_chaos > 0 { u32::MAX } else { settings.chaos_from },
        chaos_errors: settings.chaos_errors,
        iterations: settings.iterations,
        passes_per_period: settings.passes_per_period,
        events_per_period: settings.events_per_period,
        most_events: settings.most_events,
        row: slots.row * settings.workgroup,
        transient_periods,
        growth_from: if policy.late_tangent { averaging.growth_from } else { 0 },
        exponent_from: averaging.exponent_from,
        exponent_block: averaging.block,
        max_period: settings.max_period.min(LONGEST_CYCLE),
        early_stop: u32::from(early_stop),
        measured_periods: settings.measured_on_lanes().map_or(0, |measures| measures.periods.max(1)),
        few_lanes: policy.few_lanes,
    }
}
