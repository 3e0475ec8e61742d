//! Which model an argument means: one that is built in, or a file.

use std::path::Path;

use anyhow::anyhow;
use rattlemap_dynamics::model::Model;

use crate::cli::say;
use crate::job::error::Failure;
use crate::job::scene_file;
use crate::model_file::{BUILT_IN, FileModel};

/// What a model's file is known by: no name that is built in has either.
const FILE_MARKS: [&str; 3] = [".toml", "/", "\\"];

/// The model that is called `name`, or stands in the file `name`.
///
/// # Errors
/// [`Failure::Usage`] if there is none, or its file cannot be read or is wrong.
pub fn find(name: &str) -> Result<FileModel, Failure> {
    if let Some(model) = FileModel::built_in(name) {
        return Ok(model);
    }
    if FILE_MARKS.iter().any(|mark| name.contains(mark)) {
        let file = scene_file::find_model(Path::new(name));
        let file =
            file.map_err(|reason| Failure::Usage(anyhow!("{}: the model {reason}", say::quoted(name))))?;
        return Ok(FileModel::parse(&file.text, &file.name)?);
    }
    let names: Vec<&str> = BUILT_IN.iter().map(|(name, _)| *name).collect();
    Err(Failure::Usage(anyhow!(
        "no model is called `{}`; there is {}, or give the path of a model's file, such as my-model.toml",
        say::quoted(name),
        names.join(", ")
    )))
}

/// Numbers of a state, checked against what the model has.
///
/// # Errors
/// [`Failure::Usage`] if there are not as many.
pub fn check_components(model: &dyn Model, count: usize) -> Result<(), Failure> {
    let names = model.state_names();
    let number = if names.len() == 2 { "two" } else { "four" };
    match count == names.len() {
        true => Ok(()),
        false => Err(Failure::Usage(anyhow!(
            "--start: it must be {number} finite numbers, the model's {}; {count} were given",
            names.join(", ")
        ))),
    }
}
