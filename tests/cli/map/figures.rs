//! Figures in each format: written, listed in the manifest, repaired, and replaced by other formats.

use super::*;

const LAYERS: [&str; 6] = ["impacts", "lyapunov", "map", "mesh", "pattern", "word"];

/// Names of the figures in a folder.
fn figures(out: &Path) -> Vec<String> {
    let is_figure = |name: &String| [".png", ".svg", ".pdf"].iter().any(|end| name.ends_with(end));
    names(out).into_iter().filter(is_figure).collect()
}

fn of_layers(ends: &[&str]) -> Vec<String> {
    LAYERS.iter().flat_map(|layer| ends.iter().map(move |end| format!("{layer}.{end}"))).collect()
}

#[test]
fn figures_of_a_map_come_in_each_format() {
    let folder = folder();
    map(&folder, &format!("{FEW} --quiet --format svg,pdf")).success();
    let out = folder.path().join("out/s");
    assert_eq!(figures(&out), of_layers(&["pdf", "svg"]));
    assert!(["cells.csv", "cells.npy", "report.html"].iter().all(|name| out.join(name).is_file()));
    let manifest = json(&out.join("manifest.json"));
    assert_eq!(manifest["set"][2], r#"outputs.files=["csv","npy","html","svg","pdf"]"#);
    let good = ["map.svg", "word.pdf"].map(|name| fs::read(out.join(name)).unwrap());
    fs::remove_file(out.join("map.svg")).unwrap();
    fs::write(out.join("word.pdf"), "%PDF").unwrap();
    fails(&folder, "check out/s --quiet", 1, &["map.svg is missing", "word.pdf is damaged"]);
    let run = succeeds(&folder, "check out/s --repair");
    run.stderr(says(&["map.svg was recreated", "word.pdf was recreated"]));
    assert_eq!(["map.svg", "word.pdf"].map(|name| fs::read(out.join(name)).unwrap()), good);
    // Resuming adds formats; so does a new run with --format.
    map(&folder, &format!("{FEW} --quiet --format png --resume")).success();
    assert_eq!(figures(&out), of_layers(&["pdf", "png", "svg"]));
    map(&folder, &format!("{FEW} --quiet --set outputs.files=[\"csv\",\"svg\"] --resume")).success();
    assert_eq!(figures(&out), of_layers(&["svg"]));
    map(&folder, &format!("{FEW} --quiet --format pdf --force")).success();
    assert_eq!(figures(&out), of_layers(&["pdf", "svg"]));
    // A new run without it writes the scene's formats, and names what it removes.
    let files = "--set outputs.files=[\"svg\"] --force";
    let removed = "out/s: removed files of an earlier run: cells.csv, cells.npy, impacts.pdf, lyapunov.pdf, map.pdf, \
                   mesh.pdf, pattern.pdf, report.html, word.pdf, words.csv\n";
    map(&folder, &format!("{FEW} {files}")).success().stderr(says(&[removed]));
    assert_eq!(figures(&out), of_layers(&["svg"]));
    assert!(!out.join("cells.csv").exists());
}

/// A finished map is drawn again without losing what belongs to its records.
#[test]
fn redrawing_a_map_keeps_its_validation_and_its_other_files() {
    let folder = folder();
    map(&folder, &format!("{FEW} --quiet")).success();
    succeeds(&folder, "validate out/s --samples 4 --quiet");
    let out = folder.path().join("out/s");
    let before = names(&out);
    let validation = fs::read(out.join("validation.json")).unwrap();
    let report = fs::read_to_string(out.join("report.html")).unwrap();
    let run = map(&folder, &format!("{FEW} --resume --format svg --set title=Other")).success();
    let text = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    assert!(!text.contains("removed") && !text.contains("cells/s"), "{text}");
    assert!(text.contains("12 cells, all by earlier runs; files written in "), "{text}");
    let after: Vec<String> = names(&out).into_iter().filter(|name| !name.ends_with(".svg")).collect();
    assert_eq!(after, before);
    assert_eq!(figures(&out), of_layers(&["png", "svg"]));
    assert!(fs::read(out.join("validation.json")).unwrap() == validation);
    // The page has the new title and the validation.
    let redrawn = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(redrawn.contains("Other") && redrawn != report);
    let manifest = json(&out.join("manifest.json"));
    assert!(manifest["timings"]["validate"].as_f64().unwrap() > 0.0, "{manifest}");
    succeeds(&folder, "check out/s").stderr(says(&["files are as manifest.json says"]));
    // Without options the same files are written again.
    map(&folder, &format!("{FEW} --quiet --resume")).success();
    assert_eq!(figures(&out), of_layers(&["png", "svg"]));
    assert!(fs::read_to_string(out.join("report.html")).unwrap() == report);
    // A damaged validation is removed, as is one of other records.
    for damaged in ["validation.json", "records.bin"] {
        succeeds(&folder, "validate out/s --samples 4 --quiet");
        damage(&out.join(damaged), 1);
        let run = map(&folder, &format!("{FEW} --resume")).success();
        run.stderr(says(&["out/s: removed files of an earlier run: validation.json\n"]));
        assert!(!out.join("validation.json").exists());
        succeeds(&folder, "check out/s --quiet");
    }
}

/// A model with one wall has no symmetric motion.
#[test]
fn a_legend_does_not_mention_symmetry_that_was_not_requested() {
    let folder = folder();
    let scene = "model = 'impact-oscillator'\n[parameters]\nsigma = 0.5\n\
                 [[axis]]\nparameter = 'omega'\nvalues = [1.4, 3.0]\n[[axis]]\nparameter = 'e'\nvalues = [0.7, 0.8]\n\
                 [outputs]\nquantities = ['class', 'impacts', 'mesh']\nfiles = ['svg']\n";
    fs::write(folder.path().join("one.toml"), scene).unwrap();
    succeeds(&folder, "map one.toml --engine cpu --out o --quiet");
    let figure = fs::read_to_string(folder.path().join("o/map.svg")).unwrap();
    let has = |text: &str| figure.contains(text);
    assert!(
        has("period 1, no contact") && has("period 1, intermittent contact") && !has("symmetric"),
        "{figure}"
    );
}

/// A shaft drives a loose gear. The flanks stay in contact while the drag exceeds the inertia, up to swing = 8.106. The driving
/// flank of a gear with elastic teeth stays in contact if its mean load exceeds the amplitude of the linear response.
#[test]
fn a_legend_names_motion_that_never_leaves_contact() {
    let folder = folder();
    let scene = |model: &str, axes: &str| {
        format!(
            "model = '{model}'\n{axes}[outputs]\nquantities = ['class', 'impacts', 'mesh']\nfiles = ['svg', 'html']\n"
        )
    };
    let axis = |name: &str, values: &str| format!("[[axis]]\nparameter = '{name}'\nvalues = {values}\n");
    let gear = axis("swing", "[4.0, 8.10, 8.11]") + &axis("e", "[0.0, 0.5]");
    let teeth = axis("F_m", "[0.01, 0.2]") + &axis("omega", "[0.4, 0.5]");
    for (name, text, share) in
        [("gear", scene("loose-gear", &gear), "66.7 %"), ("teeth", scene("kahraman-singh", &teeth), "50.0 %")]
    {
        fs::write(folder.path().join(format!("{name}.toml")), text).unwrap();
        succeeds(&folder, &format!("map {name}.toml --engine cpu --out {name} --quiet"));
        let [figure, report] = ["map.svg", "report.html"]
            .map(|file| fs::read_to_string(folder.path().join(name).join(file)).unwrap());
        let has = |text: &str| figure.contains(text);
        assert!(has("period 1, always in contact") && has("period 1, intermittent contact"), "{figure}");
        let entry = format!(r#""color":"ebaac8","text":"period 1, always in contact","share":"{share}""#);
        assert!(report.contains(&entry), "{entry}");
    }
}

#[test]
fn figures_of_diagrams_and_orbits_come_in_each_format() {
    let folder = folder();
    let line = "[[axis]]\nparameter = 'e'\nmin = 0.4\nmax = 0.5\ncount = 2\n";
    fs::write(folder.path().join("line.toml"), line).unwrap();
    let run = |line: &str| succeeds(&folder, line);
    run("bifurcation line.toml --out b --quiet --format pdf,png");
    let b = folder.path().join("b");
    assert_eq!(figures(&b), ["bifurcation.pdf", "bifurcation.png"]);
    run("bifurcation line.toml --out b --quiet --format svg --force");
    assert_eq!(figures(&b), ["bifurcation.pdf", "bifurcation.png", "bifurcation.svg"]);
    let removed = "b: removed files of an earlier run: bifurcation.pdf, bifurcation.svg\n";
    run("bifurcation line.toml --out b --force").stderr(says(&[removed]));
    assert_eq!(figures(&b), ["bifurcation.png"]);
    assert!(["bifurcation.csv", "bifurcation_columns.csv"].iter().all(|name| b.join(name).is_file()));
    run("orbit --out o --format svg");
    let o = folder.path().join("o");
    assert_eq!(figures(&o), ["gap.svg", "phase_plane.svg", "spectrum.svg", "time_history.svg"]);
    run("check o --quiet");
    run("orbit --out o --force --format png").stderr(predicate::str::contains("removed").not());
    assert_eq!(figures(&o).len(), 8);
    let removed =
        "o: removed files of an earlier run: gap.svg, phase_plane.svg, spectrum.svg, time_history.svg\n";
    run("orbit --out o --force").stderr(says(&[removed]));
    assert_eq!(figures(&o), ["gap.png", "phase_plane.png", "spectrum.png", "time_history.png"]);
    fails(&folder, "orbit --format svg", 2, &["--out"]);
    fails(&folder, "map s.toml --format eps", 2, &["eps", "png, svg, pdf"]);
}
