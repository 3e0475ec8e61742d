//! Compares the committed engine of reports, under Node.js, with today's sources.
//!
//! The engine is compiled without fused multiplication and addition, so numbers differ by rounding, and transients may end in another
//! class. Texts and the form of the data do not differ.

use std::io::{self, Write};
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use crate::{Window, orbit};

/// Reads requests from stdin, and answers them with the committed engine.
const ANSWER: &str = r#"
const { readFileSync } = require("fs");
const { gunzipSync } = require("zlib");
const [engine, code] = process.argv.slice(-2);
const wasm_bindgen = new Function(readFileSync(code, "utf8") + "; return wasm_bindgen;")();
wasm_bindgen.initSync({ module: new WebAssembly.Module(gunzipSync(readFileSync(engine))) });
const { windows, orbits } = JSON.parse(readFileSync(0, "utf8"));
const answered = {
  windows: windows.map((scene) => {
    const window = new wasm_bindgen.Window(scene, "", "");
    const runs = Uint32Array.from({ length: window.runs() }, (_, run) => run);
    return { labels: Array.from(window.labels(runs)), data: JSON.parse(window.data(window.compute(runs))) };
  }),
  orbits: orbits.map((command) => JSON.parse(wasm_bindgen.orbit(command, ""))),
};
process.stdout.write(JSON.stringify(answered));
"#;

/// Returns a scene of 5 x 5 cells of a built-in model.
fn scene(model: &str, axes: [(&str, f64, f64); 2]) -> String {
    let axis = |(name, min, max): (&str, f64, f64)| {
        format!("[[axis]]\nparameter = \"{name}\"\nmin = {min:?}\nmax = {max:?}\ncount = 5\n")
    };
    let outputs = "[outputs]\nquantities = [\"class\", \"impacts\", \"word\"]\n";
    format!("model = \"{model}\"\n{}{outputs}", axes.map(axis).concat())
}

/// One model of each shape: two coordinates, one, several walls, several gaps, friction, stages.
fn scenes() -> Vec<String> {
    vec![
        scene("gear-pair", [("e", 0.1, 0.9), ("omega", 3.0, 11.0)]),
        scene("impact-oscillator", [("e", 0.3, 0.9), ("omega", 2.0, 4.0)]),
        scene("clutch", [("omega", 0.4, 1.2), ("F", 0.5, 2.0)]),
        scene("two-loose-gears", [("e", 0.3, 0.7), ("omega", 150.0, 230.0)]),
        scene("friction-oscillator", [("omega", 0.6, 1.4), ("f", 0.1, 0.5)]),
        scene("meissner", [("delta", 0.4, 2.0), ("e", 0.5, 0.9)]),
    ]
}

const ORBITS: [&str; 4] = [
    "rattlemap orbit --set e=0.06 --transient 500 --start 0.1,0,-0.25,1",
    "rattlemap orbit --set e=0.605 --transient 400",
    "rattlemap orbit --set omega=1.0 --set e=0.6 --transient 400 --model two-masses",
    "rattlemap orbit --set e=2",
];

/// Cells of all scenes, of 150, whose class or period may differ.
const MOST_DIFFERING: usize = 3;

/// Returns the form of a value: names of objects, and the form of the first entry of lists.
fn form(value: &Value) -> Value {
    match value {
        Value::Object(entries) => entries.iter().map(|(key, value)| (key.clone(), form(value))).collect(),
        Value::Array(entries) => entries.iter().take(1).map(form).collect(),
        Value::String(_) => json!("text"),
        Value::Number(_) => json!(0),
        Value::Bool(_) | Value::Null => json!("flag"),
    }
}

/// Compares two answers: texts and their numbers, and all values of objects and lists.
fn differences(path: &str, ours: &Value, theirs: &Value, found: &mut Vec<String>) {
    match (ours, theirs) {
        (Value::Object(a), Value::Object(b)) if a.keys().eq(b.keys()) => {
            a.iter().for_each(|(key, value)| differences(&format!("{path}.{key}"), value, &b[key], found));
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            (0..)
                .zip(a.iter().zip(b))
                .for_each(|(i, (a, b))| differences(&format!("{path}[{i}]"), a, b, found));
        }
        (Value::String(a), Value::String(b)) if is_same_text(a, b) => {}
        (Value::Number(a), Value::Number(b)) if is_near(a.as_f64().unwrap(), b.as_f64().unwrap()) => {}
        (a, b) if a == b => {}
        (a, b) => found.push(format!("{path}: {a} instead of {b}")),
    }
}

fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-6 * a.abs().max(b.abs()).max(1e-3)
}

/// Whether two texts are equal but for rounding errors of their numbers.
fn is_same_text(a: &str, b: &str) -> bool {
    let parts = |text: &str| -> Vec<String> {
        let is_number = |c: char| c.is_ascii_digit() || ".-+e".contains(c);
        let mut parts: Vec<String> = Vec::new();
        for c in text.chars() {
            match parts.last_mut() {
                Some(part) if part.ends_with(is_number) == is_number(c) => part.push(c),
                _ => parts.push(c.to_string()),
            }
        }
        parts
    };
    let (a, b) = (parts(a), parts(b));
    let is_same = |(a, b): (&String, &String)| match (a.parse(), b.parse()) {
        (Ok(a), Ok(b)) => is_near(a, b),
        _ => a == b,
    };
    a.len() == b.len() && a.iter().zip(&b).all(is_same)
}

/// If this test fails because answers or the interface have changed, run `scripts/wasm.sh` and commit what it makes.
#[test]
fn the_committed_engine_answers_as_todays_sources_do() {
    let report = concat!(env!("CARGO_MANIFEST_DIR"), "/../src/show/report");
    let node = Command::new("node")
        .args(["-e", ANSWER, "--", &format!("{report}/engine.wasm.gz"), &format!("{report}/engine.js")])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn();
    let mut node = match node {
        Ok(node) => node,
        Err(reason) => {
            // The test harness hides what print macros write, but not this line.
            writeln!(io::stderr(), "SKIPPED: the engine of reports: no Node.js ({reason})").unwrap();
            return;
        }
    };
    let request = json!({ "windows": scenes(), "orbits": ORBITS });
    node.stdin.take().unwrap().write_all(request.to_string().as_bytes()).unwrap();
    let output = node.wait_with_output().unwrap();
    assert!(output.status.success(), "the engine stopped");
    let theirs: Value = serde_json::from_slice(&output.stdout).unwrap();
    let mut differing = 0;
    for (scene, theirs) in scenes().iter().zip(theirs["windows"].as_array().unwrap()) {
        let window = Window::new(scene, "", "").unwrap();
        let runs: Vec<u32> = (0..window.runs() as u32).collect();
        let data: Value = serde_json::from_str(&window.data(&window.compute(&runs)).unwrap()).unwrap();
        assert_eq!(form(&data), form(&theirs["data"]), "{scene}");
        let labels = theirs["labels"].as_array().unwrap();
        let labels: Vec<u8> = labels.iter().map(|label| label.as_u64().unwrap() as u8).collect();
        let ours = window.labels(&runs);
        assert_eq!(ours.len(), labels.len());
        differing += ours.chunks(2).zip(labels.chunks(2)).filter(|(a, b)| a != b).count();
    }
    assert!(differing <= MOST_DIFFERING, "{differing} cells have another class or period");
    let ours: Vec<Value> =
        ORBITS.iter().map(|command| serde_json::from_str(&orbit(command, "")).unwrap()).collect();
    let mut found = Vec::new();
    differences("", &json!(ours), &theirs["orbits"], &mut found);
    assert!(
        found.is_empty(),
        "{} differences, such as\n{}",
        found.len(),
        found[..found.len().min(10)].join("\n")
    );
}
