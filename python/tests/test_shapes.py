"""Every function of the package works for models of each shape."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
import rattlemap as rm

#: One coordinate, one gap; two coordinates, mesh; dry friction; stages, no force; eight coordinates; several gaps.
SHAPES = ("impact-oscillator", "gear-pair", "friction-oscillator", "meissner", "absorber-chain", "two-loose-gears", "several.toml")
#: Two gaps, friction and a signal; a parameter, a coordinate and a gap have names like those of columns.
SEVERAL = """
name = "several"
parameters = { omega = 1.0, gap = 0.2 }
motion.coordinates = ["x", "side_2"]
motion.mass = [[1, 0], [0, 1]]
motion.damping = [[0.1, 0], [0, 0.1]]
motion.stiffness = [[2, -1], [-1, 2]]
motion.force = [1, 0]
motion.frequency = "omega"
motion.gap = { a = [1, 0], domains = [0, 1] }
friction = [{ row = [0, 1], force = 0.1 }]
signal = [{ name = "sum_of_rates", velocity = [1, 1], acceleration = [0, 1], cos = 1 }]
[[contact]]
gap = "a"
side = "right"
at = "gap"
law = "elastic"
stiffness = 9
[[contact]]
gap = "domains"
side = "right"
at = "gap"
law = "elastic"
stiffness = 9
"""
SETTINGS = {"integration.transient_periods": 20, "integration.observed_periods": 16}
#: Functions without a model, and types.
OTHERS = {"about", "devices", "models", "gear_pair"} | {name for name in rm.__all__ if name[0].isupper()}


def calls(name: str) -> dict[str, Callable[[], object]]:
    """Returns a short call of each function that uses a model."""
    model = rm.load_model(name)
    first, second = (
        {key: (0.9 * model.parameters[key], 1.1 * model.parameters[key], 2)} for key in [*model.parameters][:2]
    )
    short: dict[str, Any] = {"engine": "cpu", "settings": SETTINGS, "progress": False}
    ends = {component: (-0.01, 0.01, 2) for component in model.state_names[:2]}
    return {
        "load_model": lambda: rm.load_model(name).help,
        "map": lambda: rm.map(model, axes={**first, **second}, out="map", **short)["class"].values,
        "basins": lambda: rm.basins(model, axes=ends, **short)["attractor_strobe"].values,
        "cells": lambda: rm.cells(model, {key: ends[:2] for key, ends in first.items()}, **short),
        "bifurcation": lambda: rm.bifurcation(model, axes=first, start="both", settings=SETTINGS, progress=False),
        "orbit": lambda: motion(rm.orbit(model, transient=20, start=[0.01] * len(model.state_names))),
        "explore": lambda: rm.explore(model, axes={**first, **second}, progress=False),
        "open": lambda: rm.open("map")["period"].values,
        "plot": lambda: rm.plot(rm.open("map")),
        "compare": lambda: rm.compare("map", "map").table,
        "validate": lambda: rm.validate("map", samples=2, progress=False).mismatches,
        "curves": lambda: rm.curves("map", progress=False).points,
        "check": lambda: rm.check("map"),
    }


def motion(orbit: rm.Orbit) -> None:
    """Reads everything that an orbit has."""
    for name in dir(rm.Orbit):
        value = getattr(orbit, name)
        if callable(value) and name in ("trajectory", "to_dict"):
            value()
    if orbit.class_ == "periodic" and orbit.model.name != "two-loose-gears":
        by = next(iter(orbit.parameters))
        assert np.isfinite(orbit.derivative("strobe", by)).all()
    assert len(pickle.loads(pickle.dumps(orbit)).events) == len(orbit.events) and repr(orbit)
    table = orbit.history(2, points=50)
    texts = {name for name in table if str(name).split("_")[0] in ("domain", "event", "moment", "element") or name == "gap" and "gap_rate" not in table}
    assert {*table.select_dtypes("number")} == {*table} - texts, table.dtypes


@pytest.mark.parametrize("name", SHAPES)
def test_every_function_works(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "several.toml").write_text(SEVERAL)
    every = calls(name)
    assert {*every} | OTHERS == {*rm.__all__}
    for call in every.values():
        call()
    plt.close("all")
