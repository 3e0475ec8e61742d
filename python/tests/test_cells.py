"""rattlemap.cells: the program's list of cells, as columns after those of the frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import rattlemap as rm
from conftest import Program, assert_same_array

QUANTITIES = ["class", "lyapunov", "word", "symmetric"]


def test_cells_are_the_programs(program: Program, tmp_path: Path) -> None:
    random = np.random.default_rng(34)
    frame = pd.DataFrame({"e": random.uniform(0, 1, 10), "omega": random.uniform(1, 12, 10)}, index=[*"abcdefghij"])
    before = frame.copy()
    result = rm.cells(rm.gear_pair(F=60), frame, engine="cpu", quantities=QUANTITIES)
    assert frame.equals(before) and result.index.equals(frame.index)
    (tmp_path / "cells.csv").write_text("\n".join(["e,omega", *(f"{e!r},{o!r}" for e, o in frame.to_numpy().tolist())]))
    (tmp_path / "scene.toml").write_text(
        f"[parameters]\nF = 60\n[cells]\nfile = 'cells.csv'\n[outputs]\nquantities = {QUANTITIES}\n"
    )
    program("map", tmp_path / "scene.toml", "--engine", "cpu", "--quiet", "--out", tmp_path / "out")
    expected = rm.open(tmp_path / "out")
    assert [*result.columns] == ["e", "omega", *expected.data_vars]
    for name in expected.variables:
        values = expected[name].values
        found = result[name].to_numpy()
        assert_same_array(found if values.dtype.kind in "fiu" else found.astype(values.dtype), values, str(name))


def test_other_columns_and_starts() -> None:
    frame = pd.DataFrame({"x1": [0.0, 0.5], "label": ["first", "second"]})
    result = rm.cells(rm.gear_pair(e=0.6), frame, columns=["x1"], engine="cpu", omega=5.6)
    assert result["label"].tolist() == ["first", "second"] and result["class"].tolist() == ["periodic", "periodic"]
    by_name = rm.cells(rm.gear_pair(), {"e": [0.06, 0.605], "omega": [5.6, 5.6]}, engine="cpu")
    assert by_name["period"].tolist() == [1, 1]


LONG: dict[str, Any] = {"engine": "cpu", "early_stop": False, "transient_periods": 1_000_000}


def test_errors_precede_the_computation() -> None:
    with pytest.raises(rm.SceneError, match="column 2 = G` is not known|column 2"):
        rm.cells(rm.gear_pair(), {"e": [0.5], "G": [1.0]})
    with pytest.raises(rm.SceneError, match=r"cells:3:1: `e = 1.5` is out of range"):
        rm.cells(rm.gear_pair(), {"e": [0.5, 1.5]})
    with pytest.raises(rm.SceneError, match="has a column 'class', which is the name of a result"):
        # These rows would take minutes.
        rm.cells(rm.gear_pair(), pd.DataFrame({"e": [0.5] * 1000, "class": "x"}), columns=["e"], **LONG)
