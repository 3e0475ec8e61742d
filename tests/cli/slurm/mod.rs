//! `scripts/slurm.sh`: shards as tasks of an array job and a merge make the map of a single run.

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::common::rattlemap;

const SCENE: &str = r#"
axis = [
    { parameter = "e", min = 0.1, max = 0.9, count = 12 },
    { parameter = "omega", min = 4.0, max = 7.0, count = 8 },
]
"#;

const SHARDS: usize = 2;

/// A folder with the scene, the edited job file, and the program in `bin`.
struct Work(TempDir);

impl Work {
    fn new() -> Work {
        let folder = tempfile::Builder::new().prefix("a map ").tempdir().unwrap();
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let job = fs::read_to_string(root.join("scripts/slurm.sh")).unwrap();
        let edits = [
            ("--array=1-8", "--array=1-2"),
            ("--cpus-per-task=4", "--cpus-per-task=1"),
            ("--mem=2G", "--mem=100M"),
            ("scene=scenes/e_omega.toml", "scene='my scene.toml'"),
            ("out=out/e_omega", "out=out/map"),
            ("shards=8", "shards=2"),
            ("options=()", "options=(--set title=slurm)"),
        ];
        let job = edits.iter().fold(job, |text, (from, to)| {
            assert!(text.contains(from), "{from} is not in the job file");
            text.replacen(from, to, 1)
        });
        fs::write(folder.path().join("job.sh"), job).unwrap();
        fs::write(folder.path().join("my scene.toml"), SCENE).unwrap();
        fs::create_dir(folder.path().join("bin")).unwrap();
        symlink(assert_cmd::cargo::cargo_bin("rattlemap"), folder.path().join("bin/rattlemap")).unwrap();
        Work(folder)
    }

    /// A command in the folder that finds the program as `rattlemap`.
    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        let path = std::env::var("PATH").unwrap();
        command.current_dir(self.0.path()).env("PATH", format!("{}/bin:{path}", self.0.path().display()));
        command
    }

    fn run(&self, command: &mut Command) -> String {
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    }

    /// Computes the map in a single run and compares it with the merged one.
    fn assert_same_as_one_run(&self) {
        let one = ["map", "my scene.toml", "--engine", "cpu", "--set", "title=slurm", "--out", "out/one"];
        rattlemap(&self.0).args(one).assert().success();
        rattlemap(&self.0).args(["check", "out/map"]).assert().success();
        for name in ["cells.csv", "cells.npy", "map.png"] {
            let file = |folder: &str| fs::read(self.0.path().join(folder).join(name)).unwrap();
            assert!(file("out/one") == file("out/map"), "{name} differs");
        }
    }
}

/// Runs the job file as Slurm does, without Slurm: one process per task with the task's index in its environment.
#[test]
fn tasks_of_the_job_file_and_a_merge_make_the_map_of_one_run() {
    let work = Work::new();
    // The second round finds finished shards and computes nothing.
    for _ in 0..2 {
        for task in 1..=SHARDS {
            work.run(work.command("bash").arg("job.sh").env("SLURM_ARRAY_TASK_ID", task.to_string()));
        }
    }
    let merge = "rattlemap merge out/map out/map.shard-*";
    work.run(work.command("bash").args(["-c", merge]));
    work.assert_same_as_one_run();
}

/// The daemons of a Slurm cluster of one node. They stop when this is dropped.
struct Node {
    script: Child,
    folder: TempDir,
}

impl Node {
    fn start() -> Node {
        let folder = tempfile::tempdir().unwrap();
        // Both listeners are open at once, so that the ports differ.
        let free = [(); 2].map(|()| TcpListener::bind("127.0.0.1:0").unwrap());
        let ports = free.map(|port| port.local_addr().unwrap().port().to_string());
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/slurm/node.sh");
        let mut script = Command::new(source);
        script.arg(folder.path()).args(ports).arg("2").stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut script = script.spawn().unwrap();
        let mut line = String::new();
        BufReader::new(script.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        assert_eq!(line, "ready\n", "Slurm does not start; scripts/test.sh --all installs it");
        Node { script, folder }
    }

    fn conf(&self) -> PathBuf {
        self.folder.path().join("slurm.conf")
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        drop(self.script.stdin.take());
        let _ = self.script.wait();
    }
}

#[test]
#[ignore = "starts the daemons of Slurm"]
fn slurm_runs_the_job_file_and_the_merge() {
    let (node, work) = (Node::start(), Work::new());
    let slurm = |program: &str, arguments: &[&str]| {
        let mut command = work.command(program);
        work.run(command.args(arguments).env("SLURM_CONF", node.conf()))
    };
    let job = slurm("sbatch", &["--parsable", "job.sh"]);
    let after = format!("--dependency=afterok:{job}");
    slurm("sbatch", &[&after, "--mem=100M", "--wrap", "rattlemap merge out/map out/map.shard-*"]);
    let clock = Instant::now();
    while !slurm("squeue", &["--noheader"]).is_empty() {
        assert!(clock.elapsed() < Duration::from_secs(120), "jobs are still in the queue");
        std::thread::sleep(Duration::from_millis(100));
    }
    work.assert_same_as_one_run();
}
