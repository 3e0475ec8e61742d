"""Cells of a table: one per row."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from . import _native, dataset, scenes, toml
from .engine import Adapter, Engine, Precision, adapter_text, interruptible, map_dataset, no_display, warn
from .errors import SceneError
from .model import Model, require_model
from .progress import Report, reporter


def cells(
    model: Model,
    frame: pd.DataFrame | Mapping[str, Any],
    *,
    columns: Sequence[str] | None = None,
    parameters: scenes.Parameters | None = None,
    engine: Engine = "auto",
    precision: Precision | None = None,
    adapter: Adapter | None = None,
    quantities: Iterable[str] | None = None,
    start: scenes.Start | None = None,
    settings: Mapping[str, Any] | None = None,
    progress: bool | Report = True,
    **names: Any,
) -> pd.DataFrame:
    """Compute the motion at each row of a table, like ``rattlemap map`` of a scene with a list of cells.

    Parameters
    ----------
    model
        The oscillator. It supplies the values of all parameters that neither a column nor a keyword sets.
    frame
        One row per cell, with columns named after parameters or components of the start; or a mapping of such names to arrays.
    columns
        The columns that are parameters; by default all.
    **names
        Values of single parameters, and settings of ``[integration]``.
    parameters, engine, precision, adapter, quantities, start, settings, progress
        See :func:`rattlemap.map`.

    Returns
    -------
    pandas.DataFrame
        The frame with its index, and the columns ``class``, ``period``, ``lyapunov`` and so on: the variables of
        :func:`rattlemap.map`.

    Raises
    ------
    SceneError
        For an unknown column, a column with the name of a result, a value out of its range, and in the cases of
        :func:`rattlemap.map`.

    Examples
    --------
    >>> rm.cells(rm.gear_pair(), pd.DataFrame({"e": [0.06, 0.605], "omega": [5.6, 5.6]}))["class"]
    """
    frame = frame if isinstance(frame, pd.DataFrame) else pd.DataFrame({name: np.asarray(frame[name]) for name in frame})
    reserved = [name for name in frame.columns if name in dataset.RESULTS]
    if reserved:
        raise SceneError(f"the frame has a column {reserved[0]!r}, which is the name of a result; rename it")
    used = [*frame.columns] if columns is None else [columns] if isinstance(columns, str) else [*columns]
    missing = [name for name in used if name not in frame.columns]
    if missing:
        raise SceneError(f"the frame has no column {missing[0]!r}; it has {', '.join(map(str, frame.columns))}")
    request = scenes.scene_of(
        require_model(model),
        None,
        scenes.all_names(names, None, parameters),
        purpose="map",
        axes=0,
        quantities=quantities,
        start=start,
        settings=settings,
        cells=_csv(frame, used),
    )
    with interruptible(None, resumable=False), no_display(), reporter(progress, "cells") as report:
        result = _native.map(request, engine, precision, None, False, False, report, adapter_text(adapter))
    warn(result["warnings"])
    variables = map_dataset(result).data_vars
    return frame.assign(**{str(name): pd.Series(variables[name].values, index=frame.index) for name in variables})


def _csv(frame: pd.DataFrame, columns: Sequence[Any]) -> str:
    """Return columns as CSV; numbers read back as the same bits."""
    values = [[toml.number_text(value) for value in frame[name]] for name in columns]
    rows = [",".join(row) for row in zip(*values, strict=True)]
    return "\n".join([",".join(map(str, columns)), *rows]) + "\n"
