//! Results on disk: folders with locks and manifests, record files, shards and their merge.

pub mod bifurcation;
pub mod bifurcation_manifest;
pub mod compare;
pub mod error;
pub mod folder;
pub mod in_memory;
pub mod inventory;
pub mod manifest;
pub mod map;
pub mod map_json;
pub mod map_manifest;
pub mod merge;
pub mod orbit;
pub mod record_file;
pub mod shard;
pub mod stdout;
pub mod unfinished;
pub mod validation_json;
