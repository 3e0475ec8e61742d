//! `unfinished.json`: the time spent so far on a map that has no manifest yet.

use std::time::Duration;

use serde_json::{Value, json};

use crate::store::error::OutputError;
use crate::store::file_names::{MANIFEST, UNFINISHED};
use crate::store::folder::Folder;
use crate::store::inventory::MOST_MANIFEST_BYTES;
use crate::store::plain_file::read_text;

/// Field of the time in seconds, in both files.
const ELAPSED: &str = "elapsed_seconds";

/// Returns the time that earlier runs in this folder spent integrating; zero if no file says.
pub fn elapsed(folder: &Folder) -> Duration {
    let read = |name: &str| {
        let text = read_text(&folder.path().join(name), MOST_MANIFEST_BYTES, "").ok()?;
        let seconds = serde_json::from_str::<Value>(&text).ok()?[ELAPSED].as_f64()?;
        Duration::try_from_secs_f64(seconds).ok()
    };
    // Both files exist if a run ended between writing one and removing the other.
    [MANIFEST, UNFINISHED].into_iter().filter_map(read).max().unwrap_or_default()
}

/// Stores the time until there is a manifest.
///
/// # Errors
/// If the file cannot be written.
pub fn store_elapsed(folder: &Folder, elapsed: Duration) -> Result<(), OutputError> {
    folder.write_json(UNFINISHED, &json!({ ELAPSED: elapsed.as_secs_f64() }))
}

/// Removes the file if it exists.
///
/// # Errors
/// If it cannot be removed.
pub fn clear(folder: &Folder) -> Result<(), OutputError> {
    folder.remove(&[UNFINISHED])
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn elapsed_is_the_longer_time_of_both_files() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::open(root.path(), false).unwrap();
        assert_eq!(elapsed(&folder), Duration::ZERO);
        fs::write(root.path().join(MANIFEST), "{\"elapsed_seconds\": 2.5}").unwrap();
        assert_eq!(elapsed(&folder), Duration::from_millis(2500));
        store_elapsed(&folder, Duration::from_secs(3)).unwrap();
        assert_eq!(elapsed(&folder), Duration::from_secs(3));
        clear(&folder).unwrap();
        for text in ["{\"elapsed_seconds\": -1}", "{}", "torn"] {
            fs::write(root.path().join(MANIFEST), text).unwrap();
            assert_eq!(elapsed(&folder), Duration::ZERO, "{text}");
        }
    }
}
