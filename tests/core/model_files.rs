//! Model files: the gear pair's file equals the Rust model, and no text makes the reader panic.

use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use rattlemap::map::scene::Place;
use rattlemap::model_file::{BUILT_IN, FileModel};
use rattlemap::text::printable::line;
use rattlemap_dynamics::model::{GearPair, Model};

/// Positive numbers of any size, and zero.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => (-3.0..3.0_f64).prop_map(|x| 10_f64.powf(x)),
        1 => Just(0.0),
        1 => Just(1e300),
    ]
}

fn pair() -> impl Strategy<Value = GearPair> {
    let values = proptest::array::uniform13(number());
    (values, 0.0..=1.0_f64, -50.0..50.0_f64).prop_map(|(values, e, force)| {
        let mut pair = GearPair::paper(e);
        values.into_iter().enumerate().for_each(|(index, value)| pair.assign(index, value));
        GearPair { e, force, ..pair }
    })
}

#[test]
fn the_file_of_the_gear_pair_equals_the_rust_model() {
    let file = FileModel::built_in("gear-pair").unwrap();
    let paper = GearPair::paper(0.605);
    assert_eq!(file.parameters(), GearPair::PARAMETERS);
    assert_eq!((file.name(), file.title(), file.source()), (paper.name(), paper.title(), paper.source()));
    assert_eq!((file.state_names(), file.bodies()), (paper.state_names(), paper.bodies()));
    assert_eq!(file.frequency(), paper.frequency());
    let has_value = |index| file.value(index) == paper.value(index);
    assert!((0..file.parameters().len()).all(has_value), "the defaults are those of `orbit`");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Both are compared bit by bit: the debug text of a number also shows the sign of zero.
    #[test]
    fn both_gear_pairs_have_equal_oscillators_and_laws(pair in pair()) {
        let mut file = FileModel::built_in("gear-pair").unwrap();
        (0..file.parameters().len()).for_each(|index| file.assign(index, pair.value(index)));
        prop_assert_eq!(format!("{:?}", Model::oscillator(&file)), format!("{:?}", pair.oscillator()));
        prop_assert_eq!(format!("{:?}", file.law()), format!("{:?}", pair.law()));
    }
}

/// Values of every type, most of them invalid.
#[rustfmt::skip]
const VALUES: [&str; 36] = [
    "0", "-0.0", "1e308", "1e400", "inf", "nan", "99999999999999999999", "true", "\"e\"", "\"x\"", "\"t\"",
    "\"sqrt\"", "\"2*omega^\"", "\"-k^(e - \"", "\"1/0\"", "\"log(-1)\"", "\"right\"", "\"left\"",
    "\"elastic\"", "\"impact\"", "[]", "[1]", "[\"x\", \"y\"]", "[[1]]", "[[1, 0], [0, 1]]",
    "[[1, 2], [2, 1]]", "[0, 0.5]", "[[[1, 2]]]", "[[1, 2]]", "[{ order = 2, cos = [1] }]", "[[1, 2], [3]]", "{ default = 1, min = 2 }",
    "{ default = 1.0, min = 0, open = true }", "{ min = nan }", "1979-05-27", "\"\u{fffd}\\u0000\"",
];

/// A change of one line.
#[derive(Clone, Debug)]
enum Change {
    Drop,
    Repeat,
    Value(&'static str),
    /// Replaces the first text in quotes.
    Entry(&'static str),
    Character(prop::sample::Index, char),
    Cut,
}

fn changes() -> impl Strategy<Value = Vec<(prop::sample::Index, Change)>> {
    let value = || prop::sample::select(VALUES.to_vec());
    let change = prop_oneof![
        2 => Just(Change::Drop),
        1 => Just(Change::Repeat),
        4 => value().prop_map(Change::Value),
        4 => value().prop_map(Change::Entry),
        2 => (any::<prop::sample::Index>(), any::<char>()).prop_map(|(at, c)| Change::Character(at, c)),
        1 => Just(Change::Cut),
    ];
    prop::collection::vec((any::<prop::sample::Index>(), change), 1..4)
}

fn changed(text: &str, changes: &[(prop::sample::Index, Change)]) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for (at, change) in changes {
        if lines.is_empty() {
            break;
        }
        let at = at.index(lines.len());
        match change {
            Change::Drop => drop(lines.remove(at)),
            Change::Repeat => lines.insert(at, lines[at].clone()),
            Change::Cut => lines.truncate(at),
            Change::Value(value) => {
                if let Some((name, _)) = lines[at].split_once('=') {
                    lines[at] = format!("{name}= {value}");
                }
            }
            Change::Entry(value) => {
                let mut parts: Vec<&str> = lines[at].split('"').collect();
                if parts.len() > 2 {
                    let unquoted = value.trim_matches('"');
                    parts[1] = unquoted;
                    lines[at] = parts.join("\"");
                }
            }
            Change::Character(place, c) => {
                let places: Vec<usize> = lines[at].char_indices().map(|(i, _)| i).collect();
                if !places.is_empty() {
                    lines[at].insert(places[place.index(places.len())], *c);
                }
            }
        }
    }
    lines.join("\n")
}

/// Checks that an accepted text has a motion and reads back as equal, and that an error has one line and a place.
fn check(text: &str) -> bool {
    match FileModel::parse(text, "m.toml") {
        Ok(model) => {
            assert!(model.oscillator().is_ok(), "{text}");
            assert_eq!(FileModel::parse(&model.definition().text, "again").as_ref(), Ok(&model));
            assert_eq!(model.state_names().len(), 2 * model.oscillator().unwrap().degrees());
            assert!(!model.equations().is_empty());
            true
        }
        Err(error) => {
            let message = error.to_string();
            let lines = text.lines().count().max(1) + 1;
            assert!(
                matches!(error.place, Place::Text { line, column, .. } if line <= lines && column > 0),
                "{message}"
            );
            assert_eq!(line(&message), message, "one line that a terminal shows as it is");
            assert!(message.chars().count() < 1200, "{message}");
            false
        }
    }
}

#[test]
fn no_text_makes_the_model_reader_panic() {
    let mut runner = TestRunner::new(ProptestConfig::with_cases(3000));
    let texts: Vec<&str> = BUILT_IN.iter().map(|(_, text)| *text).collect();
    let [accepted, refused] = [std::cell::Cell::new(0), std::cell::Cell::new(0)];
    let strategy = (prop::sample::select(texts), changes());
    let verdict = runner.run(&strategy, |(text, changes)| {
        let counter = if check(&changed(text, &changes)) { &accepted } else { &refused };
        counter.set(counter.get() + 1);
        Ok(())
    });
    verdict.unwrap();
    // Both results must be frequent.
    assert!(accepted.get() > 150 && refused.get() > 750, "{accepted:?} {refused:?}");
}
