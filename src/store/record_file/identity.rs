//! Whose records a file holds.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::map::scene::Scene;
use crate::map::shard::Shard;
use crate::record::RECORD_VERSION;
use crate::store::record_file::RecordFileError;
use crate::store::record_file::reader::Reader;

/// Whose records a file holds: they may be continued by the same alone.
///
/// The same are runs of one scene by one engine in one precision, on devices of one model and driver, by programs of the
/// same deciding sources for the same processor. Which commit they were built from does not matter.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    record_version: u32,
    /// For the reader's information: the sources decide.
    crate_version: String,
    sources: String,
    target: String,
    engine: String,
    precision: String,
    device: String,
    scene: Vec<(String, String)>,
    /// Which part of the map; absent where it is the whole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    shard: Option<Shard>,
}

impl Identity {
    /// The identity of a run of this program.
    pub fn new(engine: &str, precision: &str, device: &str, scene: Vec<(String, String)>) -> Identity {
        Identity {
            record_version: RECORD_VERSION,
            crate_version: env!("CARGO_PKG_VERSION").to_owned(),
            sources: Identity::own_sources().to_owned(),
            target: Identity::own_target().to_owned(),
            engine: engine.to_owned(),
            precision: precision.to_owned(),
            device: device.to_owned(),
            scene,
            shard: None,
        }
    }

    /// The same run of a part of the map, or of all of it.
    #[must_use]
    pub fn of_shard(self, shard: Option<Shard>) -> Identity {
        Identity { shard, ..self }
    }

    /// The same run of a program of other sources, or for another processor.
    #[must_use]
    pub fn built_from(self, sources: &str, target: &str) -> Identity {
        Identity { sources: sources.to_owned(), target: target.to_owned(), ..self }
    }

    /// The same run, its records in the layout of another.
    pub(crate) fn laid_out_as(self, other: &Identity) -> Identity {
        Identity { record_version: other.record_version, ..self }
    }

    /// A hash of the sources of this program that decide what a record holds.
    pub fn own_sources() -> &'static str {
        env!("RATTLEMAP_SOURCES")
    }

    /// What this program is compiled for: system, processor and its extensions in use.
    pub fn own_target() -> &'static str {
        env!("RATTLEMAP_TARGET")
    }

    /// The identity of the run whose records a file holds; none in a file in which nothing was kept yet.
    ///
    /// # Errors
    /// [`RecordFileError`] if it cannot be read.
    pub fn read(path: &Path) -> Result<Option<Identity>, RecordFileError> {
        let file = super::open(path)?;
        Ok(Reader::open(&file, path)?.map(|reader| reader.identity))
    }

    /// The engine's name.
    pub fn engine(&self) -> &str {
        &self.engine
    }

    /// Its precision.
    pub fn precision(&self) -> &str {
        &self.precision
    }

    /// Engine, precision, device, sources and target, as manifests tell them, too.
    pub(crate) fn told(&self) -> [&str; 5] {
        [&self.engine, &self.precision, &self.device, &self.sources, &self.target].map(String::as_str)
    }

    /// Whether it is of a run of this scene.
    pub fn is_of(&self, scene: &Scene) -> bool {
        self.scene == scene.identity()
    }

    /// What it runs on.
    pub fn device(&self) -> &str {
        &self.device
    }

    /// Which part of the map it is; none where it is the whole.
    pub fn shard(&self) -> Option<Shard> {
        self.shard
    }

    fn named(&self) -> Vec<(&str, String)> {
        let own = [
            ("sources", &self.sources),
            ("target", &self.target),
            ("engine", &self.engine),
            ("precision", &self.precision),
            ("device", &self.device),
        ];
        let shard = self.shard.map(|shard| ("shard", shard.to_string()));
        let own = own.map(|(name, value)| (name, value.clone()));
        let scene = self.scene.iter().map(|(name, value)| (name.as_str(), value.clone()));
        own.into_iter().chain(shard).chain(scene).collect()
    }

    /// What differs from the identity that is `asked` for, in words; empty if nothing.
    pub fn differences(&self, asked: &Identity) -> String {
        self.differing(asked, |mine, theirs| format!("was {mine}, now {theirs}"))
    }

    /// What differs from another identity, with both values as `tell` puts them; empty if nothing.
    pub fn differing(&self, other: &Identity, tell: impl Fn(&str, &str) -> String) -> String {
        let (mine, theirs) = (self.named(), other.named());
        let value = |list: &[(&str, String)], name: &str| {
            list.iter().find(|(n, _)| *n == name).map_or("absent".to_owned(), |(_, value)| value.clone())
        };
        let mut names: Vec<&str> = mine.iter().map(|(name, _)| *name).collect();
        names.extend(theirs.iter().map(|(name, _)| *name).filter(|name| value(&mine, name) == "absent"));
        let differing = names.into_iter().filter(|name| value(&mine, name) != value(&theirs, name));
        let sentence = |name| format!("`{name}` {}", tell(&value(&mine, name), &value(&theirs, name)));
        let mut differences: Vec<String> = differing.map(sentence).collect();
        if self.record_version != other.record_version {
            let [mine, theirs] =
                [self.record_version, other.record_version].map(|version| version.to_string());
            differences.insert(0, format!("`record version` {}", tell(&mine, &theirs)));
        }
        differences.join(", ")
    }
}
