//! The folder of a comparison of two maps: table, figure and manifest.

use std::path::Path;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::findings::compare::{Kind, Tally};
use crate::map::scene::Format;
use crate::show::figure;
use crate::show::map_pair::{ClassTransition, MapPair, SceneDifference};
use crate::show::names;
use crate::show::table::compare_csv;
use crate::store::error::OutputError;
use crate::store::folder::Folder;
use crate::store::inventory::{self, FileEntry};
use crate::store::manifest::{Head, MANIFEST};

const CSV: &str = "compare.csv";
/// The figure, by format.
static FIGURES: LazyLock<[(Format, String); 3]> = LazyLock::new(|| names::figures("compare"));

/// Every file that a comparison may write.
pub fn names() -> impl Iterator<Item = &'static str> {
    [MANIFEST, CSV].into_iter().chain(FIGURES.iter().map(|(_, name)| name.as_str()))
}

#[derive(Serialize)]
struct SideObject<'a> {
    folder: &'a str,
    title: &'a str,
    engine: &'a str,
    precision: &'a str,
    device: &'a str,
    crate_version: &'a str,
    commit: &'a str,
}

#[derive(Serialize)]
struct TallyObject {
    compared: usize,
    differing: usize,
}

/// The largest difference of exponents and its cell; null where none was compared or it is infinite.
#[derive(Serialize)]
struct ExponentsObject {
    compared: usize,
    largest: Option<f64>,
    i: Option<usize>,
    j: Option<usize>,
}

/// What was compared, and what came out.
#[derive(Serialize)]
struct Object<'a> {
    a: SideObject<'a>,
    b: SideObject<'a>,
    scene_differences: Vec<SceneDifference>,
    cells: usize,
    differing: usize,
    /// Of these, by kind.
    by_class: usize,
    by_period: usize,
    /// Cells that agree in both and differ by pattern, or by word where a map has no patterns.
    by_pattern: usize,
    by_word: usize,
    transitions: Vec<ClassTransition>,
    /// Of cells of one period; null where a map does not have it.
    symmetric: Option<TallyObject>,
    words: Option<TallyObject>,
    patterns: Option<TallyObject>,
    exponents: ExponentsObject,
    attractors: Option<TallyObject>,
}

#[derive(Serialize)]
struct Manifest<'a> {
    #[serde(flatten)]
    head: Head,
    #[serde(flatten)]
    object: Object<'a>,
    timings: TimingsObject,
    files: &'a [FileEntry],
}

#[derive(Serialize)]
struct TimingsObject {
    read: f64,
    write: f64,
}

#[derive(Serialize)]
struct PrintedObject<'a> {
    /// As it was named.
    folder: String,
    files: &'a [&'static str],
    #[serde(flatten)]
    object: Object<'a>,
}

impl<'a> Object<'a> {
    fn of(compared: &MapPair<'a>) -> Object<'a> {
        let MapPair { sides, comparison } = compared;
        let [a, b] = sides.map(|side| SideObject {
            folder: side.name,
            title: side.cells.scene().title(),
            engine: side.provenance.engine,
            precision: side.provenance.precision,
            device: side.provenance.device,
            crate_version: side.crate_version,
            commit: side.commit,
        });
        let tally =
            |Tally { compared, differing }| (compared > 0).then_some(TallyObject { compared, differing });
        let indices = comparison.exponent.map(|largest| sides[0].cells.row(largest.id).indices);
        Object {
            a,
            b,
            scene_differences: compared.scene_differences(),
            cells: comparison.kinds.len(),
            differing: comparison.differing(),
            by_class: comparison.count(Kind::Class),
            by_period: comparison.count(Kind::Period),
            by_pattern: comparison.count(Kind::Pattern),
            by_word: comparison.count(Kind::Word),
            transitions: compared.transitions(),
            symmetric: tally(comparison.symmetric),
            words: tally(comparison.words),
            patterns: tally(comparison.patterns),
            exponents: ExponentsObject {
                compared: comparison.exponents,
                largest: comparison.exponent.map(|largest| largest.difference).filter(|x| x.is_finite()),
                i: indices.map(|[i, _]| i),
                j: indices.map(|[_, j]| j),
            },
            attractors: tally(comparison.attractors),
        }
    }
}

/// Writes the table, the figure in these formats, and the manifest last: a folder that has one is complete. A list of
/// cells has no figure. `reading` is how long it took to read the maps. Returns the files' names.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    folder: &Folder,
    compared: &MapPair<'_>,
    formats: &[Format],
    reading: Duration,
) -> Result<Vec<&'static str>, OutputError> {
    let clock = Instant::now();
    folder.remove(&names().collect::<Vec<_>>())?;
    folder.replace(CSV, |out| compare_csv::write(out, compared))?;
    let mut files = vec![CSV];
    let has_figure = compared.sides[0].cells.scene().list().is_none();
    for (format, name) in FIGURES.iter().filter(|(format, _)| has_figure && formats.contains(format)) {
        folder.replace(name, |out| figure::compare::write(out, *format, compared))?;
        files.push(name);
    }
    let listed = inventory::entries(folder, &files)?;
    let manifest = Manifest {
        head: Head::of("compare"),
        object: Object::of(compared),
        timings: TimingsObject { read: reading.as_secs_f64(), write: clock.elapsed().as_secs_f64() },
        files: &listed,
    };
    inventory::write_manifest(folder, &manifest)?;
    files.push(MANIFEST);
    Ok(files)
}

/// Prints to stdout what was found: one object, its fields a contract.
///
/// # Errors
/// [`OutputError`] if stdout cannot be written, unless its reader has closed it.
pub fn print(folder: &Path, files: &[&'static str], compared: &MapPair<'_>) -> Result<(), OutputError> {
    let folder = folder.to_string_lossy().into_owned();
    let object = PrintedObject { folder, files, object: Object::of(compared) };
    crate::store::stdout::print(&serde_json::to_string_pretty(&object)?)
}
