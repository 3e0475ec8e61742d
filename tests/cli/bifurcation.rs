//! Bifurcation diagrams: upwards and downwards, and along one axis of a plane.

use std::fs;
use std::path::Path;

use crate::common::{empty as folder, json, names, rattlemap, rows, run, says};

/// A range in which period 4 changes to period 2, with hysteresis.
const HYSTERESIS: &str =
    "parameters = { omega = 5.6 }\naxis = [{ parameter = 'e', min = 0.915, max = 0.935, count = 21 }]\n";

/// Files in a diagram's folder.
const DIAGRAM: [&str; 4] = ["bifurcation.csv", "bifurcation.png", "bifurcation_columns.csv", "manifest.json"];

/// The rows of `bifurcation_columns.csv` in a folder.
fn columns(folder: &Path) -> Vec<Vec<String>> {
    rows(&folder.join("bifurcation_columns.csv")).1
}

fn manifest(folder: &Path) -> serde_json::Value {
    json(&folder.join("manifest.json"))
}

/// Between 0.92 and 0.927 the attractor depends on the direction in which it is followed.
#[test]
fn a_diagram_of_both_directions_reports_where_they_differ() {
    let folder = folder();
    fs::write(folder.path().join("h.toml"), HYSTERESIS).unwrap();
    run(&folder, "bifurcation h.toml --set start.policy=both").success().stderr(says(&[
        "42 of 42 columns",
        "up and down differ by class or period in ",
        " of 21 columns, at e = 0.92",
    ]));
    let out = folder.path().join("out/h");
    assert_eq!(names(&out), DIAGRAM);
    let both = columns(&out);
    assert_eq!(both.len(), 42);
    let mut differing = 0;
    for (policy, rows) in ["up", "down"].into_iter().zip(both.chunks(21)) {
        let line = format!("bifurcation h.toml --quiet --out {policy} --set start.policy={policy}");
        run(&folder, &line).success();
        let alone = columns(&folder.path().join(policy));
        for (row, alone) in rows.iter().zip(&alone) {
            assert_eq!(row[1], policy);
            assert_eq!([&row[..1], &row[2..]].concat(), *alone, "the pass alone");
        }
        differing = alone.iter().zip(&both).filter(|(a, b)| a[1..3] != b[2..4]).count();
    }
    let manifest = manifest(&out);
    assert_eq!(manifest["start"]["policy"], "both");
    assert_eq!(manifest["hysteresis"]["differing"], differing);
    assert!(differing > 3, "{differing}");
    let points = fs::read_to_string(out.join("bifurcation.csv")).unwrap();
    assert!(points.starts_with("e,direction,class,"), "{}", points.lines().next().unwrap());
    assert!(points.contains(",up,") && points.contains(",down,"));
}

/// The stable cycle with impacts ends at a fold. From there an unstable branch leads back to the graze of the motion without contact.
#[test]
fn branches_have_their_unstable_parts_and_special_points() {
    let folder = folder();
    let scene = "model = 'coco-impact'\nparameters = { omega = 1.1 }\naxis = [{ parameter = 'A', min = 0.05, max = 0.9, count = 8 }]\n\
                 outputs = { quantities = ['amplitude'], files = ['csv', 'svg'] }\n";
    fs::write(folder.path().join("b.toml"), scene).unwrap();
    run(&folder, "bifurcation b.toml --branches").success().stderr(says(&[
        "branches with ",
        " special points",
        "special_points.csv",
    ]));
    let out = folder.path().join("out/b");
    let (head, special) = rows(&out.join("special_points.csv"));
    assert!(head.starts_with("branch,kind,arclength,A,word,period,stable,x,"), "{head}");
    let value = |kind: &str| {
        let found =
            special.iter().find(|row| row[1] == kind).unwrap_or_else(|| panic!("no {kind}: {special:?}"));
        found[3].parse::<f64>().unwrap()
    };
    // Closed forms: tests/gallery/branches.rs.
    assert!((value("fold") - 0.116443006937796).abs() < 1e-12, "{special:?}");
    assert!((value("grazing") - 0.237065391822594).abs() < 1e-10, "{special:?}");
    let (head, points) = rows(&out.join("branches.csv"));
    let place = |name: &str| {
        head.split(',').position(|field| field == name).unwrap_or_else(|| panic!("no {name}: {head:?}"))
    };
    let [stable, amplitude] = ["stable", "amplitude_x"].map(place);
    for is_stable in ["true", "false"] {
        let of: Vec<f64> = points
            .iter()
            .filter(|row| row[stable] == is_stable)
            .map(|row| row[amplitude].parse().unwrap())
            .collect();
        assert!(of.len() > 10 && of.iter().all(|x| *x > 0.0), "{is_stable}: {of:?}");
    }
    let figure = fs::read_to_string(out.join("bifurcation.svg")).unwrap();
    assert!(figure.contains("unstable") && figure.contains("stroke-dasharray"), "dashed lines");
    run(&folder, "bifurcation b.toml --force").success();
    assert!(!names(&out).contains(&"branches.csv".to_owned()), "{:?}", names(&out));
}

#[test]
fn a_map_refuses_both_directions_with_the_remedy() {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/e_omega.toml");
    let run = rattlemap(&folder()).args(["map", scene, "--set", "start.policy=both"]).assert();
    run.code(2).stderr(says(&["`start.policy = both` does not fit: a map shows one", "`rattlemap compare`"]));
}

#[test]
fn a_line_through_a_plane_equals_a_scene_of_one_axis() {
    let folder = folder();
    let plane = "title = 'A plane'\n[[axis]]\nparameter = 'e'\nmin = 0.3\nmax = 0.5\ncount = 3\n\
                 [[axis]]\nparameter = 'omega'\nmin = 5.0\nmax = 6.0\ncount = 2\n[refine]\n\
                 [outputs]\nfiles = ['html', 'npy', 'csv']\n";
    let line = "parameters = { omega = 5.65 }\n[[axis]]\nparameter = 'e'\nmin = 0.3\nmax = 0.5\ncount = 3\n";
    fs::write(folder.path().join("plane.toml"), plane).unwrap();
    fs::write(folder.path().join("line.toml"), line).unwrap();
    run(&folder, "bifurcation plane.toml")
        .code(2)
        .stderr(says(&["one table for `bifurcation`", "--along e --at omega=VALUE"]));
    run(&folder, "bifurcation plane.toml --along e")
        .code(2)
        .stderr(says(&["--along e: `--at omega=VALUE` is missing"]));
    assert!(!folder.path().join("out").exists(), "an output folder was created");
    run(&folder, "bifurcation plane.toml --along e --at omega=5.65").success();
    run(&folder, "bifurcation line.toml").success();
    let [out, alone] = ["out/plane.e.omega=5.65", "out/line"].map(|name| folder.path().join(name));
    assert_eq!(names(&out), ["bifurcation.csv", "bifurcation_columns.csv", "manifest.json"]);
    assert_eq!(columns(&out), columns(&alone));
    let manifest = manifest(&out);
    assert_eq!((&manifest["along"], &manifest["at"]), (&"e".into(), &serde_json::json!(["omega=5.65"])));
    assert_eq!((&manifest["scene"], &manifest["parameters"]["omega"]), (&plane.into(), &5.65.into()));
    run(&folder, "bifurcation line.toml --at omega=5").code(2);
}

/// The title of such a scene describes the plane. Options of figures override the scene.
#[test]
fn the_figure_of_a_line_names_the_line_and_has_the_requested_width() {
    let folder = folder();
    let plane = "title = 'A plane'\n[[axis]]\nparameter = 'e'\nmin = 0.3\nmax = 0.5\ncount = 3\n\
                 [[axis]]\nparameter = 'omega'\nmin = 5.0\nmax = 6.0\ncount = 2\n[figure]\nwidth = '120mm'\n";
    fs::write(folder.path().join("plane.toml"), plane).unwrap();
    let draw = |options: &str| {
        let line = "bifurcation plane.toml --along e --at omega=5.65 --format svg --out b --force";
        run(&folder, &format!("{line} {options}")).success();
        fs::read_to_string(folder.path().join("b/bifurcation.svg")).unwrap()
    };
    let (svg, titles) = (draw(""), ["A plane, along e at \u{3c9} = 5.65", "periodic"]);
    assert!(titles.iter().all(|text| svg.contains(text)) && svg.contains("width=\"4.7244in\""), "{svg:.400}");
    let svg = draw("--width 85mm --no-legend --title=");
    assert!(
        !titles.iter().any(|text| svg.contains(text)) && svg.contains("width=\"3.3465in\""),
        "{svg:.400}"
    );
    for (options, part) in
        [("--width 85", "such as \"85mm\""), ("--width 60mm --font-size 9", "at most 8 points")]
    {
        run(&folder, &format!("orbit --out o {options}")).code(2).stderr(says(&[part]));
        assert!(!folder.path().join("o").exists());
    }
}

/// At sigma = 0.2 the mass hits the stop; at 2 its amplitude of 1/3 does not reach it.
const ONE_STOP: &str = "model = 'impact-oscillator'\nparameters = { omega = 2.0, zeta = 0.02 }\n\
    [[axis]]\nparameter = 'sigma'\nmin = 0.2\nmax = 2.0\ncount = 2\n[outputs]\nfiles = ['csv', 'svg']\n";

#[test]
fn a_model_whose_wall_fixes_the_displacement_has_a_table_of_strobe_states() {
    let folder = folder();
    fs::write(folder.path().join("stop.toml"), ONE_STOP).unwrap();
    run(&folder, "bifurcation stop.toml --quiet").success();
    let out = folder.path().join("out/stop");
    let strobe = "bifurcation_strobe.csv";
    assert_eq!(
        names(&out),
        ["bifurcation.csv", "bifurcation.svg", "bifurcation_columns.csv", strobe, "manifest.json"]
    );
    let listed = manifest(&out)["files"].to_string();
    assert!(listed.contains(strobe), "{listed}");
    let (header, strobes) = rows(&out.join(strobe));
    assert_eq!(header, "sigma,class,period,status,x,v");
    let of = |value: &str| strobes.iter().filter(|row| row[0] == value).collect::<Vec<_>>();
    // One row per period of the cycle.
    let hit = of("0.2");
    assert_eq!(hit.len().to_string(), hit[0][2], "{hit:?}");
    // Without contact: the steady response, F / (1 - omega^2 + 2 i zeta omega).
    let [free] = of("2.0")[..] else { panic!("{strobes:?}") };
    let [x, v] = [4, 5].map(|i| free[i].parse::<f64>().unwrap());
    let (stiffness, damping) = (1.0 - 4.0, 2.0 * 0.02 * 2.0);
    let square = stiffness * stiffness + damping * damping;
    assert!((x - stiffness / square).abs() < 1e-13 && (v - 2.0 * damping / square).abs() < 1e-13, "{x} {v}");
    let svg = fs::read_to_string(out.join("bifurcation.svg")).unwrap();
    for text in
        ["right wall, x = \u{3c3}", "velocity before contact, v", "x at phase 0", "phase 0 of each period"]
    {
        assert!(svg.contains(&format!(">{text}</text>")), "{text}");
    }
    assert!(!svg.contains("left wall") && !svg.contains("|z|"));
    // A gap of two displacements does not fix them: the diagram shows displacements, and there is no strobe table.
    fs::write(folder.path().join("h.toml"), HYSTERESIS.replace("count = 21", "count = 2")).unwrap();
    run(&folder, "bifurcation h.toml --quiet").success();
    assert_eq!(names(&folder.path().join("out/h")), DIAGRAM);
}
