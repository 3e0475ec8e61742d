//! The command that goes on with a run, or begins it anew, to be pasted into a shell.

use clap::ValueEnum;

use crate::cli::arguments::{EngineChoice, EngineOptions, Map};
use crate::text::shell::quoted;

/// Asks for the same again, and for what is there already.
pub(super) fn resume_command(ask: &Map) -> String {
    command(ask, &ask.engine, "--resume")
}

/// Asks for the same again, in the place of what is there.
pub(super) fn same_command(ask: &Map) -> String {
    command(ask, &ask.engine, "--force")
}

/// Asks for the same map of the CPU engine, in the place of what is there: it does not go on with another's records.
pub(super) fn cpu_command(ask: &Map) -> String {
    command(ask, &EngineOptions { engine: EngineChoice::Cpu, precision: None, adapter: None }, "--force")
}

fn command(ask: &Map, engine: &EngineOptions, last: &str) -> String {
    let mut words = vec!["rattlemap map".to_owned(), quoted(&ask.run.scene.display().to_string())];
    if let Some(out) = &ask.run.out {
        words.push(format!("--out {}", quoted(&out.display().to_string())));
    }
    if let Some(named) = engine.engine.to_possible_value().filter(|_| engine.engine != EngineChoice::Auto) {
        words.push(format!("--engine {}", named.get_name()));
    }
    words.extend(engine.precision.map(|precision| format!("--precision {}", precision.name())));
    words.extend(ask.shard.map(|shard| format!("--shard {shard}")));
    let adapter = engine.adapter.as_ref();
    words.extend(adapter.map(|adapter| format!("--adapter {}", quoted(&adapter.to_string()))));
    words.extend(ask.run.set.iter().map(|set| format!("--set {}", quoted(set))));
    words.extend(ask.json.then(|| "--json".to_owned()));
    words.push(last.to_owned());
    words.join(" ")
}
