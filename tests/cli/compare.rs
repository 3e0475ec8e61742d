//! `rattlemap compare`: the differing cells of two maps, and maps that cannot be compared.

use std::fs;
use std::path::Path;

use assert_cmd::assert::Assert;
use rattlemap::record::Record;
use rattlemap::store::inventory;
use rattlemap::store::record_file::{Identity, Order, RecordFile};
use tempfile::TempDir;

use crate::common::{empty, json, rows, run, says, with_scene};

/// A range in which period 4 ends, later on the way up than on the way down.
const SCENE: &str = "title = 'Around a fold'
axis = [
    { parameter = 'omega', min = 5.5, max = 5.7, count = 12 },
    { parameter = 'e', min = 0.915, max = 0.937, count = 12 },
]
[outputs]
quantities = ['class', 'lyapunov', 'symmetric', 'word', 'pattern']
files = ['csv']
";

/// Creates a folder with finished maps; each has a name and `--set` arguments.
fn maps(of: &[(&str, &[&str])]) -> TempDir {
    let folder = with_scene(SCENE);
    of.iter().for_each(|(name, sets)| map(&folder, name, sets));
    folder
}

fn map(folder: &TempDir, name: &str, sets: &[&str]) {
    let sets: String = sets.iter().map(|set| format!(" --set {set}")).collect();
    run(folder, &format!("map s.toml --engine cpu --quiet --out {name}{sets}")).success();
}

fn compare(folder: &TempDir, line: &str) -> Assert {
    run(folder, &format!("compare {line}"))
}

/// The object that a command prints.
fn printed(run: &Assert) -> serde_json::Value {
    serde_json::from_slice(&run.get_output().stdout).unwrap()
}

#[test]
fn differing_cells_are_those_of_the_tables() {
    let folder = maps(&[("m/up", &["start.policy=up"]), ("m/down", &["start.policy=down"])]);
    let [(_, up), (_, down)] =
        ["up", "down"].map(|name| rows(&folder.path().join(format!("m/{name}/cells.csv"))));
    // Columns of compare.csv, from i, j, omega, e, class, period and lyapunov of both tables.
    let differing: Vec<[String; 11]> = up
        .iter()
        .zip(&down)
        .filter(|(a, b)| a[4..6] != b[4..6])
        .map(|(a, b)| {
            let kind = if a[4] == b[4] { "period" } else { "class" };
            let place =
                [&a[0], &a[1], &a[2], &a[3], &a[4], &a[5], &b[4], &b[5], &a[6], &b[6]].map(String::clone);
            std::array::from_fn(|i| place.get(i).cloned().unwrap_or_else(|| kind.to_owned()))
        })
        .collect();
    let kinds = ["class", "period"].map(|kind| differing.iter().filter(|row| row[10] == kind).count());
    assert!(kinds.iter().all(|&count| count > 0), "{kinds:?}: no difference");
    let done = compare(&folder, "m/up m/down --json").success().stderr(says(&[
        "start: up in A, down in B",
        &format!("{} of 144 cells differ (", differing.len()),
        &format!("): {} by class, {} by period", kinds[0], kinds[1]),
        "cells with the same period in both maps differ: ",
        " in symmetry, ",
        " by word, ",
        " by pattern, ",
        "out/compare/up-down: compare.csv, compare.png, manifest.json",
    ]));
    let out = folder.path().join("out/compare/up-down");
    let (header, found) = rows(&out.join("compare.csv"));
    assert_eq!(header, "i,j,omega,e,class_a,period_a,class_b,period_b,lyapunov_a,lyapunov_b,kind,quantities");
    let decisive = found.iter().filter(|row| ["class", "period"].contains(&&*row[10]));
    assert_eq!(decisive.map(|row| &row[..11]).collect::<Vec<_>>(), differing);
    let manifest = json(&out.join("manifest.json"));
    let printed = printed(&done);
    assert_eq!(
        (&manifest["command"], &printed["folder"]),
        (&"compare".into(), &"out/compare/up-down".into())
    );
    for object in [&manifest, &printed] {
        assert_eq!((&object["cells"], &object["differing"]), (&144.into(), &differing.len().into()));
        assert_eq!((&object["by_class"], &object["by_period"]), (&kinds[0].into(), &kinds[1].into()));
        let sides = ["a", "b"]
            .map(|side| [&object[side]["folder"], &object[side]["engine"], &object[side]["precision"]]);
        assert_eq!(sides, [["up", "cpu", "f64"], ["down", "cpu", "f64"]]);
        assert_eq!(
            object["scene_differences"],
            serde_json::json!([{ "name": "start", "a": "up", "b": "down" }])
        );
        let moved: u64 = object["transitions"]
            .as_array()
            .unwrap()
            .iter()
            .map(|pair| pair["cells"].as_u64().unwrap())
            .sum();
        assert_eq!(moved, kinds[0] as u64);
    }
    check_picture(&out.join("compare.png"), &differing);
    run(&folder, "check out/compare/up-down").success();
    compare(&folder, "m/up m/down").code(2).stderr(says(&["the folder is not empty", "--force"]));
    // With --fail the exit code is 1, and the files are written.
    let failed = compare(&folder, "m/down m/up --fail --quiet").code(1).stdout("");
    failed.stderr(format!("error: {} of 144 cells differ by class or period\n", differing.len()));
    assert!(folder.path().join("out/compare/down-up/manifest.json").is_file());
}

/// Rattling on the way up and motion without contact on the way down have the same class and period.
#[test]
fn cells_that_differ_by_pattern_are_listed_and_do_not_fail() {
    let sets = |policy| {
        ["axis.0.parameter=e", "axis.0.min=0.05", "axis.0.max=0.1", "axis.0.count=2"]
            .into_iter()
            .chain(["axis.1.parameter=omega", "axis.1.min=8.5", "axis.1.max=12", "axis.1.count=8", policy])
            .collect::<Vec<_>>()
    };
    let folder = maps(&[("up", &sets("start.policy=up")), ("down", &sets("start.policy=down"))]);
    let patterns = ["up", "down"].map(|name| {
        let path = folder.path().join(name).join("cells.csv");
        let mut table = csv::Reader::from_path(path).unwrap();
        let at = table.headers().unwrap().iter().position(|field| field == "pattern").unwrap();
        table.records().map(|row| row.unwrap()[at].to_owned()).collect::<Vec<_>>()
    });
    let differing = patterns[0].iter().zip(&patterns[1]).filter(|(up, down)| up != down).count();
    assert!(differing > 3, "{patterns:?}");
    let done = compare(&folder, "up down --fail --json --out c").success();
    let object = printed(&done);
    let counts = ["differing", "by_pattern", "by_word"].map(|name| object[name].as_u64().unwrap());
    assert_eq!(counts, [0, differing as u64, 0]);
    let (_, rows) = rows(&folder.path().join("c/compare.csv"));
    assert_eq!(rows.iter().filter(|row| row[10] == "pattern").count(), differing);
    assert!(rows.iter().all(|row| row[10] == "pattern" || row[10] == "motion"), "{rows:?}");
    let picture = image::open(folder.path().join("c/compare.png")).unwrap().to_rgb8();
    let pixels = picture.pixels().filter(|pixel| pixel.0 == [0xf6, 0xd9, 0x8b]).count();
    assert!(pixels > 0, "no pixel has the colour of patterns");
}

/// Checks that each kind's colour has the area of its cells.
fn check_picture(path: &Path, differing: &[[String; 11]]) {
    let picture = image::open(path).unwrap().to_rgb8();
    let cell = (1024 / 12 * 12 / 12) as usize * (1024 / 12) as usize;
    let share = |color: [u8; 3]| {
        let pixels = picture.pixels().filter(|pixel| pixel.0 == color).count();
        // The patch of the legend is a hundredth of a cell.
        (pixels as f64 / cell as f64).round() as usize
    };
    let of = |a: &str, b: &str| differing.iter().filter(|row| row[4] == a && row[6] == b).count();
    assert_eq!(share([0xd5, 0x5e, 0x00]), of("periodic", "chaotic"));
    assert_eq!(share([0x00, 0x72, 0xb2]), of("chaotic", "periodic"));
    assert_eq!(share([0x00, 0x9e, 0x73]), of("periodic", "periodic"));
}

#[test]
fn equal_maps_of_two_versions_do_not_differ() {
    let few = ["axis.0.count=4", "axis.1.count=3"];
    let folder = maps(&[("a", &few), ("b", &few)]);
    of_other_sources(&folder.path().join("b"));
    let done = compare(&folder, "a b --fail --out c --format svg,pdf").success().stdout("");
    done.stderr(says(&["no cell of 12 differs by class or period", "exponents of 12 by at most 0.0e0"]));
    let (_, found) = rows(&folder.path().join("c/compare.csv"));
    assert!(found.is_empty(), "{found:?}");
    let svg = fs::read_to_string(folder.path().join("c/compare.svg")).unwrap();
    assert!(
        svg.contains(">class differs</text>")
            && svg.contains(concat!("by version ", env!("CARGO_PKG_VERSION"), " (")),
        "{svg:.400}"
    );
    assert!(fs::read(folder.path().join("c/compare.pdf")).unwrap().starts_with(b"%PDF"));
    let manifest = json(&folder.path().join("c/manifest.json"));
    assert_eq!(
        (&manifest["b"]["crate_version"], &manifest["b"]["commit"]),
        (&"0.0.9".into(), &"feed".into())
    );
    assert_eq!(manifest["exponents"]["largest"], 0.0);
    assert_eq!(manifest["attractors"], serde_json::Value::Null);
    // `validate` needs a map of its own version.
    run(&folder, "validate b").code(2).stderr(says(&["made by rattlemap 0.0.9"]));
}

/// Changes a map's folder into one that another version with other sources has written.
fn of_other_sources(out: &Path) {
    let (records, manifest) = (out.join("records.bin"), out.join("manifest.json"));
    let mut object = json(&manifest);
    let foreign = Identity::read(&records).unwrap().unwrap().built_from("0123", "other processor");
    let mut records_of_map: Vec<(u32, Record)> = Vec::new();
    let own = Identity::read(&records).unwrap().unwrap();
    let take = |batch: &[(u32, Record)]| {
        records_of_map.extend_from_slice(batch);
        true
    };
    RecordFile::read(&records, &own, Order::Any, take).unwrap();
    RecordFile::create(&records, &foreign).unwrap().append(&records_of_map).unwrap();
    for (field, value) in
        [("sources", "0123"), ("target", "other processor"), ("crate_version", "0.0.9"), ("commit", "feed")]
    {
        object[field] = value.into();
    }
    fs::write(manifest, inventory::sealed(object).unwrap()).unwrap();
}

/// Where a response curve jumps, run-up and coast-down have equal class, period and pattern, and other amplitudes.
#[test]
fn cycles_of_equal_period_differ_by_motion_and_quantities() {
    let folder = with_scene(
        "model = 'kahraman-singh'
        axis = [
            { parameter = 'F_m', min = 0.15, max = 0.17, count = 2 },
            { parameter = 'omega', min = 0.7, max = 1.0, count = 13 },
        ]
        [outputs]
        quantities = ['class', 'pattern', 'amplitude']
        files = ['csv']
        ",
    );
    ["up", "down"].into_iter().for_each(|name| map(&folder, name, &[&format!("start.policy={name}")]));
    let cells = ["up", "down"].map(|name| rows(&folder.path().join(format!("{name}/cells.csv"))));
    let at = |column: &str| cells[0].0.split(',').position(|name| name == column).unwrap();
    let (class, period, amplitude) = (at("class"), at("period"), at("amplitude_x"));
    let far = cells[0].1.iter().zip(&cells[1].1).filter(|(up, down)| {
        let [a, b] = [up, down].map(|row| row[amplitude].parse::<f64>().unwrap());
        up[class] == "periodic" && up[period] == down[period] && (a - b).abs() > 0.05 * a.max(b)
    });
    let far = far.count();
    assert!(far > 2, "{far} cells");
    let done = compare(&folder, "up down --fail quantities --json --out c").code(1);
    let object = printed(&done);
    let (_, listed) = rows(&folder.path().join("c/compare.csv"));
    let equal = listed.iter().filter(|row| row[5] == row[7] && row[4] == "periodic");
    let named = equal.clone().filter(|row| row[11].split(' ').any(|name| name == "amplitude_x")).count();
    assert_eq!(named, far, "{listed:?}");
    assert!(equal.clone().all(|row| row[10] != "period" && row[10] != "class"));
    let amplitudes =
        object["quantities"].as_array().unwrap().iter().find(|of| of["name"] == "amplitude_x").unwrap();
    assert!(amplitudes["differing"].as_u64().unwrap() as usize >= far, "{object}");
    let others = ["by_pattern", "by_motion"].map(|kind| object[kind].as_u64().unwrap() as usize);
    assert!(others[1] > 0 && others[0] + others[1] >= far, "{object}");
    done.stderr(says(&["amplitude_x differs by more than 5 % in ", "error: ", "motion or quantities"]));
    // Half of the larger amplitude is a larger tolerance, and folders may follow --fail.
    compare(&folder, "--fail up up --quiet --out d").success();
    let tolerant = printed(&compare(&folder, "up down --tolerance 0.5 --json --out e").success());
    assert_ne!(tolerant["quantities"], object["quantities"]);
    compare(&folder, "up down --tolerance 5").code(2).stderr(says(&["above 0 and below 1"]));
}

#[test]
fn all_classes_are_compared() {
    let folder = with_scene(include_str!("../../scenes/gallery/absorber_chain.toml"));
    let few = ["axis.0.count=3", "axis.1.count=3"];
    map(&folder, "a", &few);
    let short = [
        "integration.observed_periods=20",
        "integration.transient_periods=20",
        "integration.undecided_periods=0",
    ];
    map(&folder, "b", &[&few[..], &short].concat());
    let object = printed(&compare(&folder, "a b --json").success());
    let classes: Vec<&str> =
        object["transitions"].as_array().unwrap().iter().filter_map(|pair| pair["a"].as_str()).collect();
    assert!(classes.contains(&"quasi-periodic"), "{object}");
}

/// Lists have no indices along axes, and no figure.
#[test]
fn lists_of_cells_are_compared_row_by_row() {
    let folder = empty();
    for (name, points) in [("s", "e,omega\n0.4,5.6\n0.92,5.6\n"), ("t", "e,omega\n0.4,5.6\n0.92,5.7\n")] {
        fs::write(folder.path().join(format!("{name}.csv")), points).unwrap();
        fs::write(folder.path().join(format!("{name}.toml")), format!("cells.file = '{name}.csv'\n"))
            .unwrap();
        run(&folder, &format!("map {name}.toml --engine cpu --quiet")).success();
    }
    map(&folder, "u", &["start.policy=state", "start.state=[0.5,4,-0.5,0]"]);
    compare(&folder, "out/s u --quiet --out c").success();
    let (header, _) = rows(&folder.path().join("c/compare.csv"));
    assert_eq!(header, "e,omega,class_a,period_a,class_b,period_b,lyapunov_a,lyapunov_b,kind,quantities");
    assert!(!folder.path().join("c/compare.png").exists());
    compare(&folder, "out/s out/t").code(2).stderr(says(&[
        "maps of different cells",
        "out/t",
        "different lists",
    ]));
}

#[test]
fn maps_that_cannot_be_compared_are_refused_with_the_reason() {
    let few = ["axis.0.count=3", "axis.1.count=2"];
    let with = |set: &'static str| [few[0], few[1], set];
    let folder = maps(&[
        ("a", &few),
        ("wider", &with("axis.0.max=5.8")),
        ("finer", &with("axis.1.count=3")),
        ("other", &with("axis.0.parameter=k1")),
        ("classless", &with("outputs.quantities=[\"lyapunov\"]")),
        ("unfinished", &few),
    ]);
    fs::remove_file(folder.path().join("unfinished/manifest.json")).unwrap();
    fs::create_dir(folder.path().join("empty")).unwrap();
    for (b, parts) in [
        (
            "wider",
            &[
                "different grids",
                "axis 0 of a is omega from 5.5 to 5.7 in 3 values, of wider omega from 5.5 to 5.8",
            ][..],
        ),
        ("finer", &["axis 1 of a is e from 0.915 to 0.937 in 2 values, of finer e from 0.915 to 0.937 in 3"]),
        ("other", &["axis 0 of a is omega ", ", of other k1 "]),
        ("classless", &["classless: the map has no classes", "outputs.quantities"]),
        ("unfinished", &["unfinished: there is no manifest.json; the run is unfinished", "--resume"]),
        ("empty", &["empty: there is no manifest.json; it is not the folder of a map"]),
        ("absent", &["absent: there is no such folder"]),
    ] {
        compare(&folder, &format!("a {b}")).code(2).stdout("").stderr(says(parts));
    }
    assert!(!folder.path().join("out").exists(), "an output folder was created");
    let run = compare(&folder, "a a --out ./a --force");
    run.code(2).stderr(says(&["--out ./a: this is the folder of a, one of the compared maps"]));
    // Parameters that are not axes may differ.
    map(&folder, "stiffer", &with("k=1010"));
    compare(&folder, "a stiffer").success().stderr(says(&["parameters.k: 1000.0 in A, 1010.0 in B"]));
}
