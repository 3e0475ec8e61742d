//! docs/scenes.md lists the columns of all files.

use std::fs;
use std::path::Path;

use crate::common::{empty, json, rows, run};

const TEXT: &str = include_str!("../../docs/scenes.md");

/// Names in the first column of the table under a heading of the page.
fn listed(heading: &str) -> Vec<&'static str> {
    let text = TEXT.split_once(&format!("\n### {heading}\n")).unwrap_or_else(|| panic!("no {heading}")).1;
    let rows = text.lines().skip_while(|line| !line.starts_with("| ---")).skip(1);
    let rows = rows.take_while(|line| line.starts_with('|'));
    rows.flat_map(|row| row.split('|').nth(1).unwrap().trim().split(", ")).collect()
}

fn header(path: &Path) -> Vec<String> {
    rows(path).0.split(',').map(str::to_owned).collect()
}

fn fields(path: &Path) -> Vec<String> {
    json(path).as_object().unwrap().keys().cloned().collect()
}

fn sorted<T: Ord>(mut list: Vec<T>) -> Vec<T> {
    list.sort_unstable();
    list
}

#[test]
fn the_page_lists_the_columns_of_all_files() {
    let folder = empty();
    let dir = folder.path();
    let axis =
        |name, min, max| format!("[[axis]]\nparameter = \"{name}\"\nmin = {min}\nmax = {max}\ncount = 3\n");
    let [e, omega] = [axis("e", 0.3, 0.5), axis("omega", 5.0, 6.0)];
    fs::write(dir.join("line.toml"), &e).unwrap();
    let everything =
        "[outputs]\nquantities = ['class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word', 'pattern']\n";
    fs::write(dir.join("plane.toml"), format!("{e}{omega}[start]\ncount = 2\n{everything}")).unwrap();
    run(&folder, "map plane.toml --engine cpu --quiet").code(0);
    run(&folder, "validate out/plane --quiet").code(0);
    run(&folder, "bifurcation line.toml --quiet --set start.policy=both").code(0);
    run(&folder, "orbit --set e=0.3 --refine --out out/orbit").code(0);
    run(&folder, "orbit --from-start 2 --out out/first").code(0);
    run(&folder, "compare out/plane out/plane --quiet").code(0);
    assert_eq!(header(&dir.join("out/compare/plane-plane/compare.csv")), listed("compare.csv"));
    run(&folder, "curves out/plane --quiet").code(0);
    for name in ["curves.csv", "curve_points.csv", "unexplained.csv"] {
        let all = header(&dir.join("out/curves/plane").join(name));
        let is_first = |name: &&String| !name.starts_with("multiplier") || name.starts_with("multiplier1_");
        let named: Vec<&str> = listed(name).into_iter().filter(|name| *name != "...").collect();
        assert_eq!(all.iter().filter(is_first).collect::<Vec<_>>(), named, "{name}");
    }
    let sample = "[start]\nsample = 'box'\nlow = [-0.2, -1, 0, -1]\nhigh = [0.2, 1, 0, 1]\ncount = 8\n";
    let energy = "[outputs]\nquantities = ['class', 'impact_energy']\nfiles = ['csv']\n";
    fs::write(dir.join("likely.toml"), format!("{e}{omega}{sample}{energy}")).unwrap();
    run(&folder, "map likely.toml --engine cpu --quiet").code(0);
    for name in ["shares.csv", "share_cells.csv", "share_attractors.csv"] {
        assert_eq!(header(&dir.join("out/likely").join(name)), listed(name), "{name}");
    }
    // Maps of lanes have a further column (map/engines.rs).
    let listed_cells = listed("cells.csv and cells.npy").into_iter().filter(|name| *name != "finished");
    assert_eq!(header(&dir.join("out/plane/cells.csv")), listed_cells.collect::<Vec<_>>());
    let start = |name| axis(name, -0.5, 0.5).replace("parameter", "start");
    let starts = format!("[parameters]\ne = 0.3\n{}{}", start("x1"), start("v2"));
    fs::write(dir.join("starts.toml"), starts).unwrap();
    run(&folder, "map starts.toml --engine cpu --quiet").code(0);
    assert_eq!(header(&dir.join("out/starts/attractors.csv")), listed("attractors.csv"));
    let measured = listed("Measured quantities");
    let quantities = "impact_speed impact_speed_max impact_energy impact_rate contact_force_max contact_force_rms amplitude rms \
                      harmonic dissipated multiplier stick_fraction friction_energy release_energy cycle_time state";
    let list: String = quantities.split_whitespace().map(|name| format!("'{name}', ")).collect();
    let requested = format!("[outputs]\nquantities = [{list}]\n");
    fs::write(dir.join("measured.toml"), format!("{e}{omega}{requested}")).unwrap();
    run(&folder, "map measured.toml --engine cpu --quiet").code(0);
    let columns = header(&dir.join("out/measured/cells.csv"));
    assert_eq!(columns[12..12 + measured.len()], measured, "all quantities after those that every table has");
    fs::write(dir.join("measured_line.toml"), format!("{e}{requested}")).unwrap();
    run(&folder, "bifurcation measured_line.toml --quiet").code(0);
    let columns = header(&dir.join("out/measured_line/bifurcation_columns.csv"));
    assert_eq!(columns[columns.len() - measured.len()..], measured);
    assert_eq!(header(&dir.join("out/plane/words.csv")), listed("words.csv"));
    assert_eq!(header(&dir.join("out/line/bifurcation.csv")), listed("bifurcation.csv"));
    assert_eq!(header(&dir.join("out/line/bifurcation_columns.csv")), listed("bifurcation_columns.csv"));
    fs::write(dir.join("stop.toml"), format!("model = 'impact-oscillator'\n{}", axis("F", 0.1, 1.0)))
        .unwrap();
    run(&folder, "bifurcation stop.toml --quiet --set start.policy=both").code(0);
    let strobe = "bifurcation_strobe.csv";
    assert_eq!(header(&dir.join("out/stop").join(strobe)), listed(strobe));
    // The gear pair has no units.
    let listed_without_units = listed("orbit.json").into_iter().filter(|field| *field != "units").collect();
    assert_eq!(sorted(fields(&dir.join("out/orbit/orbit.json"))), sorted(listed_without_units));
    assert_eq!(header(&dir.join("out/orbit/trajectory.csv")), listed("trajectory.csv"));
    assert_eq!(header(&dir.join("out/first/trajectory.csv")), listed("trajectory.csv"));
    assert_eq!(header(&dir.join("out/first/events.csv")), listed("events.csv"));
    assert_eq!(header(&dir.join("out/orbit/spectrum.csv")), listed("spectrum.csv"));
    assert_eq!(sorted(fields(&dir.join("out/plane/validation.json"))), sorted(listed("validation.json")));
}
