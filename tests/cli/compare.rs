//! `rattlemap compare`: which cells of two maps differ, and what is refused.

use std::fs;
use std::path::Path;

use rattlemap::record::Record;
use rattlemap::store::inventory;
use rattlemap::store::record_file::{Identity, Order, RecordFile};
use tempfile::TempDir;

use crate::common::{rattlemap, rows, says};

/// Around the fall of period 4, which comes later on the way up than on the way down.
const SCENE: &str = "title = 'Around a fold'
[[axis]]
parameter = 'omega'
min = 5.5
max = 5.7
count = 12
[[axis]]
parameter = 'e'
min = 0.915
max = 0.937
count = 12
[outputs]
quantities = ['class', 'lyapunov', 'symmetric', 'word', 'pattern']
files = ['csv']
";

/// A folder with finished maps: each has a name and what is set.
fn maps(of: &[(&str, &[&str])]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), SCENE).unwrap();
    for (name, sets) in of {
        let sets = sets.iter().flat_map(|set| ["--set", set]);
        let map = ["map", "s.toml", "--engine", "cpu", "--quiet", "--out", name];
        run(&folder, &map.into_iter().chain(sets).collect::<Vec<_>>()).success();
    }
    folder
}

fn run(folder: &TempDir, arguments: &[&str]) -> assert_cmd::assert::Assert {
    rattlemap(folder).args(arguments).assert()
}

fn compare(folder: &TempDir, arguments: &[&str]) -> assert_cmd::assert::Assert {
    run(folder, &[&["compare"], arguments].concat())
}

fn json(text: &[u8]) -> serde_json::Value {
    serde_json::from_slice(text).unwrap()
}

#[test]
fn up_against_down_is_what_their_tables_say() {
    let folder = maps(&[("m/up", &["start.policy=up"]), ("m/down", &["start.policy=down"])]);
    let [(_, up), (_, down)] =
        ["up", "down"].map(|name| rows(&folder.path().join(format!("m/{name}/cells.csv"))));
    // i, j, omega, e, class, period, lyapunov of both tables, side by side.
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
    assert!(kinds.iter().all(|&count| count > 0), "{kinds:?}: nothing to see");
    let done = compare(&folder, &["m/up", "m/down", "--json"]).success().stderr(says(&[
        "start: up in A, down in B",
        &format!("{} of 144 cells differ (", differing.len()),
        &format!("): {} by class, {} by period", kinds[0], kinds[1]),
        "of cycles of one period differ: ",
        " in symmetry, ",
        " by word, ",
        " by pattern, ",
        "out/compare/up-down: compare.csv, compare.png, manifest.json",
    ]));
    let out = folder.path().join("out/compare/up-down");
    let (header, found) = rows(&out.join("compare.csv"));
    assert_eq!(header, "i,j,omega,e,class_a,period_a,class_b,period_b,lyapunov_a,lyapunov_b,kind");
    assert_eq!(found, differing);
    let manifest = json(&fs::read(out.join("manifest.json")).unwrap());
    let printed = json(&done.get_output().stdout);
    assert_eq!(
        (&manifest["command"], &printed["folder"]),
        (&"compare".into(), &"out/compare/up-down".into())
    );
    for told in [&manifest, &printed] {
        assert_eq!((&told["cells"], &told["differing"]), (&144.into(), &differing.len().into()));
        assert_eq!((&told["by_class"], &told["by_period"]), (&kinds[0].into(), &kinds[1].into()));
        let sides =
            ["a", "b"].map(|side| [&told[side]["folder"], &told[side]["engine"], &told[side]["precision"]]);
        assert_eq!(sides, [["up", "cpu", "f64"], ["down", "cpu", "f64"]]);
        assert_eq!(
            told["scene_differences"],
            serde_json::json!([{ "name": "start", "a": "up", "b": "down" }])
        );
        let moved: u64 =
            told["transitions"].as_array().unwrap().iter().map(|pair| pair["cells"].as_u64().unwrap()).sum();
        assert_eq!(moved, kinds[0] as u64);
    }
    check_picture(&out.join("compare.png"), &differing);
    run(&folder, &["check", "out/compare/up-down"]).success();
    // Again: the folder is guarded; with --fail the difference is the exit code, and the files are there.
    compare(&folder, &["m/up", "m/down"]).code(2).stderr(says(&["the folder is not empty", "--force"]));
    let failed = compare(&folder, &["m/down", "m/up", "--fail", "--quiet"]).code(1).stdout("");
    failed.stderr(format!("error: {} of 144 cells differ by class or period\n", differing.len()));
    assert!(folder.path().join("out/compare/down-up/manifest.json").is_file());
}

/// Rattling on the way up and motion without contact on the way down are of one class and period: rows of their own kind,
/// which `--fail` does not heed.
#[test]
fn cells_of_another_pattern_are_told_and_do_not_fail() {
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
    let done = compare(&folder, &["up", "down", "--fail", "--json", "--out", "c"]).success();
    let told = json(&done.get_output().stdout);
    let counts = ["differing", "by_pattern", "by_word"].map(|name| told[name].as_u64().unwrap());
    assert_eq!(counts, [0, differing as u64, 0]);
    let (_, rows) = rows(&folder.path().join("c/compare.csv"));
    assert_eq!(rows.len(), differing);
    assert!(rows.iter().all(|row| row[10] == "pattern"), "{rows:?}");
    let picture = image::open(folder.path().join("c/compare.png")).unwrap().to_rgb8();
    let pixels = picture.pixels().filter(|pixel| pixel.0 == [0xf6, 0xd9, 0x8b]).count();
    assert!(pixels > 0, "a colour of their own");
}

/// The colours of the kinds take as much of the picture as their cells of the map.
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
fn equal_maps_of_other_sources_and_engines_differ_nowhere() {
    let few = ["axis.0.count=4", "axis.1.count=3"];
    let folder = maps(&[("a", &few), ("b", &few)]);
    of_other_sources(&folder.path().join("b"));
    let done =
        compare(&folder, &["a", "b", "--fail", "--out", "c", "--format", "svg,pdf"]).success().stdout("");
    done.stderr(says(&["no cell of 12 differs by class or period", "exponents of 12 by 0.0e0 at most"]));
    let (_, found) = rows(&folder.path().join("c/compare.csv"));
    assert!(found.is_empty(), "{found:?}");
    let svg = fs::read_to_string(folder.path().join("c/compare.svg")).unwrap();
    assert!(
        svg.contains(">class differs</text>")
            && svg.contains(concat!("by version ", env!("CARGO_PKG_VERSION"), " (")),
        "{svg:.400}"
    );
    assert!(fs::read(folder.path().join("c/compare.pdf")).unwrap().starts_with(b"%PDF"));
    let manifest = json(&fs::read(folder.path().join("c/manifest.json")).unwrap());
    assert_eq!(
        (&manifest["b"]["crate_version"], &manifest["b"]["commit"]),
        (&"0.0.9".into(), &"feed".into())
    );
    assert_eq!(manifest["exponents"]["largest"], 0.0);
    assert_eq!(manifest["attractors"], serde_json::Value::Null);
    // A command that computes again does not take it.
    run(&folder, &["validate", "b"]).code(2).stderr(says(&["made by rattlemap 0.0.9"]));
}

/// Makes a map's folder one that another version of other sources has written.
fn of_other_sources(out: &Path) {
    let (records, manifest) = (out.join("records.bin"), out.join("manifest.json"));
    let mut told = json(&fs::read(&manifest).unwrap());
    let foreign = Identity::read(&records).unwrap().unwrap().built_from("0123", "other processor");
    let mut kept: Vec<(u32, Record)> = Vec::new();
    let own = Identity::read(&records).unwrap().unwrap();
    let take = |batch: &[(u32, Record)]| {
        kept.extend_from_slice(batch);
        true
    };
    RecordFile::read(&records, &own, Order::Any, take).unwrap();
    RecordFile::create(&records, &foreign).unwrap().append(&kept).unwrap();
    for (field, value) in
        [("sources", "0123"), ("target", "other processor"), ("crate_version", "0.0.9"), ("commit", "feed")]
    {
        told[field] = value.into();
    }
    fs::write(manifest, inventory::sealed(told).unwrap()).unwrap();
}

/// Without axes there is neither a place in a grid nor a picture.
#[test]
fn lists_of_cells_are_compared_row_by_row() {
    let folder = tempfile::tempdir().unwrap();
    for (name, points) in [("s", "e,omega\n0.4,5.6\n0.92,5.6\n"), ("t", "e,omega\n0.4,5.6\n0.92,5.7\n")] {
        fs::write(folder.path().join(format!("{name}.csv")), points).unwrap();
        fs::write(folder.path().join(format!("{name}.toml")), format!("cells.file = '{name}.csv'\n"))
            .unwrap();
        run(&folder, &["map", &format!("{name}.toml"), "--engine", "cpu", "--quiet"]).success();
    }
    let rattling = ["--set", "start.policy=state", "--set", "start.state=[0.5, 4, -0.5, 0]"];
    run(&folder, &[&["map", "s.toml", "--engine", "cpu", "--quiet", "--out", "u"], &rattling[..]].concat())
        .success();
    compare(&folder, &["out/s", "u", "--quiet", "--out", "c"]).success();
    let (header, _) = rows(&folder.path().join("c/compare.csv"));
    assert_eq!(header, "e,omega,class_a,period_a,class_b,period_b,lyapunov_a,lyapunov_b,kind");
    assert!(!folder.path().join("c/compare.png").exists());
    compare(&folder, &["out/s", "out/t"]).code(2).stderr(says(&[
        "maps of other cells",
        "out/t",
        "two lists",
    ]));
}

#[test]
fn what_cannot_be_compared_is_refused_with_the_reason() {
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
                "two grids",
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
        compare(&folder, &["a", b]).code(2).stdout("").stderr(says(parts));
    }
    assert!(!folder.path().join("out").exists(), "an output folder was made");
    let run = compare(&folder, &["a", "a", "--out", "./a", "--force"]);
    run.code(2).stderr(says(&["--out ./a: this is the folder of a, which is compared"]));
    // Of another parameter that is not on an axis the maps may be.
    let set = with("k=1010");
    let sets: Vec<&str> = set.iter().flat_map(|set| ["--set", set]).collect();
    let map = ["map", "s.toml", "--engine", "cpu", "--quiet", "--out", "stiffer"];
    self::run(&folder, &map.into_iter().chain(sets).collect::<Vec<_>>()).success();
    compare(&folder, &["a", "stiffer"]).success().stderr(says(&["parameters.k: 1000.0 in A, 1010.0 in B"]));
}
