//! Compares the files of a folder with its manifest, and recreates those of a map from its records.

use std::path::{Path, PathBuf};

use crate::job::error::JobError;
use crate::job::finished::{self, LoadedMap, damage, repair_command};
use crate::job::observer::Observer;
use crate::map::scene::Scene;
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
    let command = manifest["command"].as_str().unwrap_or_default();
    CheckedFolder::of(dir, command, &files)
}

impl CheckedFolder {
    /// Compares size and hash of the files that the manifest of a command lists.
    ///
    /// # Errors
    /// [`JobError`] if the folder cannot be read.
    pub(crate) fn of(dir: &Path, command: &str, listed: &[FileEntry]) -> Result<CheckedFolder, JobError> {
        let findings = inventory::check(dir, listed)
            .map_err(|error| JobError::Failed(format!("cannot read {}: {error}", dir.display())))?;
        Ok(CheckedFolder { dir: dir.to_owned(), command: command.to_owned(), files: listed.len(), findings })
    }

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
        let lost: Vec<&str> = self.lost().map(|finding| finding.name.as_str()).collect();
        if lost.is_empty() {
            return Ok(Vec::new());
        }
        let (map, scene) = self.repairable().map_err(|error| match error {
            JobError::Failed(why) => JobError::Failed(format!("{}; {why}", damage(&self.dir, self.lost()))),
            error => error,
        })?;
        folder.prepare(map::names_of(&scene))?;
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

    /// Checks that a map's damaged and missing files can be recreated from its records. Returns the map and its scene.
    ///
    /// # Errors
    /// [`JobError`] with the reason and the remedy.
    fn repairable(&self) -> Result<(FinishedMap, Scene), JobError> {
        let failed = |why| Err(JobError::Failed(why));
        if self.command != MAP {
            return failed(format!(
                "only the files of a map can be recreated from records; run `{}` again with --force",
                self.command.escape_debug()
            ));
        }
        let part = FinishedMap::open_part(&self.dir)?;
        let remake = part.remake_command();
        if let Some(shard) = part.manifest().shard {
            return failed(format!(
                "no file of shard {shard} can be recreated from the others; `{remake}` keeps the undamaged records, computes \
                 the others and writes the files again"
            ));
        }
        let map = FinishedMap::open_own(&self.dir)?;
        for name in self.lost().map(|finding| finding.name.as_str()) {
            return failed(match name {
                MANIFEST => format!("{MANIFEST} cannot be trusted; `{remake}` recreates every file"),
                RECORDS => format!(
                    "{RECORDS} cannot be recreated from other files; `{remake}` keeps its undamaged records, computes the \
                     others and recreates every file"
                ),
                LIST => format!(
                    "no other file than {LIST} lists the cells; `{remake}` recreates every file from the scene's own table"
                ),
                _ => continue,
            });
        }
        let scene = finished::scene(&map)?;
        let known = map::names_of(&scene);
        if let Some(Finding { name, .. }) = self.lost().find(|finding| !known.contains(&finding.name)) {
            let name = name.escape_debug();
            return failed(format!("a map has no file {name}; `{remake}` recreates every file"));
        }
        Ok((map, scene))
    }

    /// Checks that no file is damaged or missing, except those that were `written` since the check. `is_repaired` says
    /// whether a repair has been tried.
    ///
    /// # Errors
    /// [`JobError::Failed`] with the files and the remedy.
    pub fn require_good(&self, written: &[impl AsRef<str>], is_repaired: bool) -> Result<(), JobError> {
        let is_left = |finding: &&Finding| !written.iter().any(|name| name.as_ref() == finding.name);
        let left: Vec<&Finding> = self.lost().filter(is_left).collect();
        if left.is_empty() {
            return Ok(());
        }
        let (validation, others): (Vec<&Finding>, Vec<&Finding>) =
            left.iter().partition(|finding| finding.name == VALIDATION);
        let mut text = damage(&self.dir, left);
        if !others.is_empty() && !is_repaired {
            text += &match self.repairable() {
                Ok(_) => format!(
                    "; `{}` recreates tables, figures and report from the records",
                    repair_command(&self.dir)
                ),
                Err(why) => format!("; {why}"),
            };
        }
        if !validation.is_empty() {
            text += &format!("; `rattlemap validate` recreates {VALIDATION} and its section of the report");
        }
        Err(JobError::Failed(text))
    }
}
