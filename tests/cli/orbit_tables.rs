//! Tables of `orbit --out`: the trajectory and the spectrum.

use rattlemap_dynamics::model::state;
use std::fs;

use rattlemap::model::GearPair;
use rattlemap::motion::Flow;
use rattlemap::motion::Trajectory;

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

/// A model with three coordinates and two gaps. Its gears leave their driving flanks and are back on them at phase 0.
#[test]
fn tables_have_the_names_of_all_coordinates_and_gaps() {
    let (folder, scene) = (
        empty(),
        "model = 'two-loose-gears'\n[[axis]]\nparameter = 'A'\nmin = 2e-4\nmax = 3e-4\ncount = 2\n",
    );
    fs::write(
        folder.path().join("line.toml"),
        format!("{scene}[integration]\ntransient_periods = 40\nobserved_periods = 8\n[outputs]\nquantities = ['amplitude', 'rms']\n"),
    )
    .unwrap();
    run(&folder, "orbit --model two-loose-gears --set A=3e-4 --transient 40 --periods 8 --out o").code(0);
    run(&folder, "bifurcation line.toml --quiet").code(0);
    let table = |name: &str| rows(&folder.path().join(name));
    let (header, moments) = table("o/trajectory.csv");
    assert_eq!(
        header,
        "t,phase,a,a_rate,b,b_rate,s,vs,x1,v1,x2,v2,domain_a,domain_b,event,side,moment,gap,contact_force_a,contact_force_b"
    );
    let mut seen = [[0; 2]; 2];
    for row in &moments {
        let number = |i: usize| row[i].parse::<f64>().unwrap();
        for (i, (gap, backlash)) in [("a", 1e-4), ("b", 1.5e-4)].into_iter().enumerate() {
            let z = number(2 + 2 * i);
            assert!((z - (number(6) - number(8 + 2 * i))).abs() < 1e-18, "{row:?}");
            assert!((number(3 + 2 * i) - (number(7) - number(9 + 2 * i))).abs() < 1e-14, "{row:?}");
            let is_on_flank = z.abs() < 1e-15;
            assert!(row[12 + i] != "meshing_right" || is_on_flank, "{row:?}");
            if row[17] == gap {
                let at = if row[15] == "1" { 0.0 } else { -backlash };
                assert!((z - at).abs() < 1e-15, "{row:?}");
                seen[i][0] += 1;
            }
            seen[i][1] += u32::from(row[12 + i] == "meshing_right");
        }
        assert_eq!(row[14].is_empty(), row[17].is_empty(), "{row:?}");
    }
    assert!(seen.iter().flatten().all(|&count| count > 10), "{seen:?}");
    assert_eq!(moments[0][12..14], ["meshing_right", "meshing_right"]);
    let (header, lines) = table("o/spectrum.csv");
    assert_eq!(header, "frequency,a,a_rate,b,b_rate");
    // The mean of each gap.
    for i in [1, 3] {
        let samples = moments.iter().filter(|row| row[14].is_empty());
        let values: Vec<f64> = samples.skip(1).map(|row| row[1 + i].parse().unwrap()).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        assert!(
            (lines[0][i].parse::<f64>().unwrap() / mean.abs() - 1.0).abs() < 1e-3,
            "{} {mean}",
            lines[0][i]
        );
    }
    let (header, points) = table("out/line/bifurcation.csv");
    assert!(header.ends_with("_before,s,vs,x1,v1,x2,v2,gap"), "{header}");
    assert!(["a", "b"].iter().all(|gap| points.iter().any(|row| row.last().unwrap() == gap)));
    let (header, columns) = table("out/line/bifurcation_columns.csv");
    let names = "amplitude_s,mean_s,amplitude_x1,mean_x1,amplitude_x2,mean_x2,amplitude_a,mean_a,amplitude_b,mean_b,\
                 rms_s,rms_x1,rms_x2,rms_a,rms_b";
    assert!(header.ends_with(names), "{header}");
    for row in columns {
        let measured: Vec<f64> = row[row.len() - 15..].iter().map(|x| x.parse().unwrap()).collect();
        let [amplitude, mean] = [0, 1].map(|part| move |i: usize| 2 * i + part);
        for (gap, (gear, backlash)) in [(3, (1, 1e-4)), (4, (2, 1.5e-4))] {
            let expected = measured[mean(0)] - measured[mean(gear)];
            assert!((measured[mean(gap)] - expected).abs() < 1e-12 && expected < 0.0, "{row:?}");
            let size = measured[amplitude(gap)];
            assert!(size > 0.0 && size < 0.5 * backlash + 1e-12, "{row:?}");
            assert!(measured[10 + gap] > expected.abs() && measured[10 + gap] < backlash, "{row:?}");
        }
    }
}
