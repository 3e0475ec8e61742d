//! Why shards make no map.

use std::fmt;
use std::path::PathBuf;

use thiserror::Error;

use crate::map::plan::NoMotion;
use crate::map::scene::SceneError;
use crate::map::shard::Shard;
use crate::store::error::OutputError;
use crate::store::folder::FolderError;
use crate::store::record_file::RecordFileError;

/// Why shards make no map. But for the last three nothing was written, and a map that was there before is as it was.
#[derive(Debug, Error)]
pub enum MergeError {
    /// There are none.
    #[error("there are no shards to merge; name the folder of each")]
    Nothing,
    /// There is no such folder.
    #[error("{}: there is no such folder; name the folders of shards", .part.display())]
    NoFolder {
        /// The folder.
        part: PathBuf,
    },
    /// Something else is in it.
    #[error("{}: this is no shard of a map ({why}); `rattlemap map SCENE --shard I/N` makes one", .part.display())]
    NoShard {
        /// The folder.
        part: PathBuf,
        /// What is not as in a shard.
        why: String,
    },
    /// A map is in it.
    #[error("{}: this is a whole map, not a shard of one: there is nothing to merge it with", .part.display())]
    WholeMap {
        /// The folder.
        part: PathBuf,
    },
    /// Its files are not what they were.
    #[error("{}: {what}; `{command}` keeps what is good and computes the rest", .part.display())]
    Damaged {
        /// The folder.
        part: PathBuf,
        /// What is wrong.
        what: String,
        /// What makes it anew.
        command: String,
    },
    /// Two parts are of two runs.
    #[error("{} and {} are of two runs, and make no map: {differences}; make the shards of one map with one scene, \
             engine, precision and version, on cards of one model and driver", .first.display(), .part.display())]
    OtherRun {
        /// The folder of the first part.
        first: PathBuf,
        /// The folder of the one that differs.
        part: PathBuf,
        /// In what, with both values.
        differences: String,
    },
    /// Two parts are of maps that were dealt out to different numbers.
    #[error("{} is shard {of_first}, and {} is shard {shard}: all must be of one number of shards", .first.display(), .part.display())]
    OtherCount {
        /// The folder of the first part.
        first: PathBuf,
        /// Which it is.
        of_first: Shard,
        /// The folder of the one that differs.
        part: PathBuf,
        /// Which it is.
        shard: Shard,
    },
    /// One shard twice.
    #[error("{} and {} are both shard {shard}; name one of them", .first.display(), .part.display())]
    Twice {
        /// Which it is.
        shard: Shard,
        /// One folder.
        first: PathBuf,
        /// The other, or the same.
        part: PathBuf,
    },
    /// Shards are missing or unfinished.
    #[error("{}", told(.missing, .unfinished))]
    Incomplete {
        /// Shards that no part is.
        missing: Vec<Missing>,
        /// Parts that have not all of their runs.
        unfinished: Vec<Unfinished>,
    },
    /// The map would be written over one of its shards.
    #[error("{}: this is the folder of a shard; name another one for the map", .part.display())]
    IsPart {
        /// The folder.
        part: PathBuf,
    },
    /// The map is too large.
    #[error("{runs} runs are more than the {} that can be numbered", u32::MAX)]
    TooLarge {
        /// Cells times starts per cell.
        runs: u64,
    },
    /// The scene of the shards is not one of this version.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The model has no motion somewhere.
    #[error(transparent)]
    NoMotion(#[from] NoMotion),
    /// Whoever was told of progress asked to stop.
    #[error("interrupted")]
    Stopped,
    /// The folder of the map cannot be used.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// Records cannot be read or written.
    #[error(transparent)]
    Records(#[from] RecordFileError),
    /// A file of the map cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// A shard that no part is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missing {
    /// Which.
    pub shard: Shard,
    /// What makes it.
    pub command: String,
}

/// A part that has not all of its runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unfinished {
    /// Its folder.
    pub part: PathBuf,
    /// Which shard it is; none where nothing was kept yet.
    pub shard: Option<Shard>,
    /// Runs that it has.
    pub kept: usize,
    /// Runs that it should have; none where no finished part tells the scene.
    pub of: Option<usize>,
    /// What goes on with it.
    pub command: String,
}

impl fmt::Display for Unfinished {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Unfinished { part, shard, kept, of, command } = self;
        let part = part.display();
        match shard {
            Some(shard) => write!(f, "shard {shard} in {part} is unfinished: {kept} ")?,
            None => write!(f, "{part} is an unfinished run: {kept} ")?,
        }
        match of {
            Some(of) => write!(f, "of {of} runs are there (`{command}`)"),
            None => write!(f, "runs are there (`{command}`)"),
        }
    }
}

/// What is not there, and how to make it.
fn told(missing: &[Missing], unfinished: &[Unfinished]) -> String {
    let count = missing.first().map_or(0, |first| first.shard.count());
    let each: Vec<String> =
        missing.iter().map(|Missing { shard, command }| format!("{shard} (`{command}`)")).collect();
    let are = if missing.len() == 1 { "is" } else { "are" };
    let missing = (!each.is_empty())
        .then(|| format!("{} of {count} shards {are} missing: {}", each.len(), each.join(", ")));
    let unfinished = unfinished.iter().map(ToString::to_string);
    missing.into_iter().chain(unfinished).collect::<Vec<_>>().join("; ")
}
