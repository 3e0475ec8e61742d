//! Finished folders: manifests, checks, comparisons and validations. The Python package reads the tables itself.

use std::path::PathBuf;
use std::time::Instant;

use pyo3::prelude::*;
use rattlemap::job::check;
use rattlemap::job::compare::CompareJob;
use rattlemap::job::curves::CurvesJob;
use rattlemap::job::observer::Observer;
use rattlemap::job::validate::ValidateJob;
use rattlemap::map::curves::{Curves, Kind, Search, Watch};
use rattlemap::store::finished_map;
use rattlemap::store::folder::Folder;
use rattlemap::store::in_memory;
use rattlemap::store::inventory::Fault;

use rattlemap::record::Spelling;

use crate::problem::Problem;
use crate::worker::{self, Collector};

/// Returns the manifest of the folder of a map or a diagram, as JSON.
#[pyfunction]
pub(crate) fn manifest(folder: PathBuf) -> PyResult<String> {
    Ok(finished_map::read_tables(&folder).map_err(Problem::from)?.to_string())
}

/// Name of a file, its fault, and a description of the damage.
type FileFault = (String, &'static str, String);

/// Compares the files of a folder with its manifest. With `repair` it recreates damaged and missing files of a map. Returns the
/// faults, the names of the repaired files, and warnings.
#[pyfunction]
#[pyo3(signature = (folder, repair=false))]
pub(crate) fn check_folder(
    py: Python<'_>,
    folder: PathBuf,
    repair: bool,
) -> PyResult<(Vec<FileFault>, Vec<String>, Vec<String>)> {
    worker::run(py, None, move |watch| {
        // The lock comes first: another run must not replace the map between reading and writing.
        let lock = if repair && folder.is_dir() { Some(Folder::open(&folder, true)?) } else { None };
        let found = check::check(&folder)?;
        let observer = Collector::new(watch);
        let repaired = lock.map(|lock| found.repair(&lock, &observer)).transpose()?.unwrap_or_default();
        let faults = found.findings().iter().map(|finding| {
            let (kind, reason) = match &finding.fault {
                Fault::Damaged(reason) => ("damaged", reason.clone()),
                Fault::Missing => ("missing", String::new()),
                Fault::Unknown => ("unknown", String::new()),
            };
            (finding.name.clone(), kind, reason)
        });
        Ok(Some((faults.collect(), repaired, observer.lines())))
    })
}

/// Compares two finished maps. Returns the result as JSON, `compare.csv`, and warnings.
#[pyfunction]
pub(crate) fn compare(
    py: Python<'_>,
    a: PathBuf,
    b: PathBuf,
    tolerance: f64,
) -> PyResult<(String, String, Vec<String>)> {
    worker::run(py, None, move |watch| {
        let job = CompareJob::open([&a, &b])?;
        let observer = Collector::new(watch);
        let Some(result) = job.compare(tolerance, &observer, watch.halt())? else { return Ok(None) };
        let (json, table) = in_memory::comparison(&result.pair(&result.cells()))?;
        Ok(Some((json, table, observer.lines())))
    })
}

/// Tables `curves.csv`, `curve_points.csv` and `unexplained.csv`, numbers of pairs of cells, and warnings.
type CurveTables = ([String; 3], Option<[usize; 2]>, Vec<String>);

/// Follows the bifurcation curves of a finished map. `texts`: a place, a condition, and values of axes. Returns the tables, and how many pairs of cells have a curve between them and are
/// borders of basins; none if only some curves were searched.
#[pyfunction]
#[pyo3(signature = (folder, kinds, word, texts, unstable, longest, most_curves, most_points, progress=None))]
#[expect(clippy::too_many_arguments, reason = "they are those of the program")]
pub(crate) fn curves(
    py: Python<'_>,
    folder: PathBuf,
    kinds: Vec<String>,
    word: Option<&str>,
    texts: [Option<String>; 3],
    unstable: bool,
    longest: u32,
    most_curves: usize,
    most_points: usize,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<CurveTables> {
    let kind = |name: &String| {
        let list = || Kind::NAMES.join(", ");
        Kind::named(name)
            .ok_or_else(|| Problem::scene(format!("kinds: there is no `{name}`; the kinds are {}", list())))
    };
    let kinds = kinds.iter().map(kind).collect::<Result<Vec<_>, _>>()?;
    let word =
        word.map(|text| text.parse::<Spelling>().map_err(|error| Problem::scene(format!("word: {error}"))));
    let word = word.transpose()?;
    worker::run(py, progress, move |watch| {
        let observer = Collector::new(watch);
        let job = CurvesJob::open(&folder, &observer)?;
        let ([place, condition, through], scene) = (texts, job.scene());
        let through = through.map(|text| CurvesJob::through(scene, &text)).transpose()?.unwrap_or_default();
        let search = Search {
            longest,
            kinds: &kinds,
            word: word.as_ref(),
            unstable,
            condition: condition.map(|text| CurvesJob::condition(scene, &text)).transpose()?,
            through: &through,
            from: place.map(|text| CurvesJob::place(scene, &text)).transpose()?,
            most_curves,
            most_points,
        };
        let hooks = Watch {
            progress: &|done, count| observer.progress(done, count),
            found: &|_| (),
            halt: watch.halt(),
        };
        let found = job.find(&search, Curves::default(), &hooks);
        if watch.is_halted() {
            return Ok(None);
        }
        let pairs = found.pairs.map(|pairs| [pairs.explained, pairs.basins]);
        Ok(Some((in_memory::curves(job.scene(), &found)?, pairs, observer.lines())))
    })
}

/// Validates a finished map, and writes `validation.json` and its section of the report. Returns the error that the program would
/// report, if any, and warnings.
#[pyfunction]
#[pyo3(signature = (folder, samples, seed, chaos_periods, progress=None))]
pub(crate) fn validate(
    py: Python<'_>,
    folder: PathBuf,
    samples: u32,
    seed: u64,
    chaos_periods: u32,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Option<String>, Vec<String>)> {
    worker::run(py, progress, move |watch| {
        let clock = Instant::now();
        let observer = Collector::new(watch);
        let job = ValidateJob::open(&folder, samples as usize, seed, chaos_periods, &observer)?;
        let lanes = job.run_lanes(None, &(), watch.halt());
        if watch.is_halted() {
            return Ok(None);
        }
        let (lanes, count) = (lanes?, job.sample_count() + job.followed_count());
        let report = |done| observer.progress(done, count);
        let Some(validation) = job.replay(&lanes, &report, watch.halt()) else { return Ok(None) };
        let written = job.write(&job.validated(&lanes, &validation), clock.elapsed())?;
        let failure = job.require_valid(&validation, &written).err().map(|error| error.to_string());
        Ok(Some((failure, observer.lines())))
    })
}
