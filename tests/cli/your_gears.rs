//! The examples of docs/your-gears.md: SI units, the scenes, the commands, and the classes that the page lists.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fs;

use rattlemap::map::scene::{Purpose, Scene};
use tempfile::TempDir;

use crate::common::{empty, run};

const TEXT: &str = include_str!("../../docs/your-gears.md");

/// The page's scenes of a loose gear and of two gears.
fn toml(nth: usize) -> &'static str {
    let block = TEXT.split("```toml\n").nth(nth + 1).expect("a scene");
    block.split_once("```").expect("its end").0
}

/// A folder with the page's scene of a loose gear.
fn loose_gear() -> TempDir {
    let folder = empty();
    fs::write(folder.path().join("my-loose-gear.toml"), toml(0)).unwrap();
    folder
}

/// Rows of a table that a command has written.
fn table(folder: &TempDir, path: &str) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(folder.path().join(path)).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column} of {row:?}"))
}

/// Class and period as the page writes them.
fn motion(row: &BTreeMap<String, String>) -> String {
    match row["period"].as_str() {
        "" => row["class"].clone(),
        period => format!("{}, period {period}", row["class"]),
    }
}

/// Rows of the table with this header.
fn rows(head: &str) -> Vec<Vec<&'static str>> {
    let table = TEXT.split_once(head).unwrap_or_else(|| panic!("no table {head}")).1;
    let lines = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    lines.map(|line| line.trim_matches('|').split('|').map(str::trim).collect()).collect()
}

#[track_caller]
fn close(name: &str, scene: f64, si: f64) {
    // The scene has seven digits.
    assert!((scene - si).abs() <= 1e-6 * si, "{name}: {scene} in the scene, {si} from SI units");
}

/// Follows the commands of the page for a loose gear: the map, run-up, coast-down, their comparison, and the diagram.
#[test]
fn a_loose_gear_rattles_above_the_threshold_of_the_page() {
    let si: BTreeMap<&str, &str> = rows("| parameter | value | unit | where it comes from |")
        .iter()
        .map(|row| (row[0], row[1]))
        .collect();
    let scene = Scene::parse(toml(0), "your-gears.md", &[], Purpose::Map).unwrap();
    for (name, value) in &si {
        let Ok(value) = value.parse::<f64>() else { continue };
        assert_eq!(scene.base().get(name).unwrap(), value, "{name}");
    }
    for axis in scene.axes() {
        assert_eq!(si[&*axis.parameter().name], format!("{} to {}", axis.min(), axis.max()));
    }
    let value = |name: &str| si[name].parse::<f64>().unwrap();
    let threshold =
        |rpm: f64| value("drag") / (value("I") * value("order") * rpm * (PI / 30.0) * (PI / 30.0));
    let said = [1000.0, 2000.0, 4000.0].map(|rpm| format!("{:.2}", threshold(rpm)));
    let sentence = format!(
        "exceeds {} per minute. At 2000 it rattles above {}, at 4000\nabove {}.",
        said[0], said[1], said[2]
    );
    assert!(TEXT.contains(&sentence), "{sentence}");

    let folder = loose_gear();
    let section = TEXT.split_once("## Two gears").unwrap().0;
    let blocks = section.split("```sh\n").skip(1).map(|block| block.split_once("```").unwrap().0);
    let commands: Vec<&str> = blocks.flat_map(str::lines).collect();
    assert_eq!(commands.len(), 5, "{commands:?}");
    for command in commands {
        let line = command.strip_prefix("rattlemap ").unwrap();
        run(&folder, line).code(0);
    }
    let cells = table(&folder, "out/my-loose-gear/cells.csv");
    assert_eq!(cells.len(), 57 * 65);
    for cell in &cells {
        let rattles = number(cell, "swing") > threshold(number(cell, "rpm"));
        let found = [number(cell, "impacts_per_period"), number(cell, "mesh_fraction")];
        assert_eq!(found[0] > 0.0, rattles, "{cell:?}");
        assert!(rattles || (found[1] - 1.0).abs() < 1e-9, "{cell:?}");
        assert_eq!(number(cell, "impact_energy") > 0.0, rattles, "{cell:?}");
    }
    let columns = table(&folder, "out/my-loose-gear.rpm.swing=3/bifurcation_columns.csv");
    let listed = rows("| rpm | run-up | impacts per period | coast-down | impacts per period |");
    assert_eq!(listed.len(), 6);
    for row in listed {
        for (direction, expected) in [("up", &row[1..3]), ("down", &row[3..5])] {
            let is_here = |column: &&BTreeMap<String, String>| {
                number(column, "rpm") == row[0].parse::<f64>().unwrap() && column["direction"] == direction
            };
            let column = columns.iter().find(is_here).unwrap();
            let impacts = format!("{:.1}", number(column, "impacts_per_period"));
            assert_eq!([motion(column), impacts], expected, "{direction} at {} per minute", row[0]);
        }
    }
    assert!(
        TEXT.contains(&format!("The threshold is at {:.0} revolutions", 3.0f64.recip() * threshold(1.0)))
    );
}

#[test]
fn the_scene_follows_from_si_units() {
    let scene = Scene::parse(toml(1), "your-gears.md", &[], Purpose::Map).unwrap();
    let si: BTreeMap<&str, f64> = rows("| symbol | value | unit | meaning |")
        .iter()
        .map(|row| (row[0], row[1].parse().unwrap()))
        .collect();
    let (length, time) = (si["backlash"], 1e-3);
    let mass = si["I2"] / si["rb2"].powi(2);
    let arm = [si["rb1"].powi(2), si["rb2"].powi(2)];
    let model = scene.base();
    let expected = [
        ("m1", si["I1"] / arm[0] / mass),
        ("m2", si["I2"] / arm[1] / mass),
        ("k1", si["kappa1"] / arm[0] * time * time / mass),
        ("k2", si["kappa2"] / arm[1] * time * time / mass),
        ("r1", si["delta1"] / arm[0] * time / mass),
        ("r2", si["delta2"] / arm[1] * time / mass),
        ("k", si["K"] * time * time / mass),
        ("r", si["C"] * time / mass),
        ("F", si["torque"] / si["rb1"] * time * time / (mass * length)),
        ("b", 0.5),
        ("mesh_speed", si["V"] * time / length),
    ];
    for (name, value) in expected {
        close(name, model.get(name).unwrap(), value);
    }
    // No other parameter exists.
    assert_eq!(model.parameters().len(), expected.len() + scene.axes().len());
    let omega = |speed: f64| 2.0 * PI * si["z1"] * speed / 60.0 * time;
    close("omega", scene.axes()[1].min(), omega(si["n_min"]));
    close("omega", scene.axes()[1].max(), omega(si["n_max"]));
    assert!(TEXT.contains(&format!("= {:.3} omega", 1.0 / omega(1.0))));
}

#[test]
fn the_map_has_the_classes_of_the_page() {
    let folder = empty();
    fs::write(folder.path().join("my-gears.toml"), toml(1)).unwrap();
    run(&folder, "map my-gears.toml --engine cpu --quiet").code(0);
    // Classes and impacts per period by speed in 1/min.
    let mut column = BTreeMap::new();
    for cell in table(&folder, "out/my-gears/cells.csv") {
        if (number(&cell, "e") - 0.7).abs() < 1e-9 {
            let speed = 397.887 * number(&cell, "omega");
            column.insert(speed.round() as u32, (motion(&cell), number(&cell, "impacts_per_period")));
        }
    }
    assert_eq!(column.len(), 31);
    let listed = rows("| omega | n, 1/min | class | impacts per period |");
    assert_eq!(listed.len(), 9);
    for row in listed {
        let (omega, speed): (f64, u32) = (row[0].parse().unwrap(), row[1].parse().unwrap());
        assert_eq!((397.887 * omega).round() as u32, speed);
        let (class, impacts) = &column[&speed];
        assert_eq!([class.as_str(), &format!("{impacts:.1}")], row[2..], "at {speed} per minute");
    }
    let chaotic: Vec<u32> =
        column.iter().filter(|(_, (class, _))| class == "chaotic").map(|(speed, _)| *speed).collect();
    assert_eq!(chaotic, [1600, 2000, 2100, 2200, 2300]);
    assert!(column.iter().all(|(&speed, &(_, impacts))| (impacts > 0.0) == (speed < 4000)), "{column:?}");
}
