"""Single orbits."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from io import StringIO
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from . import _native, dataset, scenes
from .engine import interruptible
from .errors import EngineError, SceneError
from .model import Model, require_model

#: Ranges of the arguments, as in the program.
_PERIODS, _TRANSIENT = (2, 10_000_000), (1, 1_000_000_000)
_HISTORY, _LAST, _POINTS, _CYCLE = (1, 10_000), 30_000_000, (1, 10_000_000), (1, 64)


class Orbit:
    """A motion after its transient: its class, its cycle and every event. :func:`orbit` returns it.

    A periodic motion is described over one cycle, any other over its last 8 forcing periods. Quantities have
    the units of the model, :attr:`units`.
    """

    def __init__(self, model: Model, transient: int, periods: int | None, start: list[float] | None) -> None:
        self._arguments = (model, transient, periods, start)
        with interruptible(None, resumable=False):
            self._native = _native.orbit(model._model, transient, periods, start)
        self._facts: dict[str, Any] = json.loads(self._native.json())
        self.model = model
        """The model with the values of this orbit."""

    def __reduce__(self) -> tuple[type[Orbit], tuple[Model, int, int | None, list[float] | None]]:
        """Return the arguments, from which another process computes the same orbit in milliseconds, to the bit."""
        return Orbit, self._arguments

    @property
    def class_(self) -> str:
        """Class: ``periodic``, ``chaotic``, ``quasi-periodic``, ``undecided`` or ``failed``. ``class`` itself is a keyword of Python."""
        return str(self._facts["class"])

    @property
    def status(self) -> str:
        """How the integration ended; ``ok`` if there is no remark."""
        return str(self._facts["status"])

    @property
    def parameters(self) -> dict[str, float]:
        """The value of every parameter."""
        return dict(self._facts["parameters"])

    @property
    def units(self) -> dict[str, str]:
        """Units by name: parameters, components of the state, the gap and the time ``t``. Empty if the model has none."""
        return dict(self._facts.get("units", {}))

    @property
    def period(self) -> int | None:
        """Forcing periods per cycle; None unless the motion is periodic."""
        return None if self._facts["period"] is None else int(self._facts["period"])

    @property
    def word(self) -> str:
        """The word in order of time, without the ``w`` of tables. For a periodic motion it is in canonical rotation."""
        return str(self._facts["word"])

    @property
    def pattern(self) -> str:
        """The word with repeated symbols written once."""
        return str(self._facts["pattern"])

    @property
    def multipliers(self) -> npt.NDArray[np.complex128]:
        """Floquet multipliers of a periodic motion by decreasing modulus, shape (components of the state,); otherwise empty."""
        pairs = self._facts["floquet"] or []
        return np.array([complex(*pair) for pair in pairs], dtype=np.complex128)

    @property
    def lyapunov(self) -> float:
        """Largest Lyapunov exponent per unit of time: minus infinity if all multipliers are 0, NaN if the motion failed."""
        return self._native.lyapunov

    @property
    def lyapunov_error(self) -> float:
        """Standard error of the exponent. NaN for a cycle, whose exponent comes from its multipliers."""
        return _number(self._facts["lyapunov_error"])

    @property
    def symmetric(self) -> bool | None:
        """Whether a periodic motion is its own mirror image; None for other motions."""
        return None if self._facts["symmetric"] is None else bool(self._facts["symmetric"])

    @property
    def impacts_per_period(self) -> float:
        """Impacts per forcing period; starts of meshing are not counted."""
        return _number(self._facts["impacts_per_period"])

    @property
    def mesh_fraction(self) -> float:
        """Share of the time spent meshing, 0 to 1."""
        return _number(self._facts["mesh_fraction"])

    @property
    def quantities(self) -> dict[str, float]:
        """Measured quantities by name: speeds and energy of impacts, contact forces, amplitudes, harmonics and so on.

        Averages run over the cycle, or over the observed periods of other motion. A quantity that the motion does not have is
        NaN. ``docs/scenes.md`` lists names and meanings.
        """
        return {name: _number(value) for name, value in self._facts["quantities"].items()}

    @property
    def periods_run(self) -> int:
        """Number of integrated forcing periods."""
        return int(self._facts["periods_run"])

    @property
    def forcing_period(self) -> float:
        """The forcing period ``T``, in units of time."""
        return self._native.forcing_period

    @property
    def strobe(self) -> npt.NDArray[np.float64]:
        """The state at the phase 0 that precedes the first event, shape (components of the state,)."""
        return np.array(self._facts["strobe"], dtype=np.float64)

    @property
    def events(self) -> npt.NDArray[np.void]:
        """All events in order of time: a structured array, shape (events,).

        Fields: ``kind`` (at walls ``impact``, ``mesh_start``, ``mesh_end``), ``side`` (1 right, -1 left, 0 for friction), ``t``
        (since phase 0 of the cycle), ``t_mod_period`` (in [0, T)), ``before`` and ``after`` (states), ``impulse`` (of the contact
        on the gap; NaN for friction); ``gap``, the name of the gap, if there are events in a model with several gaps; and
        ``element``, the name of the friction element, if there are events of friction.
        """
        events = self._facts["events"]
        count = len(self._native.state_names)
        kind = np.dtype(
            [
                ("kind", "U10"),
                ("side", np.int8),
                ("t", np.float64),
                ("t_mod_period", np.float64),
                ("before", np.float64, (count,)),
                ("after", np.float64, (count,)),
                ("impulse", np.float64),
                *((name, "U32") for name in ("gap", "element") if any(name in event for event in events)),
            ]
        )
        assert kind.names is not None
        absent = {"side": 0, "impulse": np.nan, "gap": "", "element": ""}
        rows = [{name: absent[name] if event.get(name) is None else event[name] for name in kind.names} for event in events]
        return np.array([tuple(row.values()) for row in rows], dtype=kind)

    def trajectory(self, points: int = 2000) -> pd.DataFrame:
        """Return the motion over its cycle, or over its last 8 forcing periods.

        Parameters
        ----------
        points
            Least number of evenly spaced samples, 1 to 10,000,000. Each forcing period has the same number.

        Returns
        -------
        pandas.DataFrame
            The columns of ``trajectory.csv``: ``t`` since phase 0 of the cycle, ``phase`` of the forcing in turns, the gap
            ``z`` and its velocity ``w``, the state, ``domain`` (``free``, ``meshing_right``, ``meshing_left``). A model with
            several gaps has these columns for each gap, with its name: ``a``, ``a_rate``, ``domain_a``. Each
            event has two more rows, ``before`` and ``after`` in ``moment``, with its kind in ``event`` and its ``side``
            (1 or -1; 0 in other rows). Empty if the motion failed.

        Raises
        ------
        ValueError
            If ``points`` is out of its range.

        Examples
        --------
        >>> path = rm.orbit(rm.gear_pair(), e=0.06).trajectory(400)
        >>> plt.plot(path["z"], path["w"])
        """
        _check_whole("points", points, _POINTS)
        periods = max(self._native.cycle_periods, 1)
        table = StringIO(self._native.trajectory(-(-int(points) // periods)))
        return pd.DataFrame(dataset.table_columns(dataset.text_table(table)))

    def spectrum(self) -> pd.DataFrame:
        """Return the spectrum of each gap and of its velocity.

        The spectrum of a cycle is its Fourier series. That of any other motion is a root mean square over 7 Hann windows of 128
        forcing periods, which overlap by half.

        Returns
        -------
        pandas.DataFrame
            The columns of ``spectrum.csv``: ``frequency`` in multiples of the forcing frequency, and the amplitudes of the gap
            ``z`` and its velocity ``w``, with the names of :meth:`trajectory`. At frequency 0 they are magnitudes of the mean.
            ``attrs["units"]`` has the units by column, if the model has units.

        Raises
        ------
        EngineError
            If the motion cannot be followed for long enough.

        Examples
        --------
        >>> lines = rm.orbit(rm.gear_pair(), e=0.605, omega=5.6).spectrum()
        >>> plt.plot(lines["frequency"], lines["z"])
        """
        text = self._native.spectrum()
        if text is None:
            raise EngineError("the motion cannot be followed for as long as its spectrum requires")
        lines = pd.DataFrame(dataset.table_columns(dataset.text_table(StringIO(text))))
        lines.attrs["units"] = {name: unit for name, unit in self.units.items() if name in lines}
        return lines

    def history(self, periods: int, *, to_period: int | None = None, points: int = 2000) -> pd.DataFrame:
        """Return the motion from its start, which :meth:`trajectory` leaves out as transient.

        Parameters
        ----------
        periods
            Number of forcing periods, 1 to 10,000: the first ones, unless ``to_period`` is given.
        to_period
            Number of the last forcing period, counted from 1. ``history(5, to_period=100)`` returns periods 96 to 100.
        points
            Least number of evenly spaced samples. Each forcing period has the same number.

        Returns
        -------
        pandas.DataFrame
            The columns of :meth:`trajectory`, with ``t`` since the start. At the exact time of an event the last row is the
            state after the event.

        Raises
        ------
        ValueError
            If a number is out of its range.
        EngineError
            If the motion cannot be computed up to the last period.
        KeyboardInterrupt
            Within a second of Ctrl-C.

        Examples
        --------
        >>> first = rm.orbit(rm.gear_pair(), e=0.605).history(20)
        >>> plt.plot(first["t"], first["z"])
        """
        last = periods if to_period is None else to_period
        _check_whole("periods", periods, _HISTORY)
        _check_whole("to_period", last, (int(periods), _LAST))
        _check_whole("points", points, _POINTS)
        table = StringIO(self._native.history(int(last) - int(periods), int(periods), int(points)))
        return pd.DataFrame(dataset.table_columns(dataset.text_table(table)))

    def refined(self, period: int | None = None, word: str | None = None, by: str | None = None) -> dict[str, Any]:
        """Solve the equations of the cycle, so that its numbers are exact to rounding.

        Parameters
        ----------
        period, word
            Length of the cycle in forcing periods, from 1 to 64, and the order of its contacts. The cycle nearest to the start that
            has both is found, stable or unstable. The length is 1 if only a word is given. Without both, the cycle that the motion
            reaches is refined.
        by
            Name of a parameter. The derivatives of the cycle by this parameter are returned, too.

        Returns
        -------
        dict
            ``period``, ``word``, ``stable``, ``floquet`` (multipliers as pairs), ``strobe`` (state at phase 0) and ``event_times``
            (in forcing periods). With ``by`` also ``derivatives``, a dict of ``strobe``, ``event_times``, ``floquet`` and
            ``quantities``. Where a derivative does not exist it is None, and ``reasons`` says why.

        Raises
        ------
        SceneError
            For an unknown parameter, or an argument out of its range.
        EngineError
            If there is no such cycle, or it has no derivatives, for example at a graze.
        KeyboardInterrupt
            Within a second of Ctrl-C.

        Examples
        --------
        >>> chaos = rm.orbit(rm.gear_pair(), e=0.8, omega=5.6)
        >>> chaos.refined(period=1)["stable"]
        False
        """
        if period is not None:
            _check_whole("period", period, _CYCLE)
        facts: dict[str, Any] = json.loads(self._native.refined(None if period is None else int(period), word, by))
        return facts

    def derivative(self, of: str, by: str) -> Any:
        """Return the derivative of a number of the cycle by a parameter of the model.

        Parameters
        ----------
        of
            ``"strobe"``, ``"event_times"`` or ``"multipliers"``, which have one derivative per entry, or the name of a quantity
            (see :attr:`quantities`).
        by
            Name of the parameter.

        Returns
        -------
        float or numpy.ndarray
            The unit is that of the number, divided by that of the parameter. At an end of the parameter's range the derivative is
            one-sided.

        Raises
        ------
        SceneError
            For an unknown name.
        EngineError
            If there is no derivative. The message says why: the motion is no cycle, it is at a graze or a fold, or the slopes on
            both sides differ, for example because two maxima are equally high.

        Examples
        --------
        >>> o = rm.orbit(rm.gear_pair(), e=0.4)
        >>> round(o.derivative("amplitude_x1", "e"), 6)
        -0.153629
        """
        found = self.refined(by=by)["derivatives"]
        key = "floquet" if of == "multipliers" else of
        if key not in ("strobe", "event_times", "floquet") and key not in found["quantities"]:
            raise SceneError(f"{of}: unknown name. Use one of: strobe, event_times, multipliers, {', '.join(found['quantities'])}")
        if key in found["reasons"]:
            raise EngineError(f"{of} by {by}: {found['reasons'][key]}")
        if key == "floquet":
            return np.array([complex(*pair) for pair in found[key]], dtype=np.complex128)
        if key in ("strobe", "event_times"):
            return np.array(found[key], dtype=np.float64)
        if found["quantities"][key] is None:
            raise EngineError(f"{of}: the motion has no such quantity")
        return float(found["quantities"][key])

    def to_dict(self) -> dict[str, Any]:
        """Return the object that ``rattlemap orbit --json`` prints; absent values are None."""
        facts: dict[str, Any] = json.loads(self._native.json())
        return facts

    def __repr__(self) -> str:
        facts = [self.model.name, self.class_]
        if self.period is not None:
            facts += [f"period {self.period}", f"word {self.word or 'without events'}"]
        if self.status != "ok":
            facts.append(f"status {self.status}")
        if self.class_ != "failed":
            facts.append(f"exponent {self.lyapunov:.4g}")
        return f"<Orbit: {', '.join(facts)}; {len(self._facts['events'])} events>"


def _check_whole(name: str, value: float, bounds: tuple[int, int]) -> None:
    """Raise an error unless a value is a whole number within bounds, which are included."""
    least, most = bounds
    is_whole = isinstance(value, (int, np.integer)) or (isinstance(value, float) and value.is_integer())
    if not is_whole or not least <= value <= most:
        raise SceneError(f"{name} = {value!r}: it must be a whole number from {least} to {most}")


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def orbit(
    model: Model,
    *,
    parameters: scenes.Parameters | None = None,
    periods: int | None = None,
    transient: int = 400,
    start: Sequence[float] | Mapping[str, float] | None = None,
    phase: float | None = None,
    **names: float,
) -> Orbit:
    """Compute one motion after its transient, like ``rattlemap orbit``.

    Parameters
    ----------
    model
        The oscillator.
    parameters
        Values by name, for parameters whose names are keywords of this function.
    periods
        Forcing periods to analyse after the transient, 2 to 10,000,000. If the class is not decided then, the motion is
        undecided. By default 128; while the motion is undecided, the analysis is repeated with twice as many, up to 4,096.
        Cycles of up to half this number, at most 64, are found.
    transient
        Forcing periods before the first analysis, 1 to 1,000,000,000.
    start
        The state at phase 0: all components, or some by name (the others are 0); by default rest.
    phase
        Phase of the force at the start, in radians; 0 by default. Results call this phase 0. A parameter of the model with
        this name is given in ``parameters``.
    **names
        Values of parameters; the others keep the values of the model.

    Returns
    -------
    Orbit

    Raises
    ------
    SceneError
        For an unknown parameter, a value out of its range, values without a motion, or a start with a wrong number of
        components.
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
    if periods is not None:
        _check_whole("periods", periods, _PERIODS)
    _check_whole("transient", transient, _TRANSIENT)
    changes = scenes.all_names(names, None, parameters)
    if phase is not None:
        if "phase" in require_model(model).parameters and "phase" not in changes:
            raise SceneError('phase: the model has a parameter of this name; give it as parameters={"phase": VALUE}')
        changes["start.phase"] = phase
    model = require_model(model).replace(**changes)
    state = None if start is None else _state(model, start)
    return Orbit(model, int(transient), None if periods is None else int(periods), state)


def _state(model: Model, start: Sequence[float] | Mapping[str, float]) -> list[float]:
    names = model.state_names
    if isinstance(start, Mapping):
        scenes.check_components(model, start)
        values = [float(start.get(name, 0.0)) for name in names]
    else:
        values = [float(x) for x in start]
    if not np.isfinite(values).all():
        raise SceneError(f"start: it must be finite numbers for {', '.join(names)}")
    return values
