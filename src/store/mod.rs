//! Results on disk: folders with locks and manifests, record files, shards and their merge, finished maps.

pub mod bifurcation;
pub mod compare;
pub mod curves;
pub mod error;
pub mod file_names;
pub mod finished_map;
pub mod folder;
pub mod in_memory;
pub mod inventory;
pub mod manifest;
pub mod map;
pub mod map_json;
pub mod merge;
pub mod orbit;
pub(crate) mod plain_file;
pub mod record_file;
pub mod run_records;
pub mod shard;
pub mod shares;
pub mod unfinished;
pub mod validation_json;
