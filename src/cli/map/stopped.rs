//! What a run that stops before its end says: what is kept, and how to go on.

use anyhow::anyhow;

use super::resume_command::{cpu_command, resume_command, same_command};
use super::shard;
use crate::cli::arguments::{EngineChoice, Map};
use crate::job::error::Failure;
use crate::map::plan::Plan;
use crate::store::folder::Folder;
use crate::store::record_file::{Identity, Order, RECORDS, RecordFile};

/// How many are kept, and the command that computes the others.
pub(super) fn go_on(ask: &Map, plan: &Plan, done: usize) -> String {
    let (total, unit) = (shard::runs(ask, plan), plan.unit());
    let most = if plan.refine().is_some() { "at most " } else { "" };
    format!("{done} of {most}{total} {unit} are kept; go on with: {}", resume_command(ask))
}

/// The same while the engine is opened: nothing new is there to keep.
pub(super) fn before_anything(ask: &Map, plan: &Plan) -> String {
    match ask {
        Map { resume: true, .. } => {
            format!("what was kept before is kept; go on with: {}", resume_command(ask))
        }
        Map { run, .. } if run.force => {
            format!("nothing in {} was touched; start again with: {}", ask.out().display(), same_command(ask))
        }
        _ => go_on(ask, plan, 0),
    }
}

/// Where the engine was left open: another can do it, but not go on with these records.
pub(super) fn on_the_processor(ask: &Map) -> String {
    match ask.engine.engine {
        EngineChoice::Auto => {
            format!("; the CPU engine can compute the map, too, from its first cell: {}", cpu_command(ask))
        }
        EngineChoice::Cpu | EngineChoice::Gpu => String::new(),
    }
}

/// An engine that could not be opened, with what the folder still holds; what was asked in vain is told as it is.
pub(super) fn before_it_began(failure: Failure, ask: &Map, folder: &Folder, plan: &Plan) -> Failure {
    let Failure::Run(error) = failure else { return failure };
    let kept = || {
        let path = folder.path().join(RECORDS);
        let identity = Identity::read(&path).ok()??;
        Some(RecordFile::read(&path, &identity, Order::Any, |_| true).ok()?.count)
    };
    let rest = if ask.run.force {
        format!("nothing in {} was touched; try again with: {}", folder.path().display(), same_command(ask))
    } else {
        go_on(ask, plan, kept().unwrap_or(0))
    };
    Failure::Run(anyhow!("{error:#}; {rest}{}", on_the_processor(ask)))
}
