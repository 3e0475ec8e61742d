//! Names of the files in a map's folder that several modules use.

/// What a folder contains, with the hash of each file. A run writes it last: a folder with a manifest is complete.
pub const MANIFEST: &str = "manifest.json";
/// Records of all runs.
pub const RECORDS: &str = "records.bin";
/// Time spent so far on a map that has no manifest yet.
pub(crate) const UNFINISHED: &str = "unfinished.json";
/// Copy of the scene's list of cells, so that the folder does not depend on a file elsewhere.
pub const LIST: &str = "list.csv";
/// Result of `rattlemap validate`.
pub const VALIDATION: &str = "validation.json";
