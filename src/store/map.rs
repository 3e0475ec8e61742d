//! The folder of a map: tables, figures, report and manifest.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde_json::Value;

use crate::map::scene::{Format, List, Scene};
use crate::model_file::FileModel;
use crate::show::cells::Cells;
use crate::show::error::WriteError;
use crate::show::figure;
use crate::show::layers::Layer;
use crate::show::table::words_csv::WordRows;
use crate::show::table::{attractors_csv, cells_csv, cells_npy};
use crate::show::words::{self, MapWords};
use crate::show::{layers, names, report};
use crate::store::error::OutputError;
use crate::store::file_names::{RECORDS, UNFINISHED};
use crate::store::folder::Folder;
use crate::store::plain_file::PARTIAL;
use crate::store::{inventory, manifest, unfinished, validation_json};
use crate::validate::Validation;

pub use crate::show::provenance::Provenance;
pub use crate::show::replay::MODEL;
pub use crate::store::file_names::{LIST, MANIFEST, VALIDATION};
pub use crate::store::manifest::map::{Run, ShardOrigin};

const CSV: &str = "cells.csv";
const NPY: &str = "cells.npy";
const WORDS: &str = "words.csv";
const HTML: &str = "report.html";
const ATTRACTORS: &str = "attractors.csv";

/// Layers that have figures, without those of measured quantities, whose names depend on the model.
const LAYERS: [&str; 8] =
    ["map", layers::CLASS, "lyapunov", "impacts", "mesh", "pattern", "word", "attractors"];

/// Largest number of cells of a map whose figures are drawn in parallel: each figure holds its pixels twice.
const SIDE_BY_SIDE: usize = 1 << 22;

/// Names of all files that are made from a map's records.
static ALL: LazyLock<Vec<String>> = LazyLock::new(|| {
    let tables = [MANIFEST, CSV, NPY, WORDS, ATTRACTORS, HTML, VALIDATION].map(str::to_owned);
    let figures = LAYERS.into_iter().flat_map(|layer| names::figures(layer).map(|(_, name)| name));
    tables.into_iter().chain(figures).collect()
});

/// Names of all files that a map may write.
pub fn names() -> impl Iterator<Item = &'static str> {
    ALL.iter().map(String::as_str).chain([LIST, MODEL, RECORDS, UNFINISHED])
}

/// Removes the files of an earlier run except its records. A list and a model are removed if the manifest lists them;
/// otherwise they may be the user's own.
///
/// # Errors
/// If a file cannot be removed.
pub fn clear(folder: &Folder) -> Result<(), OutputError> {
    for copy in [LIST, MODEL].into_iter().filter(|copy| inventory::lists(folder, copy)) {
        folder.remove(&[copy])?;
    }
    clear_made(folder)
}

/// Removes the files that are made from records, and incomplete files.
fn clear_made(folder: &Folder) -> Result<(), OutputError> {
    folder.remove(&ALL)?;
    let names = ALL.iter().map(String::as_str).chain([LIST, MODEL]);
    folder.remove(&names.map(|name| format!("{PARTIAL}{name}")).collect::<Vec<_>>())
}

/// Prepares the folder for a run: removes the files of an earlier one except its records, and writes the copy of the list
/// of cells. An interrupted run can then resume without the scene's own table, which may be this very file.
///
/// # Errors
/// If a file cannot be removed or written.
pub fn begin(folder: &Folder, scene: &Scene) -> Result<(), OutputError> {
    match scene.list() {
        // The copy is replaced, never removed, so that a list exists at any time.
        Some(list) => {
            write_list(folder, list)?;
            clear_made(folder)
        }
        None => clear(folder),
    }
}

fn write_list(folder: &Folder, list: &List) -> Result<(), OutputError> {
    folder.replace(LIST, |out| Ok(out.write_all(list.to_csv().as_bytes())?))
}

/// Writes the files that the scene asks for, and the manifest last. Returns the names of the files.
///
/// # Errors
/// If a file cannot be written.
pub fn write(folder: &Folder, cells: &Cells<'_>, run: &Run<'_>) -> Result<Vec<String>, OutputError> {
    let clock = Instant::now();
    clear(folder)?;
    let mut files = write_files(folder, cells, None, &|_| true)?;
    let has_records = folder.path().join(RECORDS).is_file();
    let listed: Vec<&str> = files.iter().map(String::as_str).chain(has_records.then_some(RECORDS)).collect();
    let listed = inventory::entries(folder, &listed)?;
    inventory::write_manifest(folder, &manifest::map::map(cells, run, clock.elapsed(), &listed))?;
    files.push(MANIFEST.to_owned());
    unfinished::clear(folder)?;
    Ok(files)
}

/// Writes `validation.json`, the report with a section on the validation if the map has one, and the manifest. `again` is
/// the device that ran the sample's lanes again, and `elapsed` the time of the validation. Returns the names of the files.
///
/// # Errors
/// If a file cannot be written.
pub fn write_validation(
    folder: &Folder,
    cells: &Cells<'_>,
    made: &Provenance<'_>,
    again: Option<&str>,
    validation: &Validation,
    elapsed: Duration,
) -> Result<Vec<&'static str>, OutputError> {
    let object = validation_json::object(cells, made, again, validation);
    folder.write_json(VALIDATION, &object)?;
    let mut files = vec![VALIDATION];
    if folder.path().join(HTML).is_file() {
        write_files(folder, cells, Some(&object), &|name| name == HTML)?;
        files.push(HTML);
    }
    inventory::update(folder, &files, ("validate", elapsed.as_secs_f64()))?;
    Ok(files)
}

/// Writes those of the files `lost` that are made from records, and the manifest. The report gets its section on the
/// validation if `has_validation` says that `validation.json` is undamaged. Returns the names of the files.
///
/// # Errors
/// If a file cannot be written.
pub fn repair(
    folder: &Folder,
    cells: &Cells<'_>,
    lost: &[&str],
    has_validation: bool,
) -> Result<Vec<String>, OutputError> {
    let clock = Instant::now();
    let path = folder.path().join(VALIDATION);
    let read = || {
        let text = fs::read_to_string(&path);
        text.map_err(|reason| OutputError::Write { path: path.clone(), reason: reason.into() })
    };
    let validation: Option<Value> = if has_validation { Some(serde_json::from_str(&read()?)?) } else { None };
    let files = write_files(folder, cells, validation.as_ref(), &|name| lost.contains(&name))?;
    if !files.is_empty() {
        let names: Vec<&str> = files.iter().map(String::as_str).collect();
        inventory::update(folder, &names, ("repair", clock.elapsed().as_secs_f64()))?;
    }
    Ok(files)
}

/// Whether to write the file of a name.
pub(crate) type Wanted<'w> = &'w (dyn Fn(&str) -> bool + Sync);

/// Writes those wanted files that the scene asks for.
fn write_files(
    folder: &Folder,
    cells: &Cells<'_>,
    validation: Option<&Value>,
    wanted: Wanted<'_>,
) -> Result<Vec<String>, OutputError> {
    let words = words::read(cells);
    // In parallel, because both have parts that run on one core.
    let (tables, pictures) = rayon::join(
        || write_tables(folder, cells, &words, wanted),
        || write_pictures(folder, cells, &words, validation, wanted),
    );
    let mut files = tables?;
    files.extend(pictures?);
    files.extend(write_copies(folder, cells.scene(), wanted)?);
    Ok(files)
}

/// Writes the wanted copies of the scene's list and of its model, if it has these.
pub(crate) fn write_copies(
    folder: &Folder,
    scene: &Scene,
    wanted: Wanted<'_>,
) -> Result<Vec<String>, OutputError> {
    let mut files = Vec::new();
    if let Some(list) = scene.list().filter(|_| wanted(LIST)) {
        write_list(folder, list)?;
        files.push(LIST.to_owned());
    }
    let own = scene.base().downcast_ref().filter(|model: &&FileModel| !model.is_built_in());
    if let Some(model) = own.filter(|_| wanted(MODEL)) {
        folder.replace(MODEL, |out| Ok(out.write_all(model.definition().text.as_bytes())?))?;
        files.push(MODEL.to_owned());
    }
    Ok(files)
}

fn write_tables(
    folder: &Folder,
    cells: &Cells<'_>,
    words: &MapWords,
    wanted: Wanted<'_>,
) -> Result<Vec<String>, OutputError> {
    type WriteTable<'w> = &'w (dyn Fn(&mut BufWriter<File>) -> Result<(), WriteError> + Sync);
    let write_if = |is_asked: bool, name: &str, write: WriteTable<'_>| {
        if is_asked && wanted(name) {
            folder.replace(name, write).map(|()| Some(name.to_owned()))
        } else {
            Ok(None)
        }
    };
    let asks = |format| cells.scene().outputs().files.contains(&format);
    let rows = WordRows::new(words);
    let has_words = words.words.is_some() || words.patterns.is_some();
    let (csv, npy) = rayon::join(
        || write_if(asks(Format::Csv), CSV, &|out| cells_csv::write(out, cells)),
        || write_if(asks(Format::Npy), NPY, &|out| cells_npy::write(out, cells, &rows)),
    );
    let words = write_if(asks(Format::Npy) && has_words, WORDS, &|out| rows.write(out));
    let attractors = match cells.basins() {
        Some(basins) => {
            write_if(asks(Format::Csv), ATTRACTORS, &|out| attractors_csv::write(out, cells, basins))?
        }
        None => None,
    };
    Ok([csv?, npy?, words?, attractors].into_iter().flatten().collect())
}

fn write_pictures(
    folder: &Folder,
    cells: &Cells<'_>,
    words: &MapWords,
    validation: Option<&Value>,
    wanted: Wanted<'_>,
) -> Result<Vec<String>, OutputError> {
    let asks = |format| cells.scene().outputs().files.contains(&format);
    let mut files = Vec::new();
    let wants_page = asks(Format::Html) && wanted(HTML);
    let formats: Vec<Format> = Format::FIGURES.into_iter().filter(|&format| asks(format)).collect();
    let names = |layer: &str| -> Vec<(Format, String)> {
        formats.iter().map(|&format| (format, names::figure(layer, format))).collect()
    };
    let numbers = cells.numbers();
    let mut all = LAYERS.into_iter().chain(numbers.iter().map(|number| &*number.name));
    let wants_figures = all.any(|layer| names(layer).iter().any(|(_, name)| wanted(name)));
    if !wants_page && !wants_figures {
        return Ok(files);
    }
    let layers = layers::of(cells, words);
    if wants_figures {
        let figures = layers
            .iter()
            .flat_map(|layer| names(&layer.name).into_iter().map(move |(f, name)| (layer, f, name)));
        let figures: Vec<_> = figures.filter(|(.., name)| wanted(name)).collect();
        let draw = |(layer, format, name): &(&Layer, Format, String)| {
            folder.replace(name, |out| figure::map::write(out, *format, cells, layer))
        };
        match cells.count() > SIDE_BY_SIDE {
            true => figures.iter().try_for_each(draw)?,
            false => figures.par_iter().try_for_each(draw)?,
        }
        files.extend(figures.into_iter().map(|(.., name)| name));
    }
    if wants_page {
        folder.replace(HTML, |out| report::write(out, cells, &layers, words, validation))?;
        files.push(HTML.to_owned());
    }
    Ok(files)
}
