//! The table of keys agrees with the parser.

use super::*;
use crate::map::scene::keys::{KEYS, Key, KeyDefault, Takes};

const BASE: &str = "[parameters]\n[[axis]]\nparameter = \"e\"\nmin = 0.1\nmax = 0.9\ncount = 4\n\
                    [[axis]]\nparameter = \"omega\"\nmin = 1.0\nmax = 12.0\ncount = 3\n";

/// Reads a map in which `key` applies, with a value of it.
fn with(key: &Key, value: Option<&str>) -> Result<Scene, SceneError> {
    let text = if key.table == "refine" { format!("{BASE}[refine]\n") } else { BASE.to_owned() };
    let mut sets = Vec::new();
    if key.name == "seed" {
        sets.push("start.count=2".to_owned());
    }
    let path = match key.table {
        "" => key.name.to_owned(),
        "axis" => format!("axis.0.{}", key.name),
        table => format!("{table}.{}", key.name),
    };
    sets.extend(value.map(|value| format!("{path}={value}")));
    Scene::parse(&text, "s.toml", &sets, Purpose::Map)
}

#[test]
fn written_defaults_change_nothing() {
    let mut count = 0;
    for key in KEYS {
        if let KeyDefault::Value(value) = key.default {
            // The settings repeat what was written.
            let read = |scene: Result<Scene, _>| Scene { settings: String::new(), ..scene.unwrap() };
            let [written, silent] = [with(key, Some(value)), with(key, None)].map(read);
            assert_eq!(format!("{written:?}"), format!("{silent:?}"), "{}.{} = {value}", key.table, key.name);
            count += 1;
        }
    }
    assert!(count >= 15);
}

#[test]
fn the_parser_accepts_exactly_the_ranges_of_the_table() {
    let good = |key: &Key, value: &str| {
        with(key, Some(value)).unwrap_or_else(|error| panic!("{}.{}: {error}", key.table, key.name));
    };
    let bad = |key: &Key, value: &str| {
        assert!(with(key, Some(value)).is_err(), "{}.{} = {value} is taken", key.table, key.name);
    };
    for key in KEYS {
        match key.takes {
            Takes::Whole(least, most) | Takes::WholeOrAuto(least, most) => {
                [least, most].iter().for_each(|value| good(key, &value.to_string()));
                [i64::from(least) - 1, i64::from(most) + 1]
                    .iter()
                    .for_each(|value| bad(key, &value.to_string()));
            }
            Takes::Fraction => {
                ["1e-9", "0.999999"].iter().for_each(|value| good(key, value));
                ["0", "1"].iter().for_each(|value| bad(key, value));
            }
            Takes::Flag => {
                ["true", "false"].iter().for_each(|value| good(key, value));
                bad(key, "2");
            }
            Takes::OneOf(names) => {
                // "state" needs a state, "box" and "normal" need two, and "both" is for diagrams only.
                names
                    .iter()
                    .filter(|name| !["state", "box", "normal", "both"].contains(*name))
                    .for_each(|name| good(key, &format!("\"{name}\"")));
                bad(key, "\"none\"");
            }
            Takes::List(names) => {
                good(key, &format!("[\"{}\"]", names.join("\", \"")));
                bad(key, "[\"none\"]");
            }
            Takes::Text(most) => {
                good(key, &format!("\"{}\"", "x".repeat(most)));
                bad(key, &format!("\"{}\"", "x".repeat(most + 1)));
            }
            Takes::Words(_) => {}
        }
    }
}
