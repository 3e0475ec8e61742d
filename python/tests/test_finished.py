"""rattlemap.validate, compare, check, models and devices: the answers of the program's commands."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import rattlemap as rm
import xarray as xr
from conftest import Program, assert_same_columns
from rattlemap import _native

AXES = {"e": (0.5, 1.0, 6), "omega": (2.0, 8.0, 5), "engine": "cpu", "progress": False}


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two maps of the same cells with different forcing."""
    folder = tmp_path_factory.mktemp("pair")
    for name, force in (("a", 50), ("b", 80)):
        rm.map(rm.gear_pair(F=force), **AXES, quantities=["class", "lyapunov", "word", "pattern"], out=folder / name)
    return folder / "a", folder / "b"


def test_a_validation_is_the_programs(program: Program, tmp_path: Path) -> None:
    # Without words and exponents a software driver compiles in half the time.
    rm.map(rm.gear_pair(), **AXES, quantities=["impacts"], out=tmp_path / "python")
    # The map is right, and a file of its folder is missing.
    (tmp_path / "python/cells.csv").unlink()
    shutil.copytree(tmp_path / "python", tmp_path / "program")
    calls: list[tuple[int, int]] = []
    with pytest.warns(RuntimeWarning, match="cells.csv is missing"):
        found = rm.validate(tmp_path / "python", samples=8, seed=3, progress=lambda done, total: calls.append((done, total)))
    done = program("validate", tmp_path / "program", "--samples", 8, "--seed", 3, "--quiet", fails=True)
    assert found.failure is not None and "damaged or missing: cells.csv" in found.failure
    assert found.failure.replace(str(tmp_path / "python"), str(tmp_path / "program")) in done.stderr
    data, expected = (json.loads((tmp_path / name / "validation.json").read_text()) for name in ("python", "program"))
    assert data == expected == found.data
    assert (found.samples, found.faults) == (data["samples"], [])
    assert found.verdict == data["verdict"] and found.verdict.startswith("The map stands: 0 of ")
    assert found.strata.index.tolist() == [stratum["name"] for stratum in data["strata"]]
    first = data["strata"][0]
    row = found.strata.iloc[0]
    assert [row["unexplained"], row["unexplained_low"], row["unexplained_high"]] == [
        first["kinds"]["unexplained"]["count"],
        *first["kinds"]["unexplained"]["interval"],
    ]
    assert found.mismatches["id"].tolist() == [cell["id"] for cell in data["mismatches"] for _ in cell["differences"]]
    assert calls and calls[-1][0] <= calls[-1][1]
    with pytest.raises(rm.SceneError, match="samples = 0: it must be a whole number from 1"):
        rm.validate(tmp_path / "python", samples=0)


def test_curves_are_the_programs(program: Program, tmp_path: Path) -> None:
    axes = {"e": (0.5, 0.7, 8), "omega": (5.0, 6.0, 8), "engine": "cpu", "progress": False}
    rm.map(rm.gear_pair(), **axes, quantities=["class", "symmetric", "impact_speed"], out=tmp_path / "map")
    program("curves", tmp_path / "map", "--kind", "pitchfork,grazing", "--out", tmp_path / "curves", "--quiet")
    found = rm.curves(tmp_path / "map", kinds=["pitchfork", "grazing"])
    assert set(found.points["kind"]) == {"pitchfork", "grazing"}
    for name, table in (("curves", found.points), ("curve_points", found.meetings), ("unexplained", found.unexplained)):
        expected = pd.read_csv(tmp_path / f"curves/{name}.csv", float_precision="round_trip")
        assert_same_columns({column: expected[column] for column in expected}, table)
    assert json.loads((tmp_path / "curves/manifest.json").read_text())["pairs"] is found.explained is None
    whole = rm.curves(tmp_path / "map")
    assert whole.explained and whole.basins is not None and len(whole.points) > len(found.points)
    near = rm.curves(tmp_path / "map", "pitchfork", word="36", at={"e": 0.5, "omega": 5.6})
    assert set(near.points["kind"]) == {"pitchfork"}
    lines = rm.curves(
        tmp_path / "map", ["pitchfork", "condition"], condition=("impact_speed", 4.0), through={"omega": [5.5, 5.6]}, unstable=True
    )
    assert "condition" in set(lines.points["kind"])
    at = lines.meetings[lines.meetings["with"] == "value"]
    assert len(at) and set(at["omega"].round(9)) <= {5.5, 5.6}
    with pytest.raises(rm.SceneError, match="there is no quantity `q`; the model has impact_speed, "):
        rm.curves(tmp_path / "map", condition=("q", 1))
    with pytest.raises(rm.SceneError, match="e needs a number from 0.5 to 0.7"):
        rm.curves(tmp_path / "map", through={"e": 2})
    with pytest.raises(rm.SceneError, match="word: `138` is no word"):
        rm.curves(tmp_path / "map", word="138")
    with pytest.raises(rm.SceneError, match="kinds: there is no `hopf`; the kinds are fold, "):
        rm.curves(tmp_path / "map", kinds=["hopf"])
    with pytest.raises(rm.SceneError, match="longest = 0: it must be a whole number from 1 to 64"):
        rm.curves(tmp_path / "map", longest=0)


def test_mismatches_have_a_row_per_field(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    differences = [{"field": "class", "map": "chaotic", "judge": "periodic"}, {"field": "period", "map": None, "judge": 3}]
    cell = {"id": 7, "i": 1, "j": 1, "values": {"e": 0.6, "omega": 3.5}, "differences": differences}
    cell |= {"kind": "border", "replay": "rattlemap orbit"}
    stratum = {"name": "uniform", "runs": 1, "sampled": 1, "differing": {"count": 1, "interval": [0.05, 1.0]}, "kinds": {}}
    data = {"judge": "reference", "samples": 1, "strata": [stratum], "mismatches": [cell], "faults": []}
    (tmp_path / "validation.json").write_text(json.dumps(data))
    monkeypatch.setattr(_native, "validate", lambda *_: (None, []))
    found = rm.validate(tmp_path, progress=False)
    assert found.strata.loc["uniform", "differing_low"] == 0.05
    rows = found.mismatches
    assert [*rows.columns] == ["id", "i", "j", "e", "omega", "kind", "field", "map", "judge", "replay"]
    assert rows["field"].tolist() == ["class", "period"] and rows["id"].tolist() == [7, 7]


def test_a_comparison_is_the_programs(program: Program, pair: tuple[Path, Path], tmp_path: Path) -> None:
    done = program("compare", *pair, "--out", tmp_path / "out", "--json", "--quiet")
    expected = json.loads(done.stdout)
    found = rm.compare(pair[0], rm.open(pair[1]))
    assert found.data == {name: value for name, value in expected.items() if name not in ("folder", "files")}
    assert (found.cells, found.differing) == (30, expected["differing"]) and found.differing > 0
    assert found.by_class + found.by_period == found.differing
    assert found.transitions.to_dict("records") == expected["transitions"]
    table = pd.read_csv(tmp_path / "out/compare.csv", keep_default_na=False, na_values={"lyapunov_a": "", "lyapunov_b": ""})
    for name in ("period_a", "period_b"):
        table[name] = [int(text or 0) for text in table[name]]
    assert_same_columns(found.table, table)
    assert len(table) == found.differing + found.by_pattern + found.by_word + found.by_motion + found.by_quantity
    with pytest.raises(rm.FolderError, match="the Dataset has no folder"):
        rm.compare(pair[0], xr.Dataset())


def test_damaged_files_are_found_and_repaired(pair: tuple[Path, Path], tmp_path: Path) -> None:
    folder = tmp_path / "map"
    shutil.copytree(pair[0], folder)
    assert rm.check(folder) == []
    table = (folder / "cells.csv").read_bytes()
    (folder / "cells.csv").write_bytes(table[:-20])
    (folder / "words.csv").unlink()
    (folder / "notes.txt").write_text("mine")
    found = {fault.name: (fault.kind, fault.is_repaired) for fault in rm.check(folder)}
    assert found == {"cells.csv": ("damaged", False), "words.csv": ("missing", False), "notes.txt": ("unknown", False)}
    found = {fault.name: fault.is_repaired for fault in rm.check(folder, repair=True)}
    assert found == {"cells.csv": True, "words.csv": True, "notes.txt": False}
    assert (folder / "cells.csv").read_bytes() == table and [fault.name for fault in rm.check(folder)] == ["notes.txt"]
    (folder / "records.bin").unlink()
    with pytest.raises(rm.FolderError, match="records.bin cannot be recreated"):
        rm.check(folder, repair=True)


def test_models_and_their_parameters_are_listed(program: Program) -> None:
    lines = program("models").stdout.splitlines()
    assert [line.split("  ")[0].strip() for line in lines] == rm.models().index.tolist()
    assert all(summary in line for summary, line in zip(rm.models()["summary"], lines, strict=True))
    table, page = rm.models("gear-pair"), program("models", "gear-pair").stdout
    assert table.index.tolist() == [*rm.gear_pair().parameters, *rm.gear_pair().state_names]
    parameters = page.partition("\nParameters\n")[2]
    for name, row in table[table["kind"] == "parameter"].iterrows():
        line = next(line for line in parameters.splitlines() if line.startswith(f"    {name} "))
        default = "-" if np.isnan(row["default"]) else f"{row['default']:g}"
        assert line.endswith(row["meaning"]) and row["range"] in line and f" {default} " in line
    with pytest.raises(rm.ModelError, match="no model is called `gear`"):
        rm.models("gear")


def test_devices_are_the_programs(program: Program) -> None:
    found, printed = rm.devices(), program("devices").stdout
    assert f"auto chooses {found.engine} ({found.precision}): {found.reason}" in printed
    assert found.processor in printed
    for number, adapter in found.adapters.iterrows():
        assert f"(--adapter {number})" in printed and f"gpu: {adapter['name']}" in printed
        assert f"precision   {adapter['precisions'].replace(' ', ', ')}" in printed
