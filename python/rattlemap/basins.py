"""Basins of attraction: to which attractor each start leads."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any

import xarray as xr

from . import asking
from .engine import Adapter, Engine, Precision
from .errors import SceneError
from .map import map as make_map
from .model import Model, required
from .progress import Tell


def basins(
    model: Model,
    *,
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
    """Say to which attractor each start leads: a map of which an axis, or both, sweeps the start.

    Parameters
    ----------
    model
        What moves.
    **names
        Two axes as :func:`rattlemap.map` takes them, at least one of them of a component of the start at phase 0
        (``model.state_names``); values of single parameters and of other components, which are 0 unless told.
    engine, precision, adapter, quantities, start, settings, out, force, resume, client, shards, progress
        As :func:`rattlemap.map` takes them.

    Returns
    -------
    xarray.Dataset
        As :func:`rattlemap.map` gives it, with ``attractor``, the label of the attractor of each start (-1 without one).
        Over the dimension ``label``: ``attractor_class``, ``attractor_period``, ``attractor_word``,
        ``attractor_exponent``, ``attractor_cells``, ``attractor_share`` and so on, the largest basin first;
        ``attractor_strobe`` over (label, component) is a state of the cycle at phase 0.

    Raises
    ------
    SceneError
        If no axis sweeps the start, and as :func:`rattlemap.map`.

    Examples
    --------
    >>> bs = rm.basins(rm.load_model("impact-oscillator"), x=(-1, 1, 32), v=(-1, 1, 32), omega=2.8)
    >>> bs["attractor"].plot(); bs["attractor_share"].values
    """
    swept = [name for name, value in names.items() if asking.is_axis(value)]
    components = required(model).state_names
    if swept and not any(name in components for name in swept):
        raise SceneError(
            f"the axes {', '.join(swept)} are no components of the start, {', '.join(components)}: basins sweep at least one"
        )
    return make_map(
        model,
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
