//! The command line as scripts see it: exit codes, messages, files.

use std::fs;
use std::path::Path;

use crate::common::{empty as folder, json, keys, names, printed, rattlemap, rows, run, says, stdout};

const SMOKE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/smoke.toml");

/// Asserts that a parsed `orbit --json` object has exactly the fields of the contract.
fn assert_orbit_fields(orbit: &serde_json::Value) {
    let fields = "class e events floquet impacts_per_period lyapunov lyapunov_error mesh_fraction omega \
                  parameters pattern period periods_run quantities start_phase status strobe symmetric word";
    assert_eq!(keys(orbit), fields);
    for event in orbit["events"].as_array().expect("events is a list") {
        assert_eq!(keys(event), "after before impulse kind side t t_mod_period");
    }
    assert_eq!(orbit["strobe"].as_array().map(Vec::len), Some(4));
}

/// Runs a changed smoke scene. Expects exit code 2, a message with all `parts`, nothing on stdout and no output folder.
#[track_caller]
fn refuses(old: &str, new: &str, parts: &[&str]) {
    let folder = folder();
    let text = fs::read_to_string(SMOKE).unwrap();
    assert!(text.contains(old), "{old:?} is not in the smoke scene");
    fs::write(folder.path().join("bad.toml"), text.replacen(old, new, 1)).unwrap();
    run(&folder, "bifurcation bad.toml").code(2).stdout("").stderr(says(parts));
    assert!(!folder.path().join("out").exists(), "an output folder was created");
}

#[test]
fn wrong_values_in_a_scene_are_refused_with_their_place() {
    refuses("count = 5", "cuont = 5", &["bad.toml:11:1", "`axis.0.cuont = 5`", "did you mean `count`?"]);
    refuses("max = 0.8", "max = 1.5", &["bad.toml:10:7", "`axis.0.max = 1.5`", "between 0 and 1"]);
    refuses("min = 0.4", "min = nan", &["bad.toml:9:7", "`axis.0.min = nan`", "between 0 and 1"]);
    refuses("min = 0.4", "min = \"low\"", &["bad.toml:9:7", "`axis.0.min = \"low\"`", "it must be a number"]);
    refuses("min = 0.4", "min = low", &["bad.toml:9:7", "min = low", "not valid TOML"]);
    refuses("count = 5", "count = 0", &["bad.toml:11:9", "`axis.0.count = 0`", "from 2 to"]);
    refuses("max = 0.8", "max = 0.4", &["bad.toml:10:7", "`axis.0.max = 0.4`", "greater than `axis.0.min"]);
}

#[test]
fn scene_for_another_command_is_refused() {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/e_omega.toml");
    let run = rattlemap(&folder()).args(["bifurcation", scene]).assert();
    run.code(2).stderr(says(&["e_omega.toml:17:1", "`axis = 2 tables`", "one table for `bifurcation`"]));
}

#[test]
fn missing_scene_is_refused() {
    let folder = folder();
    run(&folder, "bifurcation scenes/none.toml").code(2).stdout("").stderr(says(&[
        "scenes/none.toml: cannot read",
        "give the path of a TOML file such as scenes/paper_fig5.toml",
    ]));
    assert!(!folder.path().join("out").exists());
}

#[test]
fn bad_set_is_refused_and_names_itself() {
    for (set, part) in [
        ("axis.0.count=1", "`axis.0.count = 1` is out of range"),
        ("e=0.6", "`parameters.e = 0.6` does not fit: axis 0 sweeps `e`"),
        ("omgea=6", "did you mean `omega`?"),
        ("omega", "expected NAME=VALUE"),
    ] {
        let folder = folder();
        let run = rattlemap(&folder).args(["bifurcation", SMOKE, "--set", set]).assert();
        run.code(2).stdout("").stderr(says(&[&format!("--set {set}: "), part]));
        assert!(!folder.path().join("out").exists());
    }
}

#[test]
fn bad_orbit_requests_are_refused() {
    let cases: [(&[&str], &str); 12] = [
        (
            &["--start", "0,0,0"],
            "it must be finite numbers: two, such as 0.1,0, for a model of one coordinate; four",
        ),
        (
            &["--start", "0,0,0,inf"],
            "it must be finite numbers: two, such as 0.1,0, for a model of one coordinate; four",
        ),
        (
            &["--set", "e=1.5"],
            "--set e=1.5: `parameters.e = 1.5` is out of range: it must be between 0 and 1",
        ),
        (&["--set", "e=nan"], "`parameters.e = nan` is out of range"),
        (
            &["--set", "mass=1"],
            "--set mass=1: unknown field `parameters.mass = 1`; valid names: m1 (equivalent mass of gear 1), m2 (",
        ),
        (&["--time", "-1"], "it must be a finite number, 0 or more"),
        (&["--time", "inf"], "it must be a finite number, 0 or more"),
        (&["--time", "nan"], "it must be a finite number, 0 or more"),
        (&["--time", "1e300"], "--time 1e300: it must be at most 33659921 (30000000 forcing periods)"),
        (&["--set", "E=0.6"], "did you mean `e`? valid names: m1 (equivalent mass of gear 1), m2 ("),
        (&["--periods", "1"], "2..=10000000"),
        (&["--force"], "--out <DIR>"),
    ];
    for (arguments, part) in cases {
        let run = rattlemap(&folder()).arg("orbit").args(arguments).assert();
        run.code(2).stdout("").stderr(says(&[part]));
    }
}

#[test]
fn a_file_with_the_name_of_the_output_folder_is_refused() {
    let folder = folder();
    fs::write(folder.path().join("taken"), "precious").unwrap();
    for arguments in [["bifurcation", SMOKE].as_slice(), &["orbit"]] {
        for (out, part) in [("taken", "there is a file of this name"), ("taken/below", "cannot write there")]
        {
            let run = rattlemap(&folder).args(arguments).args(["--out", out, "--force"]).assert();
            run.code(2).stdout("").stderr(says(&[&format!("{out}: {part}"), "choose another folder"]));
        }
    }
    assert_eq!(fs::read_to_string(folder.path().join("taken")).unwrap(), "precious");
}

#[test]
fn output_folders_with_files_are_refused() {
    let folder = folder();
    let out = folder.path().join("out/smoke");
    fs::create_dir_all(&out).unwrap();
    fs::write(out.join("notes.txt"), "precious").unwrap();
    let run = rattlemap(&folder).args(["bifurcation", SMOKE]).assert();
    run.code(2).stdout("").stderr(says(&["out/smoke: the folder is not empty", "--force"]));
    assert_eq!(fs::read_dir(&out).unwrap().count(), 1, "something was written");
    let run = rattlemap(&folder).args(["orbit", "--out", "out/smoke"]).assert();
    run.code(2).stdout("").stderr(says(&["--out out/smoke: the folder is not empty"]));
}

#[cfg(unix)]
#[test]
fn read_only_output_folders_are_refused() {
    use std::os::unix::fs::PermissionsExt;
    let folder = folder();
    let closed = folder.path().join("closed");
    fs::create_dir(&closed).unwrap();
    fs::set_permissions(&closed, fs::Permissions::from_mode(0o555)).unwrap();
    // Root may write anywhere.
    if fs::write(closed.join("probe"), "").is_ok() {
        return;
    }
    let run = rattlemap(&folder).args(["bifurcation", SMOKE, "--out", "closed"]).assert();
    run.code(2).stdout("").stderr(says(&["--out closed: cannot write there"]));
}

#[test]
fn every_command_has_help_with_an_example() {
    for (command, example) in [
        ("orbit", "rattlemap orbit --set"),
        ("bifurcation", "rattlemap bifurcation scenes/"),
        ("map", "rattlemap map scenes/"),
    ] {
        run(&folder(), &format!("{command} --help")).success().stdout(says(&["Example", example]));
    }
}

#[test]
fn completions_contain_every_command() {
    let script = |target: &str| {
        let run = run(&folder(), &format!("completions {target}")).success().stderr("");
        String::from_utf8(run.get_output().stdout.clone()).unwrap()
    };
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = script(shell);
        for word in ["bifurcation", "validate", "resume", "repair"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    let page = script("man");
    assert!(page.contains(".TH rattlemap 1"), "{page}");
    for word in ["rattlemap bifurcation", "rattlemap bench engines", "transient", "repair"] {
        assert!(page.contains(word), "{word}: {page}");
    }
    // Bash completes an option, a model and a parameter.
    let folder = folder();
    let path = folder.path().join("rattlemap");
    fs::write(&path, script("bash")).unwrap();
    for (line, at, completed) in [
        ("map --res", 2, "--resume"),
        ("orbit --model impact-o", 3, "impact-oscillator"),
        ("orbit --set ome", 3, "omega="),
        ("bifurcation --along mesh_s", 3, "mesh_speed"),
    ] {
        let ask = format!(
            ". ./rattlemap; COMP_WORDS=(rattlemap {line}); COMP_CWORD={at}; \
             _rattlemap rattlemap \"${{COMP_WORDS[-1]}}\" \"${{COMP_WORDS[-2]}}\"; echo \"${{COMPREPLY[@]}}\""
        );
        if let Ok(run) = std::process::Command::new("bash").args(["-c", &ask]).current_dir(&folder).output() {
            assert_eq!(String::from_utf8_lossy(&run.stdout).trim(), completed, "{run:?}");
        }
    }
    assert!(script("fish").contains("__fish_complete_directories"), "folders");
    run(&folder, "completions tcsh").code(2).stderr(says(&["bash", "man"]));
}

#[test]
fn orbit_json_has_the_fields_of_the_contract() {
    let orbit = printed(&folder(), "orbit --json");
    assert_orbit_fields(&orbit);
    assert_eq!(orbit["e"], 0.605);
    assert_eq!(orbit["omega"], 5.6);
    assert_eq!(orbit["parameters"]["F"], 50.0);
    assert_eq!(orbit["class"], "periodic");
    assert_eq!(orbit["period"], 1);
    assert_eq!((&orbit["word"], &orbit["pattern"]), (&"36".into(), &"36".into()));
    assert_eq!(orbit["lyapunov_error"], serde_json::Value::Null);
    assert_eq!(orbit["events"].as_array().unwrap().len(), 2);
    // The transient, the alignment of a tangent vector, and one check.
    assert_eq!(orbit["periods_run"], 400 + 50 + 128);
}

#[test]
fn orbit_prints_a_summary() {
    run(&folder(), "orbit --set e=0.06").success().stderr("").stdout(says(&[
        "periodic, period 1",
        "e=0.06",
        "mesh_start",
        "mesh_end",
        "Floquet",
        "word, in time         13554622\n",
        "pattern               135462\n",
    ]));
}

/// A period, a word and a pattern belong to periodic motion with contact.
#[test]
fn an_orbit_without_a_word_says_why() {
    for (line, parts) in [
        (
            "orbit --set e=0.7",
            ["class                 chaotic", "word                  none: the motion is not periodic\n"],
        ),
        (
            "orbit --model impact-oscillator --set sigma=5",
            ["class                 periodic, period 1\n", "word                  none: no contact\n"],
        ),
    ] {
        let text = stdout(&folder(), line);
        assert!(parts.iter().all(|part| text.contains(part)), "{text}");
        assert!(!text.contains("P_{") && !text.contains("pattern"), "{text}");
    }
}

/// A ball comes to rest in more than a hundred impacts.
#[test]
fn a_long_table_of_events_leaves_the_summary_on_the_screen() {
    let line = "orbit --model shaking-table --set e=0.7 --set A=1.35";
    let events = printed(&folder(), &format!("{line} --json"))["events"].as_array().unwrap().len();
    let text = stdout(&folder(), line);
    assert!(events > 100 && text.lines().count() < 45, "{events} events\n{text}");
    let hidden = format!("... {} more events; --json and --out list all of them\n", events - 16);
    assert!(text.contains(&hidden), "{text}");
}

#[test]
fn requested_periods_are_a_limit() {
    let orbit = printed(&folder(), "orbit --transient 1 --periods 2 --json");
    // The transient, the alignment of a tangent vector, and the analysis.
    assert_eq!((&orbit["class"], &orbit["periods_run"]), (&"undecided".into(), &5.into()));
    let text = stdout(&folder(), "orbit --transient 1 --periods 2");
    assert!(text.contains("undecided: neither periodic nor chaotic within 5 forcing periods\n"), "{text}");
    // Without a limit the analysis goes on.
    assert_eq!(printed(&folder(), "orbit --transient 1 --json")["class"], "periodic");
}

/// The time counts from the start, not from the end of the transient.
#[test]
fn orbit_prints_the_state_at_a_time() {
    use rattlemap::model::{GearPair, state};
    use rattlemap::motion::Flow;
    use rattlemap::motion::Trajectory;
    let at = |arguments: &[&str]| {
        let fixed = ["orbit", "--start", "0.125,0,-0.25,1.5", "--time"];
        rattlemap(&folder()).args(fixed).args(arguments).assert().success().get_output().stdout.clone()
    };
    let pair = GearPair::paper(0.605);
    let flow = Flow::new(&pair.oscillator().unwrap());
    let mut trajectory = Trajectory::new(&flow, pair.law(), state(&[0.125, 0.0, -0.25, 1.5]));
    (0..3).for_each(|_| trajectory.advance_period(&mut ()).unwrap());
    trajectory.advance_to(0.5, &mut ()).unwrap();
    let time = format!("{:?}", 3.0 * flow.period + 0.5);
    let orbit: serde_json::Value = serde_json::from_slice(&at(&[&time, "--json"])).unwrap();
    assert_eq!(orbit["time"], 3.0 * flow.period + 0.5);
    for (found, expected) in orbit["state"].as_array().unwrap().iter().zip(trajectory.state()) {
        assert!((found.as_f64().unwrap() - expected).abs() < 1e-12, "{found} {expected}");
    }
    let text = String::from_utf8(at(&["0"])).unwrap();
    assert!(text.contains("x1=0.125 v1=0.0 x2=-0.25 v2=1.5 at t = 0.0\n"), "{text}");
}

#[test]
fn orbit_folder_is_written_once_and_again_with_force() {
    let folder = folder();
    let orbit =
        |arguments: &[&str]| rattlemap(&folder).args(["orbit", "--out", "o"]).args(arguments).assert();
    orbit(&[]).success();
    let out = folder.path().join("o");
    assert_orbit_fields(&json(&out.join("orbit.json")));
    let files = names(&out);
    assert!(files.iter().any(|name| name.ends_with(".png")), "{files:?}");
    orbit(&[]).code(2);
    orbit(&["--force"]).success();
    assert_eq!(names(&out), files);
}

#[test]
fn bifurcation_writes_table_figure_and_manifest() {
    let folder = folder();
    // As many periods as `orbit` analyses first.
    let sets = ["--set", "omega=5.6", "--set", "integration.observed_periods=128"];
    let run = rattlemap(&folder).args(["bifurcation", SMOKE]).args(sets).assert();
    run.success().stdout("").stderr(says(&["5 of 5 columns", "bifurcation.csv"]));
    let out = folder.path().join("out/smoke");
    assert_eq!(names(&out), DIAGRAM);
    assert!(fs::read(out.join("bifurcation.png")).unwrap().starts_with(b"\x89PNG"));
    check_table(&out.join("bifurcation.csv"));
    check_columns(&out.join("bifurcation_columns.csv"));
    let manifest = fs::read_to_string(out.join("manifest.json")).unwrap();
    assert!(!manifest.contains(env!("CARGO_MANIFEST_DIR")), "a path of this machine: {manifest}");
    let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    assert_eq!(manifest["scene"], fs::read_to_string(SMOKE).unwrap());
    assert_eq!(manifest["set"], serde_json::json!([sets[1], sets[3]]));
    assert_eq!(manifest["engine"], "reference f64");
    assert_eq!(manifest["crate_version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(manifest["start"]["policy"], "rest");
    assert!(manifest["elapsed_seconds"].as_f64().unwrap() > 0.0);
}

/// Files in a diagram's folder.
const DIAGRAM: [&str; 4] = ["bifurcation.csv", "bifurcation.png", "bifurcation_columns.csv", "manifest.json"];

/// Checks that the table has one row per value, with the results of `orbit`.
fn check_columns(path: &Path) {
    let (header, rows) = rows(path);
    let columns = "e,class,period,word,pattern,lyapunov,lyapunov_error,impacts_per_period,mesh_fraction,symmetric,status,\
                   periods_run";
    assert_eq!((&*header, rows.len()), (columns, 5));
    for row in &rows {
        let set = format!("e={}", &row[0]);
        let orbit = printed(&folder(), &format!("orbit --json --set {set} --transient 200"));
        let is_periodic = &row[1] == "periodic";
        assert_eq!(orbit["class"], *row[1]);
        assert_eq!(orbit["period"].as_u64(), row[2].parse().ok());
        for (field, name) in [(3, "word"), (4, "pattern")] {
            let word = format!("w{}", orbit[name].as_str().unwrap());
            assert_eq!(&row[field], if is_periodic { word.as_str() } else { "" });
        }
        for (field, name) in
            [(5, "lyapunov"), (6, "lyapunov_error"), (7, "impacts_per_period"), (8, "mesh_fraction")]
        {
            assert_eq!(row[field].parse().ok(), orbit[name].as_f64(), "{name} at {set}");
        }
        assert_eq!(row[9].parse().ok(), orbit["symmetric"].as_bool());
        assert_eq!(orbit["status"], *row[10]);
    }
    assert!(rows.iter().any(|row| &row[1] == "periodic") && rows.iter().any(|row| &row[1] == "chaotic"));
}

fn check_table(path: &Path) {
    let (header, rows) = rows(path);
    let columns =
        "e,class,period,status,side,kind,t_mod_period,x1_before,v1_before,x2_before,v2_before,x1,v1,x2,v2";
    assert_eq!(header, columns);
    let mut values: Vec<&str> = rows.iter().map(|row| &*row[0]).collect();
    values.dedup();
    assert_eq!((values.len(), values[0], values[4]), (5, "0.4", "0.8"));
    assert_eq!(rows[0][1..4], ["periodic", "1", "ok"]);
    let period = std::f64::consts::TAU / 5.6;
    for row in &rows {
        let numbers: Vec<f64> = row.iter().skip(6).map(|field| field.parse().unwrap()).collect();
        assert!((0.0..period).contains(&numbers[0]), "{row:?}");
        let (side, gap): (f64, f64) = (row[4].parse().unwrap(), numbers[5] - numbers[7]);
        assert!((gap - 0.5 * side).abs() < 1e-9, "not on a wall: {row:?}");
    }
}

#[test]
fn second_bifurcation_run_needs_force_and_leaves_other_files_alone() {
    let folder = folder();
    let run = |arguments: &[&str]| {
        rattlemap(&folder).args(["bifurcation", SMOKE, "--set", "axis.0.count=2"]).args(arguments).assert()
    };
    run(&["--quiet"]).success().stdout("").stderr("");
    let out = folder.path().join("out/smoke");
    fs::write(out.join("notes.txt"), "precious").unwrap();
    run(&[]).code(2).stderr(says(&["the folder is not empty"]));
    let said = run(&["--force", "--set", "outputs.files=[\"csv\"]"]).success();
    said.stderr(says(&[
        "2 columns in ",
        " s: 1 periodic, 1 chaotic, 0 undecided, 0 failed\nout/smoke: bifurcation.csv, ",
    ]));
    assert_eq!(names(&out), ["bifurcation.csv", "bifurcation_columns.csv", "manifest.json", "notes.txt"]);
}

#[test]
fn orbit_help_explains_periods_and_transient() {
    run(&folder(), "orbit --help").success().stdout(says(&[
        "up to N/2",
        "periods, at most 64",
        "All of it is integrated",
    ]));
}

#[test]
fn advice_names_what_would_be_right() {
    let folder = folder();
    let model = include_str!("../../models/bilinear.toml").replace("\"omega\"", "\"omega**2\"");
    fs::write(folder.path().join("m.toml"), model).unwrap();
    fs::copy(SMOKE, folder.path().join("s.toml")).unwrap();
    let set = "a parameter is set by an option: --set e=0.6";
    for (line, advice) in [
        ("orbit --e 0.6", set),
        ("map s.toml -e 0.6", set),
        ("orbit --set e=0,6", "it must be a number, with a decimal point: 0.6"),
        ("models m.toml", "(a power is `^`, not `**`)"),
        (
            "bifurcation s.toml --set outputs.quantities=[\"energy\"]",
            "did you mean `impact_energy` or `friction_energy` or `release_energy`?",
        ),
    ] {
        run(&folder, line).code(2).stderr(says(&[advice]));
    }
}

#[test]
fn rows_of_orbit_have_at_most_120_characters() {
    for line in
        ["two-loose-gears", "two-loose-gears --from-start 2", "gear-pair", "absorber-chain --from-start 2"]
    {
        let text = stdout(&folder(), &format!("orbit --model {line}"));
        assert!(text.lines().all(|line| line.chars().count() <= 120), "{text}");
    }
}
