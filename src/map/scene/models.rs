//! `model`: the model of a scene.

use super::list::{CompanionFile, FindFile};
pub(super) use crate::model_file::DEFAULT;
use crate::model_file::{BUILT_IN, FileModel};
use crate::text::error::SceneError;
use crate::text::section::Section;
use rattlemap_dynamics::model::Model;

/// Extension of model files.
const FILE: &str = ".toml";

/// Reads `model`: the name of a built-in model, or the path of a model file.
pub(super) fn read(root: &Section<'_>, find: FindFile<'_>) -> Result<FileModel, SceneError> {
    let field = root.get("model");
    let name = match &field {
        Some(field) => field.text()?,
        None => DEFAULT,
    };
    match (FileModel::built_in(name), field) {
        (Some(model), _) => Ok(model),
        (None, Some(field)) if name.ends_with(FILE) => {
            let found = find(CompanionFile::Model, name).map_err(|reason| field.unreadable(&reason))?;
            FileModel::parse(&found.text, &found.name)
        }
        (None, Some(field)) => {
            let names: Vec<&str> = BUILT_IN.iter().map(|(name, _)| *name).collect();
            let all = format!("{}, or the path of a model's file, such as my-model{FILE}", names.join(", "));
            Err(field.unknown_name(name, &names, &all))
        }
        // Cannot happen: a test shows that the default is built in.
        (None, None) => Err(root.missing("model", "name one")),
    }
}

/// Returns the value of `model` in a scene: the name of a built-in model or of one implemented in Rust, else a file
/// name.
pub(super) fn named(model: &dyn Model) -> String {
    match model.downcast_ref::<FileModel>() {
        Some(file) if !file.is_built_in() => format!("{}{FILE}", model.name()),
        _ => model.name().to_owned(),
    }
}
