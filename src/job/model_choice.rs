//! Finds a model by its name or file.

use std::path::Path;

use rattlemap_dynamics::model::Model;

use crate::job::error::JobError;
use crate::job::scene_file;
use crate::model_file::{BUILT_IN, FileModel};
use crate::text::printable;

/// Strings that mark the path of a file. Names of built-in models do not contain them.
const FILE_MARKS: [&str; 3] = [".toml", "/", "\\"];

/// Names of standard input. A pipe has no size that could be checked before it is read.
const STDIN: [&str; 2] = ["-", "/dev/stdin"];

/// Returns the built-in model of this name, or reads the model's file of this name.
///
/// # Errors
/// [`JobError`] if there is no such model, or its file cannot be read or is wrong.
pub fn find(path: impl AsRef<Path>) -> Result<FileModel, JobError> {
    let path = path.as_ref();
    let name = &*path.to_string_lossy();
    if let Some(model) = FileModel::built_in(name) {
        return Ok(model);
    }
    let quoted = printable::line(name);
    let is_stdin = STDIN.contains(&name);
    if is_stdin || FILE_MARKS.iter().any(|mark| name.contains(mark)) {
        let file = if is_stdin { scene_file::model_of_stdin() } else { scene_file::find_model(path) };
        let file = file.map_err(|reason| JobError::Usage(format!("{quoted}: the model {reason}")))?;
        return Ok(FileModel::parse(&file.text, &file.name)?);
    }
    let names: Vec<&str> = BUILT_IN.iter().map(|(name, _)| *name).collect();
    Err(JobError::Usage(format!(
        "no model is called `{quoted}`; the built-in models are {}; or give the path of a model's file, such as my-model.toml",
        names.join(", ")
    )))
}

/// Checks that a state has as many numbers as the model's state.
///
/// # Errors
/// [`JobError::Usage`] if the numbers differ.
pub fn check_components(model: &dyn Model, count: usize) -> Result<(), JobError> {
    let names = model.state_names();
    let number = match names.len() {
        2 => "two".to_owned(),
        4 => "four".to_owned(),
        more => more.to_string(),
    };
    match count == names.len() {
        true => Ok(()),
        false => Err(JobError::Usage(format!(
            "--start: it must be {number} finite numbers, the model's {}; {count} were given, and the model is {}",
            names.join(", "),
            model.name()
        ))),
    }
}
