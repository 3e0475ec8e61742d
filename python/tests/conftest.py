"""Shared parts of the tests: the program, small folders that it writes, and exact comparisons."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import rattlemap
import xarray as xr

REPOSITORY = Path(__file__).parents[2]
SCENES = REPOSITORY / "scenes"
PACKAGE = Path(rattlemap.__file__).parent

#: Runs the program from the native module alone: the package imports pandas and xarray, which takes a second.
RUN = "import sys; sys.path.append(sys.argv.pop(1)); import _native; sys.exit(_native.main(['rattlemap', *sys.argv[1:]]))"

Program = Callable[..., "subprocess.CompletedProcess[str]"]
#: Runs the program with the scene of a Dataset, and opens its folder.
Rerun = Callable[..., xr.Dataset]


# A shell starts background jobs with SIGINT ignored; Python then raises no KeyboardInterrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "long: takes many seconds; scripts/test.sh --all runs it")


@pytest.fixture(scope="session")
def program() -> Program:
    """Runs a command of the program. The test fails if the exit code is not 0, or if it is 0 with ``fails``."""

    def run(*arguments: object, fails: bool = False) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", RUN, str(PACKAGE), *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True)
        assert (done.returncode != 0) == fails, f"{arguments}: {done.returncode}\n{done.stderr}"
        return done

    return run


@pytest.fixture
def rerun(program: Program, tmp_path: Path) -> Rerun:
    def run(result: xr.Dataset, command: str = "map", engine: str = "cpu", out: str = "program") -> xr.Dataset:
        (tmp_path / f"{out}.toml").write_text(result.attrs["scene"])
        arguments = ["--engine", engine] if command == "map" else []
        program(command, tmp_path / f"{out}.toml", *arguments, "--quiet", "--out", tmp_path / out)
        return rattlemap.open(tmp_path / out)

    return run


@pytest.fixture(scope="session")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("folders")


def set_arguments(*sets: str) -> list[str]:
    return [argument for text in sets for argument in ("--set", text)]


def small(program: Program, scene: Path, out: Path, counts: tuple[int, int], *sets: str) -> Path:
    """Computes a map with this number of cells along each axis."""
    sizes = [f"axis.{axis}.count={count}" for axis, count in enumerate(counts)]
    program("map", scene, "--engine", "cpu", "--quiet", "--out", out, *set_arguments(*sizes, *sets))
    return out


@pytest.fixture(scope="session")
def map_folder(program: Program, scratch: Path) -> Path:
    """The main map, 24 x 18, with all quantities."""
    return small(program, SCENES / "e_omega.toml", scratch / "map", (24, 18), "outputs.files=['csv', 'npy']")


#: Attributes that differ between two computations of one map.
TIMES = ("elapsed_seconds", "timings", "set", "scene")


def assert_same(a: xr.Dataset, b: xr.Dataset, ignored: tuple[str, ...] = TIMES) -> None:
    """Two Datasets have the same variables, coordinates, types and bits, and the same attributes but for ``ignored``."""
    assert [*a.variables] == [*b.variables]
    for name in a.variables:
        x, y = a[name], b[name]
        assert (x.dims, x.dtype, str(x.attrs)) == (y.dims, y.dtype, str(y.attrs)), name
        assert_same_array(x.values, y.values, str(name))
    assert {**a.attrs, **dict.fromkeys(ignored)} == {**b.attrs, **dict.fromkeys(ignored)}


def assert_same_array(a: Any, b: Any, name: str) -> None:
    assert a.tolist() == b.tolist() if a.dtype == object else a.tobytes() == b.tobytes(), name


def assert_same_columns(a: Mapping[Any, Any], b: pd.DataFrame) -> None:
    """Columns have the same names and values."""
    assert [*a] == [*b]
    for name in b:
        x, y = np.asarray(a[name]), b[name].to_numpy()
        if x.dtype.kind in "fiu":
            assert np.array_equal(x, y, equal_nan=True), name
        else:
            assert x.tolist() == y.tolist(), name
