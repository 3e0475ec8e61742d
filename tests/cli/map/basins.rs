//! Maps of basins: their files, and that a resumed run gives the same bytes.

use rattlemap::store::record_file::{Identity, RecordFile};

use super::*;

/// Attractors without contact and with rattling; most cells are filled.
const BASIN: &str = r#"axis = [
    { start = "x1", min = -0.6, max = 0.4, count = 65 },
    { start = "v1", min = -2.0, max = 2.0, count = 49 },
]
[parameters]
e = 0.98
omega = 9.2

[start]
policy = "state"
state = [9.0, 9.0, 0.0, 0.1]

[refine]
max_error = 0.05

[outputs]
quantities = ["class", "lyapunov"]
"#;

/// Files that a resumed run must write byte for byte.
const FILES: [&str; 7] =
    ["cells.csv", "cells.npy", "attractors.csv", "map.png", "class.png", "lyapunov.png", "report.html"];

fn bytes(out: &Path) -> Vec<Vec<u8>> {
    FILES.iter().map(|name| fs::read(out.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))).collect()
}

#[test]
fn basins_have_their_files_and_are_confirmed() {
    let folder = with(BASIN);
    map(&folder, "--quiet").success();
    let out = folder.path().join("out/s");
    let (header, cells) = rows(&out.join("cells.csv"));
    assert!(header.starts_with("i,j,x1,v1,class,") && header.ends_with(",source,attractor"), "{header}");
    let (header, attractors) = rows(&out.join("attractors.csv"));
    let columns = "label,class,period,word,exponent,largest_multiplier,symmetric,\
                   strobe_x1,strobe_v1,strobe_x2,strobe_v2,cells,share";
    assert_eq!(header, columns);
    assert!(attractors.len() >= 2, "{attractors:?}");
    let mut left = cells.len();
    for (label, row) in attractors.iter().enumerate() {
        let own: Vec<_> = cells.iter().filter(|cell| cell.last() == Some(&label.to_string())).collect();
        assert_eq!([row[0].clone(), row[11].clone()], [label.to_string(), own.len().to_string()]);
        let share = own.len() as f64 / cells.len() as f64;
        assert!((row[12].parse::<f64>().unwrap() - share).abs() < 1e-12);
        assert!(own.iter().all(|cell| cell[4] == row[1]), "one class in a basin");
        left -= own.len();
    }
    let unlabelled = cells.iter().filter(|cell| cell.last().is_some_and(String::is_empty)).count();
    assert_eq!(left, unlabelled);
    assert!(cells.iter().filter(|cell| cell[14] == "filled").count() > 1000);
    let manifest = json(&out.join("manifest.json"));
    assert_eq!(manifest["basins"].as_array().unwrap().len(), attractors.len());
    assert_eq!(
        (&manifest["axes"][0]["parameter"], &manifest["axes"][0]["is_start"]),
        (&"x1".into(), &true.into())
    );
    assert_eq!(manifest["without_effect"], serde_json::json!([]));
    // A validation confirms labels, and their table can be repaired.
    succeeds(&folder, "validate out/s --samples 60 --quiet");
    let validation = json(&out.join("validation.json"));
    assert!(validation.to_string().contains("\"attractor\""), "{validation}");
    let table = fs::read(out.join("attractors.csv")).unwrap();
    fs::remove_file(out.join("attractors.csv")).unwrap();
    succeeds(&folder, "check out/s --repair --quiet");
    assert!(fs::read(out.join("attractors.csv")).unwrap() == table);
}

#[test]
fn an_adaptive_map_resumes_from_any_of_its_records() {
    let folder = with(BASIN);
    map(&folder, "--quiet --out whole").success();
    let whole = folder.path().join("whole");
    let path = whole.join("records.bin");
    let identity = Identity::read(&path).unwrap().unwrap();
    let (all, _) = records::stored(&path);
    let cut = folder.path().join("cut");
    for count in [1, all.len() / 3, all.len() - 1] {
        fs::create_dir(&cut).unwrap();
        let mut file = RecordFile::create(&cut.join("records.bin"), &identity).unwrap();
        // Two batches: the schedule at the second one depends on the first.
        let (first, second) = all[..count].split_at(count / 2);
        [first, second]
            .into_iter()
            .filter(|batch| !batch.is_empty())
            .for_each(|batch| file.append(batch).unwrap());
        drop(file);
        map(&folder, "--out cut --resume --quiet").success();
        assert!(bytes(&cut) == bytes(&whole), "{count} of {}", all.len());
        fs::remove_dir_all(&cut).unwrap();
    }
}

#[test]
fn the_report_has_the_start_of_each_cell() {
    let folder = with(BASIN);
    map(&folder, "--quiet --set axis.0.count=3 --set axis.1.count=2").success();
    let page = fs::read_to_string(folder.path().join("out/s/report.html")).unwrap();
    assert!(page.contains("\"start\":[-0.6,-2.0,0.0,0.1]"), "the first cell's own start");
    assert!(page.contains("\"parameter\":\"v1\"") && page.contains("\"start\":1"));
}

/// Different attractors may have the same class and period.
#[test]
fn comparing_basins_says_that_attractors_are_not_compared() {
    let folder = with(BASIN);
    map(&folder, "--set axis.0.count=5 --set axis.1.count=4 --quiet").success();
    let run = succeeds(&folder, "compare out/s out/s");
    run.stderr(says(&["no cell of 20 differs", "is not compared"]));
}
