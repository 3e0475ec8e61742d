"""From columns to a Dataset: the one place where codes become text, and where variables get names, axes and attributes.

Columns are those of ``cells.npy``: one-dimensional, a value per cell, the first axis running fastest. They come from a
finished folder (:mod:`rattlemap.folder`) or straight from the engine.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr

Array = npt.NDArray[Any]

#: Columns that are rows of a table of texts.
SPELLED = ("word", "pattern")
#: Columns whose codes become text. Of ``symmetric`` they are kept: -1 absent, 0 false, 1 true.
CODED = ("class", "status", "source")
#: Columns that say where a cell lies on the axes: what a Dataset has its dimensions for.
PLACES = ("i", "j")
#: The dimension of cells that are listed.
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
    "attractors": "attractors found",
    "attractor": "label of the attractor",
}

#: What the results of a cell can be called.
RESULTS = frozenset(_LONG_NAMES)


def names_of(codes: Mapping[str, int]) -> Array:
    """The names that codes of one byte stand for.

    Parameters
    ----------
    codes
        Codes by name, as ``codes`` of a manifest has them; -128 to 127.

    Returns
    -------
    ndarray of str, shape (256,)
        Text of fixed width; the code -1 is at the last place, which is where it counts from the end.
    """
    width = max(map(len, codes), default=1)
    names = np.full(256, "", dtype=f"<U{width}")
    for name, code in codes.items():
        names[code] = name
    return names


def texts_of(texts: Iterable[str]) -> Array:
    """Texts as an array of Python strings, dtype object: words differ in length by a factor of 60."""
    return np.array([*texts], dtype=object)


def look_up(table: Array, rows: Array) -> Array:
    """The entries of a table at these rows: an array of the rows' shape and the table's dtype.

    Raises
    ------
    IndexError
        If a row is not in the table.
    """
    rows = np.asarray(rows)
    found = np.empty(rows.shape, dtype=table.dtype)
    found[...] = table[rows]
    return found


def attributes(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """A manifest as attributes that any format takes: text and numbers as they are, the rest as JSON.

    ``json.loads(ds.attrs["parameters"])`` gives such a one back. What is null is left out, and so are the files.
    """

    def plain(value: Any) -> Any:
        return value if isinstance(value, (str, int, float)) and not isinstance(value, bool) else json.dumps(value)

    left_out = ("files", "manifest_sha256")
    return {name: plain(value) for name, value in manifest.items() if name not in left_out and value is not None}


def variable_attributes(name: str, codes: Mapping[str, Mapping[str, int]]) -> dict[str, Any]:
    """What is told of a variable: a long name, of which plots make labels; of integer codes their meaning."""
    told: dict[str, Any] = {"long_name": _LONG_NAMES.get(name, name)}
    if name == "symmetric":
        ordered = sorted(codes[name].items(), key=lambda item: item[1])
        told["flag_values"] = np.array([code for _, code in ordered], dtype=np.int8)
        told["flag_meanings"] = " ".join(meaning for meaning, _ in ordered)
    return told


#: What gives a variable its data: name of the column, shape, table to look codes up in (or none).
Reader = Callable[[str, tuple[int, ...], "str | None"], Any]


def arrange(fields: Iterable[str], manifest: Mapping[str, Any], column: Callable[[str], Array], read: Reader) -> xr.Dataset:
    """A map's Dataset.

    Parameters
    ----------
    fields
        Names of the columns, in their order.
    manifest
        What the map is: ``axes`` or ``list``, ``codes``; the rest becomes attributes.
    column
        Gives a column, undecoded, of shape (cells,): asked for the axes' values alone.
    read
        Gives the data of a variable: of the column with that name, in that shape, looked up in the table of that name
        (``"words"`` or a name in ``codes``).

    Returns
    -------
    xarray.Dataset
        Dimensions (second axis, first axis), or ``cell`` of a list, whose parameters are coordinates.
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
            second: column(second)[::columns].copy(),
            first: column(first)[:columns].copy(),
        }
    else:
        dims, shape = (CELL,), (int(manifest["cells"]),)
        coords = {name: ((CELL,), column(name)) for name in manifest["list"]["columns"]}
    variables = {}
    for name in fields:
        if name in PLACES or name in coords:
            continue
        table = "words" if name in SPELLED else name if name in CODED else None
        variables[name] = xr.Variable(dims, read(name, shape, table), variable_attributes(name, codes))
    return xr.Dataset(variables, coords, attributes(manifest))


def dataset(columns: Mapping[str, Array], manifest: Mapping[str, Any], texts: Iterable[str] = ("",)) -> xr.Dataset:
    """The Dataset of a map whose columns are in memory.

    Parameters
    ----------
    columns
        Columns by name as ``cells.npy`` has them: shape (cells,), codes and rows of texts undecoded. Numbers are not
        copied.
    manifest
        As in a folder: ``axes`` or ``list`` and ``cells``, ``codes``; the rest becomes attributes.
    texts
        The texts that ``word`` and ``pattern`` are rows of; the first is empty.

    Returns
    -------
    xarray.Dataset
        As :func:`rattlemap.open` gives it.
    """
    words = texts_of(texts)

    def read(name: str, shape: tuple[int, ...], table: str | None) -> Array:
        values = columns[name].reshape(shape)
        if table is None:
            return values
        return look_up(words if table == "words" else names_of(manifest["codes"][table]), values)

    return arrange(columns, manifest, columns.__getitem__, read)


#: Types of the tables' columns; what is absent is 0, NaN or empty, as in ``cells.npy``.
_KINDS: dict[str, Any] = {
    "label": np.int32,
    "period": np.uint16,
    "periods_run": np.uint32,
    "cells": np.int64,
    "side": np.int8,
}
_TEXTS = frozenset(("word", "pattern"))
_WORDS_OF_FIXED_WIDTH = frozenset(("class", "status", "kind", "direction"))


def table_column(name: str, values: pd.Series) -> Array:
    """A column of a table (``attractors.csv``, ``bifurcation.csv`` and their like), read as text, as cells have it."""
    text = values.fillna("")
    if name in _TEXTS:
        return texts_of(text)
    if name in _WORDS_OF_FIXED_WIDTH:
        return np.asarray(text.to_numpy(), dtype=str)
    if name == "symmetric":
        return np.array([{"true": 1, "false": 0}.get(value, -1) for value in text], dtype=np.int8)
    if name in _KINDS:
        return np.array([int(value or 0) for value in text], dtype=_KINDS[name])
    return np.array([float(value or "nan") for value in text], dtype=np.float64)


def with_attractors(ds: xr.Dataset, table: pd.DataFrame) -> xr.Dataset:
    """The same map with the table of its attractors, whose columns are text as ``attractors.csv`` has it.

    Its columns become ``attractor_class``, ``attractor_period`` and so on over the dimension ``label``, by which
    ``ds["attractor"]`` names them; the strobe state is ``attractor_strobe`` over (label, component).
    """
    columns = {str(name): table_column(str(name), table[name]) for name in table.columns}
    label = columns.pop("label")
    states = [name for name in columns if name.startswith("strobe_")]
    variables: dict[str, Any] = {
        f"attractor_{name}": (("label",), values) for name, values in columns.items() if name not in states
    }
    strobe = np.stack([columns[name] for name in states], axis=-1) if states else np.empty((len(label), 0))
    variables["attractor_strobe"] = (("label", "component"), strobe)
    component = np.array([name.removeprefix("strobe_") for name in states], dtype=str)
    return ds.assign(variables).assign_coords(label=label, component=component)


def typed_points(points: pd.DataFrame) -> dict[str, Array]:
    """Section points by column, of ``bifurcation.csv`` with every column read as text; rows without a point are left out."""
    points = points[points["side"].fillna("") != ""]
    return {str(name): table_column(str(name), points[name]) for name in points.columns}


def named(names: list[str], codes: Array) -> Array:
    """Names by their places in a list, as wide as the longest of them that is there."""
    texts = np.array(names)[codes]
    width = max((len(names[code]) for code in np.unique(codes)), default=1)
    return texts.astype(f"<U{width}")


def diagram(axis: str, columns: pd.DataFrame, points: Mapping[str, Array], manifest: Mapping[str, Any]) -> xr.Dataset:
    """The Dataset of a bifurcation diagram.

    Parameters
    ----------
    axis
        The swept parameter.
    columns
        As ``bifurcation_columns.csv``, every column read as text: a row per value (and direction).
    points
        The columns of ``bifurcation.csv``, each of its type: a value per section point.
    manifest
        Becomes attributes.

    Returns
    -------
    xarray.Dataset
        Class, period, exponent and so on over ``axis``, or over (direction, ``axis``) where the attractor was followed
        both ways. Section points are over the dimension ``point``: ``side``, ``kind``, ``t_mod_period``, states before
        and after; ``point_<axis>`` is the parameter's value there, ``point_direction`` the direction.
    """
    data = {str(name): table_column(str(name), columns[name]) for name in columns.columns}
    value, direction = data.pop(axis), data.pop("direction", None)
    coords: dict[str, Any]
    dims: tuple[str, ...]
    if direction is None:
        dims, place, coords = (axis,), np.argsort(value, kind="stable"), {axis: np.sort(value)}
    else:
        ways = ("up", "down")
        order = [np.flatnonzero(direction == way) for way in ways]
        place = np.stack([at[np.argsort(value[at], kind="stable")] for at in order])
        dims, coords = ("direction", axis), {"direction": np.array(ways), axis: value[place[0]]}
    codes = {"symmetric": {"absent": -1, "false": 0, "true": 1}}
    variables = {
        name: xr.Variable(dims, values[place], variable_attributes(name, codes)) for name, values in data.items()
    }
    of_column = {"class", "period", "status"}
    for name, values in points.items():
        if name in of_column:
            continue
        if name in (axis, "direction"):
            coords[f"point_{name}"] = (("point",), values)
        else:
            variables[name] = xr.Variable(("point",), values)
    return xr.Dataset(variables, coords, attributes(manifest))
