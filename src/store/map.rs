//! The folder of a map: tables, figures, report and manifest.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde_json::Value;

use crate::map::scene::{Format, List, Quantity, Scene};
use crate::model_file::FileModel;
use crate::show::cells::Cells;
use crate::show::drawing::write_figure;
use crate::show::error::WriteError;
use crate::show::figure;
use crate::show::layers::Layer;
use crate::show::numbers::Number;
use crate::show::table::words_csv::WordRows;
use crate::show::table::{attractors_csv, cells_csv, cells_npy};
use crate::show::validation::Validated;
use crate::show::words::{self, MapWords};
use crate::show::{layers, names, report};
use crate::store::error::OutputError;
use crate::store::file_names::{RECORDS, UNFINISHED};
use crate::store::folder::Folder;
use crate::store::inventory::FileEntry;
use crate::store::plain_file::read_text;
use crate::store::{inventory, manifest, unfinished, validation_json};

pub use crate::show::provenance::Provenance;
pub use crate::show::replay::MODEL;
pub use crate::store::file_names::{LIST, MANIFEST, VALIDATION};
pub use crate::store::manifest::map::{Run, ShardOrigin};

const CSV: &str = "cells.csv";
const NPY: &str = "cells.npy";
const WORDS: &str = "words.csv";
/// Name of the report.
pub const REPORT: &str = "report.html";
const ATTRACTORS: &str = "attractors.csv";

/// Layers that have figures, without those of measured quantities, whose names depend on the model.
const LAYERS: [&str; 8] =
    ["map", layers::CLASS, "lyapunov", "impacts", "mesh", "pattern", "word", "attractors"];

/// Largest number of cells of a map whose figures are drawn in parallel: each figure holds its pixels twice.
const SIDE_BY_SIDE: usize = 1 << 22;

/// Largest size of a validation that is read, in bytes.
const MOST_VALIDATION_BYTES: u64 = 1_000_000_000;

/// Names of all files that are made from a map's records, apart from figures of measured quantities.
static ALL: LazyLock<Vec<String>> = LazyLock::new(|| {
    let tables = [MANIFEST, CSV, NPY, WORDS, ATTRACTORS, REPORT, VALIDATION].map(str::to_owned);
    let figures = LAYERS.into_iter().flat_map(|layer| names::figures(layer).map(|(_, name)| name));
    tables.into_iter().chain(figures).collect()
});

/// Names of the files that a map of any model may write.
pub fn names() -> impl Iterator<Item = &'static str> {
    ALL.iter().map(String::as_str).chain([LIST, MODEL, RECORDS, UNFINISHED])
}

/// Names of all files that a map of the scene's model may write.
pub fn names_of(scene: &Scene) -> Vec<String> {
    made(scene).into_iter().chain([LIST, MODEL, RECORDS, UNFINISHED].map(str::to_owned)).collect()
}

/// Names of all files that are made from the records of a map of the scene's model.
fn made(scene: &Scene) -> Vec<String> {
    let numbers = Number::of(scene.base(), &Quantity::ALL);
    let figures = numbers.iter().flat_map(|number| names::figures(&number.name).map(|(_, name)| name));
    ALL.iter().cloned().chain(figures).collect()
}

/// Prepares the folder for a run: removes the files of an earlier one except its records, and writes the copy of the list
/// of cells. An interrupted run can then resume without the scene's own table, which may be this very file.
///
/// # Errors
/// If a file cannot be removed or written.
pub fn begin(folder: &Folder, scene: &Scene) -> Result<(), OutputError> {
    // The copies are replaced, never removed: they may be the scene's own files.
    let keeps = |name: &str| match name {
        RECORDS => true,
        LIST => scene.list().is_some(),
        MODEL => own_model(scene).is_some(),
        _ => false,
    };
    if let Some(list) = scene.list() {
        write_list(folder, list)?;
    }
    inventory::clear(folder, made(scene).iter().map(String::as_str), keeps)
}

fn write_list(folder: &Folder, list: &List) -> Result<(), OutputError> {
    folder.replace(LIST, |out| Ok(out.write_all(list.to_csv().as_bytes())?))
}

/// Returns the formats of the files in the folder of a finished map.
pub fn formats(folder: &Path) -> Vec<Format> {
    let listed = inventory::listed(&inventory::stored(folder));
    let has = |name: &str| listed.iter().any(|file| file.name == name);
    let tables = [(Format::Csv, CSV), (Format::Npy, NPY), (Format::Html, REPORT)];
    let tables = tables.into_iter().filter(|(_, name)| has(name)).map(|(format, _)| format);
    tables.chain(inventory::figure_formats(folder, "map")).collect()
}

/// Writes the files that the scene asks for, and the manifest last. Removes other files of an earlier run, but keeps the
/// validation of the same records. Returns the names of the files.
///
/// # Errors
/// If a file cannot be written.
pub fn write(folder: &Folder, cells: &Cells<'_>, run: &Run<'_>) -> Result<Vec<String>, OutputError> {
    let clock = Instant::now();
    let earlier = inventory::stored(folder.path());
    let records = if folder.path().join(RECORDS).is_file() { &[RECORDS][..] } else { &[] };
    let records = inventory::entries(folder, records)?;
    let validation = validation_of(folder, &inventory::listed(&earlier), &records);
    let mut files = write_files(folder, cells, &run.made, validation.as_ref(), &|_| true)?;
    files.extend(validation.is_some().then(|| VALIDATION.to_owned()));
    let keeps = |name: &str| [MANIFEST, RECORDS].contains(&name) || files.iter().any(|file| file == name);
    inventory::clear(folder, made(cells.scene()).iter().map(String::as_str), keeps)?;
    let listed = [inventory::entries(folder, &files)?, records].concat();
    let timings = manifest::map::timings(run, clock.elapsed(), folder.writing_times());
    let mut manifest = manifest::map::map(cells, run, timings, &listed);
    if validation.is_some() {
        manifest["timings"]["validate"] = earlier["timings"]["validate"].clone();
    }
    inventory::write_manifest(folder, &manifest)?;
    files.push(MANIFEST.to_owned());
    unfinished::clear(folder)?;
    Ok(files)
}

/// Returns the validation in a folder, if it is undamaged and the records are those that were validated.
fn validation_of(folder: &Folder, earlier: &[FileEntry], records: &[FileEntry]) -> Option<Value> {
    let listed = earlier.iter().find(|entry| entry.name == VALIDATION)?;
    let is_same = records.iter().all(|entry| earlier.contains(entry))
        && inventory::fault(folder.path(), listed).is_none();
    let text = read_validation(&folder.path().join(VALIDATION)).ok().filter(|_| is_same)?;
    serde_json::from_str(&text).ok()
}

fn read_validation(path: &Path) -> io::Result<String> {
    read_text(path, MOST_VALIDATION_BYTES, "validate the map again")
}

/// Writes `validation.json`, the report with a section on the validation if the map has one, and the manifest. `elapsed` is
/// the time of the validation. Returns the names of the files.
///
/// # Errors
/// If a file cannot be written.
pub fn write_validation(
    folder: &Folder,
    cells: &Cells<'_>,
    validated: &Validated<'_>,
    elapsed: Duration,
) -> Result<Vec<&'static str>, OutputError> {
    let object = validation_json::object(cells, validated);
    folder.write_json(VALIDATION, &object)?;
    let mut files = vec![VALIDATION];
    if folder.path().join(REPORT).is_file() {
        write_files(folder, cells, &validated.made, Some(&object), &|name| name == REPORT)?;
        files.push(REPORT);
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
    made: &Provenance<'_>,
    lost: &[&str],
    has_validation: bool,
) -> Result<Vec<String>, OutputError> {
    let clock = Instant::now();
    let path = folder.path().join(VALIDATION);
    let read = || {
        let text = read_validation(&path);
        text.map_err(|reason| OutputError::Write { path: path.clone(), reason: reason.into() })
    };
    let validation: Option<Value> = if has_validation { Some(serde_json::from_str(&read()?)?) } else { None };
    let files = write_files(folder, cells, made, validation.as_ref(), &|name| lost.contains(&name))?;
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
    made: &Provenance<'_>,
    validation: Option<&Value>,
    wanted: Wanted<'_>,
) -> Result<Vec<String>, OutputError> {
    let words = words::read(cells);
    // In parallel, because both have parts that run on one core.
    let (tables, pictures) = rayon::join(
        || write_tables(folder, cells, &words, wanted),
        || write_pictures(folder, cells, made, &words, validation, wanted),
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
    if let Some(model) = own_model(scene).filter(|_| wanted(MODEL)) {
        folder.replace(MODEL, |out| Ok(out.write_all(model.definition().text.as_bytes())?))?;
        files.push(MODEL.to_owned());
    }
    Ok(files)
}

/// The scene's model, if its file is the user's own.
fn own_model(scene: &Scene) -> Option<&FileModel> {
    scene.base().downcast_ref().filter(|model: &&FileModel| !model.is_built_in())
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
        || write_if(asks(Format::Csv), CSV, &|out| cells_csv::write(out, cells, &rows)),
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
    made: &Provenance<'_>,
    words: &MapWords,
    validation: Option<&Value>,
    wanted: Wanted<'_>,
) -> Result<Vec<String>, OutputError> {
    let asks = |format| cells.scene().outputs().files.contains(&format);
    let mut files = Vec::new();
    let wants_page = asks(Format::Html) && wanted(REPORT);
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
            folder.replace(name, |out| write_figure(out, *format, &figure::map::draw(cells, &layers, layer)))
        };
        match cells.count() > SIDE_BY_SIDE {
            true => figures.iter().try_for_each(draw)?,
            false => figures.par_iter().try_for_each(draw)?,
        }
        files.extend(figures.into_iter().map(|(.., name)| name));
    }
    if wants_page {
        let data = report::sketched(cells, made, &layers, words, validation);
        folder.replace(REPORT, |out| report::write(out, &data))?;
        files.push(REPORT.to_owned());
    }
    Ok(files)
}
