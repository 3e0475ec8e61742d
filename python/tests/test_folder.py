"""rattlemap.open: the same as the program's tables, read when it is looked at; folders that cannot be opened."""

from __future__ import annotations

import csv
import json
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rattlemap as rm
import xarray as xr
from conftest import SCENES, Program, small
from rattlemap import decode
from rattlemap.folder import FolderBackend

ABSENT = {"period": 0, "symmetric": -1, "attractor": -1}
CODES = {"true": 1, "false": 0}


def table(path: Path) -> dict[str, list[str]]:
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name] for row in rows] for name in rows[0]}


def assert_as_table(ds: xr.Dataset, rows: dict[str, list[str]]) -> None:
    """Every variable is what the table says, numbers to the last bit."""
    for name, variable in ds.data_vars.items():
        if variable.dims != ds["status"].dims:
            continue
        texts, values = rows[str(name)], variable.values.ravel()
        if values.dtype.kind in "OU":
            assert values.tolist() == texts, name
        elif values.dtype.kind == "f":
            assert np.array_equal(values, [float(text or "nan") for text in texts], equal_nan=True), name
        else:
            expected = [CODES[text] if text in CODES else int(text or ABSENT[str(name)]) for text in texts]
            assert values.tolist() == expected, name


def test_a_map_is_its_table(map_folder: Path) -> None:
    ds, rows = rm.open(map_folder), table(map_folder / "cells.csv")
    assert dict(ds.sizes) == {"omega": 18, "e": 24}
    assert ds["lyapunov"].dims == ("omega", "e")
    assert_as_table(ds, rows)
    assert set(ds.data_vars) == set(rows) - {"i", "j", "e", "omega"}
    assert ds["e"].values.tolist() == [float(text) for text in rows["e"][:24]]
    assert ds["omega"].values.tolist() == [float(text) for text in rows["omega"][::24]]
    assert (ds["class"].dtype.kind, ds["status"].dtype.kind, ds["word"].dtype.kind) == ("U", "U", "O")
    near = ds["class"].sel(e=0.6, omega=5.6, method="nearest")
    assert near.item() == rows["class"][7 * 24 + 14]
    manifest = json.loads((map_folder / "manifest.json").read_text())
    assert (ds.attrs["engine"], ds.attrs["cells"]) == ("cpu", 432)
    assert json.loads(ds.attrs["parameters"]) == manifest["parameters"]


def test_nothing_is_read_before_it_is_looked_at(map_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looked_up: list[int] = []
    look_up = decode.look_up

    def counting(names: decode.Array, rows: decode.Array) -> decode.Array:
        looked_up.append(np.size(rows))
        return look_up(names, rows)

    monkeypatch.setattr(decode, "look_up", counting)
    ds = rm.open(map_folder)
    assert "word" in repr(ds) and not looked_up
    assert ds["word"].isel(e=3).values.shape == (18,)
    assert looked_up == [18]
    exponent = ds["lyapunov"].values
    base = exponent
    while base is not None and not isinstance(base, np.memmap):
        base = base.base
    assert isinstance(base, np.memmap) and not exponent.flags.writeable
    # As a task on another machine gets it: a name, not the numbers.
    sent = pickle.dumps(rm.open(map_folder)["lyapunov"].variable)
    assert len(sent) < exponent.nbytes
    assert np.array_equal(pickle.loads(sent).values, exponent, equal_nan=True)


def test_cells_are_chosen_in_every_way_of_xarray(map_folder: Path) -> None:
    whole = rm.open(map_folder).load()
    for choice in (
        {"e": [5, 3], "omega": [0, 17]},
        {"e": slice(20, 2, -3)},
        {"e": xr.DataArray([3, 5], dims="p"), "omega": xr.DataArray([4, 6], dims="p")},
        {"e": 2, "omega": 3},
    ):
        assert rm.open(map_folder).isel(choice).identical(whole.isel(choice)), choice
    chunks = xr.open_dataset(map_folder, engine=FolderBackend, chunks={"e": 8})
    assert ((chunks["class"] == "chaotic").sum() == (whole["class"] == "chaotic").sum()).compute()


def test_a_map_is_kept_as_netcdf(map_folder: Path, tmp_path: Path) -> None:
    ds = rm.open(map_folder)
    ds.to_netcdf(tmp_path / "map.nc", engine="scipy")
    with xr.open_dataset(tmp_path / "map.nc", engine="scipy") as kept:
        assert kept.attrs["scene"] == ds.attrs["scene"]
        for name in ds.data_vars:
            assert kept[name].values.tolist() == ds[name].values.tolist() or ds[name].dtype.kind == "f", name
            assert ds[name].dtype.kind != "f" or np.array_equal(kept[name], ds[name], equal_nan=True), name


def test_a_list_has_one_dimension(program: Program, tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text("e,omega\n0.5,5.6\n0.25,4.0\n0.9,5.6\n")
    quantities = 'quantities = ["class", "lyapunov", "symmetric", "word"]'
    (tmp_path / "list.toml").write_text(f'[cells]\nfile = "points.csv"\n[outputs]\n{quantities}\n')
    program("map", tmp_path / "list.toml", "--engine", "cpu", "--quiet", "--out", tmp_path / "list")
    ds = rm.open(tmp_path / "list")
    assert dict(ds.sizes) == {"cell": 3}
    assert ds["e"].values.tolist() == [0.5, 0.25, 0.9] and "e" in ds.coords
    assert_as_table(ds, table(tmp_path / "list/cells.csv"))


def test_basins_have_their_attractors(program: Program, scratch: Path) -> None:
    folder = small(program, SCENES / "basin.toml", scratch / "basin", (12, 9), "outputs.files=['csv', 'npy']")
    ds, rows = rm.open(folder), table(folder / "attractors.csv")
    assert_as_table(ds, table(folder / "cells.csv"))
    assert ds["attractor"].dims == ("v1", "x1")
    assert ds["label"].values.tolist() == [int(text) for text in rows["label"]]
    assert ds["attractor_word"].values.tolist() == rows["word"]
    assert ds["attractor_cells"].values.tolist() == [(ds["attractor"] == label).sum() for label in ds["label"]]
    strobe = [[float(rows[f"strobe_{name}"][label]) for name in ("x1", "v1", "x2", "v2")] for label in range(len(rows["label"]))]
    assert ds["attractor_strobe"].values.tolist() == strobe


def test_cells_of_several_starts_count_attractors(program: Program, scratch: Path) -> None:
    more = ("start.count=3", "outputs.files=['csv', 'npy']")
    folder = small(program, SCENES / "coexistence.toml", scratch / "several", (5, 4), *more)
    ds = rm.open(folder)
    assert ds["attractors"].dims == ("e", "omega")
    assert_as_table(ds, table(folder / "cells.csv"))


@pytest.mark.parametrize("policy", ["rest", "both"])
def test_a_diagram_has_columns_and_points(program: Program, scratch: Path, policy: str) -> None:
    folder = scratch / f"diagram-{policy}"
    sets = ("axis.0.count=9", "axis.0.min=0.5", "outputs.files=['csv']", f"start.policy={policy}")
    arguments = [argument for text in sets for argument in ("--set", text)]
    program("bifurcation", SCENES / "paper_fig5.toml", "--quiet", "--out", folder, *arguments)
    ds, columns, points = rm.open(folder), *(table(folder / f"bifurcation{part}.csv") for part in ("_columns", ""))
    with_contact = [row for row, side in enumerate(points["side"]) if side]
    assert ds["x1"].values.tolist() == [float(points["x1"][row]) for row in with_contact]
    assert ds["point_e"].values.tolist() == [float(points["e"][row]) for row in with_contact]
    assert ds["kind"].values.tolist() == [points["kind"][row] for row in with_contact]
    ways = ["up", "down"] if policy == "both" else [None]
    for way in ways:
        rows = [row for row in range(len(columns["e"])) if way is None or columns["direction"][row] == way]
        rows.sort(key=lambda row: float(columns["e"][row]))
        shown = ds if way is None else ds.sel(direction=way)
        assert shown["e"].values.tolist() == [float(columns["e"][row]) for row in rows]
        assert_as_table(shown, {name: [texts[row] for row in rows] for name, texts in columns.items()})


def edit_manifest(folder: Path, **changes: object) -> None:
    path = folder / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def mark_unlisted(folder: Path) -> None:
    (folder / "cells.npy").unlink()
    edit_manifest(folder, files=[])


def keep_manifest_alone(folder: Path) -> None:
    """What is left of a map without the records that other files are made of."""
    for path in folder.iterdir():
        if path.name != "manifest.json":
            path.unlink()


SPOILT: list[tuple[Callable[[Path], object], str]] = [
    (shutil.rmtree, "there is no such folder"),
    (lambda folder: (folder / "manifest.json").unlink(), "the run is unfinished: resume it with `rattlemap map SCENE --out "),
    (lambda folder: (folder / "manifest.json").write_text("{}"), "this is not the manifest of a map"),
    (lambda folder: edit_manifest(folder, format=1), "of format 1, and this version reads format 2"),
    (lambda folder: edit_manifest(folder, command="orbit"), "not the manifest of a map, but of `orbit`"),
    (lambda folder: edit_manifest(folder, shard={"index": 3, "count": 16}), "`rattlemap merge OUT PART...` makes the map"),
    (mark_unlisted, "outputs.files of the scene lacks 'npy'"),
    (lambda folder: (folder / "cells.npy").unlink(), "cells.npy is missing; `rattlemap check"),
    (keep_manifest_alone, "cells.npy is missing; `rattlemap map SCENE --out "),
    (lambda folder: (folder / "words.csv").unlink(), "words.csv is missing; `rattlemap check"),
    (lambda folder: truncate(folder / "cells.npy"), "cells.npy is damaged"),
]


@pytest.mark.parametrize(("spoil", "told"), SPOILT, ids=[told for _, told in SPOILT])
def test_folders_that_cannot_be_opened(map_folder: Path, tmp_path: Path, spoil: Callable[[Path], object], told: str) -> None:
    folder = tmp_path / "map"
    shutil.copytree(map_folder, folder)
    spoil(folder)
    with pytest.raises(rm.FolderError) as raised:
        rm.open(folder)
    assert told in str(raised.value) and str(folder) in str(raised.value)


def test_words_that_are_not_in_their_table(map_folder: Path, tmp_path: Path) -> None:
    folder = tmp_path / "map"
    shutil.copytree(map_folder, folder)
    (folder / "words.csv").write_text("row,text\n0,\n")
    with pytest.raises(rm.FolderError, match="words.csv is damaged"):
        rm.open(folder)["word"].values
