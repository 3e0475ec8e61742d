//! A pool of lanes on a device. A lane has a slot from its start to its record.

use std::ops::Range;

use bytemuck::Zeroable;
use rayon::prelude::*;

use super::constants::Constants;
use super::device::BEGIN;
use super::guard::with_error_scopes;
use super::layout::Cell;
use super::reading::LaneResult;
use super::rounds::{Length, Rounds, bind, dispatch};
use super::slots::{self, Slots};
use super::stage::Stage;
use super::tables::Tables;
use super::transfer::reals;
use super::{Gpu, GpuError, Kernels, Lane, LaneSettings};
use rattlemap_dynamics::model::REST;
use rattlemap_dynamics::orbit::Status;

/// Largest number of unchanged slots that are uploaded again to save a transfer.
const WIDEST_GAP: usize = 1024;

/// Lanes under way on a device. Lanes can begin at any time, and their records are available when they end, without
/// waiting for the slowest lane.
pub struct Pool {
    pub(super) settings: LaneSettings,
    pub(super) kernels: Kernels,
    /// Largest number of slots.
    most: usize,
    buffers: Option<Slots>,
    /// Slots of the lanes under way, in the order in which they began. Lanes that are neighbours in this order behave alike.
    active_list: Vec<u32>,
    /// Slots without a lane.
    free: Vec<u32>,
    /// The lane in each slot, and the caller's number for it.
    lanes: Vec<(u32, Lane)>,
    /// Contents of the buffers, by slot.
    cells: Vec<Cell>,
    starts: Vec<f64>,
    /// Periods between lists and iterations per dispatch in the next round.
    length: Length,
    /// Whether a round is under way that was sent ahead, while the host reads results.
    is_ahead: bool,
}

impl Pool {
    pub(super) fn new(gpu: &Gpu, kernels: Kernels, settings: &LaneSettings) -> Pool {
        Pool {
            settings: *settings,
            kernels,
            most: slots::most(&gpu.device.limits(), gpu.precision, settings),
            buffers: None,
            active_list: Vec::new(),
            free: Vec::new(),
            lanes: Vec::new(),
            cells: Vec::new(),
            starts: Vec::new(),
            length: Length::default(),
            is_ahead: false,
        }
    }

    /// Returns the number of lanes under way.
    pub fn under_way(&self) -> usize {
        self.active_list.len()
    }

    /// Returns the number of lanes that may begin now.
    pub fn room(&self) -> usize {
        self.most - self.active_list.len()
    }

    /// Discards the lanes under way.
    pub fn clear(&mut self) {
        self.free.append(&mut self.active_list);
    }

    /// Puts lanes at their starts. All lanes of a pool use the same tables. Each lane has a number by which the caller recognises its
    /// record.
    ///
    /// # Errors
    /// [`GpuError::NoSuchCell`] if a lane names a missing flow or law; [`GpuError::OutOfMemory`] if there are more
    /// lanes than [`Pool::room`] or the device has memory for; other errors of the device. After an error, none of
    /// the lanes has begun.
    pub async fn begin(&mut self, gpu: &Gpu, tables: &Tables, lanes: &[(u32, Lane)]) -> Result<(), GpuError> {
        let (flows, laws) = (tables.constants.len(), tables.is_even.len());
        for (i, &(_, Lane { flow, law, .. })) in lanes.iter().enumerate() {
            if flow as usize >= flows || law as usize >= laws {
                return Err(GpuError::NoSuchCell { lane: i, flow, law, flows, laws });
            }
        }
        if lanes.is_empty() {
            return Ok(());
        }
        for &(flow, features) in &tables.features {
            if let Some((feature, setting)) = features.lacking_in(self.settings.features) {
                return Err(GpuError::NotCompiled { flow, feature, setting });
            }
        }
        self.make_room(gpu, lanes.len()).await?;
        // The length was chosen for fewer lanes. With many more lanes, such dispatches would take too long.
        let share = self.active_list.len() as f64 / (self.active_list.len() + lanes.len()) as f64;
        self.length = self.length.scaled(share);
        // Takes the lowest slots, so that lanes that begin together are adjacent.
        self.free.sort_unstable_by(|a, b| b.cmp(a));
        let slots = self.free.split_off(self.free.len() - lanes.len());
        // In a browser, buffers cannot be shared between threads, so the closure uses these two fields only.
        let Tables { constants, is_even, .. } = tables;
        let started: Vec<_> = lanes.par_iter().map(|(_, lane)| start(constants, is_even, lane)).collect();
        let size = self.settings.features.start_numbers();
        for ((&slot, &lane), (cell, start)) in slots.iter().rev().zip(lanes).zip(started) {
            let at = slot as usize;
            self.lanes[at] = lane;
            self.cells[at] = cell;
            self.starts[at * size..][..start.len()].copy_from_slice(&start);
            self.active_list.push(slot);
        }
        let Some(buffers) = &self.buffers else { return Ok(()) };
        let real = gpu.precision.bytes();
        gpu.call(|| {
            for at in stretches(slots.iter().rev().map(|&slot| slot as usize)) {
                let (of_cells, of_starts) = (at.start * size_of::<Cell>(), at.start * size * real);
                let starts = reals(&self.starts[at.start * size..at.end * size], gpu.precision);
                gpu.write(&buffers.cells, of_cells as u64, bytemuck::cast_slice(&self.cells[at]));
                gpu.write(&buffers.starts, of_starts as u64, &starts);
            }
            buffers.call(gpu, &self.active_list, self.active_list.len() - lanes.len(), &self.settings);
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            let begin = bind(gpu, &self.kernels.common, BEGIN, &buffers.bindings(tables));
            dispatch(gpu, &mut encoder, &begin, buffers.grid(lanes.len() as u32), None);
            gpu.submit(encoder);
        })?;
        gpu.report(Stage::Uploaded);
        Ok(())
    }

    /// Integrates until at most `until` lanes are under way, and fewer than before, or until some ended lanes have waited long enough for others. Returns the
    /// lanes that have ended; none only if a flag has stopped the device.
    ///
    /// # Errors
    /// Errors of the device. The pool cannot be used afterwards.
    pub async fn advance(
        &mut self,
        gpu: &Gpu,
        tables: &Tables,
        until: usize,
    ) -> Result<Vec<LaneResult>, GpuError> {
        let Some(buffers) = self.buffers.as_ref().filter(|_| !self.active_list.is_empty()) else {
            return Ok(Vec::new());
        };
        let until = until.min(self.active_list.len() - 1);
        let bindings = buffers.bindings(tables);
        let rounds = Rounds {
            gpu,
            settings: &buffers.settings,
            queue: &buffers.queue,
            buffers: &bindings,
            active_lanes: self.active_list.len() as u32,
            workgroups: &buffers.workgroups,
            most_iterations: self.settings.iterations,
        };
        gpu.call(|| buffers.call(gpu, &self.active_list, self.active_list.len(), &self.settings))?;
        let (active_lanes, settings, common) = (self.active_list.len(), &self.settings, &self.kernels.common);
        let conclude = || buffers.conclude(gpu, common, &bindings, active_lanes, settings);
        let (concluding, device) =
            rounds.run(&self.kernels, until as u32, &mut self.length, &mut self.is_ahead, conclude).await?;
        gpu.report(Stage::Integrated { device });
        let (readings, findings, measured) = concluding.read(gpu).await?;
        if findings.is_empty() && !gpu.is_halted() {
            let message = "it returned no results of the lanes that have ended".into();
            return Err(gpu.failure(GpuError::Lost { message }));
        }
        let lanes = &self.lanes;
        let of = |i: usize| {
            let (reading, finding) = (readings[i], findings[i]);
            let (number, Lane { flow, .. }) = lanes[finding.slot as usize];
            let measured = measured.get(i).cloned();
            LaneResult { number, flow, reading, finding, measured }
        };
        let ended = (0..findings.len()).into_par_iter().map(of).collect();
        self.free.extend(findings.iter().map(|finding| finding.slot));
        // Results and active list have the same order.
        let mut slots = findings.iter().map(|finding| finding.slot).peekable();
        self.active_list.retain(|&slot| slots.next_if_eq(&slot).is_none());
        gpu.report(Stage::Read);
        Ok(ended)
    }

    /// Makes slots for a number of further lanes. Lanes under way move with their state.
    async fn make_room(&mut self, gpu: &Gpu, count: usize) -> Result<(), GpuError> {
        let (had, needed) = (self.lanes.len(), self.active_list.len() + count);
        if needed > self.most {
            return Err(GpuError::OutOfMemory { what: "lanes", count: needed });
        }
        if needed <= had {
            return Ok(());
        }
        // Doubles the slots, so that lanes move rarely. If memory is too small for this, makes only the slots that are needed.
        let ample = needed.max(2 * had).min(self.most);
        let make = async |slots| {
            with_error_scopes(gpu, "lanes", slots, || Slots::new(gpu, slots, &self.settings)).await
        };
        let (slots, buffers) = match make(ample).await {
            Err(GpuError::OutOfMemory { .. }) if needed < ample => (needed, make(needed).await?),
            buffers => (ample, buffers?),
        };
        if let Some(old) = &self.buffers {
            gpu.call(|| {
                let mut encoder = gpu.device.create_command_encoder(&Default::default());
                for (from, to) in [(&old.motions, &buffers.motions), (&old.tallies, &buffers.tallies)] {
                    encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size());
                }
                gpu.submit(encoder);
                gpu.write(&buffers.cells, 0, bytemuck::cast_slice(&self.cells));
            })?;
        }
        self.buffers = Some(buffers);
        self.free.extend(had as u32..slots as u32);
        self.lanes.resize(slots, (0, Lane { flow: 0, law: 0, start: REST }));
        self.cells.resize(slots, Cell::zeroed());
        self.starts.resize(slots * self.settings.features.start_numbers(), 0.0);
        Ok(())
    }
}

/// Returns the ranges that contain all of these ascending slots, joined across gaps of up to [`WIDEST_GAP`] slots.
fn stretches(slots: impl Iterator<Item = usize>) -> Vec<Range<usize>> {
    let mut found: Vec<Range<usize>> = Vec::new();
    for slot in slots {
        match found.last_mut() {
            Some(last) if slot <= last.end + WIDEST_GAP => last.end = slot + 1,
            _ => found.push(slot..slot + 1),
        }
    }
    found
}

/// Returns a lane's entry in the table of cells, and its start in lane units. The start of a refused lane is empty.
fn start(constants: &[Option<Constants>], is_even: &[bool], lane: &Lane) -> (Cell, Vec<f64>) {
    let cell = Cell { flow_index: lane.flow, law_index: lane.law, refused: Status::Ok.code(), mirror: 0 };
    let refuse = |status: Status| (Cell { refused: status.code(), ..cell }, Vec::new());
    match &constants[lane.flow as usize] {
        None => refuse(Status::TooStiff),
        Some(_) if !lane.start.iter().all(|x| x.is_finite()) => refuse(Status::NonFinite),
        Some(constants) => {
            // Each flow of a machine has its own law.
            let is_pair = constants.pair().is_some();
            let mirror = constants.mirror_symmetric && (!is_pair || is_even[lane.law as usize]);
            let law_index = if is_pair { lane.law } else { lane.flow };
            (Cell { mirror: u32::from(mirror), law_index, ..cell }, constants.start_numbers(lane.start))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::dispatch_policy::{DEDICATED, DispatchPolicy};
    use crate::gpu::{AdapterChoice, Features, Precision};
    use rattlemap_dynamics::model::GearPair;
    use std::time::Duration;

    #[test]
    fn adjacent_slots_are_uploaded_together() {
        let far = WIDEST_GAP + 10;
        assert_eq!(stretches([3, 4, 9, 9 * far].into_iter()), [3..10, 9 * far..9 * far + 1]);
        assert_eq!(
            stretches([0, far, far + WIDEST_GAP + 1, 5 * far].into_iter()),
            [0..1, far..2 * far - 8, 5 * far..5 * far + 1]
        );
        assert!(stretches(std::iter::empty()).is_empty());
    }

    /// A map takes few rounds, although its slowest lanes take ten times as long as most. The first round is as short as that of a map of
    /// 1,024 x 1,024 cells. Iterations have the simulated duration of a card, so the speed of the test machine does not affect the counts.
    #[test]
    #[ignore = "compiles shaders of its own; scripts/test.sh --all"]
    fn a_map_on_a_card_is_waited_for_a_few_times() {
        let mut gpu = pollster::block_on(Gpu::open(Precision::F32, &AdapterChoice::default())).unwrap();
        let at_once = DEDICATED.at_once >> 10;
        gpu.policy = DispatchPolicy { simulated: Some(Duration::from_micros(1)), at_once, ..DEDICATED };
        let at = |i: u32, count: u32| f64::from(i) / f64::from(count);
        let pairs = (0..32).flat_map(|i| (0..32).map(move |j| (at(i, 32), 1.0 + 11.0 * at(j, 32))));
        let pairs: Vec<_> = pairs.map(|(e, omega)| GearPair { omega, ..GearPair::paper(e) }).collect();
        let flows: Vec<_> = pairs.iter().map(|pair| pair.oscillator().unwrap()).collect();
        let laws: Vec<_> = pairs.iter().map(GearPair::law).collect();
        let lane = |i| (i, Lane { flow: i, law: i, start: REST });
        let lanes: Vec<_> = (0..flows.len() as u32).map(lane).collect();
        let settings = LaneSettings::default();
        let tables = pollster::block_on(gpu.load(&flows, &laws, None)).unwrap();
        // Half of the lanes give a first picture. A window of 256 x 256 has so few cells that its first round is long.
        for (until, most, at_once) in [(lanes.len() / 2, 2, DEDICATED.at_once >> 6), (0, 12, at_once)] {
            gpu.policy.at_once = at_once;
            let mut pool = pollster::block_on(gpu.pool(&settings)).unwrap();
            let before = gpu.traffic().waits;
            pollster::block_on(pool.begin(&gpu, &tables, &lanes)).unwrap();
            while pool.under_way() > until {
                pollster::block_on(pool.advance(&gpu, &tables, until)).unwrap();
            }
            let waits = gpu.traffic().waits - before;
            assert!(waits <= most, "{waits} waits until {until} lanes are left");
        }
    }

    /// Runs lanes on a device that was changed before, and returns the error. Each round takes a software driver so long that it has not
    /// ended when the host checks it, even if the host is delayed.
    fn error_after(change: impl FnOnce(&mut Gpu)) -> String {
        let mut gpu = pollster::block_on(Gpu::open(Precision::F32, &AdapterChoice::default())).unwrap();
        change(&mut gpu);
        let pair = GearPair::paper(0.5);
        let lanes = vec![Lane { flow: 0, law: 0, start: REST }; 1 << 14];
        let flows = [pair.oscillator().unwrap()];
        // The smallest shader, because drivers compile it fastest.
        let settings = LaneSettings {
            word: false,
            pattern: false,
            mesh: false,
            symmetry: false,
            chatter: false,
            features: Features::default(),
            ..LaneSettings::only(1 << 16)
        };
        let error = pollster::block_on(gpu.run(&flows, &[pair.law()], &lanes, &settings)).unwrap_err();
        assert!(matches!(error, GpuError::Lost { .. }), "{error}");
        error.to_string()
    }

    #[test]
    fn a_lost_device_is_an_error() {
        let error = error_after(|gpu| gpu.device.destroy());
        assert!(error.contains("lost"), "{error}");
    }

    #[test]
    fn a_device_that_never_ends_is_lost() {
        let error = error_after(|gpu| gpu.policy.longest_wait = Duration::ZERO);
        assert!(error.contains("it is not ready after 0 s"), "{error}");
    }
}
