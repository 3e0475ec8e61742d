//! The identity of a run: everything that decides its records.

use serde::{Deserialize, Serialize};

use crate::map::engine::Engine;
use crate::map::scene::Scene;
use crate::map::shard::Shard;
use crate::record::RECORD_VERSION;
use rattlemap_dynamics::model::MOST_COORDINATES;

/// Everything that decides the records of a run. A run resumes only from records of the same identity.
///
/// Runs have the same identity if they compute one scene by one engine in one precision, on devices of one model and
/// driver, with programs that were compiled from the same deciding sources for the same processor. The commit is not
/// compared.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    record_version: u32,
    /// Version of the program, for readers of the file. It is not compared; the sources are.
    crate_version: String,
    sources: String,
    target: String,
    engine: String,
    precision: String,
    device: String,
    scene: Vec<(String, String)>,
    /// Number of the model's coordinates; absent for one or two. It is not compared; the scene contains the model.
    #[serde(default = "two", skip_serializing_if = "is_two")]
    coordinates: usize,
    /// The part of the map that the run computes; absent if it computes the whole map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    shard: Option<Shard>,
}

/// Files of models with one or two coordinates have the same layout.
fn two() -> usize {
    2
}

fn is_two(coordinates: &usize) -> bool {
    *coordinates == two()
}

impl Identity {
    /// Returns the identity of a run of this program.
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
            coordinates: two(),
            shard: None,
        }
    }

    /// Returns the identity of a run of this program that computes a scene, or a shard of it, with an engine.
    pub fn of_run(engine: &Engine<'_>, scene: &Scene, shard: Option<Shard>) -> Identity {
        Identity::new(engine.name(), engine.precision(), &engine.device(), scene.identity())
            .of_coordinates(scene.coordinates())
            .of_shard(shard)
    }

    /// Returns this identity for a model with this number of coordinates.
    #[must_use]
    pub fn of_coordinates(self, coordinates: usize) -> Identity {
        Identity { coordinates: coordinates.max(two()), ..self }
    }

    /// Returns the number of entries of strobe states in the file.
    pub(crate) fn strobes(&self) -> usize {
        2 * self.coordinates.clamp(two(), MOST_COORDINATES)
    }

    /// Returns this identity for a shard, or for the whole map if there is none.
    #[must_use]
    pub fn of_shard(self, shard: Option<Shard>) -> Identity {
        Identity { shard, ..self }
    }

    /// Returns this identity for a program of other sources or for another target.
    #[must_use]
    pub fn built_from(self, sources: &str, target: &str) -> Identity {
        Identity { sources: sources.to_owned(), target: target.to_owned(), ..self }
    }

    /// Returns a hash of the sources of this program that decide the contents of records.
    pub fn own_sources() -> &'static str {
        env!("RATTLEMAP_SOURCES")
    }

    /// Returns the target of this program: system, processor, and the processor's extensions in use.
    pub fn own_target() -> &'static str {
        env!("RATTLEMAP_TARGET")
    }

    /// Name of the engine.
    pub fn engine(&self) -> &str {
        &self.engine
    }

    /// Name of the precision.
    pub fn precision(&self) -> &str {
        &self.precision
    }

    /// Description of the device.
    pub fn device(&self) -> &str {
        &self.device
    }

    /// The part of the map that the run computes; none if it computes the whole map.
    pub fn shard(&self) -> Option<Shard> {
        self.shard
    }

    /// Engine, precision, device, sources and target: the fields that manifests repeat.
    pub(crate) fn in_manifest(&self) -> [&str; 5] {
        [&self.engine, &self.precision, &self.device, &self.sources, &self.target].map(String::as_str)
    }

    /// Whether the run computes this scene.
    pub fn is_of(&self, scene: &Scene) -> bool {
        self.scene == scene.identity()
    }

    /// Pairs of name and value, in the order in which differences are reported.
    fn named(&self) -> Vec<(&str, String)> {
        let shard = self.shard.map(|shard| ("shard", shard.to_string()));
        let [engine, precision, device, sources, target] = self.in_manifest();
        let own = [
            ("sources", sources),
            ("target", target),
            ("engine", engine),
            ("precision", precision),
            ("device", device),
        ];
        let scene = self.scene.iter().map(|(name, value)| (name.as_str(), value.clone()));
        [("record version", self.record_version.to_string())]
            .into_iter()
            .chain(own.map(|(name, value)| (name, value.to_owned())))
            .chain(shard)
            .chain(scene)
            .collect()
    }

    /// Lists the values that differ from a requested identity; empty if none does.
    pub fn differences(&self, requested: &Identity) -> String {
        self.differing(requested, |mine, theirs| format!("was {mine}, now {theirs}"))
    }

    /// Lists the values that differ from another identity, in the words of `describe`; empty if none does.
    pub fn differing(&self, other: &Identity, describe: impl Fn(&str, &str) -> String) -> String {
        let (mine, theirs) = (self.named(), other.named());
        let value = |list: &[(&str, String)], name: &str| {
            list.iter().find(|(n, _)| *n == name).map_or("absent".to_owned(), |(_, value)| value.clone())
        };
        let mut names: Vec<&str> = mine.iter().map(|(name, _)| *name).collect();
        names.extend(theirs.iter().map(|(name, _)| *name).filter(|name| value(&mine, name) == "absent"));
        let differing = names.into_iter().filter(|name| value(&mine, name) != value(&theirs, name));
        let sentence = |name| format!("`{name}` {}", describe(&value(&mine, name), &value(&theirs, name)));
        differing.map(sentence).collect::<Vec<_>>().join(", ")
    }
}
