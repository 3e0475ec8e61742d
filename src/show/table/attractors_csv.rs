//! `attractors.csv`: the attractors of a map of basins.

use std::collections::{BTreeMap, BTreeSet};
use std::io;

use crate::findings::attractors::{Attractor, Basins};
use crate::record::Spelling;
use crate::show::cells::Cells;
use crate::show::error::WriteError;
use crate::show::names::{self, float, optional};
use crate::show::symbols::{number, symbol, with_powers};
use rattlemap_dynamics::orbit::Class;

/// Columns before and after the strobe state.
pub(super) const FIELDS_BEFORE: [&str; 7] =
    ["label", "class", "period", "word", "exponent", "largest_multiplier", "symmetric"];
pub(super) const FIELDS_AFTER: [&str; 2] = ["cells", "share"];

/// Returns the names of attractors in legends. Where several have the same period and word, a component of the strobe state tells them
/// apart.
pub(crate) fn attractor_names(attractors: &[Attractor], components: &[&str]) -> Vec<String> {
    let kinds: Vec<[String; 2]> = attractors.iter().map(kind).collect();
    let mut states = vec![String::new(); attractors.len()];
    let mut alike: BTreeMap<&[String; 2], Vec<usize>> = BTreeMap::new();
    kinds.iter().enumerate().for_each(|(label, kind)| alike.entry(kind).or_default().push(label));
    for labels in alike.into_values().filter(|labels| labels.len() > 1) {
        let told = |(digits, component): (usize, usize)| {
            let text = |&label: &usize| {
                let value = attractors[label].strobe?[component];
                Some(number(format!("{value:.digits$e}").parse().ok()?))
            };
            let texts: Vec<String> = labels.iter().map(text).collect::<Option<_>>()?;
            let different: BTreeSet<&String> = texts.iter().collect();
            (different.len() == texts.len()).then(|| (symbol(components[component]), texts.clone()))
        };
        let shortest_first = (2..17).flat_map(|digits| (0..components.len()).map(move |i| (digits, i)));
        if let Some((symbol, texts)) = shortest_first.into_iter().find_map(told) {
            for (label, text) in labels.into_iter().zip(texts) {
                states[label] = format!(", {symbol} = {text}");
            }
        }
    }
    let name =
        |(label, [kind, word]): (usize, &[String; 2])| format!("{label}: {kind}{}{word}", states[label]);
    kinds.iter().enumerate().map(name).collect()
}

/// Returns period and word of an attractor.
fn kind(attractor: &Attractor) -> [String; 2] {
    let kind = match attractor.class {
        Class::Periodic { period } => format!("period {period}"),
        Class::QuasiPeriodic => "quasi-periodic".to_owned(),
        _ => "chaos".to_owned(),
    };
    let word = match &attractor.word {
        Some(word) if word.is_empty() && attractor.meshes => ", always in contact".to_owned(),
        Some(word) if word.is_empty() => ", no contact".to_owned(),
        Some(word) => format!(", word {}", with_powers(&Spelling::new(word).text())),
        None => String::new(),
    };
    [kind, word]
}

/// Writes the table: one attractor per row, the largest basin first. The last columns are the swept parameters at which the
/// attractor was found.
pub fn write(out: impl io::Write, cells: &Cells<'_>, basins: &Basins) -> Result<(), WriteError> {
    let mut table = csv::Writer::from_writer(out);
    let scene = cells.scene();
    let names = scene.base().state_names();
    let states = names.iter().map(|name| format!("strobe_{name}"));
    let axes = scene.axes().iter().enumerate();
    let swept: Vec<(usize, &str)> = axes
        .filter(|(_, axis)| !axis.target().is_start())
        .map(|(i, axis)| (i, &*axis.parameter().name))
        .collect();
    let before = FIELDS_BEFORE.iter().map(ToString::to_string);
    let after =
        FIELDS_AFTER.iter().map(ToString::to_string).chain(swept.iter().map(|(_, name)| (*name).to_owned()));
    table.write_record(before.chain(states).chain(after))?;
    let total = basins.labels().len() as f64;
    for (label, attractor) in basins.attractors().iter().enumerate() {
        let word = attractor.word.as_ref().map_or(String::new(), |word| Spelling::new(word).in_table());
        let before = [
            label.to_string(),
            attractor.class.name().to_owned(),
            optional(names::period(attractor.class)),
            word,
            float(attractor.exponent),
            float(attractor.multiplier),
            optional(attractor.symmetric),
        ];
        let state = (0..names.len()).map(|i| float(attractor.strobe.map(|state| state[i])));
        let after = [attractor.cells.to_string(), float(attractor.cells as f64 / total)];
        // Chaos is one attractor over all swept values, so it has none of its own.
        let is_cycle = attractor.strobe.is_some();
        let values = cells.values(attractor.cell);
        let at = swept.iter().map(|&(i, _)| float(Some(values[i]).filter(|_| is_cycle)));
        table.write_record(before.into_iter().chain(state).chain(after).chain(at))?;
    }
    Ok(table.flush()?)
}

#[test]
fn no_two_attractors_have_the_same_name() {
    let attractor = |period: u32, first: f64, word: &str| Attractor {
        class: Class::Periodic { period },
        strobe: Some(rattlemap_dynamics::model::state(&[0.5, first])),
        word: Some(rattlemap_dynamics::word::Word::cyclic(word.as_bytes())),
        meshes: false,
        exponent: None,
        multiplier: None,
        symmetric: None,
        cells: 1,
        cell: 0,
    };
    let list = [attractor(3, -0.25, "36"), attractor(1, 0.0, "36"), attractor(3, -0.251, "36")];
    let names = attractor_names(&list, &["x1", "v1"]);
    let last = |value: &str| format!("period 3, v\u{2081} = \u{2212}{value}, word 36");
    assert_eq!(
        names,
        ["0: ".to_owned() + &last("0.25"), "1: period 1, word 36".into(), "2: ".to_owned() + &last("0.251")]
    );
}
