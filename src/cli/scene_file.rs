//! A scene from its file.

use std::path::Path;

use super::arguments::{FigureFormat, SceneOptions};
use crate::map::scene::{Along, FileText, Format, Place, Problem, Purpose, Scene, SceneError};

/// The `--set` that says what is written.
const FILES: &str = "outputs.files=";

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
    let find = |file: &str| {
        let beside = path.parent().unwrap_or(Path::new("")).join(file);
        find(&beside)
    };
    Scene::parse_along(&text, &name, sets, purpose, along, &find)
}

/// Reads a table of cells.
pub(crate) fn find(path: &Path) -> Result<FileText, String> {
    let name = path.display().to_string();
    match std::fs::read_to_string(path) {
        Ok(text) => Ok(FileText { name, text }),
        Err(error) => Err(format!(
            "cannot be read at {name} ({error}); give the path of a CSV table, relative to the scene's folder"
        )),
    }
}

/// The options with `--format` told as one more `--set`: that is what a manifest keeps and what resuming compares.
///
/// # Errors
/// As [`load_along`], where there is such an option.
pub(crate) fn with_figures(
    options: &SceneOptions,
    purpose: Purpose,
    along: Option<&Along>,
) -> Result<SceneOptions, SceneError> {
    let mut options = options.clone();
    let formats = FigureFormat::scene(&std::mem::take(&mut options.format));
    if formats.is_empty() {
        return Ok(options);
    }
    let written = load_along(&options.scene, &options.set, purpose, along)?.outputs().files.clone();
    let others = written.into_iter().filter(|format| !Format::FIGURES.contains(format));
    let names: Vec<String> = others.chain(formats).map(|format| format!("{:?}", format.name())).collect();
    options.set.retain(|set| !set.starts_with(FILES));
    options.set.push(format!("{FILES}[{}]", names.join(",")));
    Ok(options)
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
