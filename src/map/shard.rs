//! A part of a map for one of several machines: which runs are its own. Pure.
//!
//! Cells go to shards in small blocks of the plan's order: cells side by side stay together, as lanes that run together
//! should, and the blocks of a shard are spread over the whole map, for regions differ in what their cells cost by a
//! factor of 100. Block `n` is the next shard's, and after every round of all shards the turn is shifted: else a shard
//! would own stripes of a map whose side is a multiple of their number. Of 64 shards of the main map the one with the most
//! work has 9 % more than the mean; without the shift 20 %, as 64 ranges of the order five times as much. All starts of a
//! cell are in its shard. Where cells follow their neighbours along the last axis, what is dealt out are columns: a chain
//! of cells stays whole.
//!
//! A shard derives those flows that its cells need, lanes all of the map's where they are kept (8,192 at most): on the
//! main map 512 flows, in some milliseconds.

use std::fmt;
use std::num::NonZeroU32;
use std::ops::Range;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::plan::Plan;

/// Most cells of a block: what a subgroup of a graphics card runs together.
const LARGEST_BLOCK: usize = 64;

/// Blocks that each shard gets, of smaller ones where cells are few: the more, the better work is spread. Cells that are
/// no neighbours make lanes wait for each other: 5 % in blocks of 16, a quarter one by one.
const BLOCKS: usize = 256;

/// An odd number near the golden section of 2^32: its multiples are spread.
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
#[serde(try_from = "Written")]
pub struct Shard {
    index: NonZeroU32,
    count: NonZeroU32,
}

/// As it comes from a file.
#[derive(Deserialize)]
struct Written {
    index: u32,
    count: u32,
}

impl TryFrom<Written> for Shard {
    type Error = ShardError;

    fn try_from(written: Written) -> Result<Shard, ShardError> {
        Shard::new(written.index, written.count)
    }
}

/// Why there is no such shard.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ShardError {
    /// It is not written as one.
    #[error("it must be two whole numbers, such as 3/16: the third of 16 shards")]
    NotAShard,
    /// There are none.
    #[error("there must be one shard at least, such as 1/1")]
    NoShards,
    /// They are counted from 1.
    #[error("shards are counted from 1: of {count} the first is 1/{count}, the last {count}/{count}")]
    OutOfRange {
        /// How many there are.
        count: u32,
    },
    /// Some would be empty.
    #[error("{shard} is one of {} shards, and the map has {parts} {what} to deal out; ask for {parts} shards at most", .shard.count)]
    TooMany {
        /// The one asked for.
        shard: Shard,
        /// How many there can be.
        parts: usize,
        /// Of what each gets one at least.
        what: &'static str,
    },
    /// The map is adaptive.
    #[error(
        "{shard}: which cells an adaptive map integrates follows from the records of all others, and no shard has them; \
         drop [refine] from the scene, or make the map on one machine"
    )]
    Adaptive {
        /// The one asked for.
        shard: Shard,
    },
}

impl Shard {
    /// The shard `index`, from 1, of `count`.
    ///
    /// # Errors
    /// [`ShardError`] if there is none.
    pub fn new(index: u32, count: u32) -> Result<Shard, ShardError> {
        let counted = NonZeroU32::new(count).ok_or(ShardError::NoShards)?;
        match NonZeroU32::new(index) {
            Some(index) if index <= counted => Ok(Shard { index, count: counted }),
            _ => Err(ShardError::OutOfRange { count }),
        }
    }

    /// Every shard of so many.
    pub fn all(count: u32) -> impl Iterator<Item = Shard> {
        (1..=count).filter_map(move |index| Shard::new(index, count).ok())
    }

    /// Which it is, from 1.
    pub fn index(self) -> u32 {
        self.index.get()
    }

    /// How many there are.
    pub fn count(self) -> u32 {
        self.count.get()
    }

    /// Looks whether a plan can be dealt out to so many.
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

    /// Its runs, in the order of the plan. Of a map whose cells follow their neighbours these are not the order of work.
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

    /// How many runs it has.
    pub fn run_count(self, plan: &Plan) -> usize {
        let (parts, _) = parts(plan);
        self.blocks(parts).map(|block| block.len()).sum::<usize>() * (plan.run_count() / parts)
    }

    /// The columns of a map whose cells follow their neighbours: indices on the first axis, ascending.
    pub(crate) fn columns(self, plan: &Plan) -> Vec<u32> {
        self.blocks(plan.counts()[0]).flatten().map(|column| column as u32).collect()
    }

    /// Its share of so many parts, ascending.
    fn blocks(self, parts: usize) -> impl Iterator<Item = Range<usize>> {
        let (own, count) = (self.index() as usize - 1, self.count() as usize);
        let length = block_length(parts, count);
        let nth = move |round: usize| round * count + (own + count - shift(round, count)) % count;
        let block = move |round: usize| nth(round) * length..parts.min((nth(round) + 1) * length);
        (0..parts.div_ceil(length * count)).map(block).filter(|block| block.start < block.end)
    }
}

/// How many parts of a map are dealt out, and what they are.
fn parts(plan: &Plan) -> (usize, &'static str) {
    match plan.policy().follows() {
        true => (plan.counts()[0], "columns of cells that follow each other"),
        false => (plan.cell_count(), "cells"),
    }
}

/// Parts per block: a power of two, so that blocks of cells are squares or halves of them.
fn block_length(parts: usize, shards: usize) -> usize {
    let most = (parts / (BLOCKS * shards)).clamp(1, LARGEST_BLOCK);
    1 << most.ilog2()
}

/// By how many shards the turn is shifted in a round.
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
    use crate::map::scene::{Purpose, Scene};

    fn plan(counts: [usize; 2], more: &str) -> Plan {
        let axis =
            |name, count| format!("[[axis]]\nparameter = '{name}'\nmin = 0.5\nmax = 1.0\ncount = {count}\n");
        let text = format!("{}{}{more}", axis("e", counts[0]), axis("omega", counts[1]));
        Plan::new(&Scene::parse(&text, "s", &[], Purpose::Map).unwrap())
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
                let told: Vec<usize> = Shard::all(count).map(|shard| shard.run_count(&plan)).collect();
                assert_eq!(sizes, told);
                let block = block_length(parts, count as usize) * (plan.run_count() / parts);
                let (least, most) = (sizes.iter().min().unwrap(), sizes.iter().max().unwrap());
                assert!(*least > 0 && most - least <= block, "{counts:?} {more} {count}: {sizes:?}");
                let mut all = shards.concat();
                all.sort_unstable();
                assert!(all.into_iter().eq(0..plan.run_count() as u32), "{counts:?} {more} {count}");
            }
        }
    }

    /// All starts of a cell are compared with each other, and a cell may wait for its neighbour's last state.
    #[test]
    fn what_belongs_together_is_in_one_shard() {
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

    /// A narrow band along either axis, and a square, cost every shard about the same.
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
    fn what_is_no_shard_is_refused() {
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
