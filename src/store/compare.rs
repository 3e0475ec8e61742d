//! The folder of a comparison of two maps: table, figure and manifest.

use std::path::Path;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::findings::compare::{Kind, QuantityTally, Tally};
use crate::map::scene::{FigureStyle, Format};
use crate::show::drawing::write_figure;
use crate::show::figure;
use crate::show::map_pair::MapPair;
use crate::show::names;
use crate::show::table::compare_csv;
use crate::store::error::OutputError;
use crate::store::folder::Folder;
use crate::store::inventory;
use crate::store::manifest::{Head, MANIFEST, joined};

const DIFFERENCES: &str = "compare.csv";
/// Names of the figure, by format.
static FIGURES: LazyLock<[(Format, String); 3]> = LazyLock::new(|| names::figures("compare"));

/// Names of all files that a comparison may write.
pub fn names() -> impl Iterator<Item = &'static str> {
    [MANIFEST, DIFFERENCES].into_iter().chain(FIGURES.iter().map(|(_, name)| name.as_str()))
}

/// Describes the result of the comparison. Each cell counts once, under its first difference: class, period, pattern (word if a map has
/// no patterns), motion, quantities. Counts over cells with one period are null if a map has no such values;
/// the largest difference of exponents is null if it is infinite.
pub(crate) fn result(compared: &MapPair<'_>) -> Value {
    let MapPair { sides, comparison } = compared;
    let [a, b] = sides.map(|side| {
        json!({
            "folder": side.name,
            "title": side.cells.scene().title(),
            "engine": side.provenance.engine,
            "precision": side.provenance.precision,
            "device": side.provenance.device,
            "crate_version": side.crate_version,
            "commit": side.provenance.commit,
        })
    });
    let tally = |Tally { compared, differing }| {
        (compared > 0).then(|| json!({ "compared": compared, "differing": differing }))
    };
    let indices = comparison.exponent.map(|largest| sides[0].cells.row(largest.id).indices);
    let quantity = |quantity: &QuantityTally| {
        let largest = quantity.largest.map(|largest| {
            let [i, j] = sides[0].cells.row(largest.id).indices;
            json!({ "difference": largest.difference, "i": i, "j": j })
        });
        json!({ "name": quantity.name, "compared": quantity.tally.compared, "differing": quantity.tally.differing, "largest": largest })
    };
    let compared_quantities = comparison.quantities.iter().filter(|quantity| quantity.tally.compared > 0);
    json!({
        "a": a,
        "b": b,
        "scene_differences": compared.scene_differences(),
        "cells": comparison.kinds.len(),
        "differing": comparison.differing(),
        "by_class": comparison.count(Kind::Class),
        "by_period": comparison.count(Kind::Period),
        "by_pattern": comparison.count(Kind::Pattern),
        "by_word": comparison.count(Kind::Word),
        "by_motion": comparison.count(Kind::Motion),
        "by_quantity": comparison.count(Kind::Quantity),
        "transitions": compared.transitions(),
        "symmetric": tally(comparison.symmetric),
        "words": tally(comparison.words),
        "patterns": tally(comparison.patterns),
        "exponents": {
            "compared": comparison.exponents,
            "largest": comparison.exponent.map(|largest| largest.difference).filter(|x| x.is_finite()),
            "i": indices.map(|[i, _]| i),
            "j": indices.map(|[_, j]| j),
        },
        "attractors": tally(comparison.attractors),
        "motions": tally(comparison.motions),
        "tolerance": comparison.tolerance,
        "quantities": compared_quantities.map(quantity).collect::<Vec<_>>(),
    })
}

/// Writes the table, the figure in these formats, and the manifest last. A list of cells has no figure. `reading` is the
/// time it took to read the maps. Returns the names of the files.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    folder: &Folder,
    compared: &MapPair<'_>,
    (formats, style): (&[Format], &FigureStyle),
    reading: Duration,
) -> Result<Vec<&'static str>, OutputError> {
    let clock = Instant::now();
    inventory::clear_for(folder, names())?;
    folder.replace(DIFFERENCES, |out| compare_csv::write(out, compared))?;
    let mut files = vec![DIFFERENCES];
    let has_figure = compared.sides[0].cells.scene().list().is_none();
    for (format, name) in FIGURES.iter().filter(|(format, _)| has_figure && formats.contains(format)) {
        folder.replace(name, |out| write_figure(out, *format, &figure::compare::draw(style, compared)))?;
        files.push(name);
    }
    let listed = inventory::entries(folder, &files)?;
    let timings = json!({ "read": reading.as_secs_f64(), "write": clock.elapsed().as_secs_f64() });
    let manifest = joined([
        json!(Head::of("compare")),
        result(compared),
        json!({ "timings": timings, "files": listed }),
    ]);
    inventory::write_manifest(folder, &manifest)?;
    files.push(MANIFEST);
    Ok(files)
}

/// Returns the object that `compare --json` prints. Scripts depend on its fields.
pub fn object(folder: &Path, files: &[&'static str], compared: &MapPair<'_>) -> Value {
    joined([json!({ "folder": folder.to_string_lossy(), "files": files }), result(compared)])
}
