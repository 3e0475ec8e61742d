"""Scenes from keywords: writes the text that the program would read from a file.

The library reads the text and checks it, so that error messages are the program's. Only keywords that no text can express are
checked here.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native, toml
from .errors import SceneError
from .model import Model, require_model

#: Keywords of the scene's table ``[integration]``. A model's parameter of the same name takes precedence.
INTEGRATION = (
    "steps_per_period",
    "transient_periods",
    "observed_periods",
    "early_stop",
    "undecided_periods",
    "confirm_chaos",
    "max_period",
)

#: The name of a policy, or a state: all components, or some by name (the others are 0).
Start = str | Sequence[float] | Mapping[str, float]
#: Tuples (min, max, count) or arrays of values, by name.
Axes = Mapping[str, Any]
#: Values by name.
Parameters = Mapping[str, Any]

_COUNTS = ("no axes", "one axis", "two axes")


def is_axis(value: Any) -> bool:
    """Whether the value of a keyword is an axis: a tuple (min, max, count), or several values."""
    return not isinstance(value, (str, bytes, Mapping)) and np.ndim(value) > 0


def all_names(names: Mapping[str, Any], axes: Axes | None, parameters: Parameters | None) -> dict[str, Any]:
    """Return axes, keywords and parameters in one dictionary, in this order. Raises SceneError if a name is given twice."""
    for name, value in (axes or {}).items():
        if not is_axis(value):
            raise SceneError(f"axes: `{name} = {value!r}` must be a tuple (min, max, count) or an array of values")
    for name, value in (parameters or {}).items():
        if is_axis(value):
            raise SceneError(f"parameters: `{name} = {value!r}` must be one number; use axes={{...}} to sweep it")
    merged: dict[str, Any] = {}
    for part in (axes or {}, names, parameters or {}):
        for name, value in part.items():
            if name in merged:
                raise SceneError(f"`{name}` is given twice; leave one of the two out")
            merged[name] = value
    return merged


def scene_of(
    model: Model | None,
    path: str | os.PathLike[str] | None,
    names: Mapping[str, Any],
    *,
    purpose: str,
    axes: int,
    sets: Iterable[str] = (),
    along: str | None = None,
    at: Mapping[str, float] | None = None,
    quantities: Iterable[str] | None = None,
    start: Start | None = None,
    settings: Mapping[str, Any] | None = None,
    cells: str | None = None,
) -> _native.Scene:
    """Return the scene of a model and keywords, or of a scene file. With a model, the keywords must contain ``axes`` axes."""
    if path is None:
        if model is None:
            raise SceneError("no model and no scene is given; give a model, such as rm.gear_pair(), or scene=PATH")
        if [*sets] or along is not None or at is not None:
            raise SceneError("`set`, `along` and `at` apply to a scene file; with a model use settings={...} or keywords")
        return _of_keywords(require_model(model), names, purpose, axes, quantities, start, settings or {}, cells)
    if model is not None:
        raise SceneError("a model and a scene are given, and the scene names its own model; leave one of the two out")
    line = None if along is None else (along, toml.assignments(at or {}))
    return _native.Scene.load(os.fspath(path), _sets(sets, names, quantities, start, settings), purpose, line)


def _of_keywords(
    model: Model,
    names: Mapping[str, Any],
    purpose: str,
    axes: int,
    quantities: Iterable[str] | None,
    start: Start | None,
    settings: Mapping[str, Any],
    cells: str | None,
) -> _native.Scene:
    native = model._model
    parameters, components = model.parameters, model.state_names
    fixed: toml.Table = dict(native.changed)
    phase = fixed.pop("start.phase", None)
    swept: list[toml.Table] = []
    integration: toml.Table = {}
    states: dict[str, float] = {}
    for name, value in names.items():
        is_state = name in components and name not in parameters
        if is_axis(value):
            swept.append({"start" if is_state else "parameter": name, **_axis(name, value)})
            fixed.pop(name, None)
        elif is_state:
            states[name] = value
        elif name in INTEGRATION and name not in parameters:
            integration[name] = value
        else:
            fixed[name] = toml.number_or_text(value)
    if len(swept) != axes:
        given = ", ".join(str(axis.get("parameter", axis.get("start"))) for axis in swept) or "none"
        raise SceneError(
            f"{_COUNTS[axes]} must be given, and these are: {given}; an axis is a keyword with a tuple (min, max, count) or an "
            "array"
        )
    for name in [] if cells is None else cells.partition("\n")[0].split(","):
        fixed.pop(name, None)
    document: toml.Table = {"model": model.name if native.is_built_in else f"{model.name}.toml", "parameters": fixed}
    if swept:
        document["axis"] = swept
    if cells is not None:
        document["cells"] = {"file": "cells.csv"}
    document["integration"] = integration
    document["start"] = _start_table(model, start, states)
    if phase is not None:
        document["start"]["phase"] = phase
    document["outputs"] = {} if quantities is None else {"quantities": _list_of(quantities)}
    for path, value in settings.items():
        _put(document, path, value)
    # A formula replaces the model's own value of a parameter.
    for name in document.get("derived", {}):
        if name not in names:
            fixed.pop(name, None)
    file = None if native.is_built_in else (native.file, model.text)
    return _native.Scene(toml.document_text(document), model=file, cells=cells, purpose=purpose)


def _sets(
    sets: Iterable[str],
    names: Mapping[str, Any],
    quantities: Iterable[str] | None,
    start: Start | None,
    settings: Mapping[str, Any] | None,
) -> list[str]:
    """Return changes of a scene file in the form of the program's ``--set``."""
    swept = [name for name, value in names.items() if is_axis(value)]
    if swept:
        raise SceneError(
            f"the scene has its own axes, so {', '.join(swept)} cannot be one; change an axis with "
            'settings={"axis.0.count": 64}'
        )
    changes = _list_of(sets)
    for name, value in names.items():
        is_setting = name in INTEGRATION
        changes.append(f"integration.{name}={toml.value_text(value)}" if is_setting else toml.assignments({name: value})[0])
    by_path: dict[str, Any] = {} if quantities is None else {"outputs.quantities": _list_of(quantities)}
    if isinstance(start, Mapping):
        raise SceneError("start: with a scene file it must be a policy or a state with all components")
    if start is not None:
        by_path["start.policy"] = start if isinstance(start, str) else "state"
        if not isinstance(start, str):
            by_path["start.state"] = _floats("start", start).tolist()
    changes += [f"{path}={toml.value_text(value)}" for path, value in by_path.items()]
    return changes + [f"{path}={toml.value_text(value)}" for path, value in (settings or {}).items()]


def _axis(name: str, value: Any) -> toml.Table:
    """Return the table of an axis: its ends if they give the same values to the bit, else all values."""
    if isinstance(value, tuple):
        if len(value) != 3:
            raise SceneError(
                f"`{name} = {value!r}`: an axis is a tuple (min, max, count) or an array of values; this has {len(value)} entries"
            )
        least, most, count = map(toml.number_or_text, value)
        # The library refuses a count that is no whole number.
        is_whole = isinstance(count, float) and count.is_integer()
        return {"min": least, "max": most, "count": int(count) if is_whole else count}
    values = _floats(name, value)
    if values.ndim != 1:
        raise SceneError(f"`{name}`: an axis is a tuple (min, max, count) or values in one dimension, not in {values.ndim}")
    if is_linear(values):
        return {"min": float(values[0]), "max": float(values[-1]), "count": len(values)}
    return {"values": values.tolist()}


def _floats(name: str, value: Any) -> npt.NDArray[np.float64]:
    array = np.asarray(value)
    if not np.iscomplexobj(array):
        try:
            return array.astype(np.float64)
        except (TypeError, ValueError):
            pass
    raise SceneError(f"`{name} = {value!r}`: it must be numbers")


def is_linear(values: npt.NDArray[np.float64]) -> bool:
    """Whether these are, to the bit, the values of the program's linear axis with the same ends and count."""
    last = len(values) - 1
    if last < 1 or not np.isfinite(values).all() or not values[0] < values[-1]:
        return False
    least, most = values[0], values[-1]
    with np.errstate(over="ignore", invalid="ignore"):
        linear = np.minimum(least + (most - least) * np.arange(last + 1, dtype=np.float64) / last, most)
    linear[last] = most
    # Bytes, because -0.0 and 0.0 are equal as numbers.
    return bool(linear.tobytes() == values.tobytes())


def _start_table(model: Model, start: Start | None, components: Mapping[str, float]) -> toml.Table:
    """Return the table ``[start]``: the policy, or a state in which ``components`` replace single values."""
    names = model.state_names
    if isinstance(start, Mapping):
        check_components(model, start)
        components = {**start, **components}
        start = None
    if not components:
        if start is None:
            return {}
        return {"policy": start} if isinstance(start, str) else {"policy": "state", "state": _floats("start", start).tolist()}
    if isinstance(start, str) and start != "rest":
        raise SceneError(
            f"start = {start!r} cannot be combined with {', '.join(components)}: it starts cells from the states of their "
            "neighbours"
        )
    state = dict.fromkeys(names, 0.0) if start is None or isinstance(start, str) else dict(zip(names, start, strict=False))
    state.update({name: toml.number_or_text(value) for name, value in components.items()})
    return {"policy": "state", "state": list(state.values())}


def check_components(model: Model, start: Mapping[str, float]) -> None:
    """Raise SceneError if a name is not a component of the model's state."""
    unknown = [name for name in start if name not in model.state_names]
    if unknown:
        raise SceneError(f"start: the model has no component {unknown[0]!r}; its state is {', '.join(model.state_names)}")


def _put(document: toml.Table, path: str, value: Any) -> None:
    """Put a setting at its path, such as ``integration.max_period`` or ``axis.0.scale``."""
    *parents, name = path.split(".")
    table: Any = document
    for part in parents:
        if isinstance(table, list):
            if not part.isdigit() or int(part) >= len(table):
                raise SceneError(f"settings: `{path}` must name an axis by its number; there are {len(table)}, counted from 0")
            table = table[int(part)]
        else:
            table = table.setdefault(part, {}) if isinstance(table, dict) else None
    if not isinstance(table, dict):
        raise SceneError(f"settings: `{path}` is inside a value that is no table")
    table[name] = value


def _list_of(names: Iterable[str]) -> list[str]:
    """Return a list of names; a single text is one name."""
    return [names] if isinstance(names, str) else [*names]
