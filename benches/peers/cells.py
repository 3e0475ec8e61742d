"""Cells that `rattlemap-bench work-precision` exports, and errors of results."""

import json
import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Cell:
    """One lane: parameters of Table 1, the start at phase 0, and the reference's result."""

    parameters: dict
    periods: int
    start: tuple
    state: tuple
    events: tuple

    @property
    def period(self):
        return 2 * math.pi / self.parameters["omega"]


def read(path):
    with open(path, encoding="utf-8") as file:
        rows = json.load(file)
    return [
        Cell(row["parameters"], row["periods"], tuple(row["start"]), tuple(row["state"]), tuple(row["events"]))
        for row in rows
    ]


def to_gap(state):
    """Converts (x1, v1, x2, v2) to (z, w, x2, v2)."""
    x1, v1, x2, v2 = state
    return [x1 - x2, v1 - v2, x2, v2]


def from_gap(q):
    z, w, x2, v2 = q
    return [z + x2, w + v2, x2, v2]


def state_error(cell, q):
    """Returns the largest difference of a component of the state; infinite if one is not finite."""
    error = max(abs(a - b) for a, b in zip(from_gap(q), cell.state))
    return error if math.isfinite(error) else math.inf


def event_error(cell, latest):
    """Returns the largest difference of the times of the last events, the latest first; None without events.

    An event at phase 0 may belong to either period.
    """
    if not cell.events:
        return None
    if len(latest) < len(cell.events):
        return math.inf
    differences = [abs(a - b) % cell.period for a, b in zip(latest, cell.events)]
    error = max(min(d, cell.period - d) for d in differences)
    return error if math.isfinite(error) else math.inf
