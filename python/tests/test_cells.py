"""rattlemap.cells: the program's list of cells, as columns of the frame that they came in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import rattlemap as rm
from conftest import Program

QUANTITIES = ["class", "lyapunov", "word", "symmetric"]


def test_cells_are_the_programs(program: Program, tmp_path: Path) -> None:
    random = np.random.default_rng(34)
    frame = pd.DataFrame({"e": random.uniform(0, 1, 20), "omega": random.uniform(1, 12, 20)}, index=[*"abcdefghijklmnopqrst"])
    before = frame.copy()
    made = rm.cells(rm.gear_pair(F=60), frame, engine="cpu", quantities=QUANTITIES)
    assert frame.equals(before) and made.index.equals(frame.index)
    (tmp_path / "cells.csv").write_text("\n".join(["e,omega", *(f"{e!r},{o!r}" for e, o in frame.to_numpy().tolist())]))
    (tmp_path / "scene.toml").write_text(
        f"[parameters]\nF = 60\n[cells]\nfile = 'cells.csv'\n[outputs]\nquantities = {QUANTITIES}\n"
    )
    program("map", tmp_path / "scene.toml", "--engine", "cpu", "--quiet", "--out", tmp_path / "own")
    own = rm.open(tmp_path / "own")
    assert [*made.columns] == ["e", "omega", *own.data_vars]
    for name in own.variables:
        values, expected = made[name].to_numpy(), own[name].values
        same = values.tobytes() == expected.tobytes() if expected.dtype.kind in "fiu" else values.tolist() == expected.tolist()
        assert same, name


def test_columns_of_ones_own_and_starts() -> None:
    frame = pd.DataFrame({"x1": [0.0, 0.5], "label": ["first", "second"]})
    made = rm.cells(rm.gear_pair(e=0.6), frame, columns=["x1"], engine="cpu", omega=5.6)
    assert made["label"].tolist() == ["first", "second"] and made["class"].tolist() == ["periodic", "periodic"]
    by_name = rm.cells(rm.gear_pair(), {"e": [0.06, 0.605], "omega": [5.6, 5.6]}, engine="cpu")
    assert by_name["period"].tolist() == [1, 1]


LONG: dict[str, Any] = {"engine": "cpu", "early_stop": False, "transient_periods": 1_000_000}


def test_what_is_wrong_is_told() -> None:
    with pytest.raises(rm.SceneError, match="column 2 = G` is not known|column 2"):
        rm.cells(rm.gear_pair(), {"e": [0.5], "G": [1.0]})
    with pytest.raises(rm.SceneError, match=r"cells:3:1: `e = 1.5` is out of range"):
        rm.cells(rm.gear_pair(), {"e": [0.5, 1.5]})
    with pytest.raises(rm.SceneError, match="has a column 'class', which is a result's name"):
        # Said before anything is computed: these rows would take minutes.
        rm.cells(rm.gear_pair(), pd.DataFrame({"e": [0.5] * 1000, "class": "x"}), columns=["e"], **LONG)
