"""Cells of one's own choice: a row of a table each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from . import _native, asking, decode
from .engine import Adapter, Engine, Precision, adapter_text, dataset, no_display
from .errors import SceneError
from .model import Model, required
from .progress import Tell, telling


def cells(
    model: Model,
    frame: pd.DataFrame | Mapping[str, Any],
    *,
    columns: Sequence[str] | None = None,
    engine: Engine = "auto",
    precision: Precision | None = None,
    adapter: Adapter | None = None,
    quantities: Iterable[str] | None = None,
    start: asking.Start | None = None,
    settings: Mapping[str, Any] | None = None,
    progress: bool | Tell = True,
    **names: Any,
) -> pd.DataFrame:
    """Say what the motion is at each row of a table: ``rattlemap map`` of a scene with a list of cells.

    Parameters
    ----------
    model
        What moves; its values are those of all parameters that neither a column nor a keyword names.
    frame
        A row per cell, columns named after parameters or components of the start; or arrays of one length by name.
    columns
        Those that are parameters, where the frame has others, too; all unless told.
    **names
        Values of single parameters, and settings of ``[integration]``, as :func:`rattlemap.map` takes them.
    engine, precision, adapter, quantities, start, settings, progress
        As :func:`rattlemap.map` takes them.

    Returns
    -------
    pandas.DataFrame
        The frame, its index kept, with columns ``class``, ``period``, ``lyapunov`` and so on after its own: what
        :func:`rattlemap.map` has as variables.

    Raises
    ------
    SceneError
        For an unknown column, one with a result's name, a value out of its range, and as :func:`rattlemap.map`.

    Examples
    --------
    >>> rm.cells(rm.gear_pair(), pd.DataFrame({"e": [0.06, 0.605], "omega": [5.6, 5.6]}))["class"]
    """
    frame = frame if isinstance(frame, pd.DataFrame) else pd.DataFrame({name: np.asarray(frame[name]) for name in frame})
    taken = [name for name in frame.columns if name in decode.RESULTS]
    if taken:
        raise SceneError(f"the frame has a column {taken[0]!r}, which is a result's name; rename it")
    own = [*frame.columns] if columns is None else [columns] if isinstance(columns, str) else [*columns]
    missing = [name for name in own if name not in frame.columns]
    if missing:
        raise SceneError(f"the frame has no column {missing[0]!r}; it has {', '.join(map(str, frame.columns))}")
    asked = asking.scene(
        required(model),
        names,
        purpose="map",
        axes=0,
        quantities=quantities,
        start=start,
        settings=settings,
        cells=_table(frame, own),
    )
    with no_display(), telling(progress, "cells") as tell:
        made = _native.map(asked, engine, precision, None, False, False, tell, adapter_text(adapter))
    found = dataset(made)
    results = {str(name): variable.values for name, variable in found.data_vars.items()}
    return frame.assign(**{name: pd.Series(values, index=frame.index) for name, values in results.items()})


def _table(frame: pd.DataFrame, columns: Sequence[Any]) -> str:
    """Columns as CSV; numbers are the same to the bit."""
    values = [[asking.number(value) for value in frame[name]] for name in columns]
    rows = [",".join(row) for row in zip(*values, strict=True)]
    return "\n".join([",".join(map(str, columns)), *rows]) + "\n"
