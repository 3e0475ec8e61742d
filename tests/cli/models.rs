//! `rattlemap models`: the page says what the code does. Models of one's own, as `docs/models.md` has them.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use rattlemap::model::{GearPair, Model};
use rattlemap::model_file::{BUILT_IN, FileModel};
use rattlemap_dynamics::orbit::{Class, Status};
use serde_json::Value;

const TEXT: &str = include_str!("../../docs/models.md");

/// A block of the page's TOML.
fn toml(nth: usize) -> &'static str {
    TEXT.split("```toml\n").nth(nth + 1).and_then(|rest| rest.split("```").next()).unwrap()
}

fn rattlemap(folder: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("rattlemap").unwrap().current_dir(folder).args(arguments).assert()
}

fn stdout_in(folder: &Path, arguments: &[&str]) -> String {
    let run = rattlemap(folder, arguments).code(0).stderr("");
    String::from_utf8(run.get_output().stdout.clone()).unwrap()
}

fn stdout(arguments: &[&str]) -> String {
    stdout_in(Path::new("."), arguments)
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// The page's model and its scene in a folder.
fn my_model() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("my-bilinear.toml"), toml(0)).unwrap();
    fs::write(folder.path().join("my-map.toml"), toml(1)).unwrap();
    fs::write(folder.path().join("my-basin.toml"), toml(2)).unwrap();
    folder
}

#[test]
fn every_model_has_a_line_and_a_page() {
    let list = stdout(&["models"]);
    assert_eq!(list.lines().count(), BUILT_IN.len(), "{list}");
    for (line, model) in list.lines().zip(FileModel::all_built_in()) {
        assert!(line.starts_with(&format!("{} ", model.name())), "{line}");
        assert!(line.ends_with(model.definition().summary.as_ref().unwrap()), "{line}");
        let page = stdout(&["models", model.name()]);
        let has = |words: &[&str]| {
            let found =
                page.lines().any(|line| line.split_whitespace().collect::<Vec<_>>().starts_with(words));
            assert!(found, "{words:?} is not in\n{page}");
        };
        for parameter in model.parameters() {
            let default = parameter.default.map_or("-".to_owned(), |value| value.to_string());
            let (range, meaning) = (parameter.range.requirement(), &parameter.meaning);
            let line = format!("{} {default} {range} {meaning}", parameter.name);
            has(&line.split_whitespace().collect::<Vec<_>>());
        }
        Status::ALL.into_iter().for_each(|status| has(&[status.name()]));
        Class::NAMES.into_iter().for_each(|class| has(&[class]));
        assert!(model.equations().iter().all(|line| page.contains(line)), "{page}");
        assert!(page.contains(model.source().unwrap()), "{page}");
        let wide =
            page.lines().find(|line| line.chars().count() > 130 && !line.contains(model.source().unwrap()));
        assert_eq!(wide, None, "too long for a terminal");
        assert_eq!(
            stdout(&["models", model.name(), "--file"]).trim_end(),
            model.definition().text.trim_end()
        );
    }
    let page = stdout(&["models", "gear-pair"]);
    assert_eq!(FileModel::built_in("gear-pair").unwrap().parameters(), GearPair::PARAMETERS);
    for part in [
        "F cos(omega t)",
        "P_{1 2^2 6 4 5^2 3}",
        "13554622",
        "135462,",
        "mesh_speed is a choice",
        "Rattling Vibration in Gear Systems",
        "6  free, from the left to the right",
    ] {
        assert!(page.contains(part), "{part}");
    }
    let one_wall = stdout(&["models", "shaking-table"]);
    assert!(
        one_wall.contains("5  free, from the left to the left") && !one_wall.contains("2  free"),
        "{one_wall}"
    );
}

#[test]
fn unknown_model_is_refused_with_the_names() {
    let run = rattlemap(Path::new("."), &["models", "gears\u{1b}"]).code(2).stdout("");
    let error = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    assert!(error.starts_with("error: no model is called `gears\\u{1b}`; there is gear-pair, "), "{error}");
    assert!(error.ends_with("or give the path of a model's file, such as my-model.toml\n"), "{error}");
    let run = rattlemap(Path::new("."), &["orbit", "--model", "no/such.toml"]).code(2).stdout("");
    let error = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    assert!(error.contains("cannot be read at no/such.toml"), "{error}");
    let folder = my_model();
    fs::write(folder.path().join("my-bilinear.toml"), toml(0).replace("[[0.1]]", "[[-0.1]]")).unwrap();
    for arguments in [&["map", "my-map.toml"][..], &["models", "my-bilinear.toml"]] {
        let run = rattlemap(folder.path(), arguments).code(2).stdout("");
        let error = String::from_utf8(run.get_output().stderr.clone()).unwrap();
        assert!(
            error.starts_with("error: my-bilinear.toml:5:18: `motion.damping = [[-0.1]]` does"),
            "{error}"
        );
    }
}

/// The page's commands, and what else can be asked of a map. The folder is enough once the model's file is gone.
#[test]
fn a_model_of_ones_own_has_maps_basins_diagrams_and_orbits() {
    let folder = my_model();
    let at = |name: &str| folder.path().join(name);
    assert!(stdout_in(folder.path(), &["models", "my-bilinear.toml"]).contains("N = k (z - d)"));
    let map = ["map", "my-map.toml", "--engine", "cpu", "--quiet"];
    rattlemap(folder.path(), &map).code(0);
    let csv = fs::read_to_string(at("out/my-map/cells.csv")).unwrap();
    assert!(csv.starts_with("i,j,omega,d,class,period"), "{csv}");
    assert_eq!(csv.lines().count(), 1 + 96 * 72);
    assert!(!csv.contains("failed"), "{csv}");
    let manifest = json(&at("out/my-map/manifest.json"));
    assert_eq!(manifest["model"]["name"], "my-bilinear");
    assert_eq!(manifest["model"]["text"], toml(0));
    assert_eq!(fs::read_to_string(at("out/my-map/model.toml")).unwrap(), toml(0));
    let report = fs::read_to_string(at("out/my-map/report.html")).unwrap();
    assert!(report.contains(" --model model.toml"));

    rattlemap(folder.path(), &["map", "my-basin.toml", "--engine", "cpu", "--quiet"]).code(0);
    let attractors = fs::read_to_string(at("out/my-basin/attractors.csv")).unwrap();
    assert_eq!(attractors.lines().count(), 1 + 3, "{attractors}");

    let line = ["bifurcation", "my-map.toml", "--along", "omega", "--at", "d=0.5", "--quiet"];
    rattlemap(folder.path(), &line).code(0);
    let csv = fs::read_to_string(at("out/my-map.omega.d=0.5/bifurcation.csv")).unwrap();
    assert!(
        csv.starts_with("omega,class,period,status,side,kind,t_mod_period,x_before,v_before,x,v\n"),
        "{csv}"
    );
    assert!(csv.contains(",1,mesh_start,") && !csv.contains(",impact,"), "{csv}");

    let orbit =
        ["orbit", "--model", "my-bilinear.toml", "--set", "omega=0.8", "--json", "--out", "out/motion"];
    let run = rattlemap(folder.path(), &orbit).code(0);
    let orbit: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    assert_eq!(orbit["omega"], 0.8);
    assert!(orbit.get("e").is_none());
    assert_eq!(orbit["strobe"].as_array().unwrap().len(), 2);
    assert_eq!(orbit["events"][0]["before"].as_array().unwrap().len(), 2);
    let table = fs::read_to_string(at("out/motion/trajectory.csv")).unwrap();
    assert!(table.starts_with("t,phase,z,w,x,v,domain,event,side,moment\n"), "{table}");
    assert_eq!(json(&at("out/motion/manifest.json"))["model"]["text"], toml(0));

    // Another text is another model; without its file nothing is begun anew, and the folder stands by itself.
    let resume = [&map[..], &["--resume"]].concat();
    rattlemap(folder.path(), &resume).code(0);
    fs::write(at("my-bilinear.toml"), toml(0).replace("0.1", "0.2")).unwrap();
    let run = rattlemap(folder.path(), &resume).code(2);
    let error = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    assert!(error.contains("model.hash"), "{error}");
    fs::remove_file(at("my-bilinear.toml")).unwrap();
    fs::remove_file(at("out/my-map/model.toml")).unwrap();
    fs::remove_file(at("out/my-map/cells.csv")).unwrap();
    rattlemap(folder.path(), &["check", "out/my-map"]).code(1);
    rattlemap(folder.path(), &["check", "out/my-map", "--repair"]).code(0);
    assert_eq!(fs::read_to_string(at("out/my-map/model.toml")).unwrap(), toml(0));
    rattlemap(folder.path(), &["check", "out/my-map"]).code(0);
}

/// The start has as many numbers as the model.
#[test]
fn a_start_has_the_models_components() {
    let start = |model: &str, start: &str| {
        let run = rattlemap(Path::new("."), &["orbit", "--model", model, "--start", start, "--json"]);
        let output = run.get_output();
        (output.status.code(), String::from_utf8(output.stderr.clone()).unwrap())
    };
    assert_eq!(start("impact-oscillator", "0.1,0").0, Some(0));
    let (code, error) = start("impact-oscillator", "0.1,0,0,0");
    assert_eq!((code, error.contains("two finite numbers, the model's x, v")), (Some(2), true), "{error}");
    let (code, error) = start("gear-pair", "0.1,0");
    assert_eq!(
        (code, error.contains("four finite numbers, the model's x1, v1, x2, v2")),
        (Some(2), true),
        "{error}"
    );
}

/// The defaults are fine, so the place is what was set.
#[test]
fn motion_that_is_set_out_of_its_limits_names_what_was_set() {
    let folder = my_model();
    let orbit = ["orbit", "--model", "my-bilinear.toml", "--set", "d=1", "--set", "k=-0.5"];
    let run = rattlemap(folder.path(), &orbit).code(2);
    let stderr = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    assert_eq!(
        stderr,
        "error: --set d=1 --set k=-0.5: stiffness added in contact with the right wall = -0.5: it must be at least 0 \
         where the wall is elastic; change the parameters\n"
    );
}
