"""Single orbits: one motion, read."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from . import _native
from .asking import assignments
from .errors import SceneError
from .model import Model, required

#: What `orbit` takes, as the program bounds it.
_PERIODS, _TRANSIENT = (2, 10_000_000), (1, 1_000_000_000)


class Orbit:
    """What a motion settles on: its class, its cycle and every event on it. :func:`orbit` makes it.

    A periodic motion is shown over one cycle, any other over its last 8 forcing periods. All quantities are
    dimensionless.
    """

    def __init__(self, model: Model, transient: int, periods: int, start: list[float] | None) -> None:
        self._asked = (model, transient, periods, start)
        self._native = _native.orbit(model._model, [], transient, periods, start)
        self._told: dict[str, Any] = json.loads(self._native.json())
        self.model = model
        """The model with the values of this orbit."""

    def __reduce__(self) -> tuple[type[Orbit], tuple[Model, int, int, list[float] | None]]:
        """What it was made from: elsewhere it is computed again, which takes milliseconds and gives the same bits."""
        return Orbit, self._asked

    @property
    def class_(self) -> str:
        """``periodic``, ``chaotic``, ``undecided`` or ``failed``. With the underscore of names that Python keeps."""
        return str(self._told["class"])

    @property
    def status(self) -> str:
        """How the integration ended; ``ok`` if there is nothing to remark."""
        return str(self._told["status"])

    @property
    def parameters(self) -> dict[str, float]:
        """The value of every parameter."""
        return dict(self._told["parameters"])

    @property
    def period(self) -> int | None:
        """Forcing periods per cycle; none unless it is periodic."""
        return None if self._told["period"] is None else int(self._told["period"])

    @property
    def word(self) -> str:
        """The word in time order, of a periodic motion in canonical rotation. Not preceded by ``w``, as in tables."""
        return str(self._told["word"])

    @property
    def pattern(self) -> str:
        """The word with each run of one symbol counted once."""
        return str(self._told["pattern"])

    @property
    def multipliers(self) -> npt.NDArray[np.complex128]:
        """Floquet multipliers of a periodic motion, the largest modulus first, shape (components of the state,); else empty."""
        pairs = self._told["floquet"] or []
        return np.array([complex(*pair) for pair in pairs], dtype=np.complex128)

    @property
    def lyapunov(self) -> float:
        """The largest Lyapunov exponent per unit of time; NaN if the motion failed."""
        return _number(self._told["lyapunov"])

    @property
    def lyapunov_error(self) -> float:
        """Its standard error where it is an average, else NaN: that of a cycle comes from its multipliers."""
        return _number(self._told["lyapunov_error"])

    @property
    def symmetric(self) -> bool | None:
        """Whether a periodic motion is its own mirror image; none of others."""
        symmetric: bool | None = self._told["symmetric"]
        return symmetric

    @property
    def impacts_per_period(self) -> float:
        """Impacts per forcing period; starts of meshing are not counted."""
        return _number(self._told["impacts_per_period"])

    @property
    def mesh_fraction(self) -> float:
        """Share of the time spent meshing, 0 to 1."""
        return _number(self._told["mesh_fraction"])

    @property
    def periods_run(self) -> int:
        """Forcing periods that the motion was followed for."""
        return int(self._told["periods_run"])

    @property
    def forcing_period(self) -> float:
        """The forcing period ``T``, in units of time."""
        return self._native.forcing_period

    @property
    def strobe(self) -> npt.NDArray[np.float64]:
        """The state at the phase 0 that precedes the first event, shape (components of the state,)."""
        return np.array(self._told["strobe"], dtype=np.float64)

    @property
    def events(self) -> npt.NDArray[np.void]:
        """Every event, in order of time: a structured array, shape (events,).

        Fields: ``kind`` (``impact``, ``mesh_start``, ``mesh_end``), ``side`` (1 right, -1 left), ``t`` (since phase 0 of
        the cycle), ``t_mod_period`` (in [0, T)), ``before`` and ``after`` (states).
        """
        events = self._told["events"]
        count = len(self._native.state_names)
        kind = np.dtype(
            [
                ("kind", "U10"),
                ("side", np.int8),
                ("t", np.float64),
                ("t_mod_period", np.float64),
                ("before", np.float64, (count,)),
                ("after", np.float64, (count,)),
            ]
        )
        assert kind.names is not None
        return np.array([tuple(event[name] for name in kind.names) for event in events], dtype=kind)

    def trajectory(self, points: int = 2000) -> pd.DataFrame:
        """The motion over its cycle, or over the periods that are shown, on the exact flow.

        Parameters
        ----------
        points
            Evenly spaced samples in all, at least: each forcing period has as many as any other, and at least one.

        Returns
        -------
        pandas.DataFrame
            The columns of ``trajectory.csv``: ``t`` since phase 0 of the cycle, ``phase`` of the forcing in turns, the gap
            ``z`` and its velocity ``w``, the state, ``domain`` (``free``, ``meshing_right``, ``meshing_left``). Two rows
            for each event among them, ``before`` and ``after`` in ``moment``, with its kind in ``event`` and its
            ``side`` (1 or -1; 0 elsewhere). Empty if the motion failed.

        Examples
        --------
        >>> path = rm.orbit(rm.gear_pair(), e=0.06).trajectory(400)
        >>> plt.plot(path["z"], path["w"])
        """
        if points < 1:
            raise ValueError(f"points = {points}: at least one is needed")
        periods = max(self._native.cycle_periods, 1)
        return pd.DataFrame(self._native.moments(-(-points // periods)))

    def to_dict(self) -> dict[str, Any]:
        """The object that ``rattlemap orbit --json`` prints: numbers, texts, lists; what is absent is None."""
        told: dict[str, Any] = json.loads(self._native.json())
        return told

    def __repr__(self) -> str:
        facts = [self.model.name, self.class_]
        if self.period is not None:
            facts += [f"period {self.period}", f"word {self.word or 'without events'}"]
        if self.status != "ok":
            facts.append(f"status {self.status}")
        if self.class_ != "failed":
            facts.append(f"exponent {self.lyapunov:.4g}")
        return f"<Orbit: {', '.join(facts)}; {len(self._told['events'])} events>"


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def orbit(
    model: Model,
    *,
    periods: int = 128,
    transient: int = 400,
    start: Sequence[float] | Mapping[str, float] | None = None,
    **parameters: float,
) -> Orbit:
    """Follow one motion until it is decided, and read what it settles on: ``rattlemap orbit``.

    Parameters
    ----------
    model
        What moves.
    periods
        Forcing periods of the first check, 2 to 10,000,000. While the motion is undecided checks of twice the length
        follow, up to 32,768 periods or this many. Cycles of up to half as many are found, at most 64.
    transient
        Forcing periods before the first check, 1 to 1,000,000,000.
    start
        The state at phase 0 to start from, all components or some by name (the others are 0); at rest unless told.
    **parameters
        Values of parameters; the others have the model's own.

    Returns
    -------
    Orbit

    Raises
    ------
    SceneError
        For an unknown parameter, a value out of its range, values with which there is no motion, a start of another
        number of components.
    KeyboardInterrupt
        Within a second of Ctrl-C.

    Examples
    --------
    >>> o = rm.orbit(rm.gear_pair(), e=0.605, omega=5.6)
    >>> o.class_, o.period, o.word
    ('periodic', 1, '36')
    >>> bool((abs(o.multipliers) < 1).all())
    True
    """
    for name, value, (least, most) in (("periods", periods, _PERIODS), ("transient", transient, _TRANSIENT)):
        is_whole = isinstance(value, (int, np.integer)) or (isinstance(value, float) and value.is_integer())
        if not is_whole or not least <= value <= most:
            raise SceneError(f"{name} = {value!r}: it must be a whole number from {least} to {most}")
    own = required(model).replace(**parameters)
    state = None if start is None else _state(own, start)
    return Orbit(own, int(transient), int(periods), state)


def _state(model: Model, start: Sequence[float] | Mapping[str, float]) -> list[float]:
    names = model.state_names
    if isinstance(start, Mapping):
        unknown = [name for name in start if name not in names]
        if unknown:
            raise SceneError(f"start: the model has no component {unknown[0]!r}; its state is {', '.join(names)}")
        values = [float(start.get(name, 0.0)) for name in names]
    else:
        values = [float(x) for x in start]
    if not np.isfinite(values).all():
        raise SceneError(f"start: it must be finite numbers, the model's {', '.join(names)}")
    return values
