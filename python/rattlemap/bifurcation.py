"""Bifurcation diagrams: how the attractor changes along one parameter."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from typing import Any

import xarray as xr

from . import _native, asking, decode
from .engine import table
from .errors import SceneError
from .model import Model, required
from .progress import Tell, telling


def bifurcation(
    model: Model | None = None,
    *,
    scene: str | os.PathLike[str] | None = None,
    set: Iterable[str] = (),  # noqa: A002
    along: str | None = None,
    at: Mapping[str, float] | None = None,
    start: asking.Start | None = None,
    settings: Mapping[str, Any] | None = None,
    progress: bool | Tell = True,
    **names: Any,
) -> xr.Dataset:
    """Follow the attractor along one parameter: ``rattlemap bifurcation``.

    Parameters
    ----------
    model
        What moves; its values are those of all parameters that no keyword names.
    scene
        A scene file in the place of a model and an axis, with changes ``set`` as the program's ``--set`` takes them. Of
        a scene of two axes ``along`` names the one to run along, and ``at`` says where the other one stays.
    start
        ``"rest"``, a state, or ``"up"``, ``"down"``, ``"both"``: the attractor is followed from one value to the next.
    settings
        Any other setting of a scene by its path, such as ``{"integration.max_period": 32}``.
    progress
        A bar of tqdm where that is installed, or a function of (done, total).
    **names
        One axis, a tuple ``(min, max, count)`` or an array of increasing values; values of single parameters; settings of
        ``[integration]``. All quantities are dimensionless.

    Returns
    -------
    xarray.Dataset
        Over the parameter (over ``direction``, too, with ``start="both"``): ``class``, ``period``, ``word``,
        ``pattern``, ``lyapunov``, ``lyapunov_error``, ``impacts_per_period``, ``mesh_fraction``, ``symmetric``,
        ``status``, ``periods_run``. Over ``point``, a row per crossing of a wall: ``side``, ``kind``,
        ``t_mod_period``, the state before (``x1_before`` ...) and after (``x1`` ...); the coordinate ``point_<name>``
        is the parameter's value there. The same as :func:`rattlemap.open` gives for the program's folder.

    Raises
    ------
    SceneError, ModelError, KeyboardInterrupt
        As :func:`rattlemap.map`.

    Examples
    --------
    >>> bd = rm.bifurcation(rm.gear_pair(), e=(0, 0.999, 200), omega=5.6)
    >>> plt.plot(bd["point_e"], bd["v1"], ",")
    """
    if scene is not None:
        if model is not None:
            raise SceneError("a scene says which model it is about; give a model or a scene, not both")
        line = None if along is None else (along, asking.assignments(at or {}))
        asked = asking.scene_file(
            scene, names, purpose="bifurcation", sets=set, start=start, settings=settings, along=line
        )
    elif model is None:
        raise SceneError("give a model, such as rm.gear_pair(), or the path of a scene")
    elif along is not None or at is not None or [*set]:
        raise SceneError("`set`, `along` and `at` are for a scene file; beside a model say settings={...} or keywords")
    else:
        asked = asking.scene(required(model), names, purpose="bifurcation", axes=1, start=start, settings=settings)
    with telling(progress, "columns") as tell:
        made = _native.bifurcation(asked, tell)
    manifest, points = json.loads(made["manifest"]), made["points"]
    for name, names_of in (("kind", made["kinds"]), ("direction", made["directions"])):
        if name in points:
            points[name] = decode.named(names_of, points[name])
    return decode.diagram(manifest["axis"]["parameter"], table(made["columns"]), points, manifest)
