//! `rattlemap compare`: lists and draws the cells in which two finished maps differ.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::anyhow;

use super::arguments::{Compare, FailOn, figures_and_added};
use super::console::Console;
use super::failure::Failure;
use super::interrupt::Interrupt;
use super::say;
use super::stdout::print_json;
use crate::findings::compare::{Comparison, Kind, QuantityTally, Tally};
use crate::job::compare::CompareJob;
use crate::map::scene::Scene;
use crate::show::map_pair::MapPair;
use crate::store;
use crate::store::folder::Folder;
use rattlemap_dynamics::number::significant;

/// Reads both maps, compares them, and writes the result.
pub(crate) fn run(arguments: &Compare) -> Result<(), Failure> {
    let clock = Instant::now();
    let style = arguments.figure.style()?;
    let interrupt = Interrupt::listen(arguments.quiet)?;
    let job = CompareJob::open([&arguments.a, &arguments.b])?;
    let out = arguments.out(job.names());
    job.check_output(&out)?;
    let folder = Folder::open(&out, arguments.force)?;
    folder.prepare(store::compare::names())?;
    interrupt.wait_for(Some("the maps are read"));
    let console = Console::new(arguments.quiet, "", false);
    let result = job.compare(arguments.tolerance, &console, interrupt.raised())?;
    let stopped = || interrupt.failure(format!("interrupted, and nothing was written to {}", out.display()));
    let Some(result) = result.filter(|_| interrupt.wait_for(None)) else { return Err(stopped()) };
    let cells = result.cells();
    let pair = result.pair(&cells);
    let formats = figures_and_added(&arguments.format, folder.path(), "compare");
    let files = store::compare::write(&folder, &pair, (&formats, &style), clock.elapsed())?;
    if !arguments.quiet {
        let files = format!("{}: {}", say::path(folder.path()), files.join(", "));
        say::notes(format_args!("{}\n{files}", summary(&pair, job.scene(), arguments.tolerance)));
        say::removed(&folder);
    }
    if arguments.json {
        print_json(&store::compare::object(folder.path(), &files, &pair))?;
    }
    let count = result.comparison.kinds.len();
    let (differing, by) = match arguments.fail {
        None => return Ok(()),
        Some(FailOn::Class) => (result.comparison.differing(), "class or period"),
        Some(FailOn::Quantities) => {
            (result.comparison.listed(), "class, period, pattern, motion or quantities")
        }
    };
    match differing {
        0 => Ok(()),
        _ => Err(Failure::Run(anyhow!("{differing} of {count} cells differ by {by}"))),
    }
}

impl Compare {
    /// The folder to write to.
    fn out(&self, [a, b]: &[String; 2]) -> PathBuf {
        self.out.clone().unwrap_or_else(|| Path::new("out/compare").join(format!("{a}-{b}")))
    }
}

/// Lists differences of scenes, engines, classes and periods, then differences between cells of equal class and period.
fn summary(maps: &MapPair<'_>, scene: &Scene, tolerance: f64) -> String {
    let MapPair { sides, comparison } = maps;
    let (differing, cells) = (comparison.differing(), comparison.kinds.len());
    let differences = maps.scene_differences();
    let mut lines: Vec<String> = differences
        .iter()
        .map(|found| say::quoted(format_args!("{}: {} in A, {} in B", found.name, found.a, found.b)))
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
            100.0 * differing as f64 / cells as f64,
            comparison.count(Kind::Class),
            comparison.count(Kind::Period)
        ),
    });
    lines.extend(
        maps.transitions().iter().map(|pair| format!("{} in A, {} in B: {}", pair.a, pair.b, pair.cells)),
    );
    lines.extend(other_differences(comparison, scene));
    lines.extend(comparison.quantities.iter().filter_map(|quantity| of_quantity(quantity, scene, tolerance)));
    lines.join("\n")
}

/// Describes the cells in which a quantity differs; none if it differs nowhere.
fn of_quantity(quantity: &QuantityTally, scene: &Scene, tolerance: f64) -> Option<String> {
    let QuantityTally { name, is_angle, tally: Tally { compared, differing }, largest } = quantity;
    let place = scene.points().named((*largest)?.id);
    let by = match is_angle {
        true => format!("{tolerance} rad"),
        false => format!("{} %", significant(100.0 * tolerance)),
    };
    Some(format!("{name} differs by more than {by} in {differing} of {compared} cells, most at {place}"))
}

/// Lists differences between cells of equal class and period, and in the number of attractors.
fn other_differences(comparison: &Comparison, scene: &Scene) -> Vec<String> {
    let tally = |what: &str, Tally { compared, differing }: Tally| {
        (compared > 0).then(|| format!("{differing} of {compared} {what}"))
    };
    let exponents = comparison.exponent.map(|largest| {
        let place = scene.points().named(largest.id);
        format!("exponents of {} by at most {:.1e}, at {place}", comparison.exponents, largest.difference)
    });
    let parts = [
        tally("in symmetry", comparison.symmetric),
        tally("by word", comparison.words),
        tally("by pattern", comparison.patterns),
        tally("by motion", comparison.motions),
        exponents,
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    let cycles = (!parts.is_empty())
        .then(|| format!("cells with the same period in both maps differ: {}", parts.join(", ")));
    let attractors = tally("cells differ in the number of attractors", comparison.attractors);
    // Each map numbers its attractors by its own shares, so numbers of two maps cannot be compared.
    let basins = scene.is_basin().then(|| {
        "which attractor a start leads to is not compared: see attractors.csv of both maps".to_owned()
    });
    [cycles, attractors, basins].into_iter().flatten().collect()
}
