//! Why shards cannot be merged.

use std::path::PathBuf;

use thiserror::Error;

use crate::map::plan::NoMotion;
use crate::map::shard::{Shard, ShardError};
use crate::store::error::OutputError;
use crate::store::finished_map::FinishedMapError;
use crate::store::record_file::RecordFileError;

/// Why shards cannot be merged. Except for the last two, nothing was written.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the fields")]
pub enum MergeError {
    /// No folder was named.
    #[error("there are no shards to merge; name the folder of each")]
    Nothing,
    /// A folder is not that of a finished shard.
    #[error(transparent)]
    Part(#[from] FinishedMapError),
    /// A folder has no manifest.
    #[error("{}: this is not the folder of a shard; `rattlemap map SCENE --engine E --shard I/N` computes one", .part.display())]
    NoShard { part: PathBuf },
    /// A folder contains a whole map.
    #[error("{}: this is a whole map, not a shard of one; name the folders of shards", .part.display())]
    WholeMap { part: PathBuf },
    /// Files of a shard are damaged.
    #[error("{}: {what}; `{command}` keeps what is good and computes the rest", .part.display())]
    Damaged { part: PathBuf, what: String, command: String },
    /// Two parts belong to different runs.
    #[error("{} and {} are of two runs, and make no map: {differences}; make the shards of one map with one scene, \
             engine, precision and version, on cards of one model and driver", .first.display(), .part.display())]
    OtherRun { first: PathBuf, part: PathBuf, differences: String },
    /// Two parts belong to maps with different numbers of shards.
    #[error("{} is shard {of_first}, and {} is shard {shard}: the number of shards must be the same", .first.display(), .part.display())]
    OtherCount { first: PathBuf, of_first: Shard, part: PathBuf, shard: Shard },
    /// Two parts are the same shard.
    #[error("{} and {} are both shard {shard}; name one of them", .first.display(), .part.display())]
    Twice { shard: Shard, first: PathBuf, part: PathBuf },
    /// The map cannot be divided into so many shards.
    #[error("{}: {reason}", .part.display())]
    Impossible { part: PathBuf, reason: ShardError },
    /// Shards are missing or unfinished.
    #[error("{0}")]
    Incomplete(String),
    /// The map would be written into the folder of one of its shards.
    #[error("{}: this is the folder of a shard; name another one for the map", .part.display())]
    IsPart { part: PathBuf },
    /// The map is too large.
    #[error("{runs} runs are more than the {} that can be numbered", u32::MAX)]
    TooLarge { runs: u64 },
    /// The model has no motion in a cell.
    #[error(transparent)]
    NoMotion(#[from] NoMotion),
    /// The caller stopped the merge.
    #[error("interrupted")]
    Stopped,
    /// The records of the map cannot be written.
    #[error(transparent)]
    Records(#[from] RecordFileError),
    /// Another file of the map cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl MergeError {
    /// Whether the caller named wrong folders; otherwise a part is damaged, or a file cannot be written.
    pub fn is_usage(&self) -> bool {
        match self {
            MergeError::Part(error) => error.is_usage(),
            MergeError::Damaged { .. }
            | MergeError::Output(_)
            | MergeError::Stopped
            | MergeError::Records(RecordFileError::Io { .. } | RecordFileError::Damaged { .. }) => false,
            _ => true,
        }
    }
}
