//! The folder of a map: tables, figures, report and manifest.

use std::path::Path;

use rayon::prelude::*;

use super::unfinished::UNFINISHED;
use super::validation_json::ValidationObject;
use super::{
    Cells, Folder, OutputError, RECORDS, WriteError, cells_csv, cells_npy, layers, map_figure, map_manifest,
    report, unfinished,
};
use crate::map::scene::Format;
use crate::validate::Validation;

pub use super::manifest::MANIFEST;
pub use super::map_manifest::{Made, Run};

const CSV: &str = "cells.csv";
const NPY: &str = "cells.npy";
const HTML: &str = "report.html";
const VALIDATION: &str = "validation.json";

/// Every file that a map may have beside its records.
const ALL: [&str; 11] = [
    MANIFEST,
    CSV,
    NPY,
    "map.png",
    "lyapunov.png",
    "impacts.png",
    "mesh.png",
    "word.png",
    "attractors.png",
    HTML,
    VALIDATION,
];

/// Every file that a map may write, records included.
pub fn names() -> impl Iterator<Item = &'static str> {
    ALL.into_iter().chain([RECORDS, UNFINISHED])
}

/// Removes what an earlier run left, but for its records: files must not stand beside a
/// manifest that does not know them.
///
/// # Errors
/// If a file cannot be removed.
pub fn clear(folder: &Folder) -> Result<(), OutputError> {
    folder.remove(&ALL)
}

/// Writes the files that the scene asks for, and the manifest last: a folder that has one is
/// complete. Returns the files' names.
///
/// # Errors
/// If a file cannot be written.
pub fn write(folder: &Folder, cells: &Cells<'_>, run: &Run<'_>) -> Result<Vec<String>, OutputError> {
    clear(folder)?;
    // Side by side, for each of them has parts that one core must do alone.
    let (tables, pictures) = rayon::join(|| write_tables(folder, cells), || write_pictures(folder, cells));
    let mut files = tables?;
    files.extend(pictures?);
    files.push(MANIFEST.to_owned());
    folder.write_json(MANIFEST, &map_manifest::map(cells, run, &files))?;
    unfinished::clear(folder)?;
    Ok(files)
}

/// Writes `validation.json` and, where the map has a report, the report again with a section
/// on it. `again` is the device that ran the sample's lanes again, if one did. Returns the files'
/// names.
///
/// # Errors
/// If a file cannot be written.
pub fn write_validation(
    folder: &Folder,
    cells: &Cells<'_>,
    made: &Made<'_>,
    again: Option<&str>,
    validation: &Validation,
) -> Result<Vec<&'static str>, OutputError> {
    let object = ValidationObject::new(cells, made, again, validation);
    folder.write_json(VALIDATION, &object)?;
    if !folder.path().join(HTML).is_file() {
        return Ok(vec![VALIDATION]);
    }
    let words = layers::read_words(cells);
    let layers = layers::of(cells, words.as_ref());
    folder.replace(HTML, |path| report::write(path, cells, &layers, words.as_ref(), Some(&object)))?;
    Ok(vec![VALIDATION, HTML])
}

fn write_tables(folder: &Folder, cells: &Cells<'_>) -> Result<Vec<String>, OutputError> {
    let wants = |format| cells.scene().outputs().files.contains(&format);
    let write_if = |wanted: bool, name: &str, write: fn(&Path, &Cells<'_>) -> Result<(), WriteError>| {
        if wanted {
            folder.replace(name, |path| write(path, cells)).map(|()| Some(name.to_owned()))
        } else {
            Ok(None)
        }
    };
    let (csv, npy) = rayon::join(
        || write_if(wants(Format::Csv), CSV, cells_csv::write),
        || write_if(wants(Format::Npy), NPY, cells_npy::write),
    );
    Ok([csv?, npy?].into_iter().flatten().collect())
}

fn write_pictures(folder: &Folder, cells: &Cells<'_>) -> Result<Vec<String>, OutputError> {
    let wants = |format| cells.scene().outputs().files.contains(&format);
    let mut files = Vec::new();
    if !wants(Format::Png) && !wants(Format::Html) {
        return Ok(files);
    }
    let words = layers::read_words(cells);
    let layers = layers::of(cells, words.as_ref());
    if wants(Format::Png) {
        let names: Vec<String> = layers.iter().map(|layer| format!("{}.png", layer.name)).collect();
        layers.par_iter().zip(&names).try_for_each(|(layer, name)| {
            folder.replace(name, |path| Ok(map_figure::write(path, cells, layer)?))
        })?;
        files.extend(names);
    }
    if wants(Format::Html) {
        folder.replace(HTML, |path| report::write(path, cells, &layers, words.as_ref(), None))?;
        files.push(HTML.to_owned());
    }
    Ok(files)
}
