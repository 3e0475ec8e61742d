//! Engines compute the cells of a plan.
//!
//! An [`Engine`] accepts cells at any time and returns one record for each, in any order. A record depends on its cell,
//! its start and the plan only. It does not depend on other cells under way, on neighbours, or on the number of
//! threads.

mod cpu;
mod fake;
#[cfg(feature = "gpu")]
mod finish;
mod flows;
#[cfg(feature = "gpu")]
mod gpu;
mod requested;

use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use thiserror::Error;

pub use cpu::Cpu;
pub(crate) use cpu::largest_batch;
pub use fake::Fake;
#[cfg(feature = "gpu")]
pub(crate) use finish::{Completion, Ended};
pub(crate) use flows::Flows;
#[cfg(feature = "gpu")]
pub use gpu::{Gpu, Prepared};
#[cfg(feature = "gpu")]
pub(crate) use gpu::{lane_settings, renumbered};
#[cfg(feature = "gpu")]
pub(crate) use requested::drop_unrequested;
pub use requested::measured_record;

#[cfg(feature = "gpu")]
use crate::gpu::AdapterId;
use crate::map::plan::Cell;
use crate::record::Record;

/// Largest number of cells under way.
pub(crate) const LARGEST_BATCH: usize = 1 << 20;

/// Why a batch was not computed.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum EngineError {
    /// The cells do not fit into the engine's memory. Fewer cells may fit.
    #[error("no memory on {device} for {cells} cells at a time")]
    OutOfMemory {
        /// The engine's device.
        device: String,
        /// Number of cells under way, including those that were to be begun.
        cells: usize,
    },
    /// The device failed to do its work.
    #[error("{device}: {reason}")]
    Refused {
        /// The engine's device.
        device: String,
        /// The device's message.
        reason: String,
    },
    /// Lanes have no code for a part of the model.
    #[error("graphics devices do not compute {feature}, the processor does (--engine cpu)")]
    NotOnLanes {
        /// The part, in words.
        feature: &'static str,
    },
    /// The device is lost; the engine computes nothing any more.
    #[error("{device} was lost ({reason})")]
    Lost {
        /// The engine's device.
        device: String,
        /// The driver's message.
        reason: String,
    },
}

/// Time that it took to prepare an engine on its open device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Preparation {
    /// Time for the constants of all flows.
    pub flows: Duration,
    /// Time in which the driver compiled the shaders.
    pub compile: Duration,
}

/// Computes cells.
pub enum Engine<'p> {
    /// The event-driven reference on all processor cores, in f64.
    Cpu(Cpu<'p>),
    /// Lanes in WGSL on a graphics device, in f32 or f64.
    #[cfg(feature = "gpu")]
    Gpu(Box<Gpu<'p>>),
    /// Computes records by a rule and fails on demand, for tests.
    Fake(Fake),
}

/// What is known of an engine without computing a cell. The defaults are those of an engine without a device of its own.
pub trait Properties {
    /// Returns the name in manifests and record files.
    fn name(&self) -> &'static str;

    /// Returns the precision in manifests and record files.
    fn precision(&self) -> &'static str {
        "f64"
    }

    /// Describes the device. The text is part of a record file's identity, since only one device reproduces results bit
    /// by bit.
    fn device(&self) -> String;

    /// Returns the graphics adapter; none if the engine uses none.
    #[cfg(feature = "gpu")]
    fn adapter(&self) -> Option<AdapterId> {
        None
    }

    /// Returns the largest number of bytes that the map needs in the device's memory; none without a device.
    fn device_bytes(&self) -> Option<u64> {
        None
    }

    /// Returns the smallest number of cells that keeps the engine busy. A map begins with so many.
    fn least_batch(&self) -> usize;

    /// Returns the largest number of cells under way. It bounds the memory that a fast engine uses.
    fn largest_batch(&self) -> usize {
        LARGEST_BATCH
    }

    /// Returns the number of free steps that lanes have taken so far; none without a time grid.
    fn lane_steps(&self) -> Option<u64> {
        None
    }

    /// Returns the smallest and the largest number of free steps per forcing period, over all flows that lanes support;
    /// none without a time grid.
    fn steps_per_period(&self) -> Option<[u32; 2]> {
        None
    }

    /// Returns the number of cells for which the engine has memory now.
    fn room(&self) -> usize {
        usize::MAX
    }

    /// Returns the time that it took to prepare the engine; zero without lanes.
    fn preparation(&self) -> Preparation {
        Preparation::default()
    }

    /// Sets the flag that stops the engine: while it is raised, [`Engine::advance`] soon returns the cells that have
    /// ended.
    fn stop_on(&mut self, halt: &Arc<AtomicBool>);
}

impl<'p> Deref for Engine<'p> {
    type Target = dyn Properties + 'p;

    fn deref(&self) -> &(dyn Properties + 'p) {
        match self {
            Engine::Cpu(cpu) => cpu,
            #[cfg(feature = "gpu")]
            Engine::Gpu(gpu) => &**gpu,
            Engine::Fake(fake) => fake,
        }
    }
}

impl<'p> DerefMut for Engine<'p> {
    fn deref_mut(&mut self) -> &mut (dyn Properties + 'p) {
        match self {
            Engine::Cpu(cpu) => cpu,
            #[cfg(feature = "gpu")]
            Engine::Gpu(gpu) => &mut **gpu,
            Engine::Fake(fake) => fake,
        }
    }
}

impl Engine<'_> {
    /// Begins cells. [`Engine::advance`] returns their records.
    ///
    /// # Errors
    /// [`EngineError`], after which none of these cells is under way.
    pub async fn begin(&mut self, cells: &[Cell]) -> Result<(), EngineError> {
        match self {
            Engine::Cpu(cpu) => cpu.begin(cells),
            #[cfg(feature = "gpu")]
            Engine::Gpu(gpu) => gpu.begin(cells).await?,
            Engine::Fake(fake) => fake.begin(cells)?,
        }
        Ok(())
    }

    /// Computes until some cells have ended, if possible until at most `until` are left. Returns the ids and records of
    /// those that have ended; empty if no cell is under way or the flag of `stop_on` is raised.
    ///
    /// # Errors
    /// [`EngineError`], after which no cell is under way.
    #[cfg_attr(not(feature = "gpu"), expect(unused_variables, reason = "only lanes use it"))]
    pub async fn advance(&mut self, until: usize) -> Result<Vec<(u32, Record)>, EngineError> {
        match self {
            Engine::Cpu(cpu) => Ok(cpu.advance()),
            #[cfg(feature = "gpu")]
            Engine::Gpu(gpu) => gpu.advance(until).await,
            Engine::Fake(fake) => fake.advance(),
        }
    }

    /// Computes cells and returns their records in the same order. No other cell may be under way.
    ///
    /// # Errors
    /// [`EngineError`], after which none of them is computed.
    pub async fn run(&mut self, cells: &[Cell]) -> Result<Vec<Record>, EngineError> {
        let mut ids: Vec<u32> = cells.iter().map(|cell| cell.id).collect();
        ids.sort_unstable();
        // A cell may occur twice in the list; both occurrences get the record of the last.
        ids.dedup();
        let place = |id: u32| ids.binary_search(&id).expect("engines return the cells that were begun");
        let mut records = vec![Record::default(); ids.len()];
        let mut left = cells;
        loop {
            let (next, later) = left.split_at(left.len().min(self.room()));
            self.begin(next).await?;
            left = later;
            let ended = self.advance(0).await?;
            if ended.is_empty() {
                break;
            }
            ended.into_iter().for_each(|(id, record)| records[place(id)] = record);
        }
        Ok(cells.iter().map(|cell| records[place(cell.id)].clone()).collect())
    }
}
