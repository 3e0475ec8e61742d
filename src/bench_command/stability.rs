//! `rattlemap bench stability`: every part, its verdict as it falls, and the folder.

use std::time::Instant;

use anyhow::{Context, anyhow};
use rattlemap::bench::stability::{self, Lanes, Size};
use rattlemap::gpu::AdapterChoice;
use rattlemap::output::{self, Folder};

use crate::cli::BenchOptions;
use crate::error::Failure;

/// Decides every random cell: whoever runs this meets the same ones.
const SEED: u64 = 1;

pub(crate) fn run(ask: &BenchOptions) -> Result<(), Failure> {
    let folder = Folder::open(&ask.out("stability"), ask.force)?;
    let (size, name) = if ask.quick { (Size::Quick, "quick") } else { (Size::Full, "full") };
    let mut lanes =
        pollster::block_on(Lanes::open(&AdapterChoice::default())).context("no lanes to look at")?;
    let clock = Instant::now();
    let report = stability::run(size, SEED, &mut lanes, &mut |verdict| {
        if !ask.quiet || !verdict.holds {
            let mark = if verdict.holds { "holds" } else { "FAILS" };
            eprintln!("{:<10} {mark}: {}", verdict.part, verdict.sentence);
        }
    });
    let report = report.context("a device gave up")?;
    let device = lanes.device();
    let made = output::stability::Made { size: name, seed: SEED, device: &device, elapsed: clock.elapsed() };
    let files = output::stability::write(&folder, &report, &made)?;
    if !ask.quiet {
        eprintln!("{}: {}", folder.path().display(), files.join(", "));
    }
    match report.verdicts.iter().filter(|verdict| !verdict.holds).count() {
        0 => Ok(()),
        failed => Err(anyhow!("{failed} of {} parts fail", report.verdicts.len()).into()),
    }
}
