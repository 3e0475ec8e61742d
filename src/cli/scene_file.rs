//! A scene from its file.

use std::path::Path;

use crate::map::scene::{Along, Place, Problem, Purpose, Scene, SceneError};

/// Reads and parses the scene file at `path`; messages call it by that path.
///
/// # Errors
/// [`SceneError`] if the file cannot be read, or for the first thing wrong in it.
pub(crate) fn load(path: &Path, sets: &[String], purpose: Purpose) -> Result<Scene, SceneError> {
    load_along(path, sets, purpose, None)
}

/// The same where a diagram may run along one of several axes.
///
/// # Errors
/// As [`load`].
pub(crate) fn load_along(
    path: &Path,
    sets: &[String],
    purpose: Purpose,
    along: Option<&Along>,
) -> Result<Scene, SceneError> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|error| SceneError {
        place: Place::File { file: name.as_str().into() },
        problem: Problem::Unreadable { reason: error.to_string() },
    })?;
    Scene::parse_along(&text, &name, sets, purpose, along)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_cannot_be_read_is_named_with_an_example_of_one_that_can() {
        let message = load(Path::new("no/such.toml"), &[], Purpose::Map).unwrap_err().to_string();
        assert!(message.starts_with("no/such.toml: cannot read the scene ("), "{message}");
        assert!(message.contains("scenes/smoke.toml"), "{message}");
    }
}
