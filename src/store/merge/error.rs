//! Why shards cannot be merged.

use std::fmt;
use std::path::PathBuf;

use thiserror::Error;

use crate::map::plan::NoMotion;
use crate::map::shard::Shard;
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
    /// Shards are missing or unfinished.
    #[error("{}", incomplete(.missing, .unfinished))]
    Incomplete { missing: Vec<MissingShard>, unfinished: Vec<UnfinishedShard> },
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
            | MergeError::Records(RecordFileError::Io { .. }) => false,
            _ => true,
        }
    }
}

/// A shard that no part contains.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MissingShard {
    /// The shard.
    pub shard: Shard,
    /// Command that computes it.
    pub command: String,
}

/// A part that has not all of its records.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnfinishedShard {
    /// The folder.
    pub part: PathBuf,
    /// The shard; none if nothing was written yet.
    pub shard: Option<Shard>,
    /// Number of runs with a record.
    pub count: usize,
    /// Number of all runs; none if no finished part has the scene.
    pub of: Option<usize>,
    /// Command that computes the others.
    pub command: String,
}

impl fmt::Display for UnfinishedShard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let UnfinishedShard { part, shard, count, of, command } = self;
        let part = part.display();
        match shard {
            Some(shard) => write!(f, "shard {shard} in {part} is unfinished: {count} ")?,
            None => write!(f, "{part} is an unfinished run: {count} ")?,
        }
        match of {
            Some(of) => write!(f, "of {of} runs are there (`{command}`)"),
            None => write!(f, "runs are there (`{command}`)"),
        }
    }
}

/// Lists missing and unfinished shards with the commands that compute them.
fn incomplete(missing: &[MissingShard], unfinished: &[UnfinishedShard]) -> String {
    let count = missing.first().map_or(0, |first| first.shard.count());
    let each: Vec<String> =
        missing.iter().map(|MissingShard { shard, command }| format!("{shard} (`{command}`)")).collect();
    let are = if missing.len() == 1 { "is" } else { "are" };
    let missing = (!each.is_empty())
        .then(|| format!("{} of {count} shards {are} missing: {}", each.len(), each.join(", ")));
    let unfinished = unfinished.iter().map(ToString::to_string);
    missing.into_iter().chain(unfinished).collect::<Vec<_>>().join("; ")
}
