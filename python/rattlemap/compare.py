"""Comparison of two finished maps of the same cells."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from io import StringIO
from typing import Any

import pandas as pd
import xarray as xr

from . import _native, dataset
from .engine import warn
from .errors import FolderError


_KINDS = ("class", "period", "pattern", "word", "motion", "quantity")


@dataclass(frozen=True)
class Comparison:
    """Differences between two maps. :func:`compare` returns it.

    Attributes
    ----------
    cells
        Number of cells.
    by_class, by_period
        Number of cells with different classes, and of periodic cells with different periods.
    by_pattern, by_word
        Number of cells with equal periods that differ by pattern, or by word if a map has no patterns.
    by_motion, by_quantity
        ``by_motion``: number of further cells with equal periods but different cycles; mirror images count as equal.
        ``by_quantity``: number of cells that differ only in a quantity.
    differing
        Number of cells that differ by class or period.
    transitions
        One row per pair of different classes: class ``a`` in the first map, ``b`` in the second, and the number of ``cells``.
    table
        One row per differing cell, as in ``compare.csv``: indices, swept values, ``class_a``, ``period_a``, ``class_b``,
        ``period_b``, ``lyapunov_a``, ``lyapunov_b``, ``kind`` (``class``, ``period``, ``pattern``, ``word``, ``motion``,
        ``quantity``), and ``quantities``: the names of those that differ, with spaces between.
    data
        The object that ``rattlemap compare --json`` prints, without the folder and its files.
    """

    cells: int
    differing: int
    by_class: int
    by_period: int
    by_pattern: int
    by_word: int
    by_motion: int
    by_quantity: int
    transitions: pd.DataFrame
    table: pd.DataFrame = field(repr=False)
    data: dict[str, Any] = field(repr=False)


def compare(
    a: str | os.PathLike[str] | xr.Dataset, b: str | os.PathLike[str] | xr.Dataset, tolerance: float = 0.05
) -> Comparison:
    """Compare two finished maps of the same cells, like ``rattlemap compare``.

    Parameters
    ----------
    a, b
        Folders of maps, or Datasets that :func:`rattlemap.open` has returned.
    tolerance
        Difference of a quantity that counts, relative to the larger of both values; of angles, in radians.

    Returns
    -------
    Comparison

    Raises
    ------
    FolderError
        If a folder is not a finished map's, or a Dataset has no folder.
    SceneError
        If a map has no classes, or the maps have different cells.

    Examples
    --------
    >>> axes = {"e": (0, 1, 4), "omega": (1, 12, 4), "engine": "cpu", "force": True}
    >>> _ = rm.map(rm.gear_pair(), **axes, start="up", out="up"), rm.map(rm.gear_pair(), **axes, start="down", out="down")
    >>> rm.compare("up", "down").cells
    16
    """
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance = {tolerance}: it must be above 0 and below 1")
    result, text, warnings = _native.compare(_folder(a), _folder(b), tolerance)
    warn(warnings)
    data = json.loads(result)
    return Comparison(
        **{name: data[name] for name in ("cells", "differing", *(f"by_{kind}" for kind in _KINDS))},
        transitions=pd.DataFrame(data["transitions"], columns=["a", "b", "cells"]),
        table=pd.DataFrame(dataset.table_columns(dataset.text_table(StringIO(text)))),
        data=data,
    )


def _folder(map_: str | os.PathLike[str] | xr.Dataset) -> str:
    if not isinstance(map_, xr.Dataset):
        return os.fspath(map_)
    source = map_.encoding.get("source")
    if source is None:
        raise FolderError("the Dataset has no folder; compute the map with out=FOLDER and use rm.open(FOLDER)")
    return str(source)
