//! Shards: parts of a map for several machines. Pure.
//!
//! Cells are assigned in small blocks of the plan's order. Neighbouring cells stay together, because their lanes take
//! similar work. The blocks of a shard are spread over the whole map, because regions differ in cost by a factor of
//! 100. Blocks are dealt out in rounds, one block to each shard, and the order of the shards is shifted after each
//! round. Without the shift a shard would get stripes of a map whose side is a multiple of the number of shards. With
//! 64 shards of the main map, the largest share of work is 9 % above the mean. It is 20 % above without the shift, and
//! five times the mean if each shard gets one range of the order.
//!
//! All starts of a cell are in one shard. If cells follow their neighbours along the last axis, whole columns are
//! assigned.

use std::fmt;
use std::num::NonZeroU32;
use std::ops::Range;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::plan::Plan;

/// Largest number of cells per block: the size of a subgroup of a graphics card.
const LARGEST_BLOCK: usize = 64;

/// Number of blocks per shard; for few cells the blocks are smaller. More blocks balance the work better, but lanes of
/// distant cells wait for each other: 5 % of the time in blocks of 16, a quarter for single cells.
const BLOCKS: usize = 256;

/// An odd number near the golden section of 2^32. Its multiples modulo 2^32 are evenly spread.
const GOLDEN: u32 = 2_654_435_761;

/// One of `count` shards of a map, counted from 1.
///
/// ```
/// use rattlemap::map::shard::Shard;
///
/// let shard: Shard = "3/16".parse()?;
/// assert_eq!((shard.index(), shard.count(), shard.to_string()), (3, 16, "3/16".to_owned()));
/// assert!("0/4".parse::<Shard>().is_err());
/// # Ok::<(), rattlemap::map::shard::ShardError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "RawShard")]
pub struct Shard {
    index: NonZeroU32,
    count: NonZeroU32,
}

/// A shard as read from a file, before it is checked.
#[derive(Deserialize)]
struct RawShard {
    index: u32,
    count: u32,
}

impl TryFrom<RawShard> for Shard {
    type Error = ShardError;

    fn try_from(raw: RawShard) -> Result<Shard, ShardError> {
        Shard::new(raw.index, raw.count)
    }
}

/// Why a shard is invalid.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ShardError {
    /// The text is not of the form `index/count`.
    #[error("it must be two whole numbers, such as 3/16: the third of 16 shards")]
    NotAShard,
    /// The number of shards is 0.
    #[error("there must be at least one shard, such as 1/1")]
    NoShards,
    /// The index is not between 1 and the number of shards.
    #[error("shards are counted from 1: of {count} the first is 1/{count}, the last {count}/{count}")]
    OutOfRange {
        /// Number of shards.
        count: u32,
    },
    /// The map has fewer parts than shards.
    #[error("{shard} is one of {} shards, but the map has only {parts} {what}; use at most {parts} shards", .shard.count)]
    TooMany {
        /// The requested shard.
        shard: Shard,
        /// Number of parts.
        parts: usize,
        /// Name of the parts.
        what: &'static str,
    },
    /// An adaptive map cannot be split.
    #[error(
        "{shard}: an adaptive map needs the records of all cells to decide which cells to integrate; \
         remove [refine] from the scene, or compute the map on one machine"
    )]
    Adaptive {
        /// The requested shard.
        shard: Shard,
    },
}

impl Shard {
    /// Returns the shard `index`, from 1, of `count`.
    ///
    /// # Errors
    /// [`ShardError`] for an invalid index or count.
    pub fn new(index: u32, count: u32) -> Result<Shard, ShardError> {
        let counted = NonZeroU32::new(count).ok_or(ShardError::NoShards)?;
        match NonZeroU32::new(index) {
            Some(index) if index <= counted => Ok(Shard { index, count: counted }),
            _ => Err(ShardError::OutOfRange { count }),
        }
    }

    /// Returns all shards of `count`.
    pub fn all(count: u32) -> impl Iterator<Item = Shard> {
        (1..=count).filter_map(move |index| Shard::new(index, count).ok())
    }

    /// Returns the index, from 1.
    pub fn index(self) -> u32 {
        self.index.get()
    }

    /// Returns the number of shards.
    pub fn count(self) -> u32 {
        self.count.get()
    }

    /// Checks that a plan can be split into this number of shards.
    ///
    /// # Errors
    /// [`ShardError::Adaptive`], [`ShardError::TooMany`].
    pub fn check(self, plan: &Plan) -> Result<(), ShardError> {
        if plan.refine().is_some() {
            return Err(ShardError::Adaptive { shard: self });
        }
        let (parts, what) = parts(plan);
        match parts < self.count() as usize {
            true => Err(ShardError::TooMany { shard: self, parts, what }),
            false => Ok(()),
        }
    }

    /// Returns the runs of this shard in the order of the plan. It is not the order of work if cells follow their
    /// neighbours.
    pub fn runs(self, plan: &Plan) -> Vec<u32> {
        if plan.policy().follows() {
            let [width, rows] = plan.counts();
            let columns = self.columns(plan);
            return (0..rows).flat_map(|j| columns.iter().map(move |i| (j * width) as u32 + i)).collect();
        }
        let cells = plan.cell_count();
        let of_start = |nth: usize| self.blocks(cells).flatten().map(move |place| nth * cells + place);
        (0..plan.start_count()).flat_map(of_start).map(|place| plan.run_at(place)).collect()
    }

    /// Returns the number of runs.
    pub fn run_count(self, plan: &Plan) -> usize {
        let (parts, _) = parts(plan);
        self.blocks(parts).map(|block| block.len()).sum::<usize>() * (plan.run_count() / parts)
    }

    /// Returns the columns of this shard, for a map whose cells follow their neighbours: increasing indices on the
    /// first axis.
    pub(crate) fn columns(self, plan: &Plan) -> Vec<u32> {
        self.blocks(plan.counts()[0]).flatten().map(|column| column as u32).collect()
    }

    /// Returns the ranges of this shard's parts, increasing.
    fn blocks(self, parts: usize) -> impl Iterator<Item = Range<usize>> {
        let (own, count) = (self.index() as usize - 1, self.count() as usize);
        let length = block_length(parts, count);
        let nth = move |round: usize| round * count + (own + count - shift(round, count)) % count;
        let block = move |round: usize| nth(round) * length..parts.min((nth(round) + 1) * length);
        (0..parts.div_ceil(length * count)).map(block).filter(|block| block.start < block.end)
    }
}

/// Returns the number of parts of a map that can be assigned, and their name.
fn parts(plan: &Plan) -> (usize, &'static str) {
    match plan.policy().follows() {
        true => (plan.counts()[0], "columns of cells that follow each other"),
        false => (plan.cell_count(), "cells"),
    }
}

/// Returns the number of parts per block: a power of two, so that blocks of cells are squares or halves of squares.
fn block_length(parts: usize, shards: usize) -> usize {
    let most = (parts / (BLOCKS * shards)).clamp(1, LARGEST_BLOCK);
    1 << most.ilog2()
}

/// Returns the shift of the shards' order in a round.
fn shift(round: usize, count: usize) -> usize {
    ((u64::from((round as u32).wrapping_mul(GOLDEN)) * count as u64) >> 32) as usize
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Shard, ShardError> {
        let number = |text: &str| text.trim().parse().map_err(|_| ShardError::NotAShard);
        let (index, count) = text.split_once('/').ok_or(ShardError::NotAShard)?;
        Shard::new(number(index)?, number(count)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::plan::test_plan;

    fn plan([columns, rows]: [usize; 2], more: &str) -> Plan {
        test_plan([("e", columns), ("omega", rows)], more)
    }

    #[test]
    fn every_run_is_in_one_shard_and_shards_differ_by_a_block() {
        for (counts, more) in [
            ([20, 16], ""),
            ([2, 4], ""),
            ([300, 41], ""),
            ([20, 16], "[start]\ncount = 3\n"),
            ([20, 16], "[start]\npolicy = 'up'\n"),
            ([200, 2], "[start]\npolicy = 'down'\n"),
        ] {
            let plan = plan(counts, more);
            let (parts, _) = parts(&plan);
            for count in [1, 2, 3, 4, 7, 16, 64].into_iter().filter(|&count| count as usize <= parts) {
                let shards: Vec<Vec<u32>> = Shard::all(count).map(|shard| shard.runs(&plan)).collect();
                let sizes: Vec<usize> = shards.iter().map(Vec::len).collect();
                let counted: Vec<usize> = Shard::all(count).map(|shard| shard.run_count(&plan)).collect();
                assert_eq!(sizes, counted);
                let block = block_length(parts, count as usize) * (plan.run_count() / parts);
                let (least, most) = (sizes.iter().min().unwrap(), sizes.iter().max().unwrap());
                assert!(*least > 0 && most - least <= block, "{counts:?} {more} {count}: {sizes:?}");
                let mut all = shards.concat();
                all.sort_unstable();
                assert!(all.into_iter().eq(0..plan.run_count() as u32), "{counts:?} {more} {count}");
            }
        }
    }

    /// All starts of a cell, and all cells that follow each other, are in one shard.
    #[test]
    fn starts_and_columns_stay_in_one_shard() {
        let starts = plan([20, 16], "[start]\ncount = 3\n");
        let rows = plan([20, 16], "[start]\npolicy = 'up'\n");
        for shard in Shard::all(5) {
            let mut own = shard.runs(&starts);
            let cells: Vec<u32> = own.iter().copied().filter(|&run| run < 320).collect();
            let mut expected: Vec<u32> =
                (0..3).flat_map(|nth| cells.iter().map(move |id| nth * 320 + id)).collect();
            own.sort_unstable();
            expected.sort_unstable();
            assert_eq!(own, expected);
            let own = shard.runs(&rows);
            assert!(own.iter().all(|&id| rows.before(id).is_none_or(|before| own.contains(&before))));
        }
    }

    /// Every shard gets about the same part of a narrow band along either axis, and of a square.
    #[test]
    fn regions_are_spread_over_shards() {
        let plan = plan([512, 512], "");
        for count in [8, 64] {
            let worst = |is_hard: fn(usize, usize) -> bool| {
                let hard = |shard: Shard| {
                    let runs = shard.runs(&plan);
                    runs.into_iter().map(|id| plan.indices(id)).filter(|&[i, j]| is_hard(i, j)).count()
                };
                let counts: Vec<usize> = Shard::all(count).map(hard).collect();
                *counts.iter().max().unwrap() as f64 * f64::from(count) / counts.iter().sum::<usize>() as f64
            };
            let bands = [worst(|i, _| i >= 504), worst(|_, j| j < 8), worst(|i, j| i < 64 && j < 64)];
            assert!(bands.iter().all(|&band| band <= 1.5), "{count}: {bands:?}");
        }
    }

    #[test]
    fn invalid_shards_are_refused() {
        let error = |text: &str| text.parse::<Shard>().unwrap_err();
        for text in ["3", "", "/", "1/", "a/b", "1/2/3", "-1/4", "1.5/4", "1/4294967296"] {
            assert_eq!(error(text), ShardError::NotAShard, "{text}");
        }
        assert_eq!(error("1/0"), ShardError::NoShards);
        for text in ["0/4", "5/4"] {
            assert_eq!(error(text), ShardError::OutOfRange { count: 4 });
        }
        assert_eq!(
            serde_json::from_str::<Shard>(r#"{"index": 3, "count": 4}"#).unwrap(),
            Shard::new(3, 4).unwrap()
        );
        assert!(serde_json::from_str::<Shard>(r#"{"index": 5, "count": 4}"#).is_err());
        let shard = Shard::new(1, 17).unwrap();
        assert!(matches!(shard.check(&plan([4, 4], "")), Err(ShardError::TooMany { parts: 16, .. })));
        assert!(shard.check(&plan([17, 4], "[start]\npolicy = 'up'\n")).is_ok());
        let rows = shard.check(&plan([16, 40], "[start]\npolicy = 'up'\n"));
        assert!(matches!(rows, Err(ShardError::TooMany { parts: 16, .. })));
        assert!(matches!(shard.check(&plan([20, 20], "[refine]\n")), Err(ShardError::Adaptive { .. })));
    }
}
