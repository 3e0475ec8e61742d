//! `stress`: runs the requested parts, prints each verdict when its part ends, and writes the folder.

use std::sync::Mutex;
use std::time::Instant;

use anyhow::{Context, anyhow};
use rattlemap::gpu::AdapterChoice;
use rattlemap::store::folder::Folder;
use rattlemap_bench::stress::output::Files;
use rattlemap_bench::stress::{self, Lanes, Part, Size, Verdict, Watch};

use crate::arguments::Stress;
use rattlemap::cli::Progress;
use rattlemap::cli::failure::Failure;
use rattlemap::cli::note;

/// Seed of all random cells. It is constant, so every run computes the same cells.
const SEED: u64 = 1;

pub(crate) fn run(arguments: &Stress) -> Result<(), Failure> {
    let options = &arguments.run;
    let folder = Folder::open(&options.out("stress"), options.force)?;
    let (size, name) = if options.quick { (Size::Quick, "quick") } else { (Size::Full, "full") };
    let all = Part::ALL.map(|(part, _)| part);
    let parts = if arguments.parts.is_empty() { &all[..] } else { &arguments.parts };
    let mut lanes =
        pollster::block_on(Lanes::open(&AdapterChoice::default())).context("no device for lanes")?;
    let clock = Instant::now();
    let printer = Printer { quiet: options.quiet, work: Mutex::default() };
    let mut files = Files::new(&folder)?;
    let verdicts = stress::run(parts, size, SEED, &mut lanes, &mut files, &printer)?;
    let names = files.finish((name, SEED), &lanes.device(), clock.elapsed(), &verdicts)?;
    if !options.quiet {
        note(format_args!("{}: {}", folder.path().display(), names.join(", ")));
    }
    match verdicts.iter().filter(|(_, verdict)| !verdict.holds).count() {
        0 => Ok(()),
        failed => Err(anyhow!("{failed} of {} parts fail", verdicts.len()).into()),
    }
}

/// Prints progress and verdicts.
struct Printer {
    quiet: bool,
    /// The current work.
    work: Mutex<Option<(&'static str, Progress)>>,
}

impl Watch for Printer {
    fn progress(&self, work: &'static str, done: usize, total: usize) {
        let mut current = self.work.lock().expect("no thread panics while it prints");
        if current.as_ref().is_none_or(|(of, _)| *of != work) {
            *current = Some((work, Progress::new(total, 0, work, self.quiet)));
        }
        if let Some((_, progress)) = &*current {
            progress.report(done, total);
        }
    }

    fn found(&self, what: &str) {
        // The lock prevents this line from mixing with progress.
        let work = self.work.lock().expect("no thread panics while it prints");
        match &*work {
            Some((_, progress)) if !self.quiet => progress.suspend(|| note(what)),
            _ => note(what),
        }
    }

    fn judged(&self, part: &'static str, verdict: &Verdict) {
        let done = self.work.lock().expect("no thread panics while it prints").take();
        let mark = if verdict.holds { "holds" } else { "FAILS" };
        let line = format!("{part:<10} {mark}: {}", verdict.sentence);
        match done {
            Some((_, progress)) if !self.quiet => progress.finish(&line),
            _ if !self.quiet || !verdict.holds => note(line),
            _ => {}
        }
    }
}
