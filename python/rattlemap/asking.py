"""From keywords to a scene: the text that the program would read from a file.

Nothing is judged here but what a file could not say: the library reads the text, and its errors are the program's.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _native
from .errors import SceneError

if TYPE_CHECKING:
    from .model import Model

#: Keywords that stand in the scene's table ``[integration]``, unless the model has a parameter of the name.
INTEGRATION = (
    "steps_per_period",
    "transient_periods",
    "observed_periods",
    "early_stop",
    "undecided_periods",
    "max_period",
)
#: Policies of the start; a state is told by its numbers.
POLICIES = ("rest", "up", "down", "both")

#: A state by its components, all of them or some by name (the others are 0), or the name of a policy.
Start = str | Sequence[float] | Mapping[str, float]
_Table = dict[str, Any]


def toml(value: Any) -> str:
    """A value as TOML writes it; numbers are the same to the bit."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(name)} = {toml(item)}" for name, item in value.items()) + "}"
    if isinstance(value, (Sequence, np.ndarray)) and np.ndim(value) > 0:
        return "[" + ", ".join(map(toml, value)) + "]"
    return number(value)


def number(value: Any) -> str:
    """A number as the shortest decimal that reads back as the same; anything else as text, which the program refuses."""
    try:
        return repr(float(value))
    except (TypeError, ValueError):
        return toml(str(value))


def assignments(parameters: Mapping[str, Any]) -> list[str]:
    """Parameters as the program's ``--set`` takes them."""
    return [f"{name}={toml(value) if isinstance(value, str) else number(value)}" for name, value in parameters.items()]


def settings_as_sets(settings: Mapping[str, Any]) -> list[str]:
    """Settings by path as the program's ``--set`` takes them."""
    return [f"{path}={toml(value)}" for path, value in settings.items()]


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else toml(name)


def is_axis(value: Any) -> bool:
    """Whether a keyword's value sweeps: a tuple (min, max, count), or several values."""
    return not isinstance(value, (str, bytes, Mapping)) and np.ndim(value) > 0


def _axis(name: str, value: Any) -> _Table:
    """An axis' values as a scene says them: by its ends where that gives the same numbers, else one by one."""
    if isinstance(value, tuple):
        if len(value) != 3:
            raise SceneError(
                f"`{name} = {value!r}`: an axis is a tuple (min, max, count) or an array of values; this has {len(value)} entries"
            )
        least, most, count = map(_number_or_text, value)
        # What is no whole number is refused by who reads it.
        is_whole = isinstance(count, float) and count.is_integer()
        return {"min": least, "max": most, "count": int(count) if is_whole else count}
    values = _floats(name, value)
    if values.ndim != 1:
        raise SceneError(f"`{name}`: an axis is a tuple (min, max, count) or values in one dimension, not in {values.ndim}")
    if is_linear(values):
        return {"min": float(values[0]), "max": float(values[-1]), "count": len(values)}
    return {"values": values.tolist()}


def _floats(name: str, value: Any) -> npt.NDArray[np.float64]:
    """Numbers as the program has them."""
    given = np.asarray(value)
    if not np.iscomplexobj(given):
        try:
            return given.astype(np.float64)
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
        own = np.minimum(least + (most - least) * np.arange(last + 1, dtype=np.float64) / last, most)
    own[last] = most
    # Bytes, lest -0.0 pass for 0.0.
    same: bool = own.tobytes() == values.tobytes()
    return same


def _start_table(model: Model, start: Start | None, components: Mapping[str, float]) -> _Table:
    """The table ``[start]``: the policy, or a state of which single components may be given beside it."""
    names = model.state_names
    if isinstance(start, Mapping):
        unknown = [name for name in start if name not in names]
        if unknown:
            raise SceneError(f"start: the model has no component {unknown[0]!r}; its state is {', '.join(names)}")
        components = {**start, **components}
        start = None
    if not components:
        if start is None:
            return {}
        return {"policy": start} if isinstance(start, str) else {"policy": "state", "state": _floats("start", start).tolist()}
    if isinstance(start, str) and start != "rest":
        raise SceneError(f"start = {start!r} does not go with {', '.join(components)}: a given state follows no neighbour")
    state = dict.fromkeys(names, 0.0) if start is None or isinstance(start, str) else dict(zip(names, start, strict=False))
    state.update({name: _number_or_text(value) for name, value in components.items()})
    return {"policy": "state", "state": list(state.values())}


def _put(document: _Table, path: str, value: Any) -> None:
    """Puts a setting at its path, such as ``integration.max_period`` or ``axis.0.scale``."""
    *way, name = path.split(".")
    table: Any = document
    for part in way:
        if isinstance(table, list):
            if not part.isdigit() or int(part) >= len(table):
                raise SceneError(f"settings: `{path}` names an axis by its number, and there are {len(table)}, from 0")
            table = table[int(part)]
        elif isinstance(table, dict):
            table = table.setdefault(part, {})
        else:
            raise SceneError(f"settings: `{path}` lies below a value")
    if not isinstance(table, dict):
        raise SceneError(f"settings: `{path}` lies below a value")
    table[name] = value


def _text(document: Mapping[str, Any]) -> str:
    """A scene's document as TOML: what stands before tables, tables, axes."""
    lines = [f"{_key(name)} = {toml(value)}" for name, value in document.items() if not isinstance(value, (dict, list))]
    for name, value in document.items():
        tables = value if isinstance(value, list) else [value] if isinstance(value, dict) and value else []
        head = f"[[{_key(name)}]]" if isinstance(value, list) else f"[{_key(name)}]"
        for table in tables:
            lines += ["", head, *(f"{_key(key)} = {toml(item)}" for key, item in table.items())]
    return "\n".join(lines) + "\n"


def scene(
    model: Model,
    names: Mapping[str, Any],
    *,
    purpose: str,
    axes: int,
    quantities: Iterable[str] | None = None,
    start: Start | None = None,
    settings: Mapping[str, Any] | None = None,
    cells: str | None = None,
) -> _native.Scene:
    """The scene of these keywords.

    Parameters
    ----------
    model
        Its own values are those of all parameters that no keyword names.
    names
        Axes, parameters, components of the start and settings of ``[integration]``, in their order.
    purpose
        ``"map"`` or ``"bifurcation"``.
    axes
        How many there have to be.
    quantities, start
        As :func:`rattlemap.map` takes them.
    settings
        Any setting of a scene by its path; wins over all else.
    cells
        A table of cells in the place of axes, CSV.

    Raises
    ------
    SceneError
        With the program's words.
    """
    parameters, components = model.parameters, model.state_names
    document: _Table = {"model": model.name if model._model.is_built_in else f"{model.name}.toml"}
    fixed: _Table = dict(model._model.changed)
    swept: list[_Table] = []
    integration: _Table = {}
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
            fixed[name] = _number_or_text(value)
    if len(swept) != axes:
        given = ", ".join(str(axis.get("parameter", axis.get("start"))) for axis in swept) or "none"
        wanted = {0: "no axes", 1: "one axis", 2: "two axes"}[axes]
        raise SceneError(
            f"{wanted} must be given, and these are: {given}; an axis is a keyword with a tuple (min, max, count) or an array"
        )
    if cells is not None:
        for name in cells.partition("\n")[0].split(","):
            fixed.pop(name, None)
    document["parameters"] = fixed
    if swept:
        document["axis"] = swept
    if cells is not None:
        document["cells"] = {"file": "cells.csv"}
    document["integration"] = integration
    document["start"] = _start_table(model, start, states)
    document["outputs"] = {} if quantities is None else {"quantities": _listed(quantities)}
    for path, value in (settings or {}).items():
        _put(document, path, value)
    # Those that follow others take the place of the model's own values.
    for name in document.get("derived", {}):
        if name not in names:
            fixed.pop(name, None)
    file = None if model._model.is_built_in else (model._model.file, model.text)
    return _native.Scene(_text(document), model=file, cells=cells, purpose=purpose)


def _listed(names: Iterable[str]) -> list[str]:
    """Names, of which one may be given bare."""
    return [names] if isinstance(names, str) else [*names]


def _number_or_text(value: Any) -> Any:
    """A number; anything else as text, which the program refuses."""
    if isinstance(value, str):
        return value
    try:
        return float(value)
    except (TypeError, ValueError):
        return str(value)


def scene_file(
    path: Any,
    names: Mapping[str, Any],
    *,
    purpose: str,
    sets: Iterable[str],
    quantities: Iterable[str] | None = None,
    start: Start | None = None,
    settings: Mapping[str, Any] | None = None,
    along: tuple[str, list[str]] | None = None,
) -> _native.Scene:
    """The scene in a file, with changes as the program's ``--set`` makes them."""
    swept = [name for name, value in names.items() if is_axis(value)]
    if swept:
        raise SceneError(
            f"the scene has its own axes, and {', '.join(swept)} would be another; change an axis by "
            'settings={"axis.0.count": 64}'
        )
    own = [sets] if isinstance(sets, str) else [*sets]
    for name, value in names.items():
        own.append(f"integration.{name}={toml(value)}" if name in INTEGRATION else assignments({name: value})[0])
    if quantities is not None:
        own.append(f"outputs.quantities={toml(_listed(quantities))}")
    if isinstance(start, Mapping):
        raise SceneError("a scene's start is a policy or a state with all components")
    if start is not None:
        state = [] if isinstance(start, str) else [f"start.state={toml(_floats('start', start).tolist())}"]
        own += [f"start.policy={toml(start if isinstance(start, str) else 'state')}", *state]
    own += settings_as_sets(settings or {})
    return _native.Scene.load(os.fspath(path), own, purpose, along)
