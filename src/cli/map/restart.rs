//! Messages of a run that stops before its end: what is stored, and the command that continues.

use crate::cli::arguments::{EngineOptions, Map};
use crate::cli::failure::Failure;
use crate::job::engine_choice::EngineKind;
use crate::job::error::JobError;
use crate::job::map::MapJob;
use crate::map::plan::Plan;
use crate::store::folder::Folder;
use crate::store::record_file::{Identity, Order, RECORDS, RecordFile};
use crate::text::shell::quoted;

/// A run that may stop before its end.
pub(super) struct Restart<'a> {
    pub(super) arguments: &'a Map,
    pub(super) sets: &'a [String],
    pub(super) job: &'a MapJob<'a>,
    pub(super) plan: &'a Plan,
}

impl Restart<'_> {
    /// Number of stored runs, and the command that computes the others.
    pub(super) fn text(&self, stored: usize) -> String {
        let (total, unit) = (self.job.run_count(self.plan), self.plan.unit());
        let most = if self.plan.refine().is_some() { "at most " } else { "" };
        format!("{stored} of {most}{total} {unit} are kept; go on with: {}", self.command("--resume"))
    }

    /// Number of runs whose records a resumed run finds.
    pub(super) fn stored(folder: &Folder) -> usize {
        let path = folder.path().join(RECORDS);
        let extent = |identity| RecordFile::read(&path, &identity, Order::Any, |_| true).ok();
        Identity::read(&path).ok().flatten().and_then(extent).map_or(0, |extent| extent.count)
    }

    /// The message of a run that stops before it changes the folder.
    pub(super) fn before_begin(&self) -> String {
        let Map { run: options, resume, .. } = self.arguments;
        if *resume {
            format!("earlier records are kept; go on with: {}", self.command("--resume"))
        } else if options.force {
            let out = self.arguments.out();
            format!("nothing in {} was changed; start again with: {}", out.display(), self.command("--force"))
        } else {
            self.text(0)
        }
    }

    /// Extends the error of an engine that cannot be opened by what the folder contains. Errors of the request are
    /// returned unchanged.
    pub(super) fn engine_not_opened(&self, error: JobError, folder: &Folder) -> Failure {
        if error.is_usage() {
            return error.into();
        }
        let rest =
            if self.arguments.run.force { self.before_begin() } else { self.text(Restart::stored(folder)) };
        JobError::Failed(format!("{error}; {rest}{}", self.with_the_cpu())).into()
    }

    /// The command that computes the map with the CPU engine, if the engine is `auto`. It starts from the first cell,
    /// because records of another engine cannot be continued.
    pub(super) fn with_the_cpu(&self) -> String {
        match self.arguments.engine.engine {
            EngineKind::Auto => {
                let cpu = EngineOptions { engine: EngineKind::Cpu, precision: None, adapter: None };
                let command = self.command_with(&cpu, "--force");
                format!("; the CPU engine can compute the map, too, from its first cell: {command}")
            }
            EngineKind::Cpu | EngineKind::Gpu => String::new(),
        }
    }

    fn command(&self, last: &str) -> String {
        self.command_with(&self.arguments.engine, last)
    }

    fn command_with(&self, engine: &EngineOptions, last: &str) -> String {
        let Map { run: options, shard, json, .. } = self.arguments;
        let mut words = vec!["rattlemap map".to_owned(), quoted(&options.scene.display().to_string())];
        words.extend(options.out.as_ref().map(|out| format!("--out {}", quoted(&out.display().to_string()))));
        let named = Some(engine.engine).filter(|engine| *engine != EngineKind::Auto);
        words.extend(named.map(|engine| format!("--engine {}", engine.name())));
        words.extend(engine.precision.map(|precision| format!("--precision {}", precision.name())));
        words.extend(shard.map(|shard| format!("--shard {shard}")));
        let adapter = engine.adapter.as_ref();
        words.extend(adapter.map(|adapter| format!("--adapter {}", quoted(&adapter.to_string()))));
        words.extend(self.sets.iter().map(|set| format!("--set {}", quoted(set))));
        words.extend(json.then(|| "--json".to_owned()));
        words.push(last.to_owned());
        words.join(" ")
    }
}
