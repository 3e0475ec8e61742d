"""rattlemap.open: Datasets equal the program's tables and are read on access; errors of damaged folders."""

from __future__ import annotations

import csv
import hashlib
import json
import pickle
import random
import re
import shutil
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
import rattlemap as rm
import xarray as xr
from conftest import SCENES, Program, set_arguments, small
from rattlemap import _native, dataset
from rattlemap.folder import FolderBackend

ABSENT = {"period": 0, "symmetric": -1, "attractor": -1}
CODES = {"true": 1, "false": 0}


def table(path: Path) -> dict[str, list[str]]:
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name] for row in rows] for name in rows[0]}


def assert_as_table(ds: xr.Dataset, rows: dict[str, list[str]]) -> None:
    """Every variable equals the column of the table, numbers to the last bit."""
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


def test_values_are_read_on_access(map_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looked_up: list[int] = []
    look_up = dataset.look_up

    def counting(names: dataset.Array, rows: dataset.Array) -> dataset.Array:
        looked_up.append(np.size(rows))
        return look_up(names, rows)

    monkeypatch.setattr(dataset, "look_up", counting)
    ds = rm.open(map_folder)
    assert "word" in repr(ds) and not looked_up
    assert ds["word"].isel(e=3).values.shape == (18,)
    assert looked_up == [18]
    exponent = ds["lyapunov"].values
    base = exponent
    while base is not None and not isinstance(base, np.memmap):
        base = base.base
    assert isinstance(base, np.memmap) and not exponent.flags.writeable
    # A task on another machine receives the path, not the numbers.
    sent = pickle.dumps(rm.open(map_folder)["lyapunov"].variable)
    assert len(sent) < exponent.nbytes
    assert np.array_equal(pickle.loads(sent).values, exponent, equal_nan=True)


def test_all_selections_of_xarray_work(map_folder: Path) -> None:
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


def assert_stored(stored: xr.Dataset, ds: xr.Dataset) -> None:
    """A file returns every value, text as text, and the descriptions."""
    assert stored.attrs == ds.attrs
    for name in ds.variables:
        values, expected = stored[name].values, ds[name].values
        if expected.dtype.kind == "f":
            assert np.array_equal(values, expected, equal_nan=True), name
        else:
            assert values.tolist() == expected.tolist(), name
        assert stored[name].attrs.get("long_name") == ds[name].attrs.get("long_name"), name
    if ds["class"].ndim == 2 and "direction" not in ds.dims:
        assert ((stored["class"] == "chaotic").values == (ds["class"] == "chaotic").values).all()
        plt.close(rm.plot(stored["class"]).figure)


@pytest.fixture(scope="module", params=["a map", "chunks", "basins", "a diagram"])
def stored_example(request: pytest.FixtureRequest, map_folder: Path) -> xr.Dataset:
    model = rm.load_model("impact-oscillator", omega=2.8)
    if request.param == "basins":
        return rm.basins(model, x=(-1, 1, 4), v=(-1, 1, 4), engine="cpu")
    if request.param == "a diagram":
        return rm.bifurcation(rm.gear_pair(), e=(0.5, 0.6, 4), start="both")
    ds = rm.open(map_folder)
    return ds.chunk({"e": 8}) if request.param == "chunks" else ds


@pytest.mark.parametrize("engine", ["netcdf4", "scipy"])
def test_datasets_are_stored_as_netcdf(stored_example: xr.Dataset, engine: Any, tmp_path: Path) -> None:
    stored_example.to_netcdf(tmp_path / "stored.nc", engine=engine)
    with xr.open_dataset(tmp_path / "stored.nc", engine=engine) as stored:
        assert_stored(stored, stored_example)


def test_datasets_are_stored_as_zarr(stored_example: xr.Dataset, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        # Zarr warns of types that other readers do not know, and xarray of text that it must load to know its type.
        warnings.filterwarnings("error", message="The data type|variable .* has data in the form of a dask array")
        stored_example.to_zarr(tmp_path / "stored.zarr", consolidated=False)
    with xr.open_zarr(tmp_path / "stored.zarr", consolidated=False) as stored:
        assert_stored(stored, stored_example)


def test_coordinates_have_long_names() -> None:
    basins = rm.basins(rm.load_model("impact-oscillator", omega=2.8), x=(-1, 1, 3), v=(-1, 1, 3), engine="cpu")
    for name in ("label", "component", "attractor_share", "attractor_strobe"):
        assert len(basins[name].attrs["long_name"]) > len(name) / 2, name


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
    program("bifurcation", SCENES / "paper_fig5.toml", "--quiet", "--out", folder, *set_arguments(*sets))
    ds, columns, points = rm.open(folder), *(table(folder / f"bifurcation{part}.csv") for part in ("_columns", ""))
    with_contact = [row for row, side in enumerate(points["side"]) if side]
    assert ds["x1"].values.tolist() == [float(points["x1"][row]) for row in with_contact]
    assert ds["point_e"].values.tolist() == [float(points["e"][row]) for row in with_contact]
    assert ds["kind"].values.tolist() == [points["kind"][row] for row in with_contact]
    ways = ["up", "down"] if policy == "both" else [None]
    for way in ways:
        rows = [row for row in range(len(columns["e"])) if way is None or columns["direction"][row] == way]
        rows.sort(key=lambda row: float(columns["e"][row]))
        selected = ds if way is None else ds.sel(direction=way)
        assert selected["e"].values.tolist() == [float(columns["e"][row]) for row in rows]
        assert_as_table(selected, {name: [texts[row] for row in rows] for name, texts in columns.items()})


def edit_manifest(folder: Path, **changes: object) -> None:
    path = folder / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def seal(text: str) -> str:
    """Renews the hash of a manifest's text, as a program would that forges it."""
    empty = re.sub('"manifest_sha256": "[0-9a-f]*"', '"manifest_sha256": ""', text)
    return empty.replace('"manifest_sha256": ""', f'"manifest_sha256": "{hashlib.sha256(empty.encode()).hexdigest()}"')


def mark_unlisted(folder: Path) -> None:
    path = folder / "manifest.json"
    path.write_text(seal(re.sub(r'"files": \[.*?\n  \]', '"files": []', path.read_text(), flags=re.DOTALL)))


def flip_bit(path: Path, place: int, bit: int = 0) -> None:
    content = bytearray(path.read_bytes())
    content[place] ^= 1 << bit
    path.write_bytes(content)


def keep_manifest_alone(folder: Path) -> None:
    """Removes the records, from which other files could be made."""
    for path in folder.iterdir():
        if path.name != "manifest.json":
            path.unlink()


DAMAGES: list[tuple[Callable[[Path], object], str]] = [
    (shutil.rmtree, "there is no such folder"),
    (lambda folder: (folder / "manifest.json").unlink(), "the run is unfinished: resume it with `rm.map(..., out="),
    (lambda folder: (folder / "manifest.json").write_text("{}"), "this is not the manifest of a map"),
    (lambda folder: edit_manifest(folder, format=1), "of format 1, and this version reads format 2"),
    (lambda folder: edit_manifest(folder, command="orbit"), "not the manifest of a map, but of `orbit`"),
    (lambda folder: edit_manifest(folder, shard={"index": 3, "count": 16}), "`rattlemap merge OUT PART...` makes the map"),
    (mark_unlisted, "outputs.files of the scene lacks 'npy'"),
    (lambda folder: (folder / "cells.npy").unlink(), "cells.npy is missing; `rm.check("),
    (keep_manifest_alone, "cells.npy is missing; `rm.map(..., out="),
    (lambda folder: (folder / "words.csv").unlink(), "words.csv is missing; `rm.check("),
    (lambda folder: truncate(folder / "cells.npy"), "cells.npy is damaged"),
    (lambda folder: flip_bit(folder / "cells.npy", -9), "its size or hash is not that of manifest.json"),
    (lambda folder: edit_manifest(folder, cells=431), "manifest.json is damaged: its contents are not what they were"),
]


@pytest.mark.parametrize(("damage", "message"), DAMAGES, ids=[message for _, message in DAMAGES])
def test_folders_that_cannot_be_opened(map_folder: Path, tmp_path: Path, damage: Callable[[Path], object], message: str) -> None:
    folder = tmp_path / "map"
    shutil.copytree(map_folder, folder)
    damage(folder)
    with pytest.raises(rm.FolderError) as raised:
        rm.open(folder)
    assert message in str(raised.value) and str(folder) in str(raised.value)


def test_words_that_are_not_in_their_table(map_folder: Path, tmp_path: Path) -> None:
    folder = tmp_path / "map"
    shutil.copytree(map_folder, folder)
    (folder / "words.csv").write_text("row,text\n0,\n")
    with pytest.raises(rm.FolderError, match="words.csv is damaged"):
        rm.open(folder)["word"].values


@pytest.fixture(scope="module", params=["map", "basins", "diagram"])
def example(request: pytest.FixtureRequest, program: Program, map_folder: Path, scratch: Path) -> Path:
    folder = scratch / f"mutated-{request.param}"
    if request.param == "map":
        return map_folder
    if request.param == "basins":
        return small(program, SCENES / "basin.toml", folder, (5, 4), "outputs.files=['csv', 'npy']")
    sets = ("axis.0.count=5", "axis.0.min=0.5", "outputs.files=['csv']", "start.policy=both")
    program("bifurcation", SCENES / "paper_fig5.toml", "--quiet", "--out", folder, *set_arguments(*sets))
    return folder


def assert_refused_or(folder: Path, expected: xr.Dataset | None) -> bool:
    """A malformed folder raises FolderError; if it does not, its values are the expected ones, if any. Returns if it does."""
    try:
        found = rm.open(folder).load()
    except rm.FolderError as error:
        assert str(folder) in str(error)
        return True
    assert expected is None or found.identical(expected)
    return False


def test_no_flipped_bit_changes_a_value(example: Path, tmp_path: Path) -> None:
    draw, expected, refused = random.Random(1), rm.open(example).load(), 0
    folder = tmp_path / "map"
    shutil.copytree(example, folder)
    names = ["manifest.json", "cells.npy", *(["words.csv"] if "word" in expected else []), "attractors.csv"]
    read = [folder / name for name in (*names, "bifurcation.csv", "bifurcation_columns.csv") if (folder / name).exists()]
    for path in read:
        right = path.read_bytes()
        for _ in range(30):
            flip_bit(path, draw.randrange(len(right)), draw.randrange(8))
            refused += assert_refused_or(folder, expected)
            path.write_bytes(right)
    # A flipped bit can turn "1e-9" in the manifest into "1E-9".
    assert refused >= 28 * len(read)


def test_forged_folders_raise_no_other_error(example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The hashes of forged files are right. The manifest is forged behind the check of its own hash."""
    draw, folder = random.Random(2), tmp_path / "map"
    shutil.copytree(example, folder)
    manifest = json.loads((folder / "manifest.json").read_text())

    def open_with(forged: dict[str, Any]) -> None:
        monkeypatch.setattr(_native, "manifest", lambda _: json.dumps(forged))
        assert_refused_or(folder, None)

    for key in manifest:
        for value in (None, [], {}, "x", -1, [[]], {"x": []}):
            open_with({**manifest, key: value})
        open_with({name: value for name, value in manifest.items() if name != key})
    for name in ("cells.npy", "words.csv", "attractors.csv", "bifurcation.csv", "bifurcation_columns.csv"):
        right = (folder / name).read_bytes() if (folder / name).exists() else b""
        for _ in range(40 if right else 0):
            place = draw.randrange(min(len(right), draw.choice([80, 10**9])))
            forged = right[:place] + draw.choice([b"", b"\n", b",", b'"', b"\xff", b"9"]) + right[place + draw.randrange(3) :]
            (folder / name).write_bytes(forged)
            entry = {"name": name, "bytes": len(forged), "sha256": hashlib.sha256(forged).hexdigest()}
            open_with({**manifest, "files": [entry, *(file for file in manifest["files"] if file["name"] != name)]})
        if right:
            (folder / name).write_bytes(right)
