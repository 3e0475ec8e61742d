//! Reads the folder of a finished map or of a finished shard: its manifest, its scene and its records.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::Value;
use thiserror::Error;

use crate::map::plan::Plan;
use crate::map::scene::{CompanionFile, FileText, Purpose, Scene, SceneError};
use crate::map::schedule::Refined;
use crate::map::shard::Shard;
use crate::record::RecordStore;
use crate::show::provenance::Provenance;
use crate::store::file_names::{LIST, MANIFEST, RECORDS};
use crate::store::inventory::{self, FileEntry, has_seal};
use crate::store::manifest::FORMAT;
use crate::store::plain_file::read_text;
use crate::store::record_file::{Damage, Extent, Identity, RecordFileError};
use crate::store::run_records::Work;
use crate::text::shell::quoted;

/// Largest size of a scene's table of cells, in bytes.
pub(crate) const MOST_TABLE_BYTES: u64 = 256_000_000;
/// Largest size of a folder's copy of that table. It spells out numbers such as 1e15.
pub(crate) const MOST_LIST_BYTES: u64 = 4 * MOST_TABLE_BYTES;

/// Why the folder of a finished map cannot be read.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the fields")]
pub enum FinishedMapError {
    /// The folder does not exist.
    #[error("{}: there is no such folder; name the folder of a finished map", .folder.display())]
    NoFolder { folder: PathBuf },
    /// The folder has neither a manifest nor records.
    #[error("{}: there is no {MANIFEST}; it is not the folder of a map: `rattlemap map SCENE` makes one", .folder.display())]
    NoManifest { folder: PathBuf },
    /// The folder has records, but no manifest.
    #[error("{}: there is no {MANIFEST}; {run} is unfinished: resume it with `{command}`", .folder.display())]
    Unfinished { folder: PathBuf, run: String, command: String },
    /// The manifest cannot be read, or is not one.
    #[error("{}: this is not the manifest of a map: {reason}", .manifest.display())]
    Unreadable { manifest: PathBuf, reason: String },
    /// The manifest was changed.
    #[error(
        "{}: {MANIFEST} is damaged: its contents are not what they were; write the files again with --force",
        .folder.display()
    )]
    Damaged { folder: PathBuf },
    /// Another command made the folder.
    #[error("{}: this is not the manifest of a map, but of `{}`", .manifest.display(), .command.escape_debug())]
    OtherCommand { manifest: PathBuf, command: String },
    /// The folder has another format.
    #[error("{}: the folder is of format {format}, and this version reads format {FORMAT}; make it again with --force", .manifest.display())]
    OtherFormat { manifest: PathBuf, format: String },
    /// Another version of the program computed the map.
    #[error(
        "{}: the map was made by rattlemap {}, this is {}; use that version, or make the map again with \
         `rattlemap map --force`",
        .manifest.display(), .version.escape_debug(), env!("CARGO_PKG_VERSION")
    )]
    OtherVersion { manifest: PathBuf, version: String },
    /// The folder is a shard's.
    #[error(
        "{}: this is shard {shard} of a map, which has neither tables nor figures; `rattlemap merge OUT PART...` makes the \
         map of all {} shards",
        .folder.display(), .shard.count()
    )]
    IsShard { folder: PathBuf, shard: Shard },
    /// The scene in the manifest is not valid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The folder has no record file.
    #[error(
        "{}: there is no {RECORDS}, and cells cannot be replayed from tables; make the map again with `rattlemap map SCENE --force`",
        .folder.display()
    )]
    NoRecords { folder: PathBuf },
    /// Records are missing.
    #[error(
        "{}: {}{count} of {expected} {unit} are there; `{command}` keeps them and computes the others",
        .path.display(), .damage.as_ref().map_or(String::new(), |damage| format!("{damage}: "))
    )]
    Incomplete {
        path: PathBuf,
        damage: Option<Damage>,
        count: usize,
        expected: usize,
        unit: &'static str,
        command: String,
    },
    /// The records belong to another run than the manifest.
    #[error("{} does not belong to the {MANIFEST} in its folder: {differences}; make the map again with `{command}`", .path.display())]
    OtherRecords { path: PathBuf, differences: String, command: String },
    /// The record file cannot be read.
    #[error(transparent)]
    Records(#[from] RecordFileError),
}

impl FinishedMapError {
    /// Whether the caller named a wrong folder; otherwise the folder is damaged.
    pub fn is_usage(&self) -> bool {
        !matches!(
            self,
            FinishedMapError::Records(RecordFileError::Damaged { .. })
                | FinishedMapError::Incomplete { damage: Some(_), .. }
        )
    }
}

/// Reads the manifest of a folder that any command made.
///
/// # Errors
/// [`FinishedMapError`] if there is none, or if it is not JSON.
pub fn read_manifest(folder: &Path) -> Result<Value, FinishedMapError> {
    if !folder.is_dir() {
        return Err(FinishedMapError::NoFolder { folder: folder.to_owned() });
    }
    let manifest = folder.join(MANIFEST);
    if !manifest.is_file() {
        return Err(unfinished(folder));
    }
    let text = inventory::text(folder).map_err(|error| unreadable(folder, error))?;
    serde_json::from_str(&text).map_err(|error| unreadable(folder, error))
}

/// Describes a folder without a manifest: a run that can be resumed, or none.
fn unfinished(folder: &Path) -> FinishedMapError {
    let (folder, records) = (folder.to_owned(), folder.join(RECORDS));
    if !records.is_file() {
        return FinishedMapError::NoManifest { folder };
    }
    let identity = Identity::read(&records).ok().flatten();
    let shard = identity
        .as_ref()
        .and_then(|identity| identity.shard().map(|shard| (shard, identity.engine(), identity.precision())));
    let run = shard.map_or("the run".to_owned(), |(shard, ..)| format!("shard {shard}"));
    let command = command(Some(&folder), shard, &[], "--resume");
    FinishedMapError::Unfinished { folder, run, command }
}

fn unreadable(folder: &Path, error: impl ToString) -> FinishedMapError {
    FinishedMapError::Unreadable { manifest: folder.join(MANIFEST), reason: error.to_string() }
}

/// Refuses the manifest of another format.
///
/// # Errors
/// [`FinishedMapError::OtherFormat`].
pub fn require_format(folder: &Path, manifest: &Value) -> Result<(), FinishedMapError> {
    match manifest["format"].as_u64() {
        Some(format) if format == u64::from(FORMAT) => Ok(()),
        format => {
            let format = format.map_or("unknown".to_owned(), |format| format.to_string());
            Err(FinishedMapError::OtherFormat { manifest: folder.join(MANIFEST), format })
        }
    }
}

/// Reads the manifest of a folder with tables: a whole map's, or a bifurcation diagram's.
///
/// # Errors
/// [`FinishedMapError`] if the folder is not one of these, not finished, or of another format, or if the manifest is damaged.
pub fn read_tables(folder: &Path) -> Result<Value, FinishedMapError> {
    let manifest = manifest_of(folder, &["map", "bifurcation"])?;
    match Option::<Shard>::deserialize(&manifest["shard"]) {
        Ok(None) if has_seal(&manifest) => Ok(manifest),
        Ok(None) => Err(FinishedMapError::Damaged { folder: folder.to_owned() }),
        Ok(Some(shard)) => Err(FinishedMapError::IsShard { folder: folder.to_owned(), shard }),
        Err(error) => Err(unreadable(folder, error)),
    }
}

/// Reads the manifest of a folder that one of these commands made.
fn manifest_of(folder: &Path, commands: &[&str]) -> Result<Value, FinishedMapError> {
    let manifest = read_manifest(folder)?;
    let command = manifest["command"].as_str().unwrap_or("something else");
    if !commands.contains(&command) {
        let command = command.to_owned();
        return Err(FinishedMapError::OtherCommand { manifest: folder.join(MANIFEST), command });
    }
    require_format(folder, &manifest)?;
    Ok(manifest)
}

/// Fields of the manifest of a map or a shard that are read again.
#[derive(Clone, Debug, Deserialize)]
#[expect(missing_docs, reason = "named as in the file")]
pub struct StoredManifest {
    pub engine: String,
    pub precision: String,
    pub device: String,
    pub processor: String,
    pub crate_version: String,
    pub commit: String,
    pub sources: String,
    pub target: String,
    pub scene: String,
    /// The `--set` arguments.
    pub set: Vec<String>,
    pub shard: Option<Shard>,
    pub elapsed_seconds: f64,
    pub files: Vec<FileEntry>,
    model: Value,
    integration: Value,
    timings: Value,
}

impl StoredManifest {
    /// Returns how the map was computed.
    pub fn provenance(&self) -> Provenance<'_> {
        let StoredManifest { engine, precision, device, commit, .. } = self;
        Provenance { engine, precision, device, commit }
    }

    /// The smallest and the largest number of free steps that lanes took per forcing period.
    pub(crate) fn lane_grid(&self) -> Option<[u32; 2]> {
        let steps = |name: &str| u32::try_from(self.integration[name].as_u64()?).ok();
        Some([steps("least_steps_used")?, steps("most_steps_used")?])
    }

    /// Seconds until the engine was ready.
    pub(crate) fn opening_seconds(&self) -> f64 {
        self.timings["open"].as_f64().unwrap_or_default()
    }

    /// Returns the command that computes a shard of the same map; into `out`, if that is given.
    pub(crate) fn shard_command(&self, shard: Shard, out: Option<&Path>) -> String {
        command(out, Some((shard, &self.engine, &self.precision)), &self.set, "--resume")
    }
}

/// Returns the command that computes a map or a shard, with its engine and precision.
fn command(out: Option<&Path>, shard: Option<(Shard, &str, &str)>, sets: &[String], last: &str) -> String {
    let mut words = vec!["rattlemap map SCENE".to_owned()];
    words.extend(out.map(|out| format!("--out {}", quoted(&out.display().to_string()))));
    if let Some((shard, engine, precision)) = shard {
        words.push(format!("--engine {}", quoted(engine)));
        words.extend((engine == "gpu").then(|| format!("--precision {}", quoted(precision))));
        words.push(format!("--shard {shard}"));
    }
    words.extend(sets.iter().map(|set| format!("--set {}", quoted(set))));
    words.push(last.to_owned());
    words.join(" ")
}

/// The folder of a finished map or shard.
#[derive(Clone, Debug)]
pub struct FinishedMap {
    folder: PathBuf,
    manifest: StoredManifest,
}

/// Records of a finished map.
#[derive(Debug)]
pub struct StoredRecords {
    /// Records by run.
    pub records: RecordStore,
    /// Refinement of an adaptive map.
    pub refined: Option<Refined>,
    /// Damage behind the last record, to be reported.
    pub warning: Option<String>,
}

impl FinishedMap {
    /// Reads the manifest of a map or of a shard.
    ///
    /// # Errors
    /// [`FinishedMapError`] if the folder is not one of these, not finished, or of another format.
    pub fn open_part(folder: &Path) -> Result<FinishedMap, FinishedMapError> {
        let manifest = serde_json::from_value(manifest_of(folder, &["map"])?);
        let manifest = manifest.map_err(|error| unreadable(folder, error))?;
        Ok(FinishedMap { folder: folder.to_owned(), manifest })
    }

    /// Reads the manifest of a whole map that any version of the program computed.
    ///
    /// # Errors
    /// As [`FinishedMap::open_part`], and for a shard.
    pub fn open(folder: &Path) -> Result<FinishedMap, FinishedMapError> {
        let map = FinishedMap::open_part(folder)?;
        match map.manifest.shard {
            None => Ok(map),
            Some(shard) => Err(FinishedMapError::IsShard { folder: folder.to_owned(), shard }),
        }
    }

    /// Reads the manifest of a whole map whose cells this version of the program can compute again.
    ///
    /// # Errors
    /// As [`FinishedMap::open`], and for a map of another version.
    pub fn open_own(folder: &Path) -> Result<FinishedMap, FinishedMapError> {
        let map = FinishedMap::open(folder)?;
        let version = map.manifest.crate_version.clone();
        match version == env!("CARGO_PKG_VERSION") {
            true => Ok(map),
            false => Err(FinishedMapError::OtherVersion { manifest: folder.join(MANIFEST), version }),
        }
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The manifest.
    pub fn manifest(&self) -> &StoredManifest {
        &self.manifest
    }

    /// Whether a run of this scene with these `--set` arguments writes this manifest, apart from what it measures.
    pub fn is_of(&self, scene: &Scene, sets: &[String]) -> bool {
        self.manifest.scene == scene.text() && self.manifest.set == sets
    }

    /// Parses the scene. Its list and its model are the folder's copies: the scene's own files may have changed.
    ///
    /// # Errors
    /// [`FinishedMapError::Scene`] if it is not valid.
    pub fn scene(&self) -> Result<Scene, FinishedMapError> {
        let name = self.folder.join(MANIFEST).display().to_string();
        let find = |what, _: &str| {
            if what == CompanionFile::Model {
                let text = self.manifest.model["text"].as_str();
                let text = text.ok_or("is not in the manifest; make the map again with --force")?;
                return Ok(FileText { name: format!("{name}, model"), text: text.to_owned() });
            }
            if !self.manifest.files.iter().any(|file| file.name == LIST) {
                return Err(format!(
                    "is needed, and {MANIFEST} lists no {LIST}; make the map again with --force"
                ));
            }
            let path = self.folder.join(LIST);
            let text = read_text(&path, MOST_LIST_BYTES, "list fewer cells").map_err(|error| {
                format!(
                    "was copied to {}, which cannot be read ({error}); make the map again with --force",
                    path.display()
                )
            })?;
            Ok(FileText { name: path.display().to_string(), text })
        };
        Ok(Scene::parse_with_files(
            &self.manifest.scene,
            &name,
            &self.manifest.set,
            Purpose::Map,
            None,
            &find,
        )?)
    }

    /// Reads the records of a whole map.
    ///
    /// # Errors
    /// [`FinishedMapError`] if records are missing, damaged or another run's.
    pub fn records(&self, scene: &Scene, plan: &Plan) -> Result<StoredRecords, FinishedMapError> {
        let path = self.folder.join(RECORDS);
        if !path.is_file() {
            return Err(FinishedMapError::NoRecords { folder: self.folder.clone() });
        }
        let StoredManifest { engine, precision, device, sources, target, .. } = &self.manifest;
        let identity = Identity::new(engine, precision, device, scene.identity())
            .of_coordinates(scene.coordinates())
            .built_from(sources, target);
        let mut work = Work::new(plan, None, true);
        let Extent { count, damage, .. } = work.read(&path, &identity).map_err(|error| match error {
            RecordFileError::OtherRun { path, differences } => {
                let StoredManifest { set, .. } = &self.manifest;
                let command = command(Some(&self.folder), None, set, "--force");
                FinishedMapError::OtherRecords { path, differences, command }
            }
            error => error.into(),
        })?;
        let Work { schedule, mut records, .. } = work;
        let unit = plan.unit();
        if !schedule.is_finished() {
            let (expected, command) = (schedule.expected(), self.remake_command());
            return Err(FinishedMapError::Incomplete { path, damage, count, expected, unit, command });
        }
        let warning =
            damage.map(|damage| format!("{}: {damage}; all {count} {unit} are there", path.display()));
        let refined = schedule.finish(&mut records);
        Ok(StoredRecords { records, refined, warning })
    }

    /// Returns the command that writes all files anew: with `--resume` if the records can be read.
    pub fn remake_command(&self) -> String {
        let is_readable = matches!(Identity::read(&self.folder.join(RECORDS)), Ok(Some(_)));
        let last = if is_readable { "--resume" } else { "--force" };
        let StoredManifest { engine, precision, set, shard, .. } = &self.manifest;
        command(Some(&self.folder), shard.map(|shard| (shard, &**engine, &**precision)), set, last)
    }
}
