"""The type annotations of the package pass mypy."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import PACKAGE


@pytest.mark.long
def test_strict_mypy_finds_no_error(tmp_path: Path) -> None:
    # A copy, because mypy would check other packages in the same folder, too.
    package = tmp_path / "rattlemap"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("_native.*so", "_native.*pyd"))
    settings = Path(__file__).parents[1] / "pyproject.toml"
    command = [sys.executable, "-m", "mypy", "--config-file", str(settings), str(package)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
