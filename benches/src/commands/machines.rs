//! `machines`: cells of a chain of masses for other programs, and the reference's time.

use rattlemap::cli::failure::Failure;
use rattlemap::cli::note;
use rattlemap::store::folder::Folder;
use rattlemap_bench::machines;

use crate::arguments::Machines;

/// Cells along each axis.
const SIDE: usize = 8;

/// Shortest time of the measurement, in seconds.
const LEAST_SECONDS: f64 = 0.2;

pub(crate) fn run(arguments: &Machines) -> Result<(), Failure> {
    let folder = Folder::open(&arguments.run.out("machines"), arguments.run.force)?;
    let (side, least) = if arguments.run.quick { (4, 0.0) } else { (SIDE, LEAST_SECONDS) };
    let report = machines::run(side, least);
    folder.write_json("machines.json", &report)?;
    if !arguments.run.quiet {
        let (cells, micros) = (report.cells.len(), 1e6 * report.seconds_per_lane_period);
        note(format_args!("{cells} cells, {micros:.1} us per forcing period of a cell"));
    }
    Ok(())
}
