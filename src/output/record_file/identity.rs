//! Whose records a file holds.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::RecordFileError;
use super::reader::Reader;
use crate::record::RECORD_VERSION;

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
        }
    }

    /// The same run of a program of other sources, or for another processor.
    #[must_use]
    pub fn built_from(self, sources: &str, target: &str) -> Identity {
        Identity { sources: sources.to_owned(), target: target.to_owned(), ..self }
    }

    /// The same run, its records in the layout of another.
    pub(super) fn laid_out_as(self, other: &Identity) -> Identity {
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

    fn named(&self) -> Vec<(&str, &str)> {
        let own = [
            ("sources", &self.sources),
            ("target", &self.target),
            ("engine", &self.engine),
            ("precision", &self.precision),
            ("device", &self.device),
        ];
        let own = own.map(|(name, value)| (name, value.as_str()));
        own.into_iter()
            .chain(self.scene.iter().map(|(name, value)| (name.as_str(), value.as_str())))
            .collect()
    }

    /// What differs from the identity that is `asked` for, in words; empty if nothing.
    pub(super) fn differences(&self, asked: &Identity) -> String {
        let (mine, theirs) = (self.named(), asked.named());
        let value = |list: &[(&str, &str)], name: &str| {
            list.iter()
                .find(|(n, _)| *n == name)
                .map_or("absent".to_owned(), |(_, value)| (*value).to_owned())
        };
        let mut names: Vec<&str> = mine.iter().map(|(name, _)| *name).collect();
        names.extend(theirs.iter().map(|(name, _)| *name).filter(|name| value(&mine, name) == "absent"));
        let differing = names.into_iter().filter(|name| value(&mine, name) != value(&theirs, name));
        let sentence = |name| format!("`{name}` was {}, now {}", value(&mine, name), value(&theirs, name));
        let mut differences: Vec<String> = differing.map(sentence).collect();
        if self.record_version != asked.record_version {
            let [was, now] = [self.record_version, asked.record_version];
            differences.insert(0, format!("`record version` was {was}, now {now}"));
        }
        differences.join(", ")
    }
}
