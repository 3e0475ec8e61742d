//! Loads scenes from files.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use crate::map::scene::{Along, CompanionFile, FileText, Format, Place, Problem, Purpose, Scene, SceneError};
use crate::store::finished_map::{MOST_LIST_BYTES, MOST_TABLE_BYTES};
use crate::store::plain_file::read_text;
use crate::text::size::bytes;

/// Largest size of a model's file, in bytes.
const MOST_OF_MODEL: u64 = 1_000_000;

/// Largest size of a scene, in bytes: two axes of a million listed values.
const MOST_OF_SCENE: u64 = 64_000_000;

/// Begins the `--set` argument that lists the output files.
pub const FILES: &str = "outputs.files=";

/// File of a scene, and settings for reading it.
#[derive(Clone, Copy, Debug)]
pub struct SceneFile<'a> {
    /// Path of the file, which messages show.
    pub path: &'a Path,
    /// Purpose of the scene.
    pub purpose: Purpose,
    /// Line of a bifurcation diagram through a scene with several axes.
    pub along: Option<&'a Along>,
    /// A copy of the scene's table of cells, used if the table itself does not exist: a run can be resumed without it.
    pub list_copy: Option<&'a Path>,
}

impl SceneFile<'_> {
    /// Returns the file of a map's scene.
    pub fn map(path: &Path) -> SceneFile<'_> {
        SceneFile { path, purpose: Purpose::Map, along: None, list_copy: None }
    }

    /// Reads and checks the scene, with parameters and settings overridden by `--set` arguments.
    ///
    /// # Errors
    /// [`SceneError`] if the file cannot be read or is wrong.
    pub fn load(&self, sets: &[String]) -> Result<Scene, SceneError> {
        let name = self.path.display().to_string();
        let text = read_scene(self.path).map_err(|error| SceneError {
            place: Place::File { file: name.as_str().into() },
            problem: Problem::Unreadable { reason: error.to_string(), example: self.purpose.example() },
        })?;
        let find = |what, file: &str| {
            let path = self.path.parent().unwrap_or(Path::new("")).join(file);
            if what == CompanionFile::Model {
                return find_model(&path);
            }
            match self.list_copy.filter(|copy| !path.exists() && copy.exists()) {
                Some(copy) => find_table(copy, MOST_LIST_BYTES),
                None => find_table(&path, MOST_TABLE_BYTES),
            }
        };
        Scene::parse_with_files(&text, &name, sets, self.purpose, self.along, &find)
    }

    /// Returns the `--set` arguments of a run that writes `figures` instead of the scene's figures, if there are any, and
    /// `more` formats in addition. Manifests list the arguments, and resumed runs compare them.
    ///
    /// # Errors
    /// [`SceneError`] if there are formats and the scene cannot be loaded.
    pub fn with_formats(
        &self,
        mut sets: Vec<String>,
        figures: &[Format],
        more: &[Format],
    ) -> Result<Vec<String>, SceneError> {
        if figures.is_empty() && more.is_empty() {
            return Ok(sets);
        }
        let of_scene = self.load(&sets)?.outputs().files.clone();
        let mut files = of_scene.clone();
        files.retain(|format| figures.is_empty() || !Format::FIGURES.contains(format));
        for format in figures.iter().chain(more) {
            if !files.contains(format) {
                files.push(*format);
            }
        }
        if files != of_scene {
            let names: Vec<String> = files.iter().map(|format| format!("{:?}", format.name())).collect();
            sets.retain(|set| !set.starts_with(FILES));
            sets.push(format!("{FILES}[{}]", names.join(",")));
        }
        Ok(sets)
    }
}

/// Reads a scene. It may come from a pipe.
fn read_scene(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    match File::open(path)?.take(MOST_OF_SCENE + 1).read_to_string(&mut text)? as u64 > MOST_OF_SCENE {
        true => Err(io::Error::other(format!("at most {} are read", bytes(MOST_OF_SCENE)))),
        false => Ok(text),
    }
}

/// Reads the file of a model.
///
/// # Errors
/// A text that completes a sentence about the model.
pub(crate) fn find_model(path: &Path) -> Result<FileText, String> {
    let name = path.display().to_string();
    match read_text(path, MOST_OF_MODEL, "write a shorter model") {
        Ok(text) => Ok(FileText { name, text }),
        Err(error) => Err(format!(
            "cannot be read at {name} ({error}); give the path of a model's file (in a scene: relative to the scene's folder)"
        )),
    }
}

/// Reads a model's file from standard input.
///
/// # Errors
/// As [`find_model`].
pub(crate) fn model_of_stdin() -> Result<FileText, String> {
    let name = "standard input".to_owned();
    match io::read_to_string(io::stdin().take(MOST_OF_MODEL + 1)) {
        Ok(text) if text.len() as u64 <= MOST_OF_MODEL => Ok(FileText { name, text }),
        Ok(_) => Err(format!("in {name} has more than {}; write a shorter model", bytes(MOST_OF_MODEL))),
        Err(error) => Err(format!("cannot be read from {name} ({error})")),
    }
}

fn find_table(path: &Path, most: u64) -> Result<FileText, String> {
    let name = path.display().to_string();
    match read_text(path, most, "list fewer cells") {
        Ok(text) => Ok(FileText { name, text }),
        Err(error) => Err(format!(
            "cannot be read at {name} ({error}); give the path of a CSV table, relative to the scene's folder"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_for_an_unreadable_scene_gives_an_example() {
        let message = SceneFile::map(Path::new("no/such.toml")).load(&[]).unwrap_err().to_string();
        assert!(message.starts_with("no/such.toml: cannot read the scene ("), "{message}");
        assert!(message.contains("scenes/e_omega.toml"), "{message}");
    }
}
