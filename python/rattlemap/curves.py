"""Bifurcation curves of a finished map: the borders between its regions, as lines."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from io import StringIO

import numpy as np
import pandas as pd

from . import _native
from .engine import warn
from .errors import SceneError
from .progress import Report, reporter


@dataclass(frozen=True)
class Curves:
    """Bifurcation curves. :func:`curves` returns them.

    Attributes
    ----------
    points
        One row per cycle on a curve: ``curve``, ``kind``, ``point``, the values of both axes, ``word``, ``period``, ``stable``, the
        multipliers, ``arclength`` and the state at phase 0.
    meetings
        One row per point at which two conditions are met: that of the curve, whose kind is ``kind``, and the one whose kind is
        ``with``. ``with`` is ``border`` if none of the kinds fits, and ``value`` at a value of the argument ``through``.
    unexplained
        One row per pair of neighbouring cells with different cycles and no curve between them, with the reason. Borders of basins
        are left out.
    explained, basins
        Number of pairs of cells with different cycles that have a curve between them, and of those whose cycles both continue
        to the other cell: borders of basins. None if only some curves were searched; ``unexplained`` is then empty.
    """

    points: pd.DataFrame
    meetings: pd.DataFrame = field(repr=False)
    unexplained: pd.DataFrame = field(repr=False)
    explained: int | None
    basins: int | None


def curves(
    folder: str | os.PathLike[str],
    kinds: str | Iterable[str] = (),
    longest: int = 4,
    word: str | None = None,
    at: Mapping[str, float] | None = None,
    condition: tuple[str, float] | None = None,
    through: Mapping[str, float | Iterable[float]] | None = None,
    unstable: bool = False,
    most_curves: int = 2000,
    most_points: int = 1000,
    *,
    progress: bool | Report = True,
) -> Curves:
    """Follow the borders between the regions of a finished map, like ``rattlemap curves``. Writes no files.

    Parameters
    ----------
    folder
        Folder of a finished map over two parameters.
    kinds
        Kinds of curves, such as ``["fold", "flip"]``, or one name; all if empty.
    longest
        Longest cycles that are followed, in forcing periods, at most 64.
    word
        Word of the cycles that are followed; all if None.
    at
        Values of both axes, such as ``{"e": 0.55, "omega": 5.6}``: begins at the cycle there instead of at all cells.
    condition
        A quantity of the map and a value, such as ``("impact_speed_max", 2.0)``: curves on which the quantity has this value are
        followed, too. Their kind is ``condition``.
    through
        Values of axes, such as ``{"omega": [5.5, 6.0]}``, at which points of curves are located. They are rows of ``meetings``
        with the kind ``value``.
    unstable
        Whether each cycle is also followed after it becomes unstable, up to the end of the axis. Curves that the unstable cycle
        meets are followed, too.
    most_curves, most_points
        Largest number of curves, and of points of each part of a curve.
    progress
        True shows a bar of tqdm if it is installed; a function receives (done, total) in pairs of cells.

    Returns
    -------
    Curves

    Raises
    ------
    SceneError
        If an argument is out of range, or the map has no classes or not two parameters as axes.
    FolderError
        If the folder is not that of a finished map, or its records are damaged.
    KeyboardInterrupt
        Within a second of Ctrl-C.

    Examples
    --------
    >>> _ = rm.map(rm.gear_pair(), e=(0.5, 0.6, 4), omega=(5, 6, 4), engine="cpu", out="some", force=True)
    >>> found = rm.curves("some")
    >>> for _, curve in found.points.groupby("curve"): plt.plot(curve["e"], curve["omega"])
    """
    for name, value, least, most in (
        ("longest", longest, 1, 64),
        ("most_curves", most_curves, 1, 2**32 - 1),
        ("most_points", most_points, 2, 2**32 - 1),
    ):
        if not least <= value <= most:
            raise SceneError(f"{name} = {value}: it must be a whole number from {least} to {most}")
    with reporter(progress, "pairs of cells") as report:
        names = [kinds] if isinstance(kinds, str) else list(kinds)
        if "condition" in names and condition is None:
            raise SceneError("kinds: the kind condition needs the argument condition, such as ('impact_speed_max', 2.0)")
        if condition is not None and names and "condition" not in names:
            raise SceneError("condition: add 'condition' to kinds, or leave kinds empty")
        if at is not None and not at:
            raise SceneError("at: both axes need a value")
        value = None if condition is None else "=".join(map(str, condition))
        texts = [_values(at), value, _values(through)]
        tables, pairs, warnings = _native.curves(
            os.fspath(folder), names, word, texts, unstable, longest, most_curves, most_points, report
        )
    warn(warnings)
    frames = [pd.read_csv(StringIO(table), float_precision="round_trip") for table in tables]
    explained, basins = pairs or (None, None)
    return Curves(*frames, explained=explained, basins=basins)


def _values(values: Mapping[str, float | Iterable[float]] | None) -> str | None:
    """Write values of axes as the program reads them; None if there are none."""
    if not values:
        return None
    return ",".join(f"{name}={value!r}" for name, list_ in values.items() for value in np.ravel(list_).astype(float).tolist())
