//! `scripts/slurm` on a Slurm of one node: an array job of shards and a merge make the map of one run.

mod node;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Output};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::common::rattlemap;
use node::Node;

/// Motions without early stops: no shard is done before one sees it begin.
const SCENE: &str = r#"
[[axis]]
parameter = "e"
min = 0.1
max = 0.9
count = 40

[[axis]]
parameter = "omega"
min = 4.0
max = 7.0
count = 32

[integration]
early_stop = false

[outputs]
quantities = ["class", "lyapunov", "impacts", "word"]
"#;

const SHARDS: usize = 8;

/// A folder as people have it: with a blank, and paths that begin there.
struct Work {
    folder: TempDir,
    slurm_conf: PathBuf,
}

impl Work {
    fn new(node: &Node) -> Work {
        let folder = tempfile::Builder::new().prefix("a map ").tempdir().unwrap();
        Work { folder, slurm_conf: node.conf() }
    }

    /// The scripts with settings of their own, as somebody would edit them.
    fn edit(&self, settings: &[(&str, &str)]) {
        let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/slurm");
        let copy = self.at("my scripts");
        fs::create_dir_all(&copy).unwrap();
        for name in ["submit.sh", "job.sh"] {
            fs::copy(scripts.join(name), copy.join(name)).unwrap();
        }
        let program = assert_cmd::cargo::cargo_bin("rattlemap");
        let mut text = String::new();
        let given = fs::read_to_string(scripts.join("settings.sh")).unwrap();
        let program = format!("'{}'", program.display());
        // Of two the last one counts.
        let mut all = vec![("program", program.as_str())];
        for setting in settings {
            all.retain(|(name, _)| *name != setting.0);
            all.push(*setting);
        }
        for line in given.lines() {
            match all.iter().find(|(name, _)| line.starts_with(&format!("{name}="))) {
                Some((name, value)) => writeln!(text, "{name}={value}").unwrap(),
                None => writeln!(text, "{line}").unwrap(),
            }
        }
        for (name, value) in all {
            assert!(text.contains(&format!("\n{name}={value}\n")), "no setting {name}");
        }
        fs::write(copy.join("settings.sh"), text).unwrap();
    }

    fn at(&self, path: &str) -> PathBuf {
        self.folder.path().join(path)
    }

    fn text(&self, path: &str) -> String {
        fs::read_to_string(self.at(path)).unwrap_or_else(|reason| panic!("{path}: {reason}"))
    }

    fn command(&self, program: &str, arguments: &[&str]) -> Output {
        let mut command = Process::new(program);
        command.args(arguments).current_dir(self.folder.path()).env("SLURM_CONF", &self.slurm_conf);
        // A test may run inside a job.
        std::env::vars_os().filter(|(name, _)| name.to_string_lossy().starts_with("SBATCH_")).for_each(
            |(name, _)| {
                command.env_remove(name);
            },
        );
        command.output().unwrap()
    }

    fn submit(&self) -> (Option<i32>, String) {
        let output = self.command("./my scripts/submit.sh", &[]);
        let said = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8(said).unwrap())
    }

    /// Submits what is missing; the number of the array job.
    fn submitted(&self, says: &str) -> String {
        let (code, said) = self.submit();
        assert!(code == Some(0) && said.contains(says), "{says}: {code:?}: {said}");
        let number = said.strip_prefix("array job ").and_then(|rest| rest.split_once(':'));
        number.unwrap_or_else(|| panic!("{said}")).0.to_owned()
    }

    /// Until no job is left.
    fn wait(&self, longest: Duration) {
        let clock = Instant::now();
        loop {
            let output = self.command("squeue", &["--noheader"]);
            if output.status.success() && output.stdout.is_empty() {
                return;
            }
            let left = String::from_utf8_lossy(&output.stdout).into_owned();
            assert!(clock.elapsed() < longest, "after {longest:?} there are\n{left}{}", self.logs());
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// The process that makes a shard here.
    fn task(&self, shard: &str) -> String {
        let is_it = |process: &Path| {
            let words = fs::read(process.join("cmdline")).unwrap_or_default();
            words.split(|&byte| byte == 0).any(|word| word == shard.as_bytes())
                && fs::read_link(process.join("cwd")).is_ok_and(|cwd| cwd == self.folder.path())
        };
        let mut processes = fs::read_dir("/proc").unwrap().map(|entry| entry.unwrap().path());
        let found = processes.find(|process| is_it(process)).unwrap_or_else(|| panic!("{}", self.logs()));
        found.file_name().unwrap().to_str().unwrap().to_owned()
    }

    /// What jobs said, for whoever reads of a failure.
    fn logs(&self) -> String {
        let mut text = String::new();
        let folders = fs::read_dir(self.at("out")).into_iter().flatten().flatten();
        for folder in folders.filter(|folder| folder.path().extension().is_some_and(|name| name == "slurm")) {
            for log in fs::read_dir(folder.path()).unwrap().flatten() {
                let said = fs::read_to_string(log.path()).unwrap_or_default();
                writeln!(text, "{}:\n{said}", log.path().display()).unwrap();
            }
        }
        text
    }

    /// The map of one run beside that of the jobs: the same files, and all but records and manifest the same to the byte.
    fn assert_same_map(&self, one: &str, merged: &str) {
        let names = |folder: &str| {
            let mut names: Vec<_> =
                fs::read_dir(self.at(folder)).unwrap().map(|entry| entry.unwrap().file_name()).collect();
            names.sort();
            names
        };
        assert_eq!(names(one), names(merged), "{}", self.logs());
        for name in names(one).iter().filter(|name| *name != "records.bin" && *name != "manifest.json") {
            let file = |folder: &str| fs::read(self.at(folder).join(name)).unwrap();
            assert!(file(one) == file(merged), "{} differs", name.display());
        }
        for arguments in [&["check", merged][..], &["compare", one, merged, "--fail"]] {
            rattlemap(&self.folder).args(arguments).assert().success();
        }
    }
}

#[test]
fn an_array_job_and_a_merge_make_the_map_of_one_run() {
    let Some(node) = Node::start(4) else { return };
    let work = Work::new(&node);
    fs::write(work.at("my scene.toml"), SCENE).unwrap();
    // Every option that Slurm can take exception to.
    let settings = [
        ("scene", "'my scene.toml'"),
        ("out", "'out/100 % rattle'"),
        ("map_options", "(--set 'title=it'\\''s a $map')"),
        ("cpus", "1"),
        ("memory", "100M"),
        ("at_once", "3"),
        ("constraint", "card"),
        ("task_options", "(--gpus-per-task=card:1)"),
        ("partition", "all"),
        ("job_options", "(--nice=1)"),
    ];
    work.edit(&settings);

    let job = work.submitted("8 of 8 shards of my scene.toml (tasks 1-8)");
    let (code, said) = work.submit();
    assert!(code == Some(2) && said.contains("jobs of the last call are in the queue"), "{said}");
    let records = work.at("out/100 % rattle.shard-2-of-8/records.bin");
    let clock = Instant::now();
    while !records.exists() {
        assert!(clock.elapsed().as_secs() < 60, "shard 2 does not begin\n{}", work.logs());
        std::thread::sleep(Duration::from_millis(2));
    }
    // Slurm wakes it up again, and needs a while to do so.
    work.command("kill", &["-STOP", &work.task("2/8")]);
    assert!(work.command("scancel", &[&format!("{job}_2")]).status.success());
    work.wait(Duration::from_secs(120));
    // The others went on, the merge was given up, and what the cancelled task says is how to go on.
    assert!(!work.at("out/100 % rattle").exists(), "merged without shard 2\n{}", work.logs());
    let log = work.text("out/100 % rattle.slurm/shard-2.log");
    let go_on = log.split_once("of 160 cells are kept; go on with: ").unwrap_or_else(|| panic!("{log}")).1;
    assert!(go_on.contains("--shard 2/8") && go_on.trim_end().ends_with("--resume"), "{log}");
    let done =
        |shard: usize| work.at(&format!("out/100 % rattle.shard-{shard}-of-{SHARDS}/manifest.json")).exists();
    assert_eq!((1..=SHARDS).filter(|&shard| !done(shard)).collect::<Vec<_>>(), [2], "{}", work.logs());

    // Shard 1 is looked at again: it computes nothing.
    let first = work.at("out/100 % rattle.shard-1-of-8");
    let bytes = |name: &str| fs::read(first.join(name)).unwrap();
    let before = ["manifest.json", "records.bin"].map(bytes);
    work.submitted("1 of 8 shards of my scene.toml (tasks 2)");
    let one = [
        "map",
        "my scene.toml",
        "--engine",
        "cpu",
        "--set",
        "title=it's a $map",
        "--out",
        "out/one",
        "--quiet",
    ];
    rattlemap(&work.folder).args(one).assert().success();
    work.wait(Duration::from_secs(120));
    assert!(["manifest.json", "records.bin"].map(bytes) == before, "shard 1 was computed again");
    work.assert_same_map("out/one", "out/100 % rattle");

    let (code, said) = work.submit();
    assert!(code == Some(0) && said.contains("is finished"), "{said}");

    // Shards of another scene are merged for nobody.
    fs::remove_file(work.at("out/100 % rattle/manifest.json")).unwrap();
    fs::write(work.at("my scene.toml"), SCENE.replace("max = 7.0", "max = 8.0")).unwrap();
    let (code, said) = work.submit();
    assert!(code == Some(0) && said.contains("all 8 shards are finished"), "{said}");
    work.wait(Duration::from_secs(60));
    let log = work.text("out/100 % rattle.slurm/merge.log");
    assert!(log.contains("holds another run: `axis.1.max` was 7.0, now 8.0"), "{log}");
    assert!(!work.at("out/100 % rattle/manifest.json").exists(), "{log}");
}

#[test]
fn settings_that_make_no_map_are_refused_before_anything_is_submitted() {
    let Some(node) = Node::start(1) else { return };
    let work = Work::new(&node);
    fs::write(work.at("s.toml"), SCENE).unwrap();
    fs::create_dir_all(work.at("out/other")).unwrap();
    fs::write(work.at("out/other/thesis.tex"), "").unwrap();
    for (name, value, told) in [
        ("scene", "t.toml", "no scene 't.toml'"),
        ("out", "", "out is empty"),
        ("out", "out/other", "out/other holds something that no merge of these shards has left"),
        ("shards", "0", "shards is '0'; write a number from 1"),
        ("engine", "auto", "engine is 'auto'; write cpu or gpu"),
        ("gpus", "1", "gpus are for engine=gpu"),
        ("at_once", "all", "at_once is 'all'"),
        ("program", "./rattlemap", "no program './rattlemap'"),
        ("partition", "none", "Slurm did not take the array job; nothing is submitted"),
    ] {
        work.edit(&[&[("scene", "s.toml")][..], &[(name, value)]].concat());
        let (code, said) = work.submit();
        let expected = if name == "partition" { 1 } else { 2 };
        assert!(code == Some(expected) && said.contains(told), "{name}={value}: {code:?}: {said}");
    }
    let queue = work.command("squeue", &["--noheader"]);
    assert!(queue.status.success() && queue.stdout.is_empty());
}

/// The main map, and a task that meets its time limit: half a minute before, which Slurm rounds to a minute.
#[test]
#[ignore = "takes two minutes"]
fn the_main_map_in_eight_tasks_is_that_of_one_run() {
    let Some(node) = Node::start(2) else { return };
    let work = Work::new(&node);
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/e_omega.toml");
    fs::create_dir(work.at("scenes")).unwrap();
    fs::copy(scene, work.at("scenes/e_omega.toml")).unwrap();
    // As the settings are, but for a node of two processors.
    work.edit(&[("cpus", "1")]);
    let clock = Instant::now();
    work.submitted("8 of 8 shards of scenes/e_omega.toml (tasks 1-8)");
    work.wait(Duration::from_secs(600));
    let jobs = clock.elapsed();
    rattlemap(&work.folder)
        .args(["map", "scenes/e_omega.toml", "--engine", "cpu", "--out", "out/one", "--quiet"])
        .assert()
        .success();
    eprintln!("8 tasks and a merge: {jobs:.1?}; one run: {:.1?}", clock.elapsed() - jobs);
    work.assert_same_map("out/one", "out/e_omega");
}

/// Slurm sends the signal up to a minute early: a task has some twenty seconds then, and needs a minute.
#[test]
#[ignore = "takes three minutes"]
fn a_task_at_its_time_limit_is_gone_on_with() {
    let Some(node) = Node::start(2) else { return };
    let work = Work::new(&node);
    fs::write(work.at("s.toml"), SCENE).unwrap();
    let longer = ["--set", "integration.transient_periods=60000"];
    let options = format!("({})", longer.join(" "));
    let submit = |minutes: &str| {
        work.edit(&[
            ("scene", "s.toml"),
            ("out", "out/s"),
            ("shards", "2"),
            ("cpus", "1"),
            ("time", minutes),
            ("map_options", &options),
        ]);
        work.submitted("2 of 2 shards of s.toml (tasks 1-2)");
        work.wait(Duration::from_secs(1200));
    };
    submit("1");
    assert!(!work.at("out/s").exists(), "{}", work.logs());
    submit("60");
    for shard in [1, 2] {
        let log = work.text(&format!("out/s.slurm/shard-{shard}.log"));
        let (kept, _) =
            log.split_once(" of 640 cells are kept; go on with: ").unwrap_or_else(|| panic!("{log}"));
        let kept = kept.rsplit(' ').next().unwrap();
        assert!(
            kept != "0" && log.contains(&format!("640 of 1280 cells, {kept} of them kept before,")),
            "{log}"
        );
    }
    let one = [&["map", "s.toml", "--engine", "cpu", "--out", "out/one", "--quiet"], &longer[..]].concat();
    rattlemap(&work.folder).args(one).assert().success();
    work.assert_same_map("out/one", "out/s");
}
