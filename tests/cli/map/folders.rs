//! Folders: one writer at a time, and no file through a symbolic link.

use rattlemap::store::folder::Folder;

use super::*;

/// Commands that write into the folder `o` of a finished map.
const WRITERS: [&str; 5] = [
    "map s.toml --engine cpu --out o --force",
    "map s.toml --engine cpu --out o --resume",
    "validate o",
    "bifurcation line.toml --out o --force",
    "orbit --out o --force",
];

fn finished() -> TempDir {
    let folder = folder();
    let line = "[[axis]]\nparameter = 'e'\nmin = 0.4\nmax = 0.5\ncount = 2\n";
    fs::write(folder.path().join("line.toml"), line).unwrap();
    map(&folder, &format!("{FEW} --quiet --out o")).success();
    folder
}

#[test]
fn a_folder_that_another_command_writes_is_refused() {
    let folder = finished();
    let out = folder.path().join("o");
    let before = contents(&out);
    let held = Folder::open(&out, true).unwrap();
    for writer in WRITERS {
        fails(&folder, writer, 2, &["o: another run is writing to this folder"]);
    }
    drop(held);
    assert!(contents(&out) == before);
    map(&folder, &format!("{FEW} --quiet --out o --force")).success();
}

#[cfg(unix)]
#[test]
fn files_are_not_written_through_symbolic_links() {
    let folder = finished();
    let (out, outside) = (folder.path().join("o"), folder.path().join("outside"));
    fs::write(&outside, "precious").unwrap();
    let linked = |name: &str, writers: &[&str]| {
        let link = out.join(name);
        let before = fs::read(&link).ok();
        fs::remove_file(&link).ok();
        std::os::unix::fs::symlink(&outside, &link).unwrap();
        for &writer in writers {
            fails(&folder, writer, 2, &[&format!("o: {name} is a symbolic link"), "remove it"]);
        }
        assert_eq!(fs::read_to_string(&outside).unwrap(), "precious", "{name}");
        fs::remove_file(&link).unwrap();
        before.into_iter().for_each(|before| fs::write(&link, before).unwrap());
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
    map(&folder, &format!("{FEW} --quiet --out link --force")).success();
    assert!(out.join("cells.csv").is_file());
}

/// `--force` removes what any command has written, and nothing else.
#[test]
fn force_removes_the_files_of_another_command_and_names_them() {
    let folder = finished();
    let out = folder.path().join("o");
    let map = names(&out);
    fs::write(out.join("notes.txt"), "precious").unwrap();
    let run = succeeds(&folder, "orbit --out o --force");
    let removed: Vec<String> = map.into_iter().filter(|name| name != "manifest.json").collect();
    let removed = format!("o: removed files of an earlier run: {}\n", removed.join(", "));
    run.stderr(says(&[&removed]));
    assert_eq!(
        names(&out),
        [
            "gap.png",
            "manifest.json",
            "notes.txt",
            "orbit.json",
            "phase_plane.png",
            "spectrum.csv",
            "spectrum.png",
            "time_history.png",
            "trajectory.csv"
        ]
    );
    let run = succeeds(&folder, "bifurcation line.toml --out o --force");
    run.stderr(says(&["removed files of an earlier run: gap.png, orbit.json,"]));
    assert!(!out.join("orbit.json").exists() && out.join("notes.txt").exists());
    // A manifest of unknown origin cannot name a file elsewhere.
    let text = fs::read_to_string(out.join("manifest.json")).unwrap();
    fs::write(out.join("manifest.json"), text.replace("bifurcation.csv", "../line.toml")).unwrap();
    succeeds(&folder, "orbit --out o --force");
    assert!(folder.path().join("line.toml").exists());
}

/// The system reports no free space there.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_cannot_be_written_is_refused_for_this_reason() {
    let folder = folder();
    for line in ["map s.toml --engine cpu --out /proc/x", "map s.toml --engine cpu --out /proc/x --dry-run"] {
        fails(&folder, line, 2, &["/proc/x: cannot write there (/proc cannot be written)", "another folder"]);
    }
}
