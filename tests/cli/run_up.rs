//! `orbit --run-up`: a motion during which one parameter changes.

use std::f64::consts::TAU;
use std::fs;

use tempfile::TempDir;

use crate::common::{empty, json, names, rattlemap, rows, run, says};

/// Returns a folder with the model `linear.toml` of an oscillator whose wall is far away.
fn linear() -> TempDir {
    let folder = empty();
    let text = "name = 'linear'\n[parameters]\nf = { default = 0.1, min = 0.0, open = true, unit = 'Hz' }\n\
        [motion]\ncoordinates = ['x']\nmass = [[1]]\ndamping = [[0.2]]\nstiffness = [[1]]\nforce = [1]\n\
        frequency = '2*pi*f'\ngap = [1]\n[[contact]]\nside = 'left'\nat = -100\nlaw = 'impact'\nrestitution = 0\n";
    fs::write(folder.path().join("linear.toml"), text).unwrap();
    folder
}

fn numbers(row: &[String]) -> Vec<f64> {
    row.iter().filter_map(|text| text.parse().ok()).collect()
}

/// The amplitude of order 1 in a slow run follows the resonance curve, and no other order has an amplitude.
#[test]
fn orders_of_a_linear_oscillator_follow_its_resonance_curve() {
    let folder = linear();
    let line = "orbit --model linear.toml --run-up f=0.05:0.3 --time 8000 --format png,svg --out o";
    run(&folder, line)
        .success()
        .stdout(says(&["run-up                f from 0.05 to 0.3 in the time 8000", "impacts"]));
    let out = folder.path().join("o");
    let files = [
        "campbell.png",
        "campbell.svg",
        "events.csv",
        "manifest.json",
        "orders.csv",
        "run_up.png",
        "run_up.svg",
        "trajectory.csv",
    ];
    assert_eq!(names(&out), files);
    let manifest = json(&out.join("manifest.json"));
    let ramp = serde_json::json!({ "parameter": "f", "from": 0.05, "to": 0.3, "time": 8000.0 });
    assert_eq!(manifest["run_up"], ramp);
    let (header, table) = rows(&out.join("orders.csv"));
    assert_eq!(header, "t,f,order,x,z");
    let all: Vec<[f64; 5]> = table.iter().map(|row| numbers(row).try_into().unwrap()).collect();
    let first: Vec<_> = all.iter().filter(|row| row[2] == 1.0).collect();
    assert!(first.len() > 200);
    // The first windows contain the free motion of the start.
    for [t, f, _, x, z] in first.into_iter().filter(|row| row[0] > 200.0) {
        let omega = TAU * f;
        let amplitude = 1.0 / (1.0 - omega * omega).hypot(0.2 * omega);
        assert!((f - 0.05 - 0.25 * t / 8000.0).abs() < 2e-3, "{t} {f}");
        assert!((x / amplitude - 1.0).abs() < 0.02 && x == z, "{t} {f}: {x} {amplitude}");
    }
    // Each step of the frequency excites a little free motion.
    let others = all.iter().filter(|row| row[0] > 200.0 && row[2] >= 2.0);
    assert!(others.clone().count() > 10_000 && others.into_iter().all(|row| row[3] < 5e-3));

    let (header, moments) = rows(&out.join("trajectory.csv"));
    assert!(
        header.starts_with("t,phase,z,w,x,v,domain,") && header.ends_with(",contact_force,f"),
        "{header}"
    );
    let times: Vec<f64> = moments.iter().map(|row| numbers(row)[0]).collect();
    assert!(times.windows(2).all(|pair| pair[0] < pair[1]) && times.last().unwrap() >= &8000.0);
    assert_eq!(moments.len() % 64, 1);
}

/// Impacts are listed with the value of the parameter, and a run down is possible.
#[test]
fn impacts_of_a_run_down_have_the_value_of_the_parameter() {
    let folder = empty();
    let line = "orbit --model impact-oscillator --start 0.1,0 --run-up omega=2.6:2.2 --time 300 --out o";
    run(&folder, line).success();
    let (header, events) = rows(&folder.path().join("o/events.csv"));
    assert_eq!(header, "kind,side,t,t_mod_period,before_x,before_v,after_x,after_v,impulse,omega");
    assert!(events.len() > 50 && events.iter().all(|row| &*row[0] == "impact"));
    for row in &events {
        let [_, t, t_mod_period, x, before, _, after, _, omega] = numbers(row)[..] else { panic!("{row:?}") };
        assert!((omega - 2.6 + 0.4 * (t - t_mod_period) / 300.0).abs() < 1e-9, "{row:?}");
        assert!((x - 0.2).abs() < 1e-12 && (after + 0.8 * before).abs() < 1e-12, "{row:?}");
    }
    assert!(numbers(events.last().unwrap())[8] < 2.22);
}

#[test]
fn impossible_run_ups_are_refused() {
    let folder = linear();
    for (arguments, part) in [
        ("--run-up f=0.1:0.2 --out o", "--time"),
        ("--run-up f=0.1:0.2 --time 100", "--out"),
        ("--run-up f=0.1 --time 100 --out o", "--run-up f=0.1: it must be NAME=FROM:TO"),
        ("--run-up f=0.1:x --time 100 --out o", "it must be NAME=FROM:TO"),
        ("--run-up g=0.1:0.2 --time 100 --out o", "--run-up g=0.1:0.2: unknown parameter"),
        ("--run-up f=0.1:-0.2 --time 100 --out o", "--run-up f=0.1:-0.2: at f = "),
        ("--run-up f=0.1:0.2 --time 0 --out o", "--time 0: the time of a --run-up must be above 0"),
        ("--run-up f=0.1:0.2 --time -5 --out o", "0 or more"),
        (
            "--run-up f=10:20 --time 1e4 --out o",
            "it takes more than 10000 forcing periods; give a --time of at most 9",
        ),
        ("--run-up f=0.1:0.2 --time 100 --periods 8 --out o", "cannot be used with"),
        ("--run-up f=0.1:0.2 --time 100 --json --out o", "cannot be used with"),
    ] {
        let line = format!("orbit --model linear.toml {arguments}");
        let refused = rattlemap(&folder).args(line.split(' ')).assert().code(2).stdout("");
        let message = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
        assert!(message.contains(part), "{arguments}: {message}");
        assert!(!folder.path().join("o").exists(), "{arguments}");
    }
}
