//! Compares the files of a folder with its manifest, and recreates those of a map from its records.

use std::path::{Path, PathBuf};

use crate::job::error::JobError;
use crate::job::finished::{self, LoadedMap, damage, repair_command};
use crate::job::observer::Observer;
use crate::store::finished_map::{self, FinishedMap, FinishedMapError};
use crate::store::folder::Folder;
use crate::store::inventory::{self, FileEntry, Finding};
use crate::store::map::{self, LIST, MANIFEST, VALIDATION};
use crate::store::record_file::RECORDS;

/// The command whose folders can be repaired.
const MAP: &str = "map";

/// Remedy for a wrong folder.
const WRITTEN: &str = "name a folder that `map`, `bifurcation`, `orbit`, `compare` or `bench` has written";

/// A folder whose files have been compared with its manifest.
#[derive(Debug)]
pub struct CheckedFolder {
    dir: PathBuf,
    command: String,
    files: usize,
    findings: Vec<Finding>,
}

/// Compares size and hash of every file with the manifest.
///
/// # Errors
/// [`JobError`] if the folder or its manifest cannot be read.
pub fn check(dir: &Path) -> Result<CheckedFolder, JobError> {
    let manifest = finished_map::read_manifest(dir).map_err(|error| match error {
        FinishedMapError::NoFolder { folder } => {
            JobError::Usage(format!("{}: there is no such folder; {WRITTEN}", folder.display()))
        }
        FinishedMapError::NoManifest { folder } => {
            JobError::Usage(format!("{}: there is no {MANIFEST}; {WRITTEN}", folder.display()))
        }
        FinishedMapError::Unreadable { manifest, reason } => JobError::Failed(format!(
            "{} is damaged ({reason}); run the command that wrote the folder again",
            manifest.display()
        )),
        other => other.into(),
    })?;
    finished_map::require_format(dir, &manifest)?;
    let files: Vec<FileEntry> = serde_json::from_value(manifest["files"].clone()).map_err(|error| {
        JobError::Usage(format!("{} has no list of files: {error}", dir.join(MANIFEST).display()))
    })?;
    let command = manifest["command"].as_str().unwrap_or_default().to_owned();
    Ok(CheckedFolder { dir: dir.to_owned(), command, files: files.len(), findings: findings(dir, &files)? })
}

/// Compares size and hash of the listed files.
///
/// # Errors
/// [`JobError`] if the folder cannot be read.
pub(crate) fn findings(dir: &Path, listed: &[FileEntry]) -> Result<Vec<Finding>, JobError> {
    inventory::check(dir, listed)
        .map_err(|error| JobError::Failed(format!("cannot read {}: {error}", dir.display())))
}

impl CheckedFolder {
    /// Number of files that the manifest lists.
    pub fn files(&self) -> usize {
        self.files
    }

    /// Damaged, missing and unknown files.
    pub fn findings(&self) -> &[Finding] {
        &self.findings
    }

    fn lost(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|finding| finding.is_lost())
    }

    /// Recreates the damaged and missing tables, figures and report of a map from its records. The caller must have
    /// locked the folder before the check. Returns the names of the files.
    ///
    /// # Errors
    /// [`JobError`] if the folder is not a map's, a damaged file cannot be recreated, or a file cannot be written.
    pub fn repair(&self, folder: &Folder, observer: &dyn Observer) -> Result<Vec<String>, JobError> {
        let dir = &self.dir;
        let lost: Vec<&str> = self.lost().map(|finding| finding.name.as_str()).collect();
        if lost.is_empty() {
            return Ok(Vec::new());
        }
        if self.command != MAP {
            return Err(JobError::Failed(format!(
                "{}: only the files of a map can be recreated from records; run `{}` again with --force",
                damage(dir, self.lost()),
                self.command.escape_debug()
            )));
        }
        folder.refuse_links(map::names())?;
        let part = FinishedMap::open_part(dir)?;
        let remake = part.remake_command();
        if let Some(shard) = part.manifest().shard {
            return Err(JobError::Failed(format!(
                "{}: no file of shard {shard} can be recreated from the others; `{remake}` keeps the undamaged records, \
                 computes the others and writes the files again",
                damage(dir, self.lost())
            )));
        }
        let map = FinishedMap::open_own(dir)?;
        let cannot = |name: &str, why: &str| {
            let dir = dir.display();
            JobError::Failed(format!("{dir}: {name} is damaged or missing, and {why}"))
        };
        if lost.contains(&MANIFEST) {
            return Err(cannot(MANIFEST, &format!("cannot be trusted; `{remake}` recreates every file")));
        }
        if lost.contains(&RECORDS) {
            let why = format!(
                "cannot be recreated from other files; `{remake}` keeps its undamaged records, computes the others \
                 and recreates every file"
            );
            return Err(cannot(RECORDS, &why));
        }
        if lost.contains(&LIST) {
            let why = format!(
                "no other file lists the cells; `{remake}` recreates every file from the scene's own table"
            );
            return Err(cannot(LIST, &why));
        }
        let scene = finished::scene(&map)?;
        let mut loaded = LoadedMap::read(&map, &scene, observer)?;
        let survey = loaded.survey();
        let has_validation =
            map.manifest().files.iter().any(|file| file.name == VALIDATION) && !lost.contains(&VALIDATION);
        Ok(map::repair(
            folder,
            &loaded.cells(&scene, &survey),
            &map.manifest().provenance(),
            &lost,
            has_validation,
        )?)
    }

    /// Checks that no file is damaged or missing, except the repaired ones. `repaired` is none if no repair was requested.
    ///
    /// # Errors
    /// [`JobError::Failed`] with the files and the remedy.
    pub fn require_good(&self, repaired: Option<&[String]>) -> Result<(), JobError> {
        let is_left = |finding: &&Finding| repaired.is_none_or(|names| !names.contains(&finding.name));
        let left: Vec<&Finding> = self.lost().filter(is_left).collect();
        if left.is_empty() {
            return Ok(());
        }
        let remedy = if left.iter().any(|finding| finding.name == VALIDATION) {
            format!("; `rattlemap validate` recreates {VALIDATION} and its section of the report")
        } else if repaired.is_none() && self.command == MAP {
            format!("; `{}` recreates tables, figures and report from the records", repair_command(&self.dir))
        } else {
            String::new()
        };
        Err(JobError::Failed(format!("{}{remedy}", damage(&self.dir, left))))
    }
}
