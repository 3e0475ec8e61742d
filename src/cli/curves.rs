//! `rattlemap curves`: follows the borders between the regions of a finished map.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::arguments::{Curves, Map, figures_and_added};
use super::console::Console;
use super::failure::Failure;
use super::interrupt::Interrupt;
use super::progress::Progress;
use super::say;
use crate::job::curves::CurvesJob;
use crate::job::scene_file::SceneFile;
use crate::map::curves::{self, Kind, Search};
use crate::store;
use crate::store::folder::Folder;
use rattlemap_dynamics::number::significant;

/// Number of failures that a message lists; the manifest lists all.
const LISTED: usize = 4;

/// Reads the map, finds its curves, and writes them.
pub(crate) fn run(arguments: &Curves) -> Result<(), Failure> {
    let out = arguments.out();
    let map = if arguments.map.is_file() { make_map(arguments, &out)? } else { arguments.map.clone() };
    let clock = Instant::now();
    let interrupt = Interrupt::listen(arguments.quiet)?;
    let job = CurvesJob::open(&map, &Console::new(arguments.quiet, "", false))?;
    let folder = Folder::open(&out, arguments.force)?;
    folder.prepare(store::curves::names())?;
    let search = Search {
        longest: arguments.longest,
        kinds: &arguments.kind,
        word: arguments.word.as_ref(),
        from: arguments.from.as_deref().map(|text| CurvesJob::place(job.scene(), text)).transpose()?,
        most_curves: arguments.most_curves as usize,
        most_points: arguments.most_points as usize,
    };
    let unit = if search.from.is_some() { "directions" } else { "pairs of cells" };
    let progress = Progress::new(1, 0, unit, arguments.quiet);
    let report = |done: usize, count: usize| progress.report(done, count.max(1));
    let found = job.find(&search, &report, interrupt.raised());
    let elapsed = clock.elapsed();
    let (cells, layers) = (job.cells(), job.layers());
    let formats = figures_and_added(&arguments.format, folder.path(), "curves");
    let page = job.page(&layers, &found);
    let files = store::curves::write(&folder, (&cells, &layers), (&found, &page), &formats, elapsed)?;
    let axes = [0, 1].map(|i| &*job.scene().axes()[i].parameter().name);
    progress.finish(&format!(
        "{}\n{}: {}",
        summary(&found, axes, elapsed.as_secs_f64()),
        say::path(folder.path()),
        files.join(", ")
    ));
    if !arguments.quiet {
        say::removed(&folder);
    }
    if interrupt.is_raised() {
        return Err(interrupt.failure("interrupted; the curves that were found are written".to_owned()));
    }
    Ok(())
}

/// Computes the map of a scene into its default folder, or completes it there. Returns the folder. `out`: the folder of the curves.
fn make_map(arguments: &Curves, out: &Path) -> Result<PathBuf, Failure> {
    let scene = SceneFile::map(&arguments.map).load(&[])?;
    CurvesJob::require(&scene, &arguments.map)?;
    arguments.from.as_deref().map(|text| CurvesJob::place(&scene, text)).transpose()?;
    Folder::check(out, arguments.force, store::curves::names())?;
    let map = Map::of_scene(&arguments.map, arguments.quiet);
    super::map::run(&map)?;
    Ok(map.out())
}

impl Curves {
    /// The folder to write to.
    fn out(&self) -> PathBuf {
        let name = if self.map.is_file() { self.map.file_stem() } else { self.map.file_name() };
        let name = name.map(Path::new).unwrap_or(Path::new("map"));
        self.out.clone().unwrap_or_else(|| Path::new("out/curves").join(name))
    }
}

/// Lists the curves by kind, what they explain, and which could not be followed.
fn summary(found: &curves::Curves, axes: [&str; 2], seconds: f64) -> String {
    let mut kinds: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for curve in &found.curves {
        let [count, points] = kinds.entry(curve.kind.name()).or_default();
        (*count, *points) = (*count + 1, *points + curve.points.len());
    }
    let kinds: Vec<String> =
        kinds.iter().map(|(kind, [count, points])| format!("{count} {kind} ({points} points)")).collect();
    let (count, list) = (found.curves.len(), kinds.join(", "));
    let mut lines = vec![match count {
        0 => format!("no curves in {seconds:.1} s"),
        1 => format!("1 curve in {seconds:.1} s: {list}"),
        _ => format!("{count} curves in {seconds:.1} s: {list}"),
    }];
    if let Some(reason) = found.nothing.filter(|_| count == 0) {
        lines.push(format!("from the given values: {reason}"));
    }
    let curves::Pairs { explained, basins, unexplained } = found.pairs.unwrap_or_default();
    let all = explained + unexplained;
    if all > 0 {
        lines.push(format!(
            "of {all} pairs of neighbouring cells with different cycles, {explained} have a curve between them ({:.1} %); {basins} more are borders of basins",
            100.0 * explained as f64 / all as f64
        ));
    }
    if !found.meetings.is_empty() {
        lines.push(format!("at {} points of curves another condition is met, too", found.meetings.len()));
    }
    let failure = |(kind, [x, y], reason): &(Kind, [f64; 2], String)| {
        let [a, b] = axes;
        format!(
            "a {} at {a} = {}, {b} = {} is not followed: {reason}",
            kind.name(),
            significant(*x),
            significant(*y)
        )
    };
    lines.extend(found.failures.iter().take(LISTED).map(failure));
    if found.failures.len() > LISTED {
        lines.push(format!(
            "and {} more; {} lists them",
            found.failures.len() - LISTED,
            store::manifest::MANIFEST
        ));
    }
    lines.join("\n")
}
