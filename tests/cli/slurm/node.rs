//! A Slurm of one node that lives as long as a test.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use tempfile::TempDir;

/// Exit code of `node.sh` where Slurm is not installed.
const NOT_INSTALLED: i32 = 3;

/// The daemons and their folder, which go when this is dropped, or when the test's process ends however it may.
pub(super) struct Node {
    script: Child,
    folder: TempDir,
}

impl Node {
    /// Starts one that gives away so many processors; none where Slurm is not installed, which is said.
    pub(super) fn start(cpus: usize) -> Option<Node> {
        let folder = tempfile::tempdir().unwrap();
        // Held until both are known, so that they differ.
        let free = [(); 2].map(|()| TcpListener::bind("127.0.0.1:0").unwrap());
        let ports = free.map(|port| port.local_addr().unwrap().port().to_string());
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/slurm/node.sh");
        let mut script = Command::new(source);
        script.arg(folder.path()).args(ports).arg(cpus.to_string());
        script.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut script = script.spawn().unwrap();
        let mut said = String::new();
        BufReader::new(script.stdout.as_mut().unwrap()).read_line(&mut said).unwrap();
        if said == "ready\n" {
            return Some(Node { script, folder });
        }
        script.stderr.as_mut().unwrap().read_to_string(&mut said).unwrap();
        let code = script.wait().unwrap().code();
        assert_eq!(code, Some(NOT_INSTALLED), "{said}");
        // Past the harness, which keeps what passing tests print.
        let mut stderr = std::io::stderr();
        writeln!(stderr, "SKIPPED: {}", said.trim()).unwrap();
        None
    }

    /// Where Slurm's commands find it: their `SLURM_CONF`.
    pub(super) fn conf(&self) -> PathBuf {
        self.folder.path().join("slurm.conf")
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        // It runs until its input ends.
        drop(self.script.stdin.take());
        let _ = self.script.wait();
    }
}
