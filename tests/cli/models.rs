//! `rattlemap models`, and models from files as in `docs/models.md`.

use std::fs;

use rattlemap::model::{GearPair, Model};
use rattlemap::model_file::{BUILT_IN, FileModel};
use tempfile::TempDir;

use crate::common::{empty, json, printed, rattlemap, run};

const TEXT: &str = include_str!("../../docs/models.md");

/// A TOML block of the page.
fn toml(nth: usize) -> &'static str {
    TEXT.split("```toml\n").nth(nth + 1).and_then(|rest| rest.split("```").next()).unwrap()
}

/// The output of a command that succeeds.
fn stdout(folder: &TempDir, line: &str) -> String {
    let run = run(folder, line).code(0).stderr("");
    String::from_utf8(run.get_output().stdout.clone()).unwrap()
}

/// The message of a command that is refused.
fn refusal(folder: &TempDir, line: &str) -> String {
    let run = run(folder, line).code(2).stdout("");
    String::from_utf8(run.get_output().stderr.clone()).unwrap()
}

/// A folder with the page's model and scenes.
fn my_model() -> TempDir {
    let folder = empty();
    for (nth, name) in ["my-bilinear", "my-map", "my-basin"].into_iter().enumerate() {
        fs::write(folder.path().join(format!("{name}.toml")), toml(nth)).unwrap();
    }
    folder
}

#[test]
fn every_model_has_a_line_and_a_page() {
    let folder = empty();
    let list = stdout(&folder, "models");
    assert_eq!(list.lines().count(), BUILT_IN.len(), "{list}");
    for (line, model) in list.lines().zip(FileModel::all_built_in()) {
        assert!(line.starts_with(&format!("{} ", model.name())), "{line}");
        assert!(line.ends_with(model.definition().summary.as_ref().unwrap()), "{line}");
        let page = stdout(&folder, &format!("models {}", model.name()));
        let has = |words: &[&str]| {
            let found =
                page.lines().any(|line| line.split_whitespace().collect::<Vec<_>>().starts_with(words));
            assert!(found, "{words:?} is not in\n{page}");
        };
        for parameter in model.parameters() {
            let default = parameter.default.map_or("-".to_owned(), |value| value.to_string());
            let (range, meaning) = (parameter.range.requirement(), &parameter.meaning);
            let unit = parameter.unit.as_deref().unwrap_or_default();
            let line = format!("{} {default} {unit} {range} {meaning}", parameter.name);
            has(&line.split_whitespace().collect::<Vec<_>>());
        }
        assert!(model.equations().iter().all(|line| page.contains(line)), "{page}");
        model.contacts().iter().for_each(|row| has(&row.join(" ").split_whitespace().collect::<Vec<_>>()));
        assert!(page.contains(model.source().unwrap()), "{page}");
        let wide =
            page.lines().find(|line| line.chars().count() > 130 && !line.contains(model.source().unwrap()));
        assert_eq!(wide, None, "too long for a terminal");
        assert_eq!(
            stdout(&folder, &format!("models {} --file", model.name())).trim_end(),
            model.definition().text.trim_end()
        );
    }
    let page = stdout(&folder, "models gear-pair");
    assert_eq!(FileModel::built_in("gear-pair").unwrap().parameters(), GearPair::PARAMETERS);
    let walls = "    wall   at  law     restitution  sustained up to  contact force\n    \
                 right  b   impact  e            mesh_speed       k (z - b) + r w\n    \
                 left   -b  impact  e            mesh_speed       k (z + b) + r w\n";
    for part in ["F cos(omega t)", walls, "mesh_speed is a choice", "Rattling Vibration in Gear Systems"] {
        assert!(page.contains(part), "{part} is not in\n{page}");
    }
    for (name, engine) in [
        ("gear-pair", "Engine: pair, for up to two coordinates and one gap: "),
        ("friction-oscillator", "Engine: machine, because of dry friction: "),
        ("two-loose-gears", "Engine: machine, because of more than two coordinates: "),
    ] {
        assert!(stdout(&folder, &format!("models {name}")).contains(engine), "{name}");
    }
}

#[test]
fn unknown_and_wrong_models_are_refused() {
    let folder = my_model();
    let error = refusal(&folder, "models gears\u{1b}");
    assert!(
        error.starts_with("error: no model is called `gears\\u{1b}`; the built-in models are gear-pair, "),
        "{error}"
    );
    assert!(error.ends_with("or give the path of a model's file, such as my-model.toml\n"), "{error}");
    let error = refusal(&folder, "orbit --model no/such.toml");
    assert!(error.contains("cannot be read at no/such.toml"), "{error}");
    fs::write(folder.path().join("my-bilinear.toml"), toml(0).replace("mass = [[1]]", "mass = [[-1]]"))
        .unwrap();
    for line in ["map my-map.toml", "models my-bilinear.toml"] {
        let error = refusal(&folder, line);
        assert!(error.starts_with("error: my-bilinear.toml:4:15: `motion.mass = [[-1]]` does"), "{error}");
    }
}

/// A ball of 20 g on a table, in SI units, with a coordinate `z`.
const BALL: &str = r#"name = "ball"
motion.coordinates = ["z"]
motion.mass = [["m"]]
motion.force = ["m*A*(2*pi*f)^2"]
motion.load = ["-9.81*m"]
motion.frequency = "2*pi*f"
motion.gap = [1]
motion.units = ["m"]
motion.time_unit = "s"
contact = [{ side = "left", at = 0, law = "impact", restitution = "e" }]
[parameters]
m = { default = 0.02, min = 0.0, open = true, meaning = "mass of the ball", unit = "kg" }
A = { default = 1.1e-4, meaning = "amplitude of the table", unit = "m" }
f = { default = 50.0, min = 0.0, open = true, meaning = "frequency of the table", unit = "Hz" }
e = { default = 0.3, min = 0.0, max = 1.0 }
"#;

#[test]
fn units_and_significant_digits_are_printed() {
    let folder = empty();
    fs::write(folder.path().join("ball.toml"), BALL).unwrap();
    let page = stdout(&folder, "models ball.toml");
    for part in [
        "state z [m], v [m/s]; forcing period 2 pi over 2*pi*f\n",
        "f       50       Hz    finite and greater than 0  frequency of the table\n",
        "left  0   impact  e            0                keeps gap = 0 while pressed\n",
    ] {
        assert!(page.contains(part), "{part} is not in\n{page}");
    }
    let summary = stdout(&folder, "orbit --model ball.toml --start 0.001,0");
    for part in ["m=0.02 [kg] A=0.00011 [m] f=50.0 [Hz] e=0.3", "(T = 0.02 [s])"] {
        assert!(summary.contains(part), "{part} is not in\n{summary}");
    }
    let (_, table) = summary.split_once("(T = 0.02 [s])\n").unwrap();
    let heads: Vec<&str> =
        table.lines().next().unwrap().split("  ").filter(|head| !head.is_empty()).collect();
    let heads: Vec<&str> = heads.into_iter().map(str::trim).collect();
    let expected =
        "kind|side|t [s]|t mod T [s]|impulse|z [m] before|v [m/s] before|z [m] after|v [m/s] after";
    assert_eq!(heads.join("|"), expected);
    let found = printed(&folder, "orbit --model ball.toml --start 0.001,0 --json");
    let units = &found["units"];
    let listed: Vec<&str> =
        ["m", "f", "z", "v", "gap", "gap_rate", "t"].map(|name| units[name].as_str().unwrap()).into();
    assert_eq!(listed, ["kg", "Hz", "m", "m/s", "m", "m/s", "s"]);
    assert!(units["e"].is_null());
    for event in found["events"].as_array().unwrap() {
        let speed = event["before"][1].as_f64().unwrap();
        let shown = summary.split_whitespace().filter_map(|word| word.parse::<f64>().ok());
        assert!(
            shown.into_iter().any(|x| (x - speed).abs() <= 5e-6 * speed.abs()),
            "{speed} is not in {summary}"
        );
    }
    run(&folder, "orbit --model ball.toml --out o").code(0);
    let header = crate::common::rows(&folder.path().join("o/trajectory.csv")).0;
    assert!(header.starts_with("t,phase,gap,gap_rate,z,v,domain"), "{header}");
}

#[test]
fn a_model_in_place_of_a_scene_is_named_and_so_is_a_scene_in_place_of_a_model() {
    let folder = my_model();
    let error = refusal(&folder, "map my-bilinear.toml");
    assert!(error.starts_with("error: my-bilinear.toml:3:1: `motion = "), "{error}");
    assert!(error.contains("this file is a model, but a scene is needed"), "{error}");
    let error = refusal(&folder, "orbit --model my-map.toml");
    assert!(error.contains("this file is a scene, but a model is needed"), "{error}");
    let error = refusal(&folder, "orbit omega=0.8");
    assert!(error.contains("a parameter is set by an option: --set omega=0.8"), "{error}");
    assert!(!refusal(&folder, "models bilinear omega=0.8").contains("--set"));
    let error = refusal(&folder, "map none.toml");
    assert!(error.contains("such as scenes/e_omega.toml"), "{error}");
}

/// The page's commands. A map's folder can be repaired without the model's file.
#[test]
fn a_model_from_a_file_has_maps_basins_diagrams_and_orbits() {
    let folder = my_model();
    let at = |name: &str| folder.path().join(name);
    assert!(stdout(&folder, "models my-bilinear.toml").contains("k (z - d)"));
    let map = "map my-map.toml --engine cpu --quiet";
    run(&folder, map).code(0);
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

    run(&folder, "map my-basin.toml --engine cpu --quiet").code(0);
    let attractors = fs::read_to_string(at("out/my-basin/attractors.csv")).unwrap();
    assert_eq!(attractors.lines().count(), 1 + 3, "{attractors}");

    run(&folder, "bifurcation my-map.toml --along omega --at d=0.5 --quiet").code(0);
    let csv = fs::read_to_string(at("out/my-map.omega.d=0.5/bifurcation.csv")).unwrap();
    assert!(
        csv.starts_with("omega,class,period,status,side,kind,t_mod_period,x_before,v_before,x,v\n"),
        "{csv}"
    );
    assert!(csv.contains(",1,mesh_start,") && !csv.contains(",impact,"), "{csv}");

    let orbit = printed(&folder, "orbit --model my-bilinear.toml --set omega=0.8 --json --out out/motion");
    assert_eq!(orbit["omega"], 0.8);
    assert!(orbit.get("e").is_none());
    assert_eq!(orbit["strobe"].as_array().unwrap().len(), 2);
    assert_eq!(orbit["events"][0]["before"].as_array().unwrap().len(), 2);
    let table = fs::read_to_string(at("out/motion/trajectory.csv")).unwrap();
    assert!(table.starts_with("t,phase,z,w,x,v,domain,event,side,moment,contact_force\n"), "{table}");
    assert_eq!(json(&at("out/motion/manifest.json"))["model"]["text"], toml(0));

    // A changed model cannot be resumed.
    let resume = format!("{map} --resume");
    run(&folder, &resume).code(0);
    fs::write(at("my-bilinear.toml"), toml(0).replace("0.1", "0.2")).unwrap();
    let error = refusal(&folder, &resume);
    assert!(error.contains("model.hash"), "{error}");
    fs::remove_file(at("my-bilinear.toml")).unwrap();
    fs::remove_file(at("out/my-map/model.toml")).unwrap();
    fs::remove_file(at("out/my-map/cells.csv")).unwrap();
    run(&folder, "check out/my-map").code(1);
    run(&folder, "check out/my-map --repair").code(0);
    assert_eq!(fs::read_to_string(at("out/my-map/model.toml")).unwrap(), toml(0));
    run(&folder, "check out/my-map").code(0);
}

/// A ball that falls from 1 m with e = 0.7: its state after 1 s is known. It comes to rest after 2.56 s.
#[test]
fn an_unforced_motion_does_not_depend_on_the_frequency() {
    let folder = empty();
    for frequency in ["1", "0.3", "7.0", "2*pi"] {
        let text = toml(5).replace("motion.frequency = 1", &format!("motion.frequency = \"{frequency}\""));
        fs::write(folder.path().join("ball.toml"), text).unwrap();
        let orbit = printed(&folder, "orbit --model ball.toml --start 1,0 --time 1 --json");
        let off = |i: usize, exact: f64| (orbit["state"][i].as_f64().unwrap() - exact).abs();
        assert!(off(0, 0.2250597607) < 1e-10 && off(1, -2.2799402393) < 1e-10, "{frequency}: {orbit}");
        assert_eq!(
            (&orbit["class"], &orbit["period"]),
            (&"periodic".into(), &1.into()),
            "{frequency}: {orbit}"
        );
    }
}

#[test]
fn harmonics_and_stages_are_printed_and_computed() {
    let folder = empty();
    let gear = format!("{}\n{}", toml(7), toml(6).replace("F2", "0.1*F"));
    fs::write(folder.path().join("my-gear.toml"), gear).unwrap();
    let page = stdout(&folder, "models my-gear.toml");
    for part in [
        "stages  1 from phase 0, 2 from phase eps - 1 of each 1/20 of the forcing period",
        "x'' + 0.1 x' + N = F cos(Omega t) + 0.1*F cos(2 Omega t) - 0.3*F sin(2 Omega t) + 0.1",
        "[k2 | k1] (z - 1)",
    ] {
        assert!(page.contains(part), "{part} is not in\n{page}");
    }
    let orbit = printed(&folder, "orbit --model my-gear.toml --json");
    assert_eq!(orbit["class"], "periodic", "{orbit}");
}

#[test]
fn dry_friction_is_printed() {
    let folder = empty();
    let motion = "name = 'belt'\nparameters = { u = 0.1, mu = 0.2, m1 = 1, g = 9.81, f = 0.3 }\n[motion]\n\
                  coordinates = ['x', 'y']\nmass = [['m1', 0], [0, 2]]\nstiffness = [[1, 0], [0, 1]]\nfrequency = 1\n\
                  gap = [1, -1]\n";
    let wall = "[[contact]]\nside = 'left'\nat = -1\nlaw = 'elastic'\nstiffness = 9\n";
    fs::write(folder.path().join("belt.toml"), format!("{motion}{}{wall}", toml(8))).unwrap();
    let page = stdout(&folder, "models belt.toml");
    for part in [
        "friction  sticks at x' - u = 0 while |friction force| <= mu*m1*g\n",
        "friction  sticks at x' - y' = 0 while |friction force| <= f\n",
        "m1 x'' + x + mu*m1*g sgn(x' - u) + f sgn(x' - y') + N = 0\n",
        "2 y'' + y - f sgn(x' - y') - N = 0\n",
    ] {
        assert!(page.contains(part), "{part} is not in\n{page}");
    }
    let page = stdout(&folder, "models friction-oscillator");
    assert!(page.contains("Walls\n\n    none\n") && !page.contains("N ="), "{page}");
}

#[test]
fn several_gaps_and_restitution_by_speed_are_printed() {
    let folder = empty();
    fs::write(folder.path().join("my-driveline.toml"), toml(12)).unwrap();
    let page = stdout(&folder, "models my-driveline.toml");
    for part in [
        "gap   mesh = x1 - x2\n    rate  mesh' = v1 - v2\n    gap   shaft = x2 - x3\n",
        "    x1'' + c x1' - c x2' + N_mesh = F cos(omega t) + T\n",
        "0.3 x2 - 0.3 x3 - N_mesh + N_shaft = 0\n",
        "[k2 | k1] (mesh - b)\n",
        "right of shaft  d   impact   e - 0.1*speed^0.5",
        "keeps shaft = d while pressed\n",
        "speed: size of the rate before the impact",
        "state x1, v1, x2, v2, x3, v3;",
    ] {
        assert!(page.contains(part), "{part} is not in\n{page}");
    }
}

/// Lanes of a map with stages and harmonics are computed again for its validation.
#[test]
#[ignore = "compiles large shaders; scripts/test.sh --all"]
fn a_map_with_harmonics_and_stages_is_validated() {
    let folder = empty();
    let axis = |name: &str, min: f64, max: f64| {
        format!("[[axis]]\nparameter = \"{name}\"\nmin = {min}\nmax = {max}\ncount = 4\n")
    };
    let scene = format!("model = \"mesh-stiffness\"\n{}{}", axis("omega", 0.6, 1.2), axis("kappa", 0.5, 1.0));
    fs::write(folder.path().join("scene.toml"), scene).unwrap();
    run(&folder, "map scene.toml --engine cpu --out out --quiet").code(0);
    run(&folder, "validate out --samples 16 --quiet").code(0);
}

#[test]
fn a_start_needs_as_many_numbers_as_the_models_state() {
    let start = |model: &str, start: &str| {
        let run = rattlemap(&empty()).args(["orbit", "--model", model, "--start", start, "--json"]).assert();
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

#[test]
fn a_parameter_outside_its_limits_is_refused_with_the_set_arguments() {
    assert_eq!(
        refusal(&my_model(), "orbit --model my-bilinear.toml --set d=1 --set k=-0.5"),
        "error: --set d=1 --set k=-0.5: stiffness of right wall 1 = -0.5: it must be finite and at least 0; \
         change the parameters\n"
    );
}

#[cfg(unix)]
#[test]
fn models_come_from_standard_input_and_from_paths_that_are_not_text() {
    let folder = empty();
    let text = stdout(&folder, "models bilinear --file");
    let name: &std::ffi::OsStr = std::os::unix::ffi::OsStrExt::from_bytes(b"m\xff.toml");
    fs::write(folder.path().join(name), &text).unwrap();
    for name in ["-".as_ref(), "/dev/stdin".as_ref(), name] {
        rattlemap(&folder).arg("models").arg(name).write_stdin(text.clone()).assert().success();
        rattlemap(&folder).args(["orbit", "--model"]).arg(name).write_stdin(text.clone()).assert().success();
    }
    let large = rattlemap(&folder).args(["models", "-"]).write_stdin("#".repeat(1_000_001)).assert().code(2);
    large.stderr(predicates::str::contains("the model in standard input has more than 1.0 MB"));
}
