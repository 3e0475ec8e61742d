//! `rattlemap models`: the page says what the code does.

use assert_cmd::Command;
use rattlemap::model::GearPair;
use rattlemap_dynamics::orbit::{Class, Status};

fn stdout(arguments: &[&str]) -> String {
    let run = Command::cargo_bin("rattlemap").unwrap().args(arguments).assert().code(0).stderr("");
    String::from_utf8(run.get_output().stdout.clone()).unwrap()
}

#[test]
fn every_model_has_a_line_and_a_page() {
    let list = stdout(&["models"]);
    assert_eq!(list.lines().count(), 1, "{list}");
    assert!(list.starts_with("gear-pair  "), "{list}");
    let page = stdout(&["models", "gear-pair"]);
    let has = |words: &[&str]| {
        let found = page.lines().any(|line| line.split_whitespace().collect::<Vec<_>>().starts_with(words));
        assert!(found, "{words:?} is not in\n{page}");
    };
    for parameter in GearPair::PARAMETERS {
        let default = parameter.default.map_or("-".to_owned(), |value| value.to_string());
        let (range, meaning) = (parameter.range.requirement(), &parameter.meaning);
        let line = format!("{} {default} {range} {meaning}", parameter.name);
        has(&line.split_whitespace().collect::<Vec<_>>());
    }
    Status::ALL.into_iter().for_each(|status| has(&[status.name()]));
    Class::NAMES.into_iter().for_each(|class| has(&[class]));
    for part in [
        "F cos(omega t)",
        "P_{1 2^2 6 4 5^2 3}",
        "13554622",
        "135462,",
        "mesh_speed is a choice",
        "Rattling Vibration in Gear Systems",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(page.lines().all(|line| line.chars().count() <= 130), "a line is too long for a terminal");
}

#[test]
fn unknown_model_is_refused_with_the_names() {
    let run = Command::cargo_bin("rattlemap").unwrap().args(["models", "gears\u{1b}"]).assert();
    run.code(2).stdout("").stderr("error: no model is called `gears\\u{1b}`; there is gear-pair\n");
}
