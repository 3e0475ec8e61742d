"""Bifurcation diagrams: how the attractor changes along one parameter."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from io import StringIO
from typing import Any

import xarray as xr

from . import _native, dataset, scenes
from .engine import interruptible
from .model import Model
from .progress import Report, reporter


def bifurcation(
    model: Model | None = None,
    *,
    scene: str | os.PathLike[str] | None = None,
    set: Iterable[str] = (),  # noqa: A002
    along: str | None = None,
    at: Mapping[str, float] | None = None,
    axes: scenes.Axes | None = None,
    parameters: scenes.Parameters | None = None,
    quantities: Iterable[str] | None = None,
    start: scenes.Start | None = None,
    settings: Mapping[str, Any] | None = None,
    progress: bool | Report = True,
    **names: Any,
) -> xr.Dataset:
    """Follow the attractor along one parameter, like ``rattlemap bifurcation``.

    Parameters
    ----------
    model
        The oscillator. It supplies the values of all parameters that no keyword sets.
    scene
        A scene file, instead of a model and an axis. ``set`` overrides its values, like the program's ``--set``. If the scene
        has two axes, ``along`` names the one that is swept, and ``at`` gives the value of the other one.
    axes, parameters, settings, progress
        See :func:`rattlemap.map`.
    quantities
        Measured quantities, such as ``["amplitude", "impact_speed"]``: each adds variables.
    start
        ``"rest"`` or a state. With ``"up"``, ``"down"`` or ``"both"`` each column starts from the last state of its neighbour.
    **names
        One axis, a tuple ``(min, max, count)`` or an array of increasing values; values of single parameters; settings of
        ``[integration]``. Quantities have the units of the model.

    Returns
    -------
    xarray.Dataset
        Over the parameter (and over ``direction`` with ``start="both"``): ``class``, ``period``, ``word``, ``pattern``,
        ``lyapunov``, ``lyapunov_error``, ``impacts_per_period``, ``mesh_fraction``, ``symmetric``, ``status``,
        ``periods_run``, and the requested quantities. Over ``point``, one row per crossing of a wall: ``side``, ``kind``, ``t_mod_period``, and the state
        before (``x1_before`` ...) and after (``x1`` ...); the coordinate ``point_<name>`` is the parameter's value there.
        :func:`rattlemap.open` returns the same for the program's folder.

    Raises
    ------
    SceneError, ModelError, KeyboardInterrupt
        In the cases of :func:`rattlemap.map`.

    Examples
    --------
    >>> bd = rm.bifurcation(rm.gear_pair(), e=(0, 0.999, 40), omega=5.6)
    >>> plt.plot(bd["point_e"], bd["v1"], ",")
    """
    request = scenes.scene_of(
        model,
        scene,
        scenes.all_names(names, axes, parameters),
        purpose="bifurcation",
        axes=1,
        sets=set,
        along=along,
        at=at,
        quantities=quantities,
        start=start,
        settings=settings,
    )
    with interruptible(None, resumable=False), reporter(progress, "columns") as report:
        manifest, *tables = _native.bifurcation(request, report)
    columns, points = (dataset.text_table(StringIO(table)) for table in tables)
    return dataset.diagram(columns, points, json.loads(manifest))
