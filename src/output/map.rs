//! The folder of a map: tables, figures, report and manifest.

use std::fs;

use rayon::prelude::*;

use super::{Cells, Folder, cells_csv, cells_npy, layers, map_figure, map_manifest, report};
use crate::scene::Format;

pub use super::map_manifest::Run;

const CSV: &str = "cells.csv";
const NPY: &str = "cells.npy";
const HTML: &str = "report.html";
const MANIFEST: &str = "manifest.json";

/// Every file that a map may have beside its records.
const ALL: [&str; 9] =
    [MANIFEST, CSV, NPY, "map.png", "lyapunov.png", "impacts.png", "mesh.png", "word.png", "report.html"];

/// Removes what an earlier run left, but for its records: files must not stand beside a
/// manifest that does not know them.
///
/// # Errors
/// If a file cannot be removed.
pub fn clear(folder: &Folder) -> anyhow::Result<()> {
    folder.remove(&ALL)
}

/// Writes the files that the scene asks for, and the manifest last: a folder that has one is
/// complete. Returns the files' names.
///
/// # Errors
/// If a file cannot be written.
pub fn write(folder: &Folder, cells: &Cells<'_>, run: &Run<'_>) -> anyhow::Result<Vec<String>> {
    clear(folder)?;
    let wanted = &cells.scene().outputs().files;
    let mut files = Vec::new();
    if wanted.contains(&Format::Csv) {
        folder.replace(CSV, |path| cells_csv::write(path, cells))?;
        files.push(CSV.to_owned());
    }
    if wanted.contains(&Format::Npy) {
        folder.replace(NPY, |path| cells_npy::write(path, cells))?;
        files.push(NPY.to_owned());
    }
    let words = layers::read_words(cells);
    let layers = layers::of(cells, words.as_ref());
    if wanted.contains(&Format::Png) {
        let names: Vec<String> = layers.iter().map(|layer| format!("{}.png", layer.name)).collect();
        layers.par_iter().zip(&names).try_for_each(|(layer, name)| {
            folder.replace(name, |path| map_figure::write(path, cells, layer))
        })?;
        files.extend(names);
    }
    if wanted.contains(&Format::Html) {
        folder.replace(HTML, |path| report::write(path, cells, &layers, words.as_ref()))?;
        files.push(HTML.to_owned());
    }
    files.push(MANIFEST.to_owned());
    let manifest = map_manifest::map(cells, run, &files)?;
    folder.replace(MANIFEST, |path| Ok(fs::write(path, manifest + "\n")?))?;
    Ok(files)
}
