"""Datasets of columns: names, axes and attributes of variables, and the conversion of codes to text.

Columns are those of ``cells.npy``: one-dimensional, one value per cell, the first axis changes fastest. They come from a finished
folder (:mod:`rattlemap.folder`) or from the engine.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr

Array = npt.NDArray[Any]

#: Columns that are row numbers of a table of texts.
TEXT_COLUMNS = ("word", "pattern")
#: Columns whose codes become text. Codes of ``symmetric`` stay: -1 absent, 0 false, 1 true.
CODE_COLUMNS = ("class", "status", "source", "finished")
#: Indices along the axes, which a Dataset does not need.
INDICES = ("i", "j")
#: Dimension of a list of cells.
CELL = "cell"

_LONG_NAMES = {
    "class": "class",
    "period": "forcing periods per cycle",
    "lyapunov": "largest Lyapunov exponent",
    "lyapunov_error": "standard error of the exponent",
    "impacts_per_period": "impacts per forcing period",
    "mesh_fraction": "share of the time spent meshing",
    "symmetric": "whether a cycle is its own mirror image",
    "word": "word of the cycle",
    "pattern": "pattern of the cycle",
    "status": "how the integration ended",
    "periods_run": "forcing periods integrated",
    "source": "integrated or filled",
    "finished": "engine that finished the cell",
    "attractors": "attractors found",
    "attractor": "label of the attractor",
}

#: Long names of coordinates and of variables of attractors and section points.
_MORE_LONG_NAMES = {
    "label": "label of the attractor",
    "component": "component of the state",
    "direction": "direction in which the attractor is followed",
    "side": "wall: 1 right, -1 left",
    "kind": "kind of the event",
    "t_mod_period": "time since phase 0",
    "attractor_class": "class of the attractor",
    "attractor_period": "forcing periods per cycle of the attractor",
    "attractor_word": "word of the attractor",
    "attractor_pattern": "pattern of the attractor",
    "attractor_exponent": "largest Lyapunov exponent of the attractor",
    "attractor_largest_multiplier": "largest modulus of the attractor's multipliers",
    "attractor_symmetric": "whether the attractor is its own mirror image",
    "attractor_cells": "cells that lead to the attractor",
    "attractor_share": "share of the cells that lead to the attractor",
    "attractor_strobe": "state of the attractor at phase 0",
}

#: Type of Python strings. The metadata are xarray's, which then need not read all values to know that they are text.
STRINGS = np.dtype("O", metadata={"element_type": str})
#: Encoding of text of fixed width. Files store it as text of any length, which all readers of zarr know.
_AS_TEXT = {"dtype": STRINGS}

#: Names of the results of a cell.
RESULTS = frozenset(_LONG_NAMES)


def code_names(codes: Mapping[str, int]) -> Array:
    """Return an array of names indexed by code, shape (256,), text of fixed width. The code -1 is the last entry."""
    width = max(map(len, codes), default=1)
    names = np.full(256, "", dtype=f"<U{width}")
    for name, code in codes.items():
        names[code] = name
    return names


def text_array(texts: Iterable[str]) -> Array:
    """Return texts as Python strings, dtype object, because lengths of words differ by a factor of 60."""
    return np.array([*texts], dtype=STRINGS)


def look_up(table: Array, rows: Array) -> Array:
    """Return the entries of a table at these rows, in the shape of the rows. Raises IndexError if a row is not in the table."""
    rows = np.asarray(rows)
    found = np.empty(rows.shape, dtype=table.dtype)
    found[...] = table[rows]
    return found


def attributes(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """Return a manifest as attributes that any file format accepts: text and numbers unchanged, other values as JSON.

    ``json.loads(ds.attrs["parameters"])`` restores such a value. Null values and the list of files are left out.
    """

    def plain(value: Any) -> Any:
        return value if isinstance(value, (str, int, float)) and not isinstance(value, bool) else json.dumps(value)

    left_out = ("files", "manifest_sha256")
    return {name: plain(value) for name, value in manifest.items() if name not in left_out and value is not None}


def described(name: str, manifest: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``long_name`` and, if the model gives one, ``units`` of a parameter or a component of the state.

    ``x_before`` is the component ``x`` before an event. Manifests of other programs' versions may have no meanings.
    """
    model = manifest.get("model")
    meanings, units = (model.get(key, {}) if isinstance(model, Mapping) else {} for key in ("meanings", "units"))
    component = name if name in meanings else name.removesuffix("_before")
    when = "" if component == name else " before the event"
    found = {"long_name": meanings.get(component, component) + when}
    if component in units:
        found["units"] = units[component]
    return found


def variable_attributes(
    name: str, codes: Mapping[str, Mapping[str, int]], manifest: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the attributes of a variable: a long name, which labels plots, units, and the meaning of integer codes."""
    measured = manifest.get("measured", {})
    found: dict[str, Any] = dict(measured.get(name, {"long_name": _LONG_NAMES.get(name, name)}))
    if name == "symmetric":
        ordered = sorted(codes[name].items(), key=lambda item: item[1])
        found["flag_values"] = np.array([code for _, code in ordered], dtype=np.int8)
        found["flag_meanings"] = " ".join(meaning for meaning, _ in ordered)
    return found


def finished(ds: xr.Dataset) -> xr.Dataset:
    """Add what no table contains: long names, and how files store text."""
    for name, variable in ds.variables.items():
        if name in _MORE_LONG_NAMES and variable.attrs.get("long_name", name) == name:
            variable.attrs["long_name"] = _MORE_LONG_NAMES[str(name)]
        if variable.dtype.kind == "U":
            variable.encoding.update(_AS_TEXT)
    return ds


#: Returns the data of a variable from the name of the column, the shape, and the table that its codes refer to, or None.
Reader = Callable[[str, tuple[int, ...], "str | None"], Any]


def arrange(fields: Iterable[str], manifest: Mapping[str, Any], column: Callable[[str], Array], read: Reader) -> xr.Dataset:
    """Return the Dataset of a map: dimensions (second axis, first axis), or ``cell`` for a list.

    ``fields`` names the columns. ``column`` returns the values of an axis, shape (cells,). ``read`` returns the data of a
    variable. The manifest becomes the attributes.
    """
    axes = manifest.get("axes") or []
    codes = manifest["codes"]
    coords: dict[str, Any]
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    if axes:
        first, second = (axis["parameter"] for axis in axes)
        columns, rows = (int(axis["count"]) for axis in axes)
        dims, shape = (second, first), (rows, columns)
        coords = {
            second: ((second,), column(second)[::columns].copy(), described(second, manifest)),
            first: ((first,), column(first)[:columns].copy(), described(first, manifest)),
        }
    else:
        dims, shape = (CELL,), (int(manifest["cells"]),)
        coords = {
            name: ((CELL,), column(name), described(name, manifest)) for name in manifest["list"]["columns"]
        }
    variables = {}
    for name in fields:
        if name in INDICES or name in coords:
            continue
        table = "words" if name in TEXT_COLUMNS else name if name in CODE_COLUMNS else None
        variables[name] = xr.Variable(dims, read(name, shape, table), variable_attributes(name, codes, manifest))
    return finished(xr.Dataset(variables, coords, attributes(manifest)))


def from_columns(columns: Mapping[str, Array], manifest: Mapping[str, Any], texts: Iterable[str] = ("",)) -> xr.Dataset:
    """Return the Dataset of a map whose columns are in memory. Numbers are not copied.

    ``word`` and ``pattern`` are row numbers of ``texts``, of which the first is empty.
    """
    words = text_array(texts)

    def read(name: str, shape: tuple[int, ...], table: str | None) -> Array:
        values = columns[name].reshape(shape)
        if table is None:
            return values
        return look_up(words if table == "words" else code_names(manifest["codes"][table]), values)

    return arrange(columns, manifest, columns.__getitem__, read)


#: Types of columns of whole numbers in tables. Absent values are 0, NaN or empty, as in ``cells.npy``.
_TYPES: dict[str, Any] = {
    "label": np.int32,
    "period": np.uint16,
    "period_a": np.uint16,
    "period_b": np.uint16,
    "periods_run": np.uint32,
    "cells": np.int64,
    "side": np.int8,
    "i": np.int64,
    "j": np.int64,
}
#: Columns of text that can be empty in every row.
_NAMES = frozenset(("class", "class_a", "class_b", "status", "kind", "direction", "event", "moment", "gap", "element", "quantities"))


def text_table(source: Path | StringIO | BytesIO) -> pd.DataFrame:
    """Read a table of the program with every field as text."""
    return pd.read_csv(source, dtype=str, keep_default_na=False)


def table_column(name: str, values: pd.Series) -> Array:
    """Convert a column of :func:`text_table` to the type that its variable has in a map.

    Names of other columns can be those of a model's gaps, so the fields decide: a column is text if one of them is not a number.
    """
    text = values.fillna("")
    if name in TEXT_COLUMNS:
        return text_array(text)
    if name == "symmetric":
        return np.array([{"true": 1, "false": 0}.get(value, -1) for value in text], dtype=np.int8)
    if name in _TYPES:
        return np.array([int(value or 0) for value in text], dtype=_TYPES[name])
    if any(text) or name not in _NAMES:
        with suppress(ValueError):
            return np.array([float(value or "nan") for value in text], dtype=np.float64)
    return np.asarray(text.to_numpy(), dtype=str)


def table_columns(table: pd.DataFrame) -> dict[str, Array]:
    """Convert all columns of :func:`text_table`."""
    return {str(name): table_column(str(name), table[name]) for name in table.columns}


def with_attractors(ds: xr.Dataset, table: pd.DataFrame) -> xr.Dataset:
    """Return a map with the table of its attractors, ``attractors.csv``.

    Columns become ``attractor_class``, ``attractor_period`` and so on over the dimension ``label``, to which ``ds["attractor"]``
    refers. The strobe state is ``attractor_strobe`` over (label, component).
    """
    columns = table_columns(table)
    label = columns.pop("label")
    states = [name for name in columns if name.startswith("strobe_")]
    variables: dict[str, Any] = {
        f"attractor_{name}": (("label",), values) for name, values in columns.items() if name not in states
    }
    strobe = np.stack([columns[name] for name in states], axis=-1) if states else np.empty((len(label), 0))
    variables["attractor_strobe"] = (("label", "component"), strobe)
    component = np.array([name.removeprefix("strobe_") for name in states], dtype=str)
    return finished(ds.assign(variables).assign_coords(label=label, component=component))


def diagram(columns: pd.DataFrame, points: pd.DataFrame, manifest: Mapping[str, Any]) -> xr.Dataset:
    """Return the Dataset of a bifurcation diagram from its two tables with every field as text.

    Columns are over the swept parameter, or over (direction, parameter) if the attractor was followed in both directions. Section
    points are over the dimension ``point``; ``point_<parameter>`` is the parameter's value there.
    """
    axis, data = manifest["axis"]["parameter"], table_columns(columns)
    value, direction = data.pop(axis), data.pop("direction", None)
    coords: dict[str, Any]
    dims: tuple[str, ...]
    if direction is None:
        dims, place, values = (axis,), np.argsort(value, kind="stable"), np.sort(value)
        coords = {}
    else:
        names = ("up", "down")
        rows = [np.flatnonzero(direction == name) for name in names]
        place = np.stack([of_name[np.argsort(value[of_name], kind="stable")] for of_name in rows])
        dims, values, coords = ("direction", axis), value[place[0]], {"direction": np.array(names)}
    coords[axis] = ((axis,), values, described(axis, manifest))
    codes = {"symmetric": {"absent": -1, "false": 0, "true": 1}}
    variables = {
        name: xr.Variable(dims, column[place], variable_attributes(name, codes, manifest))
        for name, column in data.items()
    }
    # A row without a side has no section point.
    for name, column in table_columns(points[points["side"] != ""]).items():
        if name == "direction":
            coords[f"point_{name}"] = (("point",), column)
        elif name == axis:
            coords[f"point_{name}"] = (("point",), column, described(name, manifest))
        elif name not in ("class", "period", "status"):
            variables[name] = xr.Variable(("point",), column, described(name, manifest))
    return finished(xr.Dataset(variables, coords, attributes(manifest)))
