"""Maps: what every cell's motion is, over two parameters."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any

import xarray as xr

from . import _native, asking
from .engine import Adapter, Engine, Precision, adapter_text, dataset, no_display
from .errors import SceneError
from .model import Model, required
from .progress import Tell, telling


def map(  # noqa: A001
    model: Model | None = None,
    *,
    scene: str | os.PathLike[str] | None = None,
    set: Iterable[str] = (),  # noqa: A002
    engine: Engine = "auto",
    precision: Precision | None = None,
    adapter: Adapter | None = None,
    quantities: Iterable[str] | None = None,
    start: asking.Start | None = None,
    settings: Mapping[str, Any] | None = None,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    resume: bool = False,
    client: Any = None,
    shards: int | None = None,
    progress: bool | Tell = True,
    **names: Any,
) -> xr.Dataset:
    """Say what every cell's motion is, over two parameters: ``rattlemap map``.

    Parameters
    ----------
    model
        What moves; its values are those of all parameters that no keyword names.
    scene
        A scene file in the place of a model and axes, with changes ``set`` as the program's ``--set`` takes them.
    engine
        ``"auto"``: a hardware GPU if there is one, else the processor; ``"cpu"``; ``"gpu"``.
    precision
        ``"f32"`` or ``"f64"``; f32 on a GPU and f64 on the processor unless told.
    adapter
        A graphics adapter by its number in ``rattlemap devices`` or a part of its name that no other has; ``"all"`` for
        all of the best one's kind, which share the cells. The records are those of one to the bit.
    quantities
        Some of ``class lyapunov impacts mesh symmetric word pattern``; class and lyapunov unless told. What is not asked
        for is not computed.
    start
        Where cells start at phase 0: ``"rest"``, ``"up"``, ``"down"``, a state ``[x1, v1, x2, v2]``, or some of its
        components by name.
    settings
        Any other setting of a scene by its path: ``{"start.count": 5, "refine.max_error": 0.01}``; ``docs/scenes.md``
        has them all.
    out
        A folder to write to, too, as the program does; it must be empty unless ``force`` or ``resume`` is given. An
        interrupted map goes on with ``resume``.
    client
        A ``distributed.Client``: the map is computed as ``shards`` on the workers of its Dask cluster and merged here, the
        same to the bit. The engine must be named. A shard that is lost with its worker is computed by another one;
        nothing else is computed twice. Progress is told in shards, a bar shows them.
    shards
        How many parts a cluster computes; 4 for each of its threads unless told.
    progress
        A bar of tqdm where that is installed, or a function of (done, total).
    **names
        Two axes, the first keyword is the first axis: a tuple ``(min, max, count)``, both ends included, or an array of
        increasing values, which are taken exactly (those of ``np.linspace`` differ from a tuple's in last digits). Then values of single parameters, components of the start, and
        settings of ``[integration]`` such as ``max_period=32``. An axis of a component of the start (``v1=(-2, 2, 64)``)
        makes a map of basins. All quantities are dimensionless.

    Returns
    -------
    xarray.Dataset
        Dimensions (second axis, first axis); the same variables as :func:`rattlemap.open` gives for a folder, the
        manifest's facts in ``attrs`` (engine, precision, device, sources, scene).

    Raises
    ------
    SceneError
        For anything wrong in what is asked, with the program's words; for a map that does not fit the machine.
    ModelError
        If the model has no motion in a cell.
    EngineError
        If the engine is not there or fails on the way.
    FolderError
        If ``out`` cannot be used.
    KeyboardInterrupt
        Within a second of Ctrl-C; cells that have ended are kept in ``out``.

    Examples
    --------
    >>> ds = rm.map(rm.gear_pair(F=50), e=(0, 1, 32), omega=np.linspace(1, 12, 32))
    >>> ds["lyapunov"].sel(e=0.6, method="nearest").plot()
    >>> ds = rm.map(scene="scenes/e_omega.toml", set=["axis.0.count=32", "axis.1.count=32"])
    """
    asked = _asked(model, scene, set, quantities, start, settings, names)
    where = None if out is None else os.fspath(out)
    if client is not None:
        if resume:
            raise SceneError("resume goes with a map that is computed here; on a cluster, begin anew with force=True")
        from .cluster import merged

        with telling(progress, "shards") as tell:
            how = (engine, precision, adapter_text(adapter))
            made = merged(asked, client, how=how, shards=shards, out=where, force=force, tell=tell)
        return dataset(made)
    if shards is not None:
        raise SceneError("shards are for a cluster: give its client, too")
    with no_display(), telling(progress, "cells") as tell:
        made = _native.map(asked, engine, precision, where, force, resume, tell, adapter_text(adapter))
    return dataset(made)


def _asked(
    model: Model | None,
    scene: str | os.PathLike[str] | None,
    sets: Iterable[str],
    quantities: Iterable[str] | None,
    start: asking.Start | None,
    settings: Mapping[str, Any] | None,
    names: Mapping[str, Any],
) -> _native.Scene:
    if scene is not None:
        if model is not None:
            raise SceneError("a scene says which model it is about; give a model or a scene, not both")
        return asking.scene_file(
            scene, names, purpose="map", sets=sets, quantities=quantities, start=start, settings=settings
        )
    if model is None:
        raise SceneError("give a model, such as rm.gear_pair(), or the path of a scene")
    if [*sets]:
        raise SceneError("`set` changes a scene file; say settings={...} or keywords beside a model")
    return asking.scene(
        required(model), names, purpose="map", axes=2, quantities=quantities, start=start, settings=settings
    )
