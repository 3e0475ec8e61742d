"""Validation of a finished map: a sample of its cells is computed again with another engine."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from . import _native
from .engine import no_display, warn
from .errors import SceneError
from .progress import Report, reporter


@dataclass(frozen=True)
class Validation:
    """Result of a validation. :func:`validate` returns it.

    Attributes
    ----------
    judge
        Computation that judges the cells of the map: ``reference``, ``lanes_f64`` or ``dop853``.
    samples
        Number of cells that were computed again.
    strata
        Rates of each stratum: columns ``runs``, ``sampled``, and for all differing cells (``differing``) and each kind of
        mismatch (``unexplained``, ``border``, ...) the count and the ends of its 95 % interval, such as ``differing``,
        ``differing_low``, ``differing_high``. The index is ``stratum``.
    mismatches
        One row per differing field of a cell of the sample: ``id``, ``i``, ``j``, the swept values, ``kind``, ``field``, its
        value ``map`` in the map and ``judge`` in the second computation, and ``replay``, the command that repeats the cell.
    faults
        Reasons why the map is not valid; empty if it is.
    failure
        Message with which the program would fail: the faults, or damaged files of the folder. None otherwise.
    data
        The content of ``validation.json``.
    """

    judge: str
    samples: int
    strata: pd.DataFrame
    mismatches: pd.DataFrame = field(repr=False)
    faults: list[str]
    failure: str | None
    data: dict[str, Any] = field(repr=False)

    @property
    def verdict(self) -> str:
        """Conclusion of the validation: whether the map stands, and the rate of wrong cells."""
        return str(self.data["verdict"])


def validate(
    folder: str | os.PathLike[str],
    samples: int = 400,
    seed: int = 1,
    chaos_periods: int = 6000,
    *,
    progress: bool | Report = True,
) -> Validation:
    """Compute a sample of a finished map's cells again and compare, like ``rattlemap validate``.

    Writes ``validation.json`` and its section of ``report.html`` to the folder.

    Parameters
    ----------
    folder
        Folder of a finished map.
    samples
        Number of cells in the sample; all cells if the map has fewer.
    seed
        Seed of the sample. The same seed draws the same cells.
    chaos_periods
        Further periods for which chaotic cells are followed, one cell per five cells of the sample; 0 follows none. The result is
        ``data["chaos_ends"]``.
    progress
        True shows a bar of tqdm if it is installed; a function receives (done, total).

    Returns
    -------
    Validation

    Raises
    ------
    SceneError
        If ``samples``, ``seed`` or ``chaos_periods`` is out of range.
    FolderError
        If the folder is not that of a finished map, or its records are damaged.
    KeyboardInterrupt
        Within a second of Ctrl-C. Nothing is written then.

    Examples
    --------
    >>> _ = rm.map(rm.gear_pair(), e=(0, 1, 4), omega=(1, 12, 4), engine="cpu", out="validated", force=True)
    >>> rm.validate("validated", samples=4).faults
    []
    """
    for name, value, least, most in (
        ("samples", samples, 1, 2**32),
        ("seed", seed, 0, 2**64),
        ("chaos_periods", chaos_periods, 0, 10**9 + 1),
    ):
        if not least <= value < most:
            raise SceneError(f"{name} = {value}: it must be a whole number from {least} to {most - 1}")
    with no_display(), reporter(progress, "cells") as report:
        failure, warnings = _native.validate(os.fspath(folder), samples, seed, chaos_periods, report)
    warn(warnings)
    data = json.loads((Path(folder) / "validation.json").read_text(encoding="utf-8"))
    strata = pd.DataFrame([_stratum(stratum) for stratum in data["strata"]]).set_index("stratum")
    rows = [
        {
            **{name: cell[name] for name in ("id", "i", "j")},
            **cell["values"],
            "kind": cell["kind"],
            **difference,
            "replay": cell["replay"],
        }
        for cell in data["mismatches"]
        for difference in cell["differences"]
    ]
    columns = None if rows else ["id", "i", "j", "kind", "field", "map", "judge", "replay"]
    mismatches = pd.DataFrame(rows, columns=columns)
    return Validation(data["judge"], data["samples"], strata, mismatches, data["faults"], failure, data)


def _stratum(stratum: dict[str, Any]) -> dict[str, Any]:
    row = {"stratum": stratum["name"], "runs": stratum["runs"], "sampled": stratum["sampled"]}
    for name, rate in {"differing": stratum["differing"], **stratum["kinds"]}.items():
        row[name] = rate["count"]
        row[f"{name}_low"], row[f"{name}_high"] = rate["interval"]
    return row
