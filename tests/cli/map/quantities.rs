//! Measured quantities of a map: columns, figures, audits, and records that are stored, merged and read again.

use super::*;

const ALL: &str = "impact_speed impact_speed_max impact_energy impact_rate contact_force_max contact_force_rms amplitude rms harmonic \
                   dissipated multiplier stick_fraction friction_energy release_energy cycle_time state";

/// A folder with a scene `s.toml` of a model, over two of its parameters, that requests all measured quantities.
fn measured(model: &str, axes: [(&str, f64, f64); 2], counts: [usize; 2], more: &str) -> TempDir {
    let axis = |((name, min, max), count)| {
        format!("[[axis]]\nparameter = '{name}'\nmin = {min:?}\nmax = {max:?}\ncount = {count}\n")
    };
    let axes: String = axes.into_iter().zip(counts).map(axis).collect();
    let list: String = ALL.split_whitespace().map(|name| format!("'{name}', ")).collect();
    with(&format!("model = '{model}'\n{axes}[outputs]\nquantities = ['class', {list}]\n{more}"))
}

const GEARS: [(&str, f64, f64); 2] = [("e", 0.1, 0.9), ("omega", 2.0, 10.0)];

/// The numbers of a column; none where the field is empty.
fn column(csv: &Path, name: &str) -> Vec<Option<f64>> {
    let (header, rows) = rows(csv);
    let place = header.split(',').position(|column| column == name).unwrap_or_else(|| panic!("no {name}"));
    rows.iter().map(|row| (!row[place].is_empty()).then(|| row[place].parse().unwrap())).collect()
}

#[test]
fn a_model_with_one_coordinate_has_columns_and_figures_of_that_coordinate() {
    let axes = [("F", 0.5, 1.5), ("omega", 1.5, 3.0)];
    let folder = measured("impact-oscillator", axes, [3, 3], "");
    succeeds(&folder, "map s.toml --engine cpu --quiet");
    let out = folder.path().join("out/s");
    let (header, _) = rows(&out.join("cells.csv"));
    let names = "impact_speed,impact_speed_max,impact_energy,impact_rate,contact_force_max,contact_force_rms,amplitude_x,mean_x,\
                 amplitude_gap,mean_gap,rms_x,rms_gap,harmonic_x,harmonic_phase_x,harmonic_gap,harmonic_phase_gap,dissipated,\
                 multiplier,multiplier_argument,stick_fraction,friction_energy,release_energy,cycle_time,state_x,state_v,status";
    assert!(header.contains(&format!(",{names},")), "{header}");
    let files = crate::common::names(&out);
    for name in names.split(',').filter(|name| *name != "status") {
        assert!(files.contains(&format!("{name}.png")), "no figure of {name}");
    }
    let figure = fs::read(out.join("mean_x.png")).unwrap();
    ["mean_x.png", "cells.csv"].iter().for_each(|name| fs::remove_file(out.join(name)).unwrap());
    succeeds(&folder, "check out/s --repair --quiet");
    assert!(fs::read(out.join("mean_x.png")).unwrap() == figure && out.join("cells.csv").exists());
    fs::write(out.join("partial-mean_x.png"), "left by a killed run").unwrap();
    succeeds(&folder, "map s.toml --engine cpu --quiet --resume");
    assert!(!out.join("partial-mean_x.png").exists());
    let csv = out.join("cells.csv");
    assert_eq!(column(&csv, "contact_force_max"), [None; 9], "a rigid stop has no force");
    let [x, gap] = ["amplitude_x", "amplitude_gap"].map(|name| column(&csv, name));
    assert!(
        x == gap && x.iter().all(|value| value.is_some_and(|value| value > 0.0)),
        "the gap is the coordinate"
    );
}

#[test]
fn shards_and_records_keep_measured_quantities() {
    let folder = measured("gear-pair", GEARS, [5, 4], "");
    let cells = |name: &str| fs::read(folder.path().join(name).join("cells.csv")).unwrap();
    succeeds(&folder, "map s.toml --engine cpu --quiet --out whole");
    for shard in 1..=2 {
        succeeds(&folder, &format!("map s.toml --engine cpu --quiet --shard {shard}/2 --out part-{shard}"));
    }
    succeeds(&folder, "merge merged --quiet part-1 part-2");
    let whole = cells("whole");
    assert!(cells("merged") == whole);
    fs::remove_file(folder.path().join("whole/cells.csv")).unwrap();
    succeeds(&folder, "check whole --repair");
    assert!(cells("whole") == whole, "read from the records");
    let speeds = column(&folder.path().join("whole/cells.csv"), "impact_speed");
    assert!(speeds.iter().any(|speed| speed.is_some_and(|speed| speed > 0.0)));
}

#[test]
fn numbers_of_a_map_are_those_of_its_orbits() {
    let folder = measured("gear-pair", GEARS, [2, 2], "");
    succeeds(&folder, "map s.toml --engine cpu --quiet");
    let orbit = printed(&folder, "orbit --set e=0.1 --set omega=2.0 --json");
    let csv = folder.path().join("out/s/cells.csv");
    let numbers = orbit["quantities"].as_object().unwrap();
    assert_eq!(orbit["class"], "periodic");
    for (name, value) in
        numbers.iter().filter(|(name, _)| !name.ends_with("_right") && !name.ends_with("_left"))
    {
        let (own, value) = (column(&csv, name)[0], value.as_f64());
        let is_near = own.zip(value).is_none_or(|(a, b)| (a - b).abs() <= 1e-6 * (1.0 + b.abs()));
        assert!(own.is_some() == value.is_some() && is_near, "{name}: {own:?} {value:?}");
    }
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn an_adaptive_map_fills_and_audits_measured_quantities() {
    let refine = "[refine]\nminimum_grid = 4\n[parameters]\ne = 0.6\n";
    let folder = measured("gear-pair", [("k", 100.0, 200.0), ("omega", 9.0, 10.0)], [17, 17], refine);
    succeeds(&folder, "map s.toml --engine cpu --quiet");
    let out = folder.path().join("out/s");
    let manifest = crate::common::json(&out.join("manifest.json"));
    let audits = manifest["refinement"]["audits"].as_array().unwrap();
    let errors = &audits.last().unwrap()["errors"];
    assert!(errors["amplitude_x1"]["compared"].as_u64().unwrap() > 0, "{errors}");
    let (amplitude, worst) =
        (column(&out.join("cells.csv"), "amplitude_x1"), &errors["amplitude_x1"]["worst"]);
    let largest = amplitude.iter().flatten().fold(0.0, |a: f64, b| a.max(*b));
    assert!(worst.as_f64().unwrap() < 0.05 * largest, "{worst} of {largest}");
    assert_eq!(manifest["measured"]["mean_gap"]["long_name"], "mean of gap");
    succeeds(&folder, "validate out/s --quiet --samples 20");
}

/// The impact oscillator has chaos that ends.
#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn chaos_that_ends_is_counted_by_maps_and_by_validations() {
    let folder = with(include_str!("../../../scenes/gallery/impact_oscillator.toml"));
    let few = "--set axis.0.count=16 --set axis.1.count=16 --engine cpu";
    let run = map(&folder, &format!("{few} --set integration.confirm_chaos=2000")).success();
    run.stderr(says(&["chaos ended ", " of these cells end in 1000 periods"]));
    let out = folder.path().join("out/s");
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains(" % end in 1000 T\""), "the legend states the rate");
    assert_eq!(json(&out.join("manifest.json"))["integration"]["confirm_chaos"], 2000);
    fails(&folder, &format!("map s.toml {few} --resume"), 2, &["integration.confirm_chaos"]);
    // A map whose chaotic cells do not continue states no rate.
    let run = map(&folder, &format!("{few} --force")).success();
    let said = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    assert!(!said.contains("chaos: "), "{said}");
    assert!(!fs::read_to_string(out.join("report.html")).unwrap().contains("end in 1000"));
    let run = succeeds(&folder, "validate out/s --samples 100 --chaos-periods 1500");
    run.stderr(says(&["Chaos was followed in 20 of ", " for 1500 further periods: it ends in "]));
    let ends = json(&out.join("validation.json"))["chaos_ends"].clone();
    assert_eq!((&ends["further_periods"], &ends["followed"]), (&1500.into(), &20.into()));
    let cells = ends["cells"].as_array().unwrap();
    assert_eq!(ends["ended"]["count"], cells.len());
    assert!(cells.iter().all(|cell| cell["replay"].is_string() && cell["values"]["omega"].is_number()));
    assert!(fs::read_to_string(out.join("report.html")).unwrap().contains("\"further_periods\":1500"));
    succeeds(&folder, "validate out/s --samples 5 --chaos-periods 0 --quiet");
    assert!(json(&out.join("validation.json"))["chaos_ends"].is_null());
}

/// A quarter car with bump stops on the suspension `susp`, whose tyre may lift off, and two loose gears with walls of law `impact`.
#[test]
fn contacts_of_each_gap_are_counted_apart() {
    let car = [("v", 20.0, 100.0), ("A", 0.02, 0.08)];
    let folder = measured("quarter_car.toml", car, [4, 4], "files = ['csv', 'svg']\n");
    fs::write(folder.path().join("quarter_car.toml"), include_str!("../../gallery/data/quarter_car.toml"))
        .unwrap();
    let gears = measured(
        "two-loose-gears",
        [("A", 2e-4, 8e-4), ("omega", 150.0, 230.0)],
        [3, 3],
        "files = ['csv']\n",
    );
    let quantities = "class impacts mesh impact_energy contact_force_max".replace(' ', "\",\"");
    let line = format!("map s.toml --engine cpu --quiet --set outputs.quantities=[\"{quantities}\"]");
    for (folder, [a, b]) in [(&folder, ["susp", "tyre"]), (&gears, ["a", "b"])] {
        succeeds(folder, &line);
        let cells = folder.path().join("out/s/cells.csv");
        let of = |name: &str| column(&cells, name);
        let each = |name: &str| [a, b].map(|gap| of(&format!("{name}_{gap}")));
        let close = |x: f64, y: f64| (x - y).abs() <= 1e-9 * x.abs().max(y.abs()).max(1.0);
        let [first, second] = each("impact_energy");
        for ((whole, a), b) in of("impact_energy").into_iter().zip(first).zip(second) {
            assert!(close(whole.unwrap(), a.unwrap() + b.unwrap()), "{whole:?} {a:?} {b:?}");
        }
        let [first, second] = each("contact_force_max");
        for ((whole, a), b) in of("contact_force_max").into_iter().zip(first).zip(second) {
            assert_eq!(whole, a.into_iter().chain(b).reduce(f64::max), "{a:?} {b:?}");
        }
        // Averages of all gaps together cover other periods if the motion is not periodic.
        let (header, table) = rows(&cells);
        let class = header.split(',').position(|name| name == "class").unwrap();
        let periodic: Vec<usize> = (0..table.len()).filter(|&id| table[id][class] == "periodic").collect();
        assert!(periodic.len() > 2);
        let of = |name: &str| periodic.iter().map(|&id| of(name)[id]).collect::<Vec<_>>();
        let each = |name: &str| [a, b].map(|gap| of(&format!("{name}_{gap}")));
        let [first, second] = each("mesh_fraction");
        for ((whole, a), b) in of("mesh_fraction").into_iter().zip(first).zip(second) {
            let [whole, a, b] = [whole, a, b].map(Option::unwrap);
            assert!(whole > a.max(b) - 1e-9 && whole < a + b + 1e-9, "{whole} {a} {b}");
        }
        let [first, second] = each("impacts_per_period");
        for ((whole, a), b) in of("impacts_per_period").into_iter().zip(first).zip(second) {
            assert!(close(whole.unwrap(), a.unwrap() + b.unwrap()), "{whole:?} {a:?} {b:?}");
        }
    }
    // The tyre is always in contact where the road is flat, and the suspension never; a bump stop is hit where it is rough.
    let cells = folder.path().join("out/s/cells.csv");
    let [susp, tyre] = ["susp", "tyre"].map(|gap| column(&cells, &format!("mesh_fraction_{gap}")));
    assert!(susp[0] == Some(0.0) && tyre[0].unwrap() > 1.0 - 1e-9, "{susp:?} {tyre:?}");
    assert!(susp.iter().any(|share| share.unwrap() > 0.0) && tyre.iter().any(|share| share.unwrap() < 0.99));
    let map = fs::read_to_string(folder.path().join("out/s/map.svg")).unwrap();
    assert!(map.contains("susp always open"), "{map:.300}");
    succeeds(&folder, &format!("{line} --force --set figure.gap=\"tyre\""));
    let map = fs::read_to_string(folder.path().join("out/s/map.svg")).unwrap();
    assert!(map.contains("tyre always closed") && !map.contains("susp always"), "{map:.300}");
    fails(&folder, "map s.toml --force --set figure.gap=\"tire\"", 2, &["susp", "tyre"]);
}
