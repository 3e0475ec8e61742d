//! `orbit --from-start`, and states at the exact time of an event.

use std::f64::consts::PI;
use std::fs;

use tempfile::TempDir;

use crate::common::{empty, json, names, printed, rattlemap, rows, run, says};

const GRAVITY: f64 = 9.81;
const RESTITUTION: f64 = 0.7;

/// Returns a folder with the model `ball.toml` of a ball above a floor.
fn ball() -> TempDir {
    let folder = empty();
    let text = "name = 'ball'\n[parameters]\ng = 9.81\ne = 0.7\n[motion]\ncoordinates = ['h']\nmass = [[1]]\n\
        load = ['-g']\nfrequency = 1.0\ngap = [1]\n[[contact]]\nside = 'left'\nat = 0\nlaw = 'impact'\n\
        restitution = 'e'\n";
    fs::write(folder.path().join("ball.toml"), text).unwrap();
    folder
}

/// Returns time and approach speed of the impacts of a ball that falls from the height `h`.
fn impacts(h: f64) -> impl Iterator<Item = [f64; 2]> {
    let first = [(2.0 * h / GRAVITY).sqrt(), (2.0 * GRAVITY * h).sqrt()];
    std::iter::successors(Some(first), |[t, w]| Some([t + 2.0 * RESTITUTION * w / GRAVITY, RESTITUTION * w]))
}

/// Returns height and speed of this ball at a time.
fn exact(h: f64, time: f64) -> [f64; 2] {
    let Some([t, w]) = impacts(h).take(80).take_while(|[t, _]| *t <= time).last() else {
        return [h - 0.5 * GRAVITY * time * time, -GRAVITY * time];
    };
    let (s, leaving) = (time - t, RESTITUTION * w);
    if w < 1e-9 { [0.0; 2] } else { [leaving * s - 0.5 * GRAVITY * s * s, leaving - GRAVITY * s] }
}

fn numbers(row: &[String]) -> Vec<f64> {
    row.iter().filter_map(|text| text.parse().ok()).collect()
}

fn state(folder: &TempDir, line: &str) -> Vec<f64> {
    let object = printed(folder, &format!("orbit --model ball.toml --from-start 1 --json {line}"));
    object["state"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

#[test]
fn a_ball_is_followed_from_its_start_to_rest() {
    let folder = ball();
    let line = "orbit --model ball.toml --start 1,0 --from-start 1 --format png,svg --out o";
    run(&folder, line)
        .success()
        .stdout(says(&["start                 h=1.0", "end                   h=0.0"]));
    let out = folder.path().join("o");
    let files = ["events.csv", "history.png", "history.svg", "manifest.json", "trajectory.csv"];
    assert_eq!(names(&out), files);
    let manifest = json(&out.join("manifest.json"));
    assert_eq!((&manifest["from_start"], &manifest["to_period"]), (&1.into(), &1.into()));

    let (header, events) = rows(&out.join("events.csv"));
    assert!(header.starts_with("kind,side,t,t_mod_period,before_h,before_"), "{header}");
    for (event, [t, w]) in events.iter().zip(impacts(1.0)).take(20) {
        let [side, at, _, _, before, _, after, impulse] = numbers(event)[..] else { panic!("{event:?}") };
        assert_eq!((&*event[0], side), ("impact", -1.0));
        assert!((at - t).abs() < 1e-13, "{event:?}: {t}");
        assert!((before + w).abs() < 1e-12 && (after - RESTITUTION * w).abs() < 1e-12, "{event:?}: {w}");
        assert!((impulse.abs() - 1.7 * w).abs() < 1e-12, "{event:?}: {w}");
    }
    let last = events.last().unwrap();
    assert_eq!(&*last[0], "mesh_start");
    assert!((numbers(last)[1] - (2.0 / GRAVITY).sqrt() * 1.7 / 0.3).abs() < 1e-9, "{last:?}");

    let moments = rows(&out.join("trajectory.csv")).1;
    assert_eq!(moments.iter().filter(|row| row[9] == "after").count(), events.len());
    assert_eq!(moments.len(), 2001 + 2 * events.len());
    for pair in moments.windows(2) {
        let [earlier, later] = [0, 1].map(|i| numbers(&pair[i])[0]);
        assert!(earlier < later || pair[0][9] == "before" && pair[1][9] == "after", "{pair:?}");
    }
    for row in moments.iter().filter(|row| row[9].is_empty()) {
        let [t, _, z, w, h, v, ..] = numbers(row)[..] else { panic!("{row:?}") };
        let [height, speed] = exact(1.0, t);
        assert!((h - height).abs() < 1e-9 && (v - speed).abs() < 1e-6, "{row:?}: {height} {speed}");
        assert_eq!([z, w], [h, v]);
    }
    // A later run without the option leaves no file of this one.
    run(&folder, "orbit --model ball.toml --start 1,0 --periods 4 --out o --force").success();
    assert!(!names(&out).iter().any(|name| name == "events.csv" || name.starts_with("history")));
}

#[test]
fn states_of_a_ball_at_rest_and_before_it_are_exact() {
    let folder = ball();
    for (start, time) in [(1.0, 0.3), (1.0, 1.0), (1.0, 3.0), (10.0, 8.05), (10.0, 9.0), (10.0, 60.0)] {
        let found = state(&folder, &format!("--start {start},0 --time {time}"));
        let [height, speed] = exact(start, time);
        assert!(
            (found[0] - height).abs() < 1e-10 && (found[1] - speed).abs() < 1e-10,
            "{start} {time}: {found:?}"
        );
    }
}

/// A ball falls from the height 9 for 3 and returns every 6, because gravity is 2 and no energy is lost.
#[test]
fn the_state_at_the_time_of_an_impact_is_the_one_after_it() {
    let folder = ball();
    for time in [3.0, 9.0, 15.0, 21.0, 603.0] {
        let [h, v] = state(&folder, &format!("--set g=2 --set e=1 --start 9,0 --time {time}"))[..] else {
            panic!("two components")
        };
        assert!(h.abs() < 1e-10 && (v - 6.0).abs() < 1e-10, "t = {time}: {h} {v}");
    }
}

#[test]
fn a_window_of_later_periods_is_a_part_of_the_whole() {
    let folder = empty();
    let line = "orbit --set e=0.06 --start 0.1,0,-0.2,1.5 --json";
    let orbit = |arguments: &str| printed(&folder, &format!("{line} {arguments}"));
    let (whole, last) =
        (orbit("--from-start 12 --out whole"), orbit("--from-start 4 --to-period 12 --out last"));
    let [all, some] = [&whole, &last].map(|object| object["events"].as_array().unwrap());
    assert!(some.len() >= 8 && all.ends_with(some), "{some:?}");
    assert_eq!((&last["first_period"], &last["last_period"]), (&9.into(), &12.into()));
    assert_eq!(whole["start"], serde_json::json!([0.1, 0.0, -0.2, 1.5]));
    let table = rows(&folder.path().join("last/events.csv")).1;
    assert_eq!(table.len(), some.len());
    for (row, event) in table.iter().zip(some) {
        assert_eq!(
            (&*row[0], numbers(row)[1]),
            (event["kind"].as_str().unwrap(), event["t"].as_f64().unwrap())
        );
    }
    let moments = rows(&folder.path().join("last/trajectory.csv")).1;
    let period = whole["forcing_period"].as_f64().unwrap();
    let ends = [&moments[0], moments.last().unwrap()].map(|row| numbers(row)[0] / period);
    assert!((ends[0] - 8.0).abs() < 1e-12 && (ends[1] - 12.0).abs() < 1e-12, "{ends:?}");
}

#[test]
fn impossible_windows_are_refused() {
    let cases: [(&[&str], &str); 5] = [
        (&["--from-start", "0"], "1..=10000"),
        (&["--to-period", "3"], "--from-start <N>"),
        (&["--from-start", "5", "--to-period", "3"], "--to-period 3: 5 periods end at period 5 or later"),
        (&["--from-start", "5", "--periods", "3"], "cannot be used with"),
        (&["--from-start", "5", "--transient", "3"], "cannot be used with"),
    ];
    for (arguments, part) in cases {
        let run = rattlemap(&empty()).arg("orbit").args(arguments).assert();
        run.code(2).stdout("").stderr(says(&[part]));
    }
}

/// A mass on a spring with dry friction, released from 0.85 mm, reverses at pi/100, 2 pi/100 and 3 pi/100 and sticks for good at 4 pi/100.
#[test]
fn reversals_and_sticking_are_events() {
    let folder = empty();
    let model = "name = 'pad'\n[motion]\ncoordinates = ['r']\nmass = [[1]]\nstiffness = [[1e4]]\nfrequency = 100\ngap = [1]\n\
        [[friction]]\nforce = 1\n";
    fs::write(folder.path().join("pad.toml"), model).unwrap();
    let line = "orbit --model pad.toml --start=0.00085,0 --from-start 3";
    let orbit = run(&folder, &format!("{line} --out o --format svg")).success();
    orbit.stdout(says(&["reversal  friction", "stick     friction"]));
    let (header, events) = rows(&folder.path().join("o/events.csv"));
    assert_eq!(header, "kind,side,t,t_mod_period,before_r,before_v,after_r,after_v,impulse,element");
    let kinds: Vec<[&str; 3]> = events.iter().map(|row| [&*row[0], &*row[1], &*row[9]]).collect();
    let of = |kind| [kind, "", "friction"];
    assert_eq!(kinds, [of("reversal"), of("reversal"), of("reversal"), of("stick")]);
    for (row, n) in events.iter().zip(1..) {
        let [t, r] = [2, 4].map(|column| row[column].parse::<f64>().unwrap());
        let exact = [-0.65e-3, 0.45e-3, -0.25e-3, 0.05e-3][n - 1];
        assert!((t - n as f64 * PI / 100.0).abs() < 1e-12 && (r - exact).abs() < 1e-15, "{row:?}");
    }
    let (header, moments) = rows(&folder.path().join("o/trajectory.csv"));
    assert!(header.ends_with("event,side,moment,element,contact_force,friction_force"), "{header}");
    let sticks: Vec<_> = moments.iter().filter(|row| row.contains(&"stick".to_owned())).collect();
    assert_eq!(sticks.len(), 2, "before and after");
    let figure = fs::read_to_string(folder.path().join("o/history.svg")).unwrap();
    assert!(["sticking begins", "sliding reverses"].iter().all(|text| figure.contains(text)));
    let object = printed(&folder, "orbit --model friction-oscillator --json");
    let kinds: Vec<_> =
        object["events"].as_array().unwrap().iter().map(|event| event["kind"].clone()).collect();
    assert_eq!(kinds, ["stick", "slip", "stick", "slip"]);
    assert!(object["events"][0]["side"].is_null() && object["events"][0]["element"] == "friction");
}

/// In chaos the strobe search finds no cycle. The refined one is unstable, and its motion comes back after a period.
#[test]
fn an_unstable_cycle_in_chaos_is_refined() {
    let folder = empty();
    let chaos = "orbit --set e=0.8 --set omega=5.6";
    let object = printed(&folder, &format!("{chaos} --refine --period 1 --word 563 --json"));
    assert_eq!(object["class"], "chaotic");
    let cycle = &object["refined"];
    assert_eq!(cycle["period"], 1);
    assert_eq!(cycle["word"], "356");
    assert_eq!(cycle["stable"], false);
    assert!(
        cycle["floquet"][0][0].as_f64().unwrap() < -3.0
            && cycle["event_times"].as_array().unwrap().len() == 3
    );
    let numbers = |list: &serde_json::Value| -> Vec<f64> {
        list.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
    };
    let start = numbers(&cycle["strobe"]);
    let listed = start.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let after = printed(&folder, &format!("{chaos} --from-start 1 --start {listed} --json"));
    for (a, b) in start.iter().zip(numbers(&after["end"])) {
        assert!((a - b).abs() < 1e-10, "{start:?}: {after}");
    }
    // The motion is printed all the same.
    run(&folder, &format!("{chaos} --refine"))
        .failure()
        .stdout(says(&["chaotic"]))
        .stderr(says(&["give a period or a word to find the nearest cycle"]));
    run(&folder, "orbit --model belt-oscillator --refine --period 2")
        .failure()
        .stderr(says(&["only a model with a force has cycles of a given period"]));
    let object = printed(&folder, "orbit --set e=0.4 --refine --by e --json");
    let found = &object["refined"]["derivatives"];
    // The mean of a cycle that is its own mirror image is 0 at every e.
    assert!(found["quantities"]["mean_gap"].as_f64().unwrap().abs() < 1e-9, "{found}");
    assert!(found["quantities"]["impact_speed"].as_f64().unwrap() < -1.0, "{found}");
    assert_eq!(found["reasons"], serde_json::json!({}));
    run(&folder, "orbit --refine --by q").code(2).stderr(says(&["unknown parameter `q`"]));
    run(&folder, &format!("{chaos} --refine --word 138")).code(2).stderr(says(&["`138` is no word"]));
}
