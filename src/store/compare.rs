//! The folder of a comparison of two maps: table, figure and manifest.

use std::path::Path;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use serde::Serialize;
use serde_json::{Value, json};

use crate::findings::compare::{Comparison, Kind, Tally};
use crate::map::scene::Format;
use crate::show::cells::Cells;
use crate::show::figure;
use crate::show::names;
use crate::show::table::compare_csv;
use crate::store::error::OutputError;
use crate::store::folder::Folder;
use crate::store::inventory;
use crate::store::manifest::map::Made;
use crate::store::manifest::{Head, MANIFEST, joined};
use rattlemap_dynamics::orbit::Class;

const CSV: &str = "compare.csv";
/// Names of the figure, by format.
static FIGURES: LazyLock<[(Format, String); 3]> = LazyLock::new(|| names::figures("compare"));

/// Names of all files that a comparison may write.
pub fn names() -> impl Iterator<Item = &'static str> {
    [MANIFEST, CSV].into_iter().chain(FIGURES.iter().map(|(_, name)| name.as_str()))
}

/// One of two maps.
#[derive(Clone, Copy, Debug)]
pub struct MapSide<'a> {
    /// The name of its folder, without the way to it.
    pub name: &'a str,
    /// Its cells.
    pub cells: &'a Cells<'a>,
    /// Who computed it.
    pub made: Made<'a>,
    /// The version of the program that did.
    pub crate_version: &'a str,
    /// And its commit.
    pub commit: &'a str,
}

/// Two maps of one grid, and in which cells they differ.
#[derive(Clone, Copy, Debug)]
pub struct Compared<'a> {
    /// The maps: A, then B.
    pub sides: [MapSide<'a>; 2],
    /// What was found.
    pub comparison: &'a Comparison,
}

/// What both scenes say, and say differently; what is not said is `absent`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// The setting.
    pub name: String,
    /// In A.
    pub a: String,
    /// In B.
    pub b: String,
}

impl Compared<'_> {
    /// What the scenes ask differently, as far as cells depend on it. What is asked of each cell does not count.
    pub fn scene_differences(&self) -> Vec<Difference> {
        let [a, b] = self.sides.map(|side| side.cells.scene().identity());
        let value = |list: &[(String, String)], name: &str| {
            list.iter()
                .find(|(n, _)| n == name)
                .map_or_else(|| "absent".to_owned(), |(_, value)| value.clone())
        };
        let mut names: Vec<&String> = a.iter().map(|(name, _)| name).collect();
        names.extend(b.iter().map(|(name, _)| name).filter(|name| !a.iter().any(|(n, _)| n == *name)));
        let difference =
            |name: &String| Difference { name: name.clone(), a: value(&a, name), b: value(&b, name) };
        let all = names.into_iter().filter(|name| !name.starts_with("outputs.")).map(difference);
        all.filter(|difference| difference.a != difference.b).collect()
    }

    /// The classes of a cell in both maps.
    pub(crate) fn classes(&self) -> impl Iterator<Item = [Class; 2]> + '_ {
        let [a, b] = self.sides.map(|side| side.cells.classes());
        a.zip(b).map(|(a, b)| [a, b])
    }

    /// Cells by their classes in both maps, where these differ.
    pub fn transitions(&self) -> Vec<Transition> {
        let mut counts = [[0usize; 4]; 4];
        self.classes().for_each(|[a, b]| counts[a.index()][b.index()] += 1);
        let pairs = (0..4).flat_map(|a| (0..4).map(move |b| (a, b)));
        let differing = pairs.filter(|&(a, b)| a != b && counts[a][b] > 0);
        differing
            .map(|(a, b)| Transition { a: names::CLASSES[a], b: names::CLASSES[b], cells: counts[a][b] })
            .collect()
    }
}

/// Cells that are of one class in A and of another one in B.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Transition {
    /// In A.
    pub a: &'static str,
    /// In B.
    pub b: &'static str,
    /// How many.
    pub cells: usize,
}

/// Describes the result of the comparison. `by_pattern` and `by_word` count cells that agree in class and period and differ
/// by pattern, or by word if a map has no patterns. Counts over cells with one period are null if a map has no such values;
/// the largest difference of exponents is null if it is infinite.
fn result(compared: &Compared<'_>) -> Value {
    let Compared { sides, comparison } = compared;
    let [a, b] = sides.map(|side| {
        json!({
            "folder": side.name,
            "title": side.cells.scene().title(),
            "engine": side.made.engine,
            "precision": side.made.precision,
            "device": side.made.device,
            "crate_version": side.crate_version,
            "commit": side.commit,
        })
    });
    let tally = |Tally { compared, differing }| {
        (compared > 0).then(|| json!({ "compared": compared, "differing": differing }))
    };
    let indices = comparison.exponent.map(|largest| sides[0].cells.row(largest.id).indices);
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
    })
}

/// Writes the table, the figure in these formats, and the manifest last. A list of cells has no figure. `reading` is the
/// time it took to read the maps. Returns the names of the files.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    folder: &Folder,
    compared: &Compared<'_>,
    formats: &[Format],
    reading: Duration,
) -> Result<Vec<&'static str>, OutputError> {
    let clock = Instant::now();
    folder.remove(&names().collect::<Vec<_>>())?;
    folder.replace(CSV, |path| compare_csv::write(path, compared))?;
    let mut files = vec![CSV];
    let has_figure = compared.sides[0].cells.scene().list().is_none();
    for (_, name) in FIGURES.iter().filter(|(format, _)| has_figure && formats.contains(format)) {
        folder.replace(name, |path| Ok(figure::compare::write(path, compared)?))?;
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
pub fn object(folder: &Path, files: &[&'static str], compared: &Compared<'_>) -> Value {
    joined([json!({ "folder": folder.to_string_lossy(), "files": files }), result(compared)])
}
