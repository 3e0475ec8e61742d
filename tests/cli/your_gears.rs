//! The example of docs/your-gears.md: SI units, the scene, and the classes that the page lists.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fs;

use assert_cmd::Command;
use rattlemap::map::scene::{Purpose, Scene};

const TEXT: &str = include_str!("../../docs/your-gears.md");

fn toml() -> &'static str {
    let block = TEXT.split_once("```toml\n").expect("a scene").1;
    block.split_once("```").expect("its end").0
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

#[test]
fn the_scene_follows_from_si_units() {
    let scene = Scene::parse(toml(), "your-gears.md", &[], Purpose::Map).unwrap();
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
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("my-gears.toml"), toml()).unwrap();
    let run = Command::cargo_bin("rattlemap")
        .unwrap()
        .current_dir(folder.path())
        .args(["map", "my-gears.toml", "--engine", "cpu", "--quiet"])
        .assert();
    run.code(0);
    let mut reader = csv::Reader::from_path(folder.path().join("out/my-gears/cells.csv")).unwrap();
    // Classes and impacts per period by speed in 1/min.
    let mut column = BTreeMap::new();
    for cell in reader.deserialize() {
        let cell: BTreeMap<String, String> = cell.unwrap();
        if (cell["e"].parse::<f64>().unwrap() - 0.7).abs() < 1e-9 {
            let speed = 397.887 * cell["omega"].parse::<f64>().unwrap();
            let class = match cell["period"].as_str() {
                "" => cell["class"].clone(),
                period => format!("{}, period {period}", cell["class"]),
            };
            let impacts: f64 = cell["impacts_per_period"].parse().unwrap();
            column.insert(speed.round() as u32, (class, impacts));
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
