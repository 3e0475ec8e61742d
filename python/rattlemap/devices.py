"""Processor and graphics adapters of this machine."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from . import _native
from .engine import no_display


@dataclass(frozen=True)
class Devices:
    """The processor, the graphics adapters, and the choice of ``engine="auto"``. :func:`devices` returns it.

    Attributes
    ----------
    processor
        Name and number of cores. The processor computes in f64.
    adapters
        Graphics adapters, the best one first, indexed by ``number``, which the keyword ``adapter`` accepts. Columns: ``name``;
        ``is_hardware``, False for a program on the processor; ``precisions``, such as ``"f32 f64"``; ``interface``; ``pci``,
        the address of the card or None; ``largest_binding`` in bytes; ``most_lanes``, the largest number of lanes under way.
    engine, precision
        Choice of ``auto``: ``"cpu"`` or ``"gpu"``, and ``"f32"`` or ``"f64"``.
    reason
        Reason for the choice.
    """

    processor: str
    adapters: pd.DataFrame
    engine: str
    precision: str
    reason: str


def devices() -> Devices:
    """List the processor, the graphics adapters, and the choice of ``engine="auto"``, like ``rattlemap devices``.

    Returns
    -------
    Devices

    Raises
    ------
    EngineError
        If ``auto`` cannot choose, for instance because the environment names a missing adapter.

    Examples
    --------
    >>> rm.devices().precision in ("f32", "f64")
    True
    """
    with no_display():
        found = _native.devices()
    columns = ["number", "name", "is_hardware", "precisions", "interface", "pci", "largest_binding", "most_lanes"]
    adapters = pd.DataFrame(found["adapters"], columns=columns).set_index("number")
    return Devices(found["processor"], adapters, found["engine"], found["precision"], found["reason"])
