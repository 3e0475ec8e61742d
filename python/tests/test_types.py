"""What the package tells type checkers holds."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import rattlemap


def test_mypy_is_strict_and_content(tmp_path: Path) -> None:
    # A copy, lest whatever is installed beside it be looked at as its own.
    package = tmp_path / "rattlemap"
    shutil.copytree(Path(rattlemap.__file__).parent, package, ignore=shutil.ignore_patterns("_native.*so", "_native.*pyd"))
    settings = Path(__file__).parents[1] / "pyproject.toml"
    command = [sys.executable, "-m", "mypy", "--config-file", str(settings), str(package)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
