//! `stress`: the parts asked for, each verdict as it falls, and the folder.

use std::sync::Mutex;
use std::time::Instant;

use anyhow::{Context, anyhow};
use rattlemap::gpu::AdapterChoice;
use rattlemap::store::folder::Folder;
use rattlemap_bench::stress::{self, Lanes, Part, Size, Verdict, Watch, output};

use crate::arguments::Stress;
use rattlemap::cli::Progress;
use rattlemap::cli::failure::Failure;
use rattlemap::cli::note;

/// Decides every random cell: whoever runs this meets the same ones.
const SEED: u64 = 1;

pub(crate) fn run(ask: &Stress) -> Result<(), Failure> {
    let folder = Folder::open(&ask.run.out("stress"), ask.run.force)?;
    let (size, name) = if ask.run.quick { (Size::Quick, "quick") } else { (Size::Full, "full") };
    let parts = if ask.parts.is_empty() { &Part::ALL[..] } else { &ask.parts };
    let mut lanes =
        pollster::block_on(Lanes::open(&AdapterChoice::default())).context("no lanes to examine")?;
    let clock = Instant::now();
    let teller = Teller { quiet: ask.run.quiet, work: Mutex::default() };
    let report = stress::run(parts, size, SEED, &mut lanes, &teller).context("a device gave up")?;
    let device = lanes.device();
    let made = output::Made { size: name, seed: SEED, device: &device, elapsed: clock.elapsed() };
    let files = output::write(&folder, &report, &made)?;
    if !ask.run.quiet {
        note(format_args!("{}: {}", folder.path().display(), files.join(", ")));
    }
    match report.verdicts.iter().filter(|verdict| !verdict.holds).count() {
        0 => Ok(()),
        failed => Err(anyhow!("{failed} of {} parts fail", report.verdicts.len()).into()),
    }
}

/// Says how far a part has come, and what came of it.
struct Teller {
    quiet: bool,
    /// What is being done.
    work: Mutex<Option<(&'static str, Progress)>>,
}

impl Watch for Teller {
    fn progress(&self, work: &'static str, done: usize, total: usize) {
        let mut current = self.work.lock().expect("nobody panics while telling");
        if current.as_ref().is_none_or(|(of, _)| *of != work) {
            *current = Some((work, Progress::new(total, 0, work, self.quiet)));
        }
        if let Some((_, progress)) = &*current {
            progress.report(done, total);
        }
    }

    fn found(&self, what: &str) {
        // Held, so that lines do not mix with progress.
        let work = self.work.lock().expect("nobody panics while telling");
        match &*work {
            Some((_, progress)) if !self.quiet => progress.suspend(|| note(what)),
            _ => note(what),
        }
    }

    fn judged(&self, verdict: &Verdict) {
        let done = self.work.lock().expect("nobody panics while telling").take();
        let mark = if verdict.holds { "holds" } else { "FAILS" };
        let line = format!("{:<10} {mark}: {}", verdict.part, verdict.sentence);
        match done {
            Some((_, progress)) if !self.quiet => progress.finish(&line),
            _ if !self.quiet || !verdict.holds => note(line),
            _ => {}
        }
    }
}
