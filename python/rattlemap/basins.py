"""Basins of attraction: the attractor that each start leads to."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any

import xarray as xr

from . import scenes
from .engine import Adapter, Engine, Precision
from .errors import SceneError
from .map import map as compute_map
from .model import Model, require_model
from .progress import Report


def basins(
    model: Model,
    *,
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
    """Compute the attractor that each start leads to: a map with at least one axis that sweeps the start.

    Parameters
    ----------
    model
        The oscillator.
    axes, parameters, engine, precision, adapter, quantities, start, settings, out, force, resume, client, shards, progress
        See :func:`rattlemap.map`.
    **names
        Two axes in the form of :func:`rattlemap.map`, at least one of a component of the start at phase 0
        (``model.state_names``). Also values of single parameters and of other components, which are 0 by default.

    Returns
    -------
    xarray.Dataset
        The map with ``attractor``, the label of each start's attractor (-1 without one). Over the dimension ``label``:
        ``attractor_class``, ``attractor_period``, ``attractor_word``, ``attractor_exponent``, ``attractor_cells``,
        ``attractor_share`` and so on, the largest basin first. ``attractor_strobe`` over (label, component) is a state of
        the cycle at phase 0.

    Raises
    ------
    SceneError
        If no axis sweeps the start, and in the cases of :func:`rattlemap.map`.

    Examples
    --------
    >>> bs = rm.basins(rm.load_model("impact-oscillator"), x=(-1, 1, 16), v=(-1, 1, 16), omega=2.8)
    >>> bs["attractor"].plot(); bs["attractor_share"].values
    """
    swept = [name for name, value in scenes.all_names(names, axes, parameters).items() if scenes.is_axis(value)]
    components = require_model(model).state_names
    if swept and not any(name in components for name in swept):
        raise SceneError(
            f"none of the axes {', '.join(swept)} is a component of the start ({', '.join(components)}); at least one must be"
        )
    return compute_map(
        model,
        axes=axes,
        parameters=parameters,
        engine=engine,
        precision=precision,
        adapter=adapter,
        quantities=quantities,
        start=start,
        settings=settings,
        out=out,
        force=force,
        resume=resume,
        client=client,
        shards=shards,
        progress=progress,
        **names,
    )
