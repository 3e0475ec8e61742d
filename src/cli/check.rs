//! `rattlemap check`: are a folder's files what its manifest says; and what can be made of records, made anew.

use std::path::Path;

use crate::show::cells::Cells;
use crate::show::cells::Survey;
use crate::store;
use crate::store::folder::Folder;
use crate::store::inventory::{FileEntry, Finding};
use crate::store::manifest::MANIFEST;
use crate::store::map::{LIST, VALIDATION, repair};
use crate::store::record_file::RECORDS;
use anyhow::{Context, anyhow};
use serde_json::Value;

use crate::cli::arguments::Check;
use crate::cli::say;
use crate::job::error::Failure;
use crate::job::finished_map::{self, Manifest, check_files, told};

/// The command whose folders can be mended.
const MAP: &str = "map";

/// Looks, names, and with `--repair` mends.
pub(crate) fn run(ask: &Check) -> Result<(), Failure> {
    let dir = &ask.folder;
    finished_map::require_folder(dir)?;
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
        format!("; `{}` makes anew what can be made of the records", finished_map::repair_command(dir))
    } else {
        String::new()
    };
    Err(Failure::Run(anyhow!("{}{remedy}", told(dir, &left))))
}

/// The command that made a folder, and the files that its manifest lists.
fn listed(dir: &Path) -> Result<(String, Vec<FileEntry>), Failure> {
    if !dir.join(MANIFEST).is_file() {
        return finished_map::read_json(dir).map(|_| Default::default()).map_err(Failure::Usage);
    }
    let damaged = || {
        format!("{} is damaged; the command that made the folder makes it anew", dir.join(MANIFEST).display())
    };
    let manifest: Value = finished_map::read_json(dir).with_context(damaged).map_err(Failure::Run)?;
    finished_map::require_format(dir, &manifest).map_err(Failure::Usage)?;
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
            told(dir, &findings.iter().filter(|finding| finding.is_lost()).collect::<Vec<_>>()),
            command.escape_debug()
        )));
    }
    folder.refuse_links(store::map::names())?;
    let part = Manifest::read_part(dir)?;
    if let Some(shard) = part.shard() {
        return Err(Failure::Run(anyhow!(
            "{}: nothing of shard {shard} can be made of the rest; `{}` keeps what is good of its records, computes \
             the others and writes its files anew",
            told(dir, &findings.iter().filter(|finding| finding.is_lost()).collect::<Vec<_>>()),
            part.remake_command(dir)
        )));
    }
    let manifest = Manifest::read(dir)?;
    let lost: Vec<&str> =
        findings.iter().filter(|finding| finding.is_lost()).map(|finding| finding.name.as_str()).collect();
    if lost.contains(&MANIFEST) {
        return Err(Failure::Run(anyhow!(
            "{}: {MANIFEST} is damaged, and cannot be believed; `{}` makes it and every file anew",
            dir.display(),
            manifest.remake_command(dir)
        )));
    }
    if lost.contains(&RECORDS) {
        return Err(Failure::Run(anyhow!(
            "{}: {RECORDS} is damaged or missing, and nothing can be made of it; `{}` keeps what is good of it, if anything \
             is, computes the rest and makes every file anew",
            dir.display(),
            manifest.remake_command(dir)
        )));
    }
    if lost.contains(&LIST) {
        return Err(Failure::Run(anyhow!(
            "{}: {LIST} is damaged or missing, and nothing tells which cells it listed; with the scene's own table `{}` \
             makes every file anew",
            dir.display(),
            manifest.remake_command(dir)
        )));
    }
    let finished = manifest.scene(dir)?;
    let plan = finished.plan()?;
    let (records, refined) = finished.records(&plan)?;
    let survey = Survey::of(&plan, &records, refined);
    let cells = Cells::new(&finished.scene, &plan, &records).surveyed(&survey);
    let has_validation =
        manifest.files.iter().any(|file| file.name == VALIDATION) && !lost.contains(&VALIDATION);
    let made = repair(folder, &cells, &lost, has_validation)?;
    if !ask.quiet {
        for name in &made {
            say::note(format_args!("{}: {name} is made anew", dir.display()));
        }
    }
    Ok(made)
}
