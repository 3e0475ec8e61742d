//! Two maps of one grid and the differences between their cells and scenes.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::findings::compare::Comparison;
use crate::show::cells::Cells;
use crate::show::provenance::Provenance;
use rattlemap_dynamics::orbit::Class;

/// One of the two maps.
#[derive(Clone, Copy, Debug)]
pub struct MapSide<'a> {
    /// Name of its folder, without the folders that contain it.
    pub name: &'a str,
    /// Cells.
    pub cells: &'a Cells<'a>,
    /// Engine, device and commit that computed it.
    pub provenance: Provenance<'a>,
    /// Version of the program that computed it.
    pub crate_version: &'a str,
}

/// Two maps of one grid and their comparison.
#[derive(Clone, Copy, Debug)]
pub struct MapPair<'a> {
    /// Maps A and B.
    pub sides: [MapSide<'a>; 2],
    /// Differences of their cells.
    pub comparison: &'a Comparison,
}

/// A setting whose values differ in the two scenes. A scene without the setting has the value `absent`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SceneDifference {
    /// Setting.
    pub name: String,
    /// Value in A.
    pub a: String,
    /// Value in B.
    pub b: String,
}

/// Number of cells that have one class in A and another class in B.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ClassTransition {
    /// Class in A.
    pub a: &'static str,
    /// Class in B.
    pub b: &'static str,
    /// Number of cells.
    pub cells: usize,
}

impl MapPair<'_> {
    /// Returns the settings that differ and that cells depend on. Requested quantities and files do not count.
    pub fn scene_differences(&self) -> Vec<SceneDifference> {
        let [a, b] = self.sides.map(|side| side.cells.scene().identity());
        let value = |list: &[(String, String)], name: &str| {
            let found = list.iter().find(|(n, _)| n == name);
            found.map_or_else(|| "absent".to_owned(), |(_, value)| value.clone())
        };
        let mut names: Vec<&String> = a.iter().map(|(name, _)| name).collect();
        names.extend(b.iter().map(|(name, _)| name).filter(|name| !a.iter().any(|(n, _)| n == *name)));
        let difference =
            |name: &String| SceneDifference { name: name.clone(), a: value(&a, name), b: value(&b, name) };
        let all = names.into_iter().filter(|name| !name.starts_with("outputs.")).map(difference);
        all.filter(|difference| difference.a != difference.b).collect()
    }

    /// Returns the classes in A and B of each cell.
    pub(crate) fn classes(&self) -> impl Iterator<Item = [Class; 2]> + '_ {
        let [a, b] = self.sides.map(|side| side.cells.classes());
        a.zip(b).map(|(a, b)| [a, b])
    }

    /// Counts the cells with different classes in A and B, by their classes.
    pub fn transitions(&self) -> Vec<ClassTransition> {
        let mut counts = BTreeMap::new();
        let differing = self.classes().map(|pair| pair.map(Class::index)).filter(|[a, b]| a != b);
        differing.for_each(|pair| *counts.entry(pair).or_default() += 1);
        let transition = |([a, b], cells): ([usize; 2], usize)| ClassTransition {
            a: Class::NAMES[a],
            b: Class::NAMES[b],
            cells,
        };
        counts.into_iter().map(transition).collect()
    }
}
