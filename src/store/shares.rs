//! The folder of a map of shares: what is done so far, then tables, figures and manifest.

use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::{Value, json};

use crate::map::plan::Plan;
use crate::map::scene::{Format, Scene};
use crate::map::shares::{CellShares, Name, Names};
use crate::record::RecordStore;
use crate::show::cells::Cells;
use crate::show::drawing::write_figure;
use crate::show::figure;
use crate::show::layers::{Layer, shares};
use crate::show::names;
use crate::show::table::share_tables::{ShareTables, kind};
use crate::store::error::OutputError;
use crate::store::folder::Folder;
use crate::store::inventory;
use crate::store::manifest::{Head, MANIFEST, joined};

/// Cells that are done: a line that names the map, then one line of JSON for each cell.
pub const DONE: &str = "shares.jsonl";
const SHARES: &str = "shares.csv";
const CELLS: &str = "share_cells.csv";
const ATTRACTORS: &str = "share_attractors.csv";

/// Largest number of layers with a figure.
const FIGURES: usize = 8;

/// Returns the names of all files that the command may write.
pub fn names() -> Vec<String> {
    let layers = ["map", "attractors"].map(str::to_owned).into_iter();
    let layers = layers.chain((0..FIGURES - 2).map(|place| format!("share_{place}")));
    let figures = layers.flat_map(|layer| names::figures(&layer).map(|(_, name)| name));
    [MANIFEST, DONE, SHARES, CELLS, ATTRACTORS].map(str::to_owned).into_iter().chain(figures).collect()
}

/// Returns the line that names the map of a scene on an engine.
fn identity(scene: &Scene, engine: [&str; 2]) -> Value {
    json!({ "shares": 1, "scene": scene.identity(), "engine": engine })
}

/// The file of the cells that are done.
pub struct DoneCells {
    file: File,
    path: PathBuf,
}

impl DoneCells {
    /// Creates the file, or with `resume` reads it and goes on. Returns also the cells in it. A line that was cut off is removed.
    ///
    /// # Errors
    /// If the file belongs to another map, or cannot be read or written.
    pub fn open(
        folder: &Folder,
        (scene, engine): (&Scene, [&str; 2]),
        resume: bool,
    ) -> Result<(DoneCells, Vec<CellShares>), OutputError> {
        let path = folder.path().join(DONE);
        let read = |head: &str| DoneCells::read(&path, head, resume);
        let head = format!("{}\n", identity(scene, engine));
        let found =
            read(&head).map_err(|reason| OutputError::Write { path: path.clone(), reason: reason.into() })?;
        Ok((DoneCells { file: found.0, path }, found.1))
    }

    fn read(path: &Path, head: &str, resume: bool) -> io::Result<(File, Vec<CellShares>)> {
        if !resume || !path.is_file() {
            let mut file = File::create(path)?;
            file.write_all(head.as_bytes())?;
            return Ok((file, Vec::new()));
        }
        let mut reader = BufReader::new(File::open(path)?);
        let (mut line, mut length, mut cells) = (String::new(), 0, Vec::new());
        reader.read_line(&mut line)?;
        if line != head {
            return Err(io::Error::other(
                "it belongs to another map or engine; compute the map again with --force",
            ));
        }
        while line.ends_with('\n') {
            length += line.len() as u64;
            line.clear();
            reader.read_line(&mut line)?;
            match serde_json::from_str(&line) {
                Ok(cell) if line.ends_with('\n') => cells.push(cell),
                _ => break,
            }
        }
        let file = OpenOptions::new().append(true).open(path)?;
        file.set_len(length)?;
        Ok((file, cells))
    }

    /// Adds cells that are done.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn add(&mut self, cells: &[CellShares]) -> Result<(), OutputError> {
        let lines = cells.iter().map(|cell| Ok(format!("{}\n", serde_json::to_string(cell)?)));
        let text: serde_json::Result<String> = lines.collect();
        let failed =
            |reason: io::Error| OutputError::Write { path: self.path.clone(), reason: reason.into() };
        text.map_err(|error| failed(error.into()))
            .and_then(|text| self.file.write_all(text.as_bytes()).map_err(failed))
    }
}

/// How a map of shares was computed.
pub struct SharesRun<'a> {
    /// Name and precision of the engine.
    pub engine: [&'a str; 2],
    /// `--set` arguments.
    pub sets: &'a [String],
    /// Time of the run.
    pub elapsed: Duration,
}

/// Writes the tables, the figures that the scene lists, and the manifest last. `cells` are in order of their numbers. Returns the names of the
/// files.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    folder: &Folder,
    (scene, plan): (&Scene, &Plan),
    cells: &[CellShares],
    of: &Names,
    run: &SharesRun<'_>,
) -> Result<Vec<String>, OutputError> {
    inventory::clear_for(folder, names().iter().map(String::as_str).filter(|name| *name != DONE))?;
    let tables = ShareTables { scene, cells, names: of };
    folder.replace(ATTRACTORS, |out| tables.write_attractors(out))?;
    folder.replace(CELLS, |out| tables.write_cells(out))?;
    folder.replace(SHARES, |out| tables.write_shares(out))?;
    let mut files = [DONE, ATTRACTORS, CELLS, SHARES].map(str::to_owned).to_vec();
    let records = RecordStore::new(plan.run_count(), false);
    let shown = Cells::new(scene, plan, &records);
    let layers = shares::of(cells, of);
    for layer in layers.iter().take(FIGURES) {
        for format in Format::FIGURES.into_iter().filter(|format| scene.outputs().files.contains(format)) {
            let name = names::figure(layer.name(), format);
            draw(folder, &name, format, &shown, (&layers, layer))?;
            files.push(name);
        }
    }
    let listed = inventory::entries(folder, &files)?;
    let attractors = |(place, name): (usize, &Name)| {
        json!({
            "attractor": place,
            "kind": kind(name.kind),
            "period": name.period,
            "word": name.word,
            "cells": name.cells,
            "share": name.share,
        })
    };
    let starts: u64 = cells.iter().map(|cell| u64::from(cell.count)).sum();
    let manifest = joined([
        json!(Head::of("shares")),
        json!({
            "title": scene.title(),
            "scene": scene.text(),
            "sets": run.sets,
            "engine": run.engine[0],
            "precision": run.engine[1],
            "axes": scene.axes().iter().map(|axis| &axis.parameter().name).collect::<Vec<_>>(),
            "cells": cells.len(),
            "starts": starts,
            "attractors": of.list.iter().enumerate().map(attractors).collect::<Vec<_>>(),
            "timings": { "integrate": run.elapsed.as_secs_f64() },
            "files": listed,
        }),
    ]);
    inventory::write_manifest(folder, &manifest)?;
    files.push(MANIFEST.to_owned());
    Ok(files)
}

fn draw(
    folder: &Folder,
    name: &str,
    format: Format,
    cells: &Cells<'_>,
    (layers, layer): (&[Layer], &Layer),
) -> Result<(), OutputError> {
    let drawn = figure::map::draw(cells, layers, layer);
    folder.replace(name, |out| write_figure(out, format, &drawn))?;
    Ok(())
}
