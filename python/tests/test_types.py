"""What the package tells type checkers holds."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import rattlemap


def test_mypy_is_strict_and_content() -> None:
    package = Path(rattlemap.__file__).parent
    settings = Path(__file__).parents[1] / "pyproject.toml"
    command = [sys.executable, "-m", "mypy", "--config-file", str(settings), str(package)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=package.parent)
    assert done.returncode == 0, done.stdout + done.stderr
