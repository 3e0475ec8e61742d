//! Folders: one writer at a time, and no file through a symbolic link.

use rattlemap::store::folder::Folder;

use super::*;

const FEW: [&str; 5] = ["--quiet", "--set", "axis.0.count=3", "--set", "axis.1.count=2"];

/// Everything in a folder, by name.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    names(folder).into_iter().map(|name| (name.clone(), fs::read(folder.join(name)).unwrap())).collect()
}

/// Commands that write into the folder `o`, where a map is finished.
const WRITERS: [&[&str]; 5] = [
    &["map", "s.toml", "--engine", "cpu", "--out", "o", "--force"],
    &["map", "s.toml", "--engine", "cpu", "--out", "o", "--resume"],
    &["validate", "o"],
    &["bifurcation", "line.toml", "--out", "o", "--force"],
    &["orbit", "--out", "o", "--force"],
];

fn finished() -> TempDir {
    let folder = folder();
    let line = "[[axis]]\nparameter = 'e'\nmin = 0.4\nmax = 0.5\ncount = 2\n";
    fs::write(folder.path().join("line.toml"), line).unwrap();
    map(&folder, &[&FEW[..], &["--out", "o"]].concat()).success();
    folder
}

#[test]
fn a_folder_that_is_being_written_is_refused() {
    let folder = finished();
    let out = folder.path().join("o");
    let before = contents(&out);
    let held = Folder::open(&out, true).unwrap();
    for writer in WRITERS {
        let run = command(&folder, writer).assert();
        run.code(2).stdout("").stderr(says(&["o: another run is writing to this folder"]));
    }
    drop(held);
    assert!(contents(&out) == before);
    map(&folder, &[&FEW[..], &["--out", "o", "--force"]].concat()).success();
}

#[cfg(unix)]
#[test]
fn files_are_not_written_through_symbolic_links() {
    let folder = finished();
    let (out, outside) = (folder.path().join("o"), folder.path().join("outside"));
    fs::write(&outside, "precious").unwrap();
    let linked = |name: &str, writers: &[&[&str]]| {
        let link = out.join(name);
        let before = fs::read(&link).ok();
        fs::remove_file(&link).ok();
        std::os::unix::fs::symlink(&outside, &link).unwrap();
        for writer in writers {
            let run = command(&folder, writer).assert();
            run.code(2).stdout("").stderr(says(&[&format!("o: {name} is a symbolic link"), "remove it"]));
        }
        assert_eq!(fs::read_to_string(&outside).unwrap(), "precious", "{name}");
        fs::remove_file(&link).unwrap();
        if let Some(before) = before {
            fs::write(link, before).unwrap();
        }
    };
    linked("manifest.json", &WRITERS[..2]);
    linked("records.bin", &WRITERS[..3]);
    linked("partial-records.bin", &WRITERS[..3]);
    linked("partial-report.html", &WRITERS[..3]);
    linked("bifurcation.png", &WRITERS[3..4]);
    linked("partial-gap.png", &WRITERS[4..]);
    linked("partial-manifest.json", &WRITERS[..4]);
    // The folder itself may be one.
    std::os::unix::fs::symlink(&out, folder.path().join("link")).unwrap();
    map(&folder, &[&FEW[..], &["--out", "link", "--force"]].concat()).success();
    assert!(out.join("cells.csv").is_file());
}
