"""The program in the package: commands, exit codes and messages."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import rattlemap as rm
from conftest import SCENES, Program, set_arguments


def test_the_package_contains_the_program(program: Program) -> None:
    command = [sys.executable, "-m", "rattlemap", "--version"]
    version = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert version.startswith(f"rattlemap {rm.__version__} (") and version == program("--version").stdout
    assert "Usage: rattlemap map" in program("help", "map").stdout
    assert json.loads(program("orbit", "--json").stdout)["class"] == "periodic"
    wrong = program("orbit", "--set", "e=2", fails=True)
    assert wrong.returncode == 2 and wrong.stderr.startswith("error: --set e=2: `parameters.e = 2` is out of range")
    assert program("orbit", "--no-such-option", fails=True).returncode == 2


@pytest.mark.skipif(sys.platform == "win32", reason="no signals to send there")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_the_program_with_its_exit_code(tmp_path: Path, number: signal.Signals, code: int) -> None:
    command = [sys.executable, "-m", "rattlemap", "map", SCENES / "e_omega.toml", "--engine", "cpu", "--out", tmp_path / "out"]
    command += set_arguments("integration.early_stop=false", "integration.transient_periods=20000")
    running = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        records = tmp_path / "out/records.bin"
        while not records.is_file() or not records.stat().st_size:
            assert running.poll() is None, running.stderr
            time.sleep(0.02)
        running.send_signal(number)
        message = running.communicate(timeout=20)[1]
    finally:
        running.kill()
    assert running.returncode == code
    assert "interrupted; " in message and "go on with: rattlemap map " in message
