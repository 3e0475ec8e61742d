//! A scene from its file.

use std::fs;
use std::path::Path;

use crate::cli::arguments::{FigureFormat, SceneOptions};
use crate::map::scene::{Along, CompanionFile, FileText, Format, Place, Problem, Purpose, Scene, SceneError};
use crate::store::finished_map::MOST_LIST_BYTES;
use crate::store::plain_file::read_text;

/// The most bytes that a table of cells may have.
const MOST: u64 = 256_000_000;

/// The most bytes that a model may have.
const MOST_OF_MODEL: u64 = 1_000_000;

/// The `--set` that says what is written.
const FILES: &str = "outputs.files=";

/// Reads and parses a map's scene, the file at `path`; messages call it by that path. Where the table that it names is
/// gone, `kept` may be the copy in the folder of the run that goes on: one of other values does not go on.
///
/// # Errors
/// [`SceneError`] if the file cannot be read, or for the first thing wrong in it.
pub(crate) fn load(path: &Path, sets: &[String], kept: Option<&Path>) -> Result<Scene, SceneError> {
    load_from(path, sets, Purpose::Map, None, kept)
}

/// The scene in the file at `path`, of any purpose; a diagram may run along one of several axes. Messages call it by that
/// path.
///
/// # Errors
/// [`SceneError`] if the file cannot be read, or for the first thing wrong in it.
pub fn load_along(
    path: &Path,
    sets: &[String],
    purpose: Purpose,
    along: Option<&Along>,
) -> Result<Scene, SceneError> {
    load_from(path, sets, purpose, along, None)
}

fn load_from(
    path: &Path,
    sets: &[String],
    purpose: Purpose,
    along: Option<&Along>,
    kept: Option<&Path>,
) -> Result<Scene, SceneError> {
    let name = path.display().to_string();
    let text = fs::read_to_string(path).map_err(|error| SceneError {
        place: Place::File { file: name.as_str().into() },
        problem: Problem::Unreadable { reason: error.to_string() },
    })?;
    let find = |what, file: &str| {
        let beside = path.parent().unwrap_or(Path::new("")).join(file);
        if what == CompanionFile::Model {
            return find_model(&beside);
        }
        match kept.filter(|kept| !beside.exists() && kept.exists()) {
            Some(kept) => find(kept, MOST_LIST_BYTES),
            None => find(&beside, MOST),
        }
    };
    Scene::parse_with_files(&text, &name, sets, purpose, along, &find)
}

/// Reads the file of a model; the error is the end of a sentence that names it.
pub(crate) fn find_model(path: &Path) -> Result<FileText, String> {
    let name = path.display().to_string();
    match read_text(path, MOST_OF_MODEL, "write a shorter model") {
        Ok(text) => Ok(FileText { name, text }),
        Err(error) => Err(format!(
            "cannot be read at {name} ({error}); give the path of a model's file, in a scene from the scene's folder"
        )),
    }
}

/// Reads a table of cells.
fn find(path: &Path, most: u64) -> Result<FileText, String> {
    let name = path.display().to_string();
    match read_text(path, most, "list fewer cells") {
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
    figures_from(options, purpose, along, None)
}

/// The same of a map's scene, as [`load`] reads it.
///
/// # Errors
/// As [`load`], where there is such an option.
pub(crate) fn map_with_figures(
    options: &SceneOptions,
    kept: Option<&Path>,
) -> Result<SceneOptions, SceneError> {
    figures_from(options, Purpose::Map, None, kept)
}

fn figures_from(
    options: &SceneOptions,
    purpose: Purpose,
    along: Option<&Along>,
    kept: Option<&Path>,
) -> Result<SceneOptions, SceneError> {
    let mut options = options.clone();
    let formats = FigureFormat::scene(&std::mem::take(&mut options.format));
    if formats.is_empty() {
        return Ok(options);
    }
    let written = load_from(&options.scene, &options.set, purpose, along, kept)?.outputs().files.clone();
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
        let message = load(Path::new("no/such.toml"), &[], None).unwrap_err().to_string();
        assert!(message.starts_with("no/such.toml: cannot read the scene ("), "{message}");
        assert!(message.contains("scenes/smoke.toml"), "{message}");
    }
}
