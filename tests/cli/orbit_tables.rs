//! Tables of `orbit --out`: the trajectory and the spectrum.

use rattlemap_dynamics::model::state;
use std::fs;

use rattlemap::flow::Flow;
use rattlemap::model::GearPair;
use rattlemap::reference::Trajectory;

use crate::common::{empty, json, rows, run};

fn numbers(row: &[String]) -> [f64; 8] {
    std::array::from_fn(|i| row[i].parse().unwrap())
}

/// Events are those of orbit.json and lie on their walls; samples lie on the flow, in the domain after the last event.
#[test]
fn a_trajectory_contains_events_and_samples() {
    let folder = empty();
    run(&folder, "orbit --out o --set e=0.06").code(0);
    let orbit = json(&folder.path().join("o/orbit.json"));
    let rows = rows(&folder.path().join("o/trajectory.csv")).1;
    let (events, samples): (Vec<_>, Vec<_>) = rows.iter().partition(|row| !row[9].is_empty());
    let listed = orbit["events"].as_array().unwrap();
    assert_eq!((events.len(), samples.len()), (2 * listed.len(), 2001));
    let list = |value: &serde_json::Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
    };
    for (event, pair) in listed.iter().zip(events.chunks(2)) {
        for (row, moment) in pair.iter().zip(["before", "after"]) {
            let [t, phase, z, _, state @ ..] = numbers(row);
            assert_eq!((t, &row[9][..]), (event["t"].as_f64().unwrap(), event["kind"].as_str().unwrap()));
            assert_eq!((&row[11][..], &state[..]), (moment, &list(&event[moment])[..]));
            assert!((z - 0.5 * row[10].parse::<f64>().unwrap()).abs() < 1e-14, "{row:?}");
            assert!((phase - t * 5.6 / std::f64::consts::TAU).abs() < 1e-14, "{row:?}");
        }
        let after = match (&pair[1][9][..], &pair[1][10][..]) {
            ("mesh_start", "1") => "meshing_right",
            ("mesh_start", _) => "meshing_left",
            _ => "free",
        };
        assert_eq!(pair[1][8], after);
    }
    // Samples between two events have the domain of the first.
    for pair in rows.windows(2).filter(|pair| pair[1][11] != "after") {
        assert_eq!(pair[0][8], pair[1][8], "{pair:?}");
        assert!(numbers(&pair[0])[0] <= numbers(&pair[1])[0]);
    }
    let pair = GearPair::paper(0.06);
    let flow = Flow::new(&pair.oscillator().unwrap());
    let strobe = state(&list(&orbit["strobe"]));
    let mut trajectory = Trajectory::<0>::new(&flow, pair.law(), strobe);
    for row in samples.iter().skip(1).step_by(77) {
        let [t, _, z, w, state @ ..] = numbers(row);
        trajectory.advance_to(t, &mut ()).unwrap();
        for (found, expected) in state.into_iter().zip(trajectory.state()) {
            assert!((found - expected).abs() < 1e-10, "{row:?}");
        }
        assert!((z - (state[0] - state[2])).abs() < 1e-15 && (w - (state[1] - state[3])).abs() < 1e-14);
    }
}

/// The lines of a cycle are multiples of one over its period; those of chaos of one over 128 periods.
#[test]
fn a_spectrum_contains_the_lines_of_its_cycle() {
    let folder = empty();
    let dir = folder.path().join("o");
    run(&folder, "orbit --out o --set e=0.62").code(0);
    let period = json(&dir.join("orbit.json"))["period"].as_f64();
    let lines = rows(&dir.join("spectrum.csv")).1;
    let frequency = |row: &[String]| row[0].parse::<f64>().unwrap();
    assert_eq!(1.0 / frequency(&lines[1]), period.unwrap_or(128.0));
    assert_eq!(frequency(lines.last().unwrap()), 40.0);
    assert!(image::open(dir.join("spectrum.png")).unwrap().width() == 1600);
    let manifest = fs::read_to_string(dir.join("manifest.json")).unwrap();
    for name in ["trajectory.csv", "spectrum.csv", "spectrum.png"] {
        assert!(manifest.contains(&format!("\"name\": \"{name}\"")), "{manifest}");
    }
}
