"""What tests share: the program, run in an interpreter of its own, and small folders that it makes."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
SCENES = REPOSITORY / "scenes"

Program = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="session")
def program() -> Program:
    """Runs a command of the program; a failure ends the test with what it said, unless ``fails``."""

    def run(*arguments: object, fails: bool = False) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "rattlemap", *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True)
        assert (done.returncode != 0) == fails, f"{command}: {done.returncode}\n{done.stderr}"
        return done

    return run


@pytest.fixture(scope="session")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("folders")


def small(program: Program, scene: Path, out: Path, counts: tuple[int, int], *more: str) -> Path:
    """A map with so many cells along its axes."""
    sets = [f"axis.{axis}.count={count}" for axis, count in enumerate(counts)]
    sets += [text for text in more if not text.startswith("--")]
    arguments = [argument for text in sets for argument in ("--set", text)]
    program("map", scene, "--engine", "cpu", "--quiet", "--out", out, *arguments)
    return out


@pytest.fixture(scope="session")
def map_folder(program: Program, scratch: Path) -> Path:
    """The main map, 24 x 18, with every quantity."""
    return small(program, SCENES / "e_omega.toml", scratch / "map", (24, 18), "outputs.files=['csv', 'npy']")
