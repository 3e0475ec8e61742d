//! `rattlemap check`: are a folder's files what its manifest says; and what can be made of records, made anew.

use std::path::Path;

use crate::map::plan::Plan;
use crate::show::cells::Cells;
use crate::show::cells::Survey;
use crate::store;
use crate::store::finished_map::{self, FinishedMap, FinishedMapError, StoredRecords};
use crate::store::folder::Folder;
use crate::store::inventory::{self, FileEntry, Finding};
use crate::store::manifest::MANIFEST;
use crate::store::map::{LIST, VALIDATION, repair};
use crate::store::record_file::RECORDS;
use anyhow::{Context, anyhow};

use crate::cli::arguments::Check;
use crate::cli::say;
use crate::job::capacity;
use crate::job::error::Failure;
use crate::text::shell::quoted;

/// The command whose folders can be mended.
const MAP: &str = "map";

/// Looks, names, and with `--repair` mends.
pub(crate) fn run(ask: &Check) -> Result<(), Failure> {
    let dir = &ask.folder;
    require_folder(dir)?;
    let folder = ask.repair.then(|| Folder::open(dir, true)).transpose()?;
    let (command, listed) = listed(dir)?;
    let findings = check_files(dir, &listed, ask.quiet)?;
    if findings.is_empty() {
        if !ask.quiet {
            let count = listed.len();
            say::note(format_args!("{}: all {count} files are as {MANIFEST} says", dir.display()));
        }
        return Ok(());
    }
    let mended = match &folder {
        Some(folder) if findings.iter().any(Finding::is_lost) => mend(ask, folder, &command, &findings)?,
        _ => Vec::new(),
    };
    // What is unknown has been named: it may be somebody's notes.
    let is_left = |finding: &&Finding| finding.is_lost() && !mended.contains(&finding.name);
    let left: Vec<&Finding> = findings.iter().filter(is_left).collect();
    if left.is_empty() {
        return Ok(());
    }
    let remedy = if left.iter().any(|finding| finding.name == VALIDATION) {
        format!("; `rattlemap validate` makes {VALIDATION} and its section of the report anew")
    } else if !ask.repair && command == MAP {
        format!("; `{}` makes anew what can be made of the records", repair_command(dir))
    } else {
        String::new()
    };
    Err(Failure::Run(anyhow!("{}{remedy}", named(dir, &left))))
}

/// The command that made a folder, and the files that its manifest lists.
fn listed(dir: &Path) -> Result<(String, Vec<FileEntry>), Failure> {
    let manifest = finished_map::read_manifest(dir).map_err(|error| match error {
        FinishedMapError::Unreadable { manifest, reason } => Failure::Run(anyhow!(
            "{} is damaged ({reason}); the command that made the folder makes it anew",
            manifest.display()
        )),
        other => other.into(),
    })?;
    finished_map::require_format(dir, &manifest)?;
    let command = manifest["command"].as_str().unwrap_or_default().to_owned();
    let files = serde_json::from_value(manifest["files"].clone());
    let files = files.with_context(|| format!("{} lists no hashes of files", dir.join(MANIFEST).display()));
    Ok((command, files.map_err(Failure::Usage)?))
}

/// Makes anew what can be made of a map's records; the names of what was.
fn mend(ask: &Check, folder: &Folder, command: &str, findings: &[Finding]) -> Result<Vec<String>, Failure> {
    let dir = &ask.folder;
    if command != MAP {
        return Err(Failure::Run(anyhow!(
            "{}: only the files of a map can be made from its records; the command that made the folder (`{}`) makes them \
             again with --force",
            named(dir, &findings.iter().filter(|finding| finding.is_lost()).collect::<Vec<_>>()),
            command.escape_debug()
        )));
    }
    folder.refuse_links(store::map::names())?;
    let part = FinishedMap::open_part(dir)?;
    if let Some(shard) = part.manifest().shard {
        return Err(Failure::Run(anyhow!(
            "{}: nothing of shard {shard} can be made of the rest; `{}` keeps what is good of its records, computes \
             the others and writes its files anew",
            named(dir, &findings.iter().filter(|finding| finding.is_lost()).collect::<Vec<_>>()),
            part.remake_command()
        )));
    }
    let map = FinishedMap::open_own(dir)?;
    let lost: Vec<&str> =
        findings.iter().filter(|finding| finding.is_lost()).map(|finding| finding.name.as_str()).collect();
    if lost.contains(&MANIFEST) {
        return Err(Failure::Run(anyhow!(
            "{}: {MANIFEST} is damaged, and cannot be believed; `{}` makes it and every file anew",
            dir.display(),
            map.remake_command()
        )));
    }
    if lost.contains(&RECORDS) {
        return Err(Failure::Run(anyhow!(
            "{}: {RECORDS} is damaged or missing, and nothing can be made of it; `{}` keeps what is good of it, if anything \
             is, computes the rest and makes every file anew",
            dir.display(),
            map.remake_command()
        )));
    }
    if lost.contains(&LIST) {
        return Err(Failure::Run(anyhow!(
            "{}: {LIST} is damaged or missing, and nothing tells which cells it listed; with the scene's own table `{}` \
             makes every file anew",
            dir.display(),
            map.remake_command()
        )));
    }
    let scene = map.scene()?;
    capacity::check_finished(&scene)?;
    let plan = Plan::new(&scene);
    plan.check()?;
    let stored = map.records(&scene, &plan)?;
    warn(&stored);
    let StoredRecords { records, refined, .. } = stored;
    let survey = Survey::of(&plan, &records, refined);
    let cells = Cells::new(&scene, &plan, &records).surveyed(&survey);
    let has_validation =
        map.manifest().files.iter().any(|file| file.name == VALIDATION) && !lost.contains(&VALIDATION);
    let made = repair(folder, &cells, &lost, has_validation)?;
    if !ask.quiet {
        for name in &made {
            say::note(format_args!("{}: {name} is made anew", dir.display()));
        }
    }
    Ok(made)
}

/// Refuses a path that is not a folder, before anything is written there.
pub(super) fn require_folder(dir: &Path) -> Result<(), Failure> {
    if dir.is_dir() { Ok(()) } else { Err(FinishedMapError::NoFolder { folder: dir.to_owned() }.into()) }
}

/// Reports damage in a record file that costs no record.
pub(super) fn warn(stored: &StoredRecords) {
    if let Some(warning) = &stored.warning {
        say::note(format_args!("warning: {warning}"));
    }
}

/// Compares a folder's files with their list, and reports each difference.
pub(super) fn check_files(dir: &Path, listed: &[FileEntry], quiet: bool) -> Result<Vec<Finding>, Failure> {
    let findings = inventory::check(dir, listed);
    let findings =
        findings.with_context(|| format!("cannot read {}", dir.display())).map_err(Failure::Run)?;
    for finding in findings.iter().filter(|finding| finding.is_lost() || !quiet) {
        say::note(format_args!("{}: {finding}", dir.display()));
    }
    Ok(findings)
}

/// Names the damaged or missing files of a folder.
pub(super) fn named(dir: &Path, lost: &[&Finding]) -> String {
    let names: Vec<String> = lost.iter().map(|finding| finding.name.escape_debug().to_string()).collect();
    format!("{}: damaged or missing: {}", dir.display(), names.join(", "))
}

/// Returns the command that repairs a folder.
pub(super) fn repair_command(dir: &Path) -> String {
    format!("rattlemap check {} --repair", quoted(&dir.display().to_string()))
}
