//! The folder of a shard, read: which part of which map it is, and whether it is finished.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::map::plan::Plan;
use crate::map::scene::{CompanionFile, FileText, Purpose, Scene};
use crate::map::shard::Shard;
use crate::record::Record;
use crate::store::inventory::{self, FileEntry};
use crate::store::manifest::{FORMAT, MANIFEST};
use crate::store::map::LIST;
use crate::store::merge::error::{MergeError, Unfinished};
use crate::store::record_file::{Identity, Order, RECORDS, RecordFile, RecordFileError};
use crate::text::shell::quoted;

/// What a shard's manifest says.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Manifest {
    format: u32,
    command: String,
    shard: Option<Shard>,
    pub(crate) engine: String,
    pub(crate) precision: String,
    pub(crate) device: String,
    pub(crate) processor: String,
    pub(crate) sources: String,
    pub(crate) target: String,
    scene: String,
    pub(crate) set: Vec<String>,
    model: Model,
    integration: Integration,
    pub(crate) elapsed_seconds: f64,
    pub(crate) timings: Timings,
    files: Vec<FileEntry>,
}

#[derive(Clone, Debug, Deserialize)]
struct Model {
    text: Option<String>,
}

#[derive(Clone, Debug, Deserialize)]
struct Integration {
    least_steps_used: Option<u32>,
    most_steps_used: Option<u32>,
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Timings {
    pub(crate) open: f64,
}

impl Manifest {
    /// The least and the most free steps of lanes per forcing period.
    pub(crate) fn lane_grid(&self) -> Option<[u32; 2]> {
        Some([self.integration.least_steps_used?, self.integration.most_steps_used?])
    }

    /// The scene of the map, from the folder's own copies of what it names.
    pub(crate) fn scene(&self, folder: &Path) -> Result<Scene, MergeError> {
        let name = folder.join(MANIFEST).display().to_string();
        let find = |what, _: &str| {
            if what == CompanionFile::Model {
                let text = self.model.text.clone().ok_or("is not told by the manifest")?;
                return Ok(FileText { name: format!("{name}, model"), text });
            }
            let path = folder.join(LIST);
            let text = fs::read_to_string(&path).map_err(|error| {
                format!("was copied to {}, which cannot be read ({error})", path.display())
            })?;
            Ok(FileText { name: path.display().to_string(), text })
        };
        Ok(Scene::parse_with_files(&self.scene, &name, &self.set, Purpose::Map, None, &find)?)
    }

    /// The command that makes a shard, if it names a folder in that one.
    pub(crate) fn command(&self, shard: Shard, folder: Option<&Path>) -> String {
        command(&self.engine, &self.precision, &self.set, shard, folder)
    }
}

fn command(engine: &str, precision: &str, sets: &[String], shard: Shard, folder: Option<&Path>) -> String {
    let mut words = vec!["rattlemap map SCENE".to_owned()];
    words.extend(folder.map(|folder| format!("--out {}", quoted(&folder.display().to_string()))));
    words.push(format!("--engine {}", quoted(engine)));
    words.extend((engine == "gpu").then(|| format!("--precision {}", quoted(precision))));
    words.push(format!("--shard {shard}"));
    words.extend(sets.iter().map(|set| format!("--set {}", quoted(set))));
    words.push("--resume".to_owned());
    words.join(" ")
}

/// A folder that was looked at.
pub(crate) enum Seen {
    Finished(Box<Part>),
    Unfinished(Begun),
}

/// A finished shard.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) folder: PathBuf,
    pub(crate) shard: Shard,
    pub(crate) identity: Identity,
    pub(crate) manifest: Manifest,
}

/// A shard that was begun.
pub(crate) struct Begun {
    pub(crate) folder: PathBuf,
    /// None where nothing was kept yet.
    pub(crate) identity: Option<Identity>,
}

impl Seen {
    /// Looks at a folder, and reads none of its records.
    pub(crate) fn at(folder: &Path) -> Result<Seen, MergeError> {
        let part = || folder.to_owned();
        let no_shard = |why: String| MergeError::NoShard { part: part(), why };
        if !folder.is_dir() {
            return Err(MergeError::NoFolder { part: part() });
        }
        let path = folder.join(MANIFEST);
        let manifest = path.is_file().then(|| fs::read_to_string(&path)).transpose();
        let manifest = manifest.map_err(|error| no_shard(format!("{MANIFEST} cannot be read: {error}")))?;
        let records = folder.join(RECORDS);
        let identity = match records.is_file().then(|| Identity::read(&records)).transpose() {
            Ok(identity) => identity.flatten(),
            Err(RecordFileError::Damaged { at, what, .. }) => {
                return Err(no_shard(format!("{RECORDS} is damaged at byte {at}: {what}")));
            }
            Err(other) => return Err(other.into()),
        };
        if identity.as_ref().is_some_and(|identity| identity.shard().is_none()) {
            return Err(MergeError::WholeMap { part: part() });
        }
        let Some(text) = manifest else {
            return match records.is_file() {
                true => Ok(Seen::Unfinished(Begun { folder: part(), identity })),
                false => Err(no_shard(format!("there is no {RECORDS}"))),
            };
        };
        let manifest: Manifest =
            serde_json::from_str(&text).map_err(|error| no_shard(format!("{MANIFEST}: {error}")))?;
        if manifest.command != "map" {
            return Err(no_shard(format!("{MANIFEST} is of `{}`", manifest.command)));
        }
        if manifest.format != FORMAT {
            let format = manifest.format;
            return Err(no_shard(format!(
                "it is of format {format}, and this version reads format {FORMAT}"
            )));
        }
        let Some(shard) = manifest.shard else { return Err(MergeError::WholeMap { part: part() }) };
        let Some(identity) = identity else {
            let (what, command) = (format!("{RECORDS} is missing"), manifest.command(shard, Some(folder)));
            return Err(MergeError::Damaged { part: part(), what, command });
        };
        let found = Part { folder: part(), shard, identity, manifest };
        found.check(&text)?;
        Ok(Seen::Finished(Box::new(found)))
    }
}

impl Part {
    /// Refuses files that are not what they were. Records have checksums of their own, and are read once, later.
    fn check(&self, manifest: &str) -> Result<(), MergeError> {
        if !inventory::is_sealed(manifest) {
            return Err(self.damaged(format!("{MANIFEST} is damaged")));
        }
        let Manifest { engine, precision, device, sources, target, files, .. } = &self.manifest;
        let told = [engine, precision, device, sources, target].map(String::as_str);
        if self.identity.shard() != Some(self.shard) || self.identity.told() != told {
            return Err(self.damaged(format!("{RECORDS} does not belong to the {MANIFEST} beside it")));
        }
        let copies: Vec<FileEntry> = files.iter().filter(|file| file.name != RECORDS).cloned().collect();
        let findings = inventory::check(&self.folder, &copies)
            .map_err(|error| self.damaged(format!("it cannot be read ({error})")))?;
        match findings.iter().find(|finding| finding.is_lost()) {
            Some(finding) => Err(self.damaged(finding.to_string())),
            None => Ok(()),
        }
    }

    pub(crate) fn damaged(&self, what: String) -> MergeError {
        let command = self.manifest.command(self.shard, Some(&self.folder));
        MergeError::Damaged { part: self.folder.clone(), what, command }
    }

    /// Hands over its records, batch by batch; what is wrong with the file, if anything is.
    pub(crate) fn read(
        &self,
        take: impl FnMut(&[(u32, Record)]) -> bool,
    ) -> Result<Option<String>, MergeError> {
        let path = self.folder.join(RECORDS);
        match RecordFile::read(&path, &self.identity, Order::Any, take) {
            Ok(extent) => Ok(extent.damage.map(|damage| damage.to_string())),
            Err(RecordFileError::Damaged { at, what, .. }) => {
                Err(self.damaged(format!("{RECORDS} is damaged at byte {at}: {what}")))
            }
            Err(other) => Err(other.into()),
        }
    }
}

impl Begun {
    /// What it has, and how to go on; a finished part, if there is one, tells the settings, its plan the number of runs.
    pub(crate) fn unfinished(&self, of: Option<(&Part, &Plan)>) -> Unfinished {
        let shard = self.identity.as_ref().and_then(Identity::shard);
        let kept = self.identity.as_ref().and_then(|identity| {
            RecordFile::read(&self.folder.join(RECORDS), identity, Order::Any, |_| true).ok()
        });
        let sets = of.map_or(&[][..], |(part, _)| &part.manifest.set);
        let command = match (&self.identity, shard) {
            (Some(identity), Some(shard)) => {
                command(identity.engine(), identity.precision(), sets, shard, Some(&self.folder))
            }
            _ => format!(
                "rattlemap map SCENE --out {} --engine E --shard I/N --resume",
                quoted(&self.folder.display().to_string())
            ),
        };
        Unfinished {
            part: self.folder.clone(),
            shard,
            kept: kept.map_or(0, |extent| extent.count),
            of: of.zip(shard).map(|((_, plan), shard)| shard.run_count(plan)),
            command,
        }
    }
}
