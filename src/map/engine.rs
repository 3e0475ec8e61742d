//! Engines: one interface between a plan and whoever computes it.
//!
//! An [`Engine`] takes up cells of a plan at any time and returns one record for each, in whatever order they
//! end. A record depends on its cell, its start and the plan alone: not on what else is under way, the
//! neighbours, or the number of threads.

#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
mod cards;
mod cpu;
mod fake;
mod flows;
#[cfg(feature = "gpu")]
mod gpu;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use thiserror::Error;

#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
pub use cards::Cards;
pub use cpu::Cpu;
pub use cpu::record as measured_record;
pub use fake::Fake;
pub(crate) use flows::Flows;
#[cfg(feature = "gpu")]
pub use gpu::Gpu;
pub(crate) use gpu::{keep, lane_settings};

#[cfg(feature = "gpu")]
use crate::gpu::AdapterId;
use crate::map::plan::Cell;
use crate::record::Record;

/// Why a batch was not computed.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum EngineError {
    /// Cells do not fit the engine's memory; fewer may.
    #[error("no memory on {device} for {cells} cells at a time")]
    OutOfMemory {
        /// The engine's device.
        device: String,
        /// Cells under way and those that were to be begun.
        cells: usize,
    },
    /// The engine's device did not do what it was asked.
    #[error("{device}: {reason}")]
    Refused {
        /// The engine's device.
        device: String,
        /// What happened.
        reason: String,
    },
    /// The engine is gone and computes nothing any more.
    #[error("{device} was lost ({reason})")]
    Lost {
        /// The engine's device.
        device: String,
        /// What its driver says.
        reason: String,
    },
}

impl EngineError {
    /// What happened, without the device.
    pub fn reason(&self) -> String {
        match self {
            EngineError::OutOfMemory { cells, .. } => format!("no memory for {cells} cells at a time"),
            EngineError::Refused { reason, .. } | EngineError::Lost { reason, .. } => reason.clone(),
        }
    }
}

/// What one of several cards has done.
#[cfg(feature = "gpu")]
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CardReport {
    /// Which card.
    pub adapter: AdapterId,
    /// Cells that it has computed.
    pub cells: usize,
    /// Why it computes no more, if it was lost.
    pub lost: Option<String>,
}

/// A card of several that is lost.
#[cfg(feature = "gpu")]
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loss {
    /// Which card.
    pub adapter: AdapterId,
    /// Cells that it leaves to the others.
    pub cells: usize,
    /// What happened.
    pub reason: String,
}

/// What computes cells.
pub enum Engine<'p> {
    /// The event-driven reference on all processor cores, in f64.
    Cpu(Cpu<'p>),
    /// Lanes in WGSL on a graphics device, in f32 or f64.
    #[cfg(feature = "gpu")]
    Gpu(Box<Gpu<'p>>),
    /// The same on several equal cards.
    #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
    Cards(Box<Cards>),
    /// Records by rule, and failures on demand: for tests of everything around an engine.
    Fake(Fake),
}

impl Engine<'_> {
    /// The name in manifests and record files.
    pub fn name(&self) -> &'static str {
        match self {
            Engine::Cpu(_) => "cpu",
            #[cfg(feature = "gpu")]
            Engine::Gpu(_) => "gpu",
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Engine::Cards(cards) => cards.name(),
            Engine::Fake(_) => "fake",
        }
    }

    /// The precision in manifests and record files.
    pub fn precision(&self) -> &'static str {
        match self {
            Engine::Cpu(_) | Engine::Fake(_) => "f64",
            #[cfg(feature = "gpu")]
            Engine::Gpu(gpu) => gpu.precision(),
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Engine::Cards(cards) => cards.precision(),
        }
    }

    /// What it runs on, in words: part of a record file's identity, since results are
    /// bitwise the same on one device only.
    pub fn device(&self) -> String {
        match self {
            Engine::Cpu(_) => "event-driven reference".to_owned(),
            #[cfg(feature = "gpu")]
            Engine::Gpu(gpu) => gpu.device(),
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Engine::Cards(cards) => cards.device(),
            Engine::Fake(_) => "fake".to_owned(),
        }
    }

    /// The adapter that computes; none where there is none, or more than one.
    #[cfg(feature = "gpu")]
    pub fn adapter(&self) -> Option<AdapterId> {
        match self {
            Engine::Gpu(gpu) => Some(gpu.adapter()),
            _ => None,
        }
    }

    /// Devices that compute side by side.
    pub fn card_count(&self) -> usize {
        match self {
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Engine::Cards(cards) => cards.count(),
            _ => 1,
        }
    }

    /// What each card has done so far, where several compute; else none.
    #[cfg(feature = "gpu")]
    pub fn cards(&self) -> Vec<CardReport> {
        match self {
            #[cfg(not(target_arch = "wasm32"))]
            Engine::Cards(cards) => cards.reports(),
            _ => Vec::new(),
        }
    }

    /// Tells `listener` from here on, while [`Engine::advance`] waits, of cards that are lost and leave their cells to others.
    #[cfg(feature = "gpu")]
    #[cfg_attr(target_arch = "wasm32", expect(unused_variables, reason = "there is one card"))]
    pub fn listen(&mut self, listener: impl Fn(&Loss) + Send + 'static) {
        #[cfg(not(target_arch = "wasm32"))]
        if let Engine::Cards(cards) = self {
            cards.listen(Box::new(listener));
        }
    }

    /// Bytes of a device's memory that the map takes at most, of all devices; none where no device of its own
    /// is at work.
    pub fn device_bytes(&self) -> Option<u64> {
        match self {
            #[cfg(feature = "gpu")]
            Engine::Gpu(gpu) => Some(gpu.device_bytes()),
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Engine::Cards(cards) => cards.device_bytes(),
            Engine::Cpu(_) | Engine::Fake(_) => None,
        }
    }

    /// The fewest cells that keep the engine busy: the size of the first batch.
    pub fn least_batch(&self) -> usize {
        match self {
            Engine::Cpu(cpu) => cpu.least_batch(),
            #[cfg(feature = "gpu")]
            Engine::Gpu(gpu) => gpu.least_batch(),
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Engine::Cards(cards) => cards.least_batch(),
            Engine::Fake(_) => 16,
        }
    }

    /// Free steps that lanes have taken so far; none where there is no grid.
    pub fn lane_steps(&self) -> Option<u64> {
        match self {
            #[cfg(feature = "gpu")]
            Engine::Gpu(gpu) => Some(gpu.steps()),
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Engine::Cards(cards) => cards.lane_steps(),
            Engine::Cpu(_) | Engine::Fake(_) => None,
        }
    }

    /// The least and the most free steps that lanes take per forcing period, over all flows that they
    /// can carry; none where there is no grid.
    pub fn steps_per_period(&self) -> Option<[u32; 2]> {
        match self {
            #[cfg(feature = "gpu")]
            Engine::Gpu(gpu) => gpu.steps_per_period(),
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Engine::Cards(cards) => cards.steps_per_period(),
            Engine::Cpu(_) | Engine::Fake(_) => None,
        }
    }

    /// Cells that may be begun now: more would be refused for want of memory.
    pub fn room(&self) -> usize {
        match self {
            Engine::Cpu(_) | Engine::Fake(_) => usize::MAX,
            #[cfg(feature = "gpu")]
            Engine::Gpu(gpu) => gpu.room(),
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Engine::Cards(cards) => cards.room(),
        }
    }

    /// Looks at a flag from here on: while it is raised, [`Engine::advance`] soon returns what has ended by then.
    pub fn heed(&mut self, halt: &Arc<AtomicBool>) {
        match self {
            Engine::Cpu(cpu) => cpu.halt = Arc::clone(halt),
            #[cfg(feature = "gpu")]
            Engine::Gpu(gpu) => gpu.heed(halt),
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Engine::Cards(cards) => cards.heed(halt),
            Engine::Fake(_) => {}
        }
    }

    /// Takes up cells; their records come from [`Engine::advance`].
    ///
    /// # Errors
    /// [`EngineError`], with none of these cells taken up.
    pub async fn begin(&mut self, cells: &[Cell]) -> Result<(), EngineError> {
        match self {
            Engine::Cpu(cpu) => cpu.begin(cells),
            #[cfg(feature = "gpu")]
            Engine::Gpu(gpu) => gpu.begin(cells).await?,
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Engine::Cards(cards) => cards.begin(cells)?,
            Engine::Fake(fake) => fake.begin(cells)?,
        }
        Ok(())
    }

    /// Computes until some of the cells under way have ended, best until no more than `until` are left: the records
    /// of those that have, by id. None if no cell is under way, or a raised flag is heeded.
    ///
    /// # Errors
    /// [`EngineError`], after which nothing is under way.
    #[cfg_attr(not(feature = "gpu"), expect(unused_variables, reason = "for lanes alone"))]
    pub async fn advance(&mut self, until: usize) -> Result<Vec<(u32, Record)>, EngineError> {
        match self {
            Engine::Cpu(cpu) => Ok(cpu.advance()),
            #[cfg(feature = "gpu")]
            Engine::Gpu(gpu) => gpu.advance(until).await,
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Engine::Cards(cards) => cards.advance(until),
            Engine::Fake(fake) => fake.advance(),
        }
    }

    /// Computes cells: one record for each, in their order. Nothing else may be under way.
    ///
    /// # Errors
    /// [`EngineError`], with none of them computed.
    pub async fn run(&mut self, cells: &[Cell]) -> Result<Vec<Record>, EngineError> {
        let ids = || cells.iter().map(|cell| cell.id as usize);
        let (Some(first), Some(last)) = (ids().min(), ids().max()) else { return Ok(Vec::new()) };
        let mut places = vec![0; last - first + 1];
        ids().enumerate().for_each(|(place, id)| places[id - first] = place);
        let mut records = vec![Record::default(); cells.len()];
        let mut left = cells;
        loop {
            let (next, later) = left.split_at(left.len().min(self.room()));
            self.begin(next).await?;
            left = later;
            let ended = self.advance(0).await?;
            if ended.is_empty() {
                break;
            }
            ended.into_iter().for_each(|(id, record)| records[places[id as usize - first]] = record);
        }
        // Cells that were asked for twice.
        Ok(ids().map(|id| records[places[id - first]]).collect())
    }
}
