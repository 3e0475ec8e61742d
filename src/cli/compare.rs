//! `rattlemap compare`: two finished maps of one grid in, the cells in which they differ out.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::anyhow;

use super::arguments::{Compare, FigureFormat};
use super::check;
use super::interrupt::Interrupt;
use super::say;
use super::stdout::print_json;
use crate::findings::coexistence;
use crate::findings::compare::{Comparison, Kind, Side, Tally, compare};
use crate::job::capacity;
use crate::job::error::Failure;
use crate::map::plan::Plan;
use crate::map::scene::{Points, Quantity, Scene};
use crate::show::cells::{Cells, Survey};
use crate::show::map_pair::{MapPair, MapSide};
use crate::store;
use crate::store::finished_map::{FinishedMap, StoredManifest};
use crate::store::folder::Folder;
use crate::store::map::Provenance;

/// Reads both, compares, writes.
pub(crate) fn run(ask: &Compare) -> Result<(), Failure> {
    let clock = Instant::now();
    let interrupt = Interrupt::listen(ask.quiet)?;
    let (dirs, formats) = ([&ask.a, &ask.b], FigureFormat::scene(&ask.format));
    let names = dirs.map(|dir| name_of(dir));
    let maps = [FinishedMap::open(dirs[0])?, FinishedMap::open(dirs[1])?];
    let scenes = [&maps[0].scene()?, &maps[1].scene()?];
    scenes.into_iter().try_for_each(capacity::check_finished)?;
    require_classes(dirs, scenes)?;
    require_one_grid(dirs, scenes)?;
    let out = ask.out(&names);
    refuse_own_folder(&out, dirs)?;
    let folder = Folder::open(&out, ask.force)?;
    folder.refuse_links(store::compare::names())?;
    let plans = scenes.map(Plan::new);
    plans.iter().try_for_each(Plan::check)?;
    interrupt.wait_for(Some("the maps are read"));
    let [a, b] = [maps[0].records(scenes[0], &plans[0])?, maps[1].records(scenes[1], &plans[1])?];
    [&a, &b].into_iter().for_each(check::warn);
    let [(a, refined_a), (b, refined_b)] = [a, b].map(|stored| (stored.records, stored.refined));
    let counted =
        plans.iter().all(|plan| plan.start_count() > 1) && interrupt.wait_for(Some("attractors are counted"));
    let attractors =
        |plan: &Plan, records| if counted { coexistence::attractors(plan, records) } else { None };
    let attractors = [attractors(&plans[0], &a), attractors(&plans[1], &b)];
    let stopped = || interrupt.failure(anyhow!("interrupted, and nothing was written to {}", out.display()));
    if !interrupt.wait_for(None) {
        return Err(stopped());
    }
    let records = [&a, &b];
    let [of_a, of_b] = [0, 1].map(|i| Side {
        records: &records[i][..plans[i].cell_count()],
        attractors: attractors[i].as_deref(),
        has_exponents: scenes[i].outputs().quantities.contains(&Quantity::Lyapunov),
    });
    let comparison = compare(of_a, of_b);
    let surveys = [refined_a, refined_b].map(Survey::of_refinement);
    let cells = [
        Cells::new(scenes[0], &plans[0], &a).surveyed(&surveys[0]),
        Cells::new(scenes[1], &plans[1], &b).surveyed(&surveys[1]),
    ];
    let side = |i: usize| {
        let StoredManifest { engine, precision, device, crate_version, commit, .. } = maps[i].manifest();
        MapSide {
            name: &names[i],
            cells: &cells[i],
            provenance: Provenance { engine, precision, device },
            crate_version,
            commit,
        }
    };
    let compared = MapPair { sides: [side(0), side(1)], comparison: &comparison };
    if interrupt.is_raised() {
        return Err(stopped());
    }
    let files = store::compare::write(&folder, &compared, &formats, clock.elapsed())?;
    if !ask.quiet {
        let files = format!("{}: {}", say::path(folder.path()), files.join(", "));
        say::notes(format_args!("{}\n{files}", summary(&compared, scenes[0])));
    }
    if ask.json {
        print_json(&store::compare::object(folder.path(), &files, &compared))?;
    }
    match comparison.differing() {
        differing if ask.fail && differing > 0 => Err(Failure::Run(anyhow!(
            "{differing} of {} cells differ by class or period",
            comparison.kinds.len()
        ))),
        _ => Ok(()),
    }
}

/// What a folder is called, whatever way leads to it.
fn name_of(dir: &Path) -> String {
    let whole = dir.canonicalize().unwrap_or_else(|_| dir.to_owned());
    whole.file_name().map_or("map".into(), |name| name.to_string_lossy()).into_owned()
}

impl Compare {
    /// The folder to write to.
    fn out(&self, [a, b]: &[String; 2]) -> PathBuf {
        self.out.clone().unwrap_or_else(|| Path::new("out/compare").join(format!("{a}-{b}")))
    }
}

/// Refuses to write among the files of a map that is compared.
fn refuse_own_folder(out: &Path, dirs: [&PathBuf; 2]) -> Result<(), Failure> {
    let Ok(whole) = out.canonicalize() else { return Ok(()) };
    match dirs.into_iter().find(|dir| dir.canonicalize().is_ok_and(|dir| dir == whole)) {
        Some(dir) => Err(Failure::Usage(anyhow!(
            "--out {}: this is the folder of {}, which is compared; choose another one",
            out.display(),
            dir.display()
        ))),
        None => Ok(()),
    }
}

/// Refuses maps without classes: there is nothing to compare.
fn require_classes(dirs: [&PathBuf; 2], scenes: [&Scene; 2]) -> Result<(), Failure> {
    let has_none = |scene: &Scene| !scene.outputs().quantities.contains(&Quantity::Class);
    match dirs.into_iter().zip(scenes).find(|(_, scene)| has_none(scene)) {
        Some((dir, _)) => Err(Failure::Usage(anyhow!(
            "{}: the map has no classes; make it again with \"class\" among outputs.quantities",
            dir.display()
        ))),
        None => Ok(()),
    }
}

/// Refuses maps whose cells lie elsewhere.
fn require_one_grid(dirs: [&PathBuf; 2], scenes: [&Scene; 2]) -> Result<(), Failure> {
    let [dir_a, dir_b] = dirs.map(|dir| dir.display());
    if scenes.iter().any(|scene| scene.list().is_some()) {
        let [a, b] = scenes.map(Scene::points);
        let names = |points: &Points| points.swept().map(|p| p.name.to_string()).collect::<Vec<_>>();
        let is_same = a.counts() == b.counts()
            && names(a) == names(b)
            && (0..a.counts()[0] * a.counts()[1]).all(|cell| a.values(cell) == b.values(cell));
        return match is_same {
            true => Ok(()),
            false => Err(Failure::Usage(anyhow!(
                "maps of other cells cannot be compared: {dir_a} and {dir_b} are of two lists, or one is of none; make \
                 one of them again with the other's cells"
            ))),
        };
    }
    let [a, b] = scenes.map(Scene::axes);
    for (number, (a, b)) in a.iter().zip(b).enumerate() {
        let is_same = a.parameter().name == b.parameter().name
            && a.count() == b.count()
            && a.values().zip(b.values()).all(|(a, b)| a == b);
        if !is_same {
            let [a, b] = [a, b].map(|axis| {
                let (name, count) = (&axis.parameter().name, axis.count());
                format!("{name} from {:?} to {:?} in {count} values", axis.min(), axis.max())
            });
            let values = if a == b { ", and not the same ones between" } else { "" };
            return Err(Failure::Usage(anyhow!(
                "maps of two grids cannot be compared: axis {number} of {dir_a} is {a}, of {dir_b} {b}{values}; make one \
                 of them again with the other's axes"
            )));
        }
    }
    Ok(())
}

/// What was found, a line for each question.
fn summary(compared: &MapPair<'_>, scene: &Scene) -> String {
    let MapPair { sides, comparison } = compared;
    let percent = |cells: usize| 100.0 * cells as f64 / comparison.kinds.len() as f64;
    let (differing, cells) = (comparison.differing(), comparison.kinds.len());
    let mut lines: Vec<String> = compared
        .scene_differences()
        .iter()
        .map(|differing| {
            say::quoted(format_args!("{}: {} in A, {} in B", differing.name, differing.a, differing.b))
        })
        .collect();
    let [a, b] = sides
        .map(|side| say::quoted(format_args!("{} {}", side.provenance.engine, side.provenance.precision)));
    if a != b {
        lines.push(format!("engine: {a} in A, {b} in B"));
    }
    lines.push(match differing {
        0 => format!("no cell of {cells} differs by class or period"),
        _ => format!(
            "{differing} of {cells} cells differ ({:.2} %): {} by class, {} by period",
            percent(differing),
            comparison.count(Kind::Class),
            comparison.count(Kind::Period)
        ),
    });
    lines.extend(
        compared.transitions().iter().map(|pair| format!("{} in A, {} in B: {}", pair.a, pair.b, pair.cells)),
    );
    lines.extend(beside(comparison, scene));
    lines.join("\n")
}

/// What is said of cells that agree by class and period, and of attractors; none where nothing could be compared.
fn beside(comparison: &Comparison, scene: &Scene) -> Option<String> {
    let tally = |what: &str, Tally { compared, differing }: Tally| {
        (compared > 0).then(|| format!("{differing} of {compared} {what}"))
    };
    let exponents = comparison.exponent.map(|largest| {
        let place = scene.points().named(largest.id);
        format!("exponents of {} by {:.1e} at most, at {place}", comparison.exponents, largest.difference)
    });
    let parts = [
        tally("in symmetry", comparison.symmetric),
        tally("by word", comparison.words),
        tally("by pattern", comparison.patterns),
        exponents,
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    let cycles = (!parts.is_empty()).then(|| format!("of cycles of one period differ: {}", parts.join(", ")));
    let attractors = tally("cells differ in the number of attractors", comparison.attractors);
    // Labels go by share in each map, so equal ones say nothing.
    let basins = scene.is_basin().then(|| {
        "to which attractor a start leads is not compared: see attractors.csv of both for twins of one period".to_owned()
    });
    let lines: Vec<String> = cycles.into_iter().chain(attractors).chain(basins).collect();
    (!lines.is_empty()).then(|| lines.join("\n"))
}
