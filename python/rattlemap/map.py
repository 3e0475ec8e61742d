"""Maps: the motion of every cell over two parameters."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any

import xarray as xr

from . import _native, scenes
from .engine import Adapter, Engine, Precision, adapter_text, interruptible, map_dataset, no_display, warn
from .errors import SceneError
from .model import Model
from .progress import Report, reporter


def map(  # noqa: A001
    model: Model | None = None,
    *,
    scene: str | os.PathLike[str] | None = None,
    set: Iterable[str] = (),  # noqa: A002
    axes: scenes.Axes | None = None,
    parameters: scenes.Parameters | None = None,
    engine: Engine = "auto",
    precision: Precision | None = None,
    adapter: Adapter | None = None,
    quantities: Iterable[str] | None = None,
    start: scenes.Start | None = None,
    settings: Mapping[str, Any] | None = None,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    resume: bool = False,
    client: Any = None,
    shards: int | None = None,
    progress: bool | Report = True,
    **names: Any,
) -> xr.Dataset:
    """Compute the motion of every cell over two parameters, like ``rattlemap map``.

    Parameters
    ----------
    model
        The oscillator. It supplies the values of all parameters that no keyword sets.
    scene
        A scene file, instead of a model and axes. ``set`` overrides its values, like the program's ``--set``.
    axes, parameters
        Axes and single values by name, for parameters whose names are keywords of this function, such as ``force`` or
        ``out``: ``axes={"force": (0, 1, 64)}``, ``parameters={"out": 2.0}``. Axes of ``axes`` precede those of keywords.
    engine
        ``"auto"``: a hardware GPU if the map has enough cells, else the processor; ``"cpu"``; ``"gpu"``.
    precision
        ``"f32"`` or ``"f64"``. By default f32 on a GPU and f64 on the processor.
    adapter
        A graphics adapter: its number in :func:`rattlemap.devices`, or a part of its name that no other adapter has.
    quantities
        Some of ``class lyapunov impacts mesh symmetric word pattern impact_speed impact_speed_max impact_energy impact_rate
        contact_force_max contact_force_rms amplitude rms harmonic dissipated multiplier
        stick_fraction friction_energy release_energy cycle_time state``; by default class and lyapunov.
        Others are not computed. ``docs/scenes.md`` explains them.
    start
        The start of cells at phase 0: ``"rest"``, ``"up"``, ``"down"``, a state ``[x1, v1, x2, v2]``, or some of its
        components by name. ``settings={"start.phase": 1.57}`` starts at another phase of the force.
    settings
        Any other setting of a scene by its path: ``{"start.count": 5, "refine.max_error": 0.01}``. ``docs/scenes.md`` lists
        them.
    out
        A folder that also receives the files of the program. It must be empty, unless ``force`` or ``resume`` is given.
        ``resume`` continues an interrupted map.
    client
        A ``distributed.Client``. The workers of its Dask cluster compute shards of the map, and this process merges them; the
        result is the same to the bit. The engine must be named. If a worker is lost, others compute its shards again. Progress
        counts shards.
    shards
        Number of shards that a cluster computes; by default 4 for each of its threads.
    progress
        True shows a bar of tqdm if it is installed; a function receives (done, total).
    **names
        Two axes in order. Each is a tuple ``(min, max, count)`` with both ends included, or an array of increasing values.
        Arrays are used exactly; those of ``np.linspace`` differ from tuples in the last digits. Also values of single
        parameters, components of the start, and settings of ``[integration]`` such as ``max_period=32``. An axis of a component
        of the start (``v1=(-2, 2, 64)``) makes a map of basins. Quantities have the units of the model.

    Returns
    -------
    xarray.Dataset
        Dimensions (second axis, first axis). The variables are those of :func:`rattlemap.open`. ``attrs`` contains the
        manifest: engine, precision, device, sources, scene.

    Raises
    ------
    SceneError
        If the request is wrong, or the map is too large for this machine.
    ModelError
        If the model has no motion in a cell.
    EngineError
        If the engine does not exist on this machine or fails.
    FolderError
        If ``out`` cannot be used.
    KeyboardInterrupt
        Within a second of Ctrl-C. ``out`` keeps the finished cells, and the message says how to continue.

    Examples
    --------
    >>> ds = rm.map(rm.gear_pair(F=50), e=(0, 1, 16), omega=np.linspace(1, 12, 16))
    >>> ds["lyapunov"].sel(e=0.6, method="nearest").plot()
    >>> ds = rm.map(scene="scenes/e_omega.toml", set=["axis.0.count=16", "axis.1.count=16"])
    """
    request = scenes.scene_of(
        model,
        scene,
        scenes.all_names(names, axes, parameters),
        purpose="map",
        axes=2,
        sets=set,
        quantities=quantities,
        start=start,
        settings=settings,
    )
    folder = None if out is None else os.fspath(out)
    if client is not None:
        if resume:
            raise SceneError("resume: a map on a cluster cannot be resumed; use force=True to compute it again")
        from .cluster import compute_shards

        with interruptible(None, resumable=False), reporter(progress, "shards") as report:
            choice = (engine, precision, adapter_text(adapter))
            result = compute_shards(request, client, choice=choice, shards=shards, out=folder, force=force, report=report)
    elif shards is not None:
        raise SceneError(f"shards = {shards}: only a cluster computes shards; give its client, too")
    else:
        with interruptible(folder), no_display(), reporter(progress, "cells") as report:
            result = _native.map(request, engine, precision, folder, force, resume, report, adapter_text(adapter))
    warn(result["warnings"])
    return map_dataset(result)
