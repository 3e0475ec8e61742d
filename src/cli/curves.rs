//! `rattlemap curves`: follows the borders between the regions of a finished map.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::arguments::{Curves, Map, figures_and_added};
use super::console::Console;
use super::failure::Failure;
use super::interrupt::Interrupt;
use super::progress::Progress;
use super::say;
use crate::job::curves::CurvesJob;
use crate::job::error::JobError;
use crate::job::scene_file::SceneFile;
use crate::map::curves::{self, Kind, Search, Watch, With};
use crate::map::scene::Scene;
use crate::store;
use crate::store::folder::Folder;
use anyhow::anyhow;
use rattlemap_dynamics::number::significant;
use serde_json::{Value, json};

/// Time after which a search stores what it has found.
const SAVED: Duration = Duration::from_secs(5);

/// Number of failures that a message lists; the manifest lists all.
const LISTED: usize = 4;

/// Finds the curves of all maps, and writes them.
pub(crate) fn run(arguments: &Curves) -> Result<(), Failure> {
    let wants = arguments.kind.is_empty() || arguments.kind.contains(&Kind::Condition);
    let needs = arguments.kind.contains(&Kind::Condition);
    if needs && arguments.condition.is_none() {
        return Err(Failure::Usage(anyhow!("--kind condition needs --condition QUANTITY=VALUE")));
    }
    if arguments.condition.is_some() && !wants {
        return Err(Failure::Usage(anyhow!("--condition: add condition to --kind, or leave out --kind")));
    }
    let folders: Vec<PathBuf> = arguments.maps.iter().map(|map| arguments.out(map)).collect();
    if let Some(twice) = (1..folders.len()).find(|&i| folders[..i].contains(&folders[i])) {
        let text = format!(
            "two maps have the same name, so their curves need the same folder, {}",
            folders[twice].display()
        );
        return Err(Failure::Usage(anyhow!(text)));
    }
    arguments.maps.iter().zip(&folders).try_for_each(|(map, out)| run_one(arguments, map, out))
}

/// Reads a map, finds its curves, and writes them into a folder.
fn run_one(arguments: &Curves, source: &Path, out: &Path) -> Result<(), Failure> {
    let map = if source.is_file() { make_map(arguments, source, out)? } else { source.to_path_buf() };
    let clock = Instant::now();
    let interrupt = Interrupt::listen(arguments.quiet)?;
    let job = CurvesJob::open(&map, &Console::new(arguments.quiet, "", false))?;
    let of = arguments.search(job.scene());
    let known = if arguments.resume { store::curves::saved(out, &of) } else { None };
    let folder = Folder::open(out, arguments.force || known.is_some())?;
    folder.prepare(store::curves::names())?;
    let through = read(&arguments.through, |text| CurvesJob::through(job.scene(), text))?.unwrap_or_default();
    let search = Search {
        longest: arguments.longest,
        kinds: &arguments.kind,
        word: arguments.word.as_ref(),
        unstable: arguments.unstable,
        condition: read(&arguments.condition, |text| CurvesJob::condition(job.scene(), text))?,
        through: &through,
        from: read(&arguments.from, |text| CurvesJob::place(job.scene(), text))?,
        most_curves: arguments.most_curves as usize,
        most_points: arguments.most_points as usize,
    };
    let unit = if search.from.is_some() { "directions" } else { "pairs of cells" };
    let progress = Progress::new(1, 0, unit, arguments.quiet);
    let (saved, latest) = (Cell::new(Instant::now()), RefCell::new(known.clone().unwrap_or_default()));
    let save = |found: &curves::Curves| {
        if !interrupt.is_raised() && saved.get().elapsed() > SAVED {
            // A search goes on without this file, too.
            store::curves::save(&folder, &of, found).unwrap_or_default();
            saved.set(Instant::now());
            *latest.borrow_mut() = found.clone();
        }
    };
    let watch = Watch {
        progress: &|done: usize, count: usize| progress.report(done, count.max(1)),
        found: &save,
        halt: interrupt.raised(),
    };
    let found = job.find(&search, known.unwrap_or_default(), &watch);
    if interrupt.is_raised() {
        store::curves::save(&folder, &of, &latest.borrow())?;
    }
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
        let text = "interrupted; the curves that were found are written, and --resume finds the others";
        return Err(interrupt.failure(text.to_owned()));
    }
    Ok(store::curves::forget(&folder)?)
}

/// Reads the text of an option, if it is given.
fn read<T>(text: &Option<String>, of: impl Fn(&str) -> Result<T, JobError>) -> Result<Option<T>, JobError> {
    text.as_deref().map(of).transpose()
}

/// Computes the map of a scene into its default folder, or completes it there. Returns the folder. `out`: the folder of the curves.
fn make_map(arguments: &Curves, source: &Path, out: &Path) -> Result<PathBuf, Failure> {
    let scene = SceneFile::map(source).load(&[])?;
    CurvesJob::require(&scene, source)?;
    read(&arguments.from, |text| CurvesJob::place(&scene, text))?;
    read(&arguments.through, |text| CurvesJob::through(&scene, text))?;
    read(&arguments.condition, |text| CurvesJob::condition(&scene, text))?;
    Folder::check(out, arguments.force || arguments.resume, store::curves::names())?;
    let map = Map::of_scene(source, arguments.quiet);
    super::map::run(&map)?;
    Ok(map.out())
}

impl Curves {
    /// Describes the search, so that it is resumed only with the same options and the same map.
    fn search(&self, scene: &Scene) -> Value {
        let kinds: Vec<&str> = self.kind.iter().map(|kind| kind.name()).collect();
        let word = self.word.as_ref().map(|word| word.text());
        let texts = [&self.from, &self.condition, &self.through];
        json!([scene.identity(), kinds, word, texts, self.unstable, self.longest, self.most_points])
    }

    /// Returns the folder to which the curves of a map are written.
    fn out(&self, map: &Path) -> PathBuf {
        let name = if map.is_file() { map.file_stem() } else { map.file_name() };
        let name = name.map_or(Path::new("map"), Path::new);
        match &self.out {
            Some(out) if self.maps.len() == 1 => out.clone(),
            out => out.as_deref().unwrap_or(Path::new("out/curves")).join(name),
        }
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
    let count = found.meetings.iter().filter(|meeting| meeting.with != With::Value).count();
    if count > 0 {
        lines.push(format!("at {count} points of curves another condition is met, too"));
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
