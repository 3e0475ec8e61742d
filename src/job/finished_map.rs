//! The folder of a finished map, read: its manifest, its scene, its records, and whether its files are what they were.

use std::fs;
use std::path::{Path, PathBuf};

use crate::job::kept::order;
use crate::map::plan::Plan;
use crate::map::scene::{CompanionFile, FileText, Purpose, Scene};
use crate::map::schedule::{Refined, Schedule};
use crate::map::shard::Shard;
use crate::map::sweep;
use crate::record::Record;
use crate::store::inventory::{self, FileEntry, Finding};
use crate::store::manifest::{FORMAT, MANIFEST};
use crate::store::map::LIST;
use crate::store::record_file::{Extent, Identity, RECORDS, RecordFile, RecordFileError};
use crate::text::shell::quoted;
use anyhow::{Context, anyhow};
use serde::Deserialize;
use serde_json::Value;

use crate::cli::say;
use crate::job::capacity;
use crate::job::error::Failure;
use crate::job::scene_file::{MOST_OF_COPY, read_table};

/// What a map's manifest has to say.
#[derive(Deserialize)]
pub(crate) struct Manifest {
    pub(crate) engine: String,
    pub(crate) precision: String,
    pub(crate) device: String,
    pub(crate) crate_version: String,
    pub(crate) commit: String,
    sources: String,
    target: String,
    scene: String,
    set: Vec<String>,
    model: Option<ModelObject>,
    shard: Option<Shard>,
    pub(crate) files: Vec<FileEntry>,
}

/// The model of a map: its file's text, where it has one.
#[derive(Deserialize)]
struct ModelObject {
    text: Option<String>,
}

/// Refuses what is no folder.
pub(crate) fn require_folder(dir: &Path) -> Result<(), Failure> {
    match dir.is_dir() {
        true => Ok(()),
        false => Err(Failure::Usage(anyhow!(
            "{}: there is no such folder; name the folder of a finished map",
            dir.display()
        ))),
    }
}

/// The manifest of any command, of this version's format.
pub(crate) fn read_json(dir: &Path) -> anyhow::Result<Value> {
    let path = dir.join(MANIFEST);
    if !path.is_file() {
        let records = dir.join(RECORDS);
        let shard = Identity::read(&records).ok().flatten().and_then(|identity| identity.shard());
        let advice = match shard {
            Some(shard) => {
                format!(
                    "shard {shard} is unfinished: go on with `rattlemap map SCENE --engine E --shard {shard} --resume`"
                )
            }
            None if records.is_file() => {
                "the run is unfinished: go on with `rattlemap map SCENE --resume`".to_owned()
            }
            None => "it is not the folder of a map: `rattlemap map SCENE` makes one".to_owned(),
        };
        return Err(anyhow!("{}: there is no {MANIFEST}; {advice}", dir.display()));
    }
    let foreign = || format!("{}: this is not the manifest of a map", path.display());
    let text = fs::read_to_string(&path).with_context(foreign)?;
    serde_json::from_str(&text).with_context(foreign)
}

/// Refuses the manifest of an earlier version.
pub(crate) fn require_format(dir: &Path, manifest: &Value) -> anyhow::Result<()> {
    match manifest["format"].as_u64() {
        Some(format) if format == u64::from(FORMAT) => Ok(()),
        format => Err(anyhow!(
            "{}: the folder is of format {}, and this version reads format {FORMAT}; make it again with --force",
            dir.join(MANIFEST).display(),
            format.map_or("unknown".to_owned(), |format| format.to_string())
        )),
    }
}

impl Manifest {
    /// Reads the manifest of a map that this version made.
    pub(crate) fn read(dir: &Path) -> Result<Manifest, Failure> {
        let manifest = Manifest::read_of_any_version(dir)?;
        let own = env!("CARGO_PKG_VERSION");
        if manifest.crate_version != own {
            return Err(Failure::Usage(anyhow!(
                "{}: the map was made by rattlemap {}, this is {own}; use that version, or make it again with \
                 `rattlemap map --force`",
                dir.join(MANIFEST).display(),
                manifest.crate_version.escape_debug()
            )));
        }
        Ok(manifest)
    }

    /// The same of a map that any version made which wrote this format: for those who compute nothing.
    pub(crate) fn read_of_any_version(dir: &Path) -> Result<Manifest, Failure> {
        let manifest = Manifest::read_part(dir)?;
        match manifest.shard {
            None => Ok(manifest),
            Some(shard) => Err(Failure::Usage(anyhow!(
                "{}: this is shard {shard} of a map, which has neither tables nor figures; `rattlemap merge OUT PART...` \
                 makes the map of all {} shards",
                dir.display(),
                shard.count()
            ))),
        }
    }

    /// The same of a map or a shard of one.
    pub(crate) fn read_part(dir: &Path) -> Result<Manifest, Failure> {
        Manifest::of(dir).map_err(Failure::Usage)
    }

    /// The part of the map that it is; none where it is the whole.
    pub(crate) fn shard(&self) -> Option<Shard> {
        self.shard
    }

    /// Whether a run of this scene with these settings writes the same manifest, but for what it measures.
    pub(crate) fn is_of(&self, scene: &Scene, sets: &[String]) -> bool {
        self.scene == scene.text() && self.set == sets
    }

    fn of(dir: &Path) -> anyhow::Result<Manifest> {
        let path = dir.join(MANIFEST);
        let manifest = read_json(dir)?;
        if manifest["command"] != "map" {
            let made = manifest["command"].as_str().unwrap_or("something else").escape_debug();
            return Err(anyhow!("{}: this is not the manifest of a map, but of `{made}`", path.display()));
        }
        require_format(dir, &manifest)?;
        serde_json::from_value(manifest)
            .with_context(|| format!("{}: this is not the manifest of a map", path.display()))
    }

    /// The scene, if its map fits this machine.
    pub(crate) fn scene(&self, dir: &Path) -> Result<FinishedMap<'_>, Failure> {
        let name = dir.join(MANIFEST).display().to_string();
        // The folder's own copy: the file that the scene names may be elsewhere by now, or another.
        let find = |what, _: &str| {
            if what == CompanionFile::Model {
                let text = self.model.as_ref().and_then(|model| model.text.clone());
                let text = text.ok_or("is not told by the manifest; make the map again with --force")?;
                return Ok(FileText { name: format!("{name}, model"), text });
            }
            let path = dir.join(LIST);
            let text = read_table(&path, MOST_OF_COPY).map_err(|error| {
                format!(
                    "was copied to {}, which cannot be read ({error}); make the map again with --force",
                    path.display()
                )
            })?;
            Ok(FileText { name: path.display().to_string(), text })
        };
        let scene = Scene::parse_with_files(&self.scene, &name, &self.set, Purpose::Map, None, &find)?;
        capacity::check_finished(&scene)?;
        Ok(FinishedMap { manifest: self, dir: dir.to_owned(), scene })
    }

    /// The command that makes all files anew: from what is good of the records, if anything is.
    pub(crate) fn remake_command(&self, dir: &Path) -> String {
        let is_readable = matches!(Identity::read(&dir.join(RECORDS)), Ok(Some(_)));
        let how = if is_readable { "--resume" } else { "--force" };
        let sets: String = self.set.iter().map(|set| format!(" --set {}", quoted(set))).collect();
        let out = quoted(&dir.display().to_string());
        let Manifest { engine, precision, .. } = self;
        let part = self.shard.map_or(String::new(), |shard| {
            format!(" --engine {} --precision {} --shard {shard}", quoted(engine), quoted(precision))
        });
        format!("rattlemap map SCENE --out {out}{part}{sets} {how}")
    }
}

/// A map as its folder tells it.
pub(crate) struct FinishedMap<'m> {
    manifest: &'m Manifest,
    dir: PathBuf,
    pub(crate) scene: Scene,
}

impl FinishedMap<'_> {
    /// Its cells, each with a motion.
    pub(crate) fn plan(&self) -> Result<Plan, Failure> {
        let plan = Plan::new(&self.scene);
        plan.check()?;
        Ok(plan)
    }

    /// One record per run, and what became of an adaptive map.
    pub(crate) fn records(&self, plan: &Plan) -> Result<(Vec<Record>, Option<Refined>), Failure> {
        let (dir, path) = (self.dir.display(), self.dir.join(RECORDS));
        if !path.is_file() {
            return Err(Failure::Usage(anyhow!(
                "{dir}: there is no {RECORDS}; tables alone cannot be replayed: make the map again with \
                 `rattlemap map SCENE --force`"
            )));
        }
        let Manifest { engine, precision, device, sources, target, .. } = self.manifest;
        let identity =
            Identity::new(engine, precision, device, self.scene.identity()).built_from(sources, target);
        let mut schedule = Schedule::new(plan);
        let mut records = vec![Record::default(); plan.run_count()];
        let order = order(&schedule);
        let take =
            |batch: &[(u32, Record)]| plan.admits(batch) && sweep::replay(&mut schedule, &mut records, batch);
        let read = RecordFile::read(&path, &identity, order, take).map_err(unreadable)?;
        let Extent { count, damage, .. } = read;
        let unit = plan.unit();
        if !schedule.is_finished() {
            let cells = schedule.expected();
            let go_on =
                format!("`{}` keeps them and computes the others", self.manifest.remake_command(&self.dir));
            let told = damage.as_ref().map_or(String::new(), |damage| format!("{damage}: "));
            let error = anyhow!("{}: {told}{count} of {cells} {unit} are there; {go_on}", path.display());
            return Err(if damage.is_some() { Failure::Run(error) } else { Failure::Usage(error) });
        }
        // Nothing is missing: it stands behind the last cell.
        if let Some(damage) = damage {
            say::note(format_args!("warning: {}: {damage}; all {count} {unit} are there", path.display()));
        }
        let refined = schedule.finish(&mut records);
        Ok((records, refined))
    }
}

fn unreadable(error: RecordFileError) -> Failure {
    const AGAIN: &str = "make the map again with `rattlemap map SCENE --force`";
    match error {
        RecordFileError::OtherRun { path, differences } => Failure::Usage(anyhow!(
            "{} does not belong to the {MANIFEST} beside it: {differences}; {AGAIN}",
            path.display()
        )),
        RecordFileError::Damaged { path, at, what } => {
            Failure::Run(anyhow!("{} is damaged at byte {at}: {what}; {AGAIN}", path.display()))
        }
        other => Failure::Usage(other.into()),
    }
}

/// Compares a folder's files with their list, and says what is wrong with each.
pub(crate) fn check_files(dir: &Path, listed: &[FileEntry], quiet: bool) -> Result<Vec<Finding>, Failure> {
    let findings = inventory::check(dir, listed);
    let findings =
        findings.with_context(|| format!("cannot read {}", dir.display())).map_err(Failure::Run)?;
    for finding in findings.iter().filter(|finding| finding.is_lost() || !quiet) {
        say::note(format_args!("{}: {finding}", dir.display()));
    }
    Ok(findings)
}

/// Files that are lost.
pub(crate) fn told(dir: &Path, lost: &[&Finding]) -> String {
    let names: Vec<String> = lost.iter().map(|finding| finding.name.escape_debug().to_string()).collect();
    format!("{}: damaged or missing: {}", dir.display(), names.join(", "))
}

/// The command that makes a folder's files anew.
pub(crate) fn repair_command(dir: &Path) -> String {
    format!("rattlemap check {} --repair", quoted(&dir.display().to_string()))
}
