"""Models: oscillators with values of their parameters."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from . import _native
from .toml import assignments


class Model:
    """An oscillator with walls, and values of its parameters. It is immutable: :meth:`replace` returns another model.

    :func:`gear_pair` and :func:`load_model` return it. Quantities have the units of the model.
    """

    __slots__ = ("_model",)

    def __init__(self, model: _native.Model) -> None:
        self._model = model

    @property
    def name(self) -> str:
        """Name in scenes and in the program."""
        return self._model.name

    @property
    def title(self) -> str:
        """Title of the model."""
        return self._model.title

    @property
    def text(self) -> str:
        """Text of the model's file, TOML."""
        return self._model.text

    @property
    def parameters(self) -> dict[str, float]:
        """Values of all parameters, in the order of the model's table."""
        return self._model.parameters

    @property
    def state_names(self) -> list[str]:
        """Components of a state: displacement and velocity of each body, such as ``x1, v1, x2, v2``."""
        return self._model.state_names

    @property
    def equations(self) -> list[str]:
        """Equations of motion, one line each."""
        return self._model.equations

    @property
    def help(self) -> str:
        """All parameters with value, meaning and range, one line each."""
        values = self.parameters
        lines = [f"{name} = {values[name]!r}: {meaning}; {range_}" for name, meaning, range_, _ in self._model.meanings]
        return "\n".join(lines)

    def replace(self, /, **parameters: float) -> Model:
        """Return the model with other values of some parameters.

        Parameters
        ----------
        **parameters
            Values by name; :attr:`help` lists their ranges.

        Returns
        -------
        Model

        Raises
        ------
        SceneError
            For an unknown name, a value out of its range, or values without a motion.

        Examples
        --------
        >>> rm.gear_pair().replace(F=60).parameters["F"]
        60.0
        """
        return Model(self._model.replace(assignments(parameters)))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Model):
            return NotImplemented
        return self.text == other.text and self._model.changed == other._model.changed

    def __hash__(self) -> int:
        return hash((self.text, tuple(self._model.changed.items())))

    def __repr__(self) -> str:
        changed = "".join(f", {name}={value!r}" for name, value in self._model.changed.items())
        return f"Model({self.name!r}{changed})"

    def __reduce__(self) -> tuple[Callable[..., Model], tuple[Any, ...]]:
        return _rebuild, (self.text, self._model.file, self._model.changed)


def require_model(model: object) -> Model:
    """Return the model, or raise TypeError if it is not one."""
    if not isinstance(model, Model):
        raise TypeError(f"{model!r} is not a model; rm.gear_pair() is one, rm.load_model(NAME_OR_FILE) makes others")
    return model


def _rebuild(text: str, file: str, changed: dict[str, float]) -> Model:
    return Model(_native.Model(text, file).replace(assignments(changed)))


def gear_pair(**parameters: float) -> Model:
    """Return the gear pair with backlash: two gears under light load, with teeth that impact and mesh.

    Parameters
    ----------
    **parameters
        Any of ``m1 m2 r1 r2 k1 k2 r k F omega b e mesh_speed``, dimensionless: masses, dampings, stiffnesses, damping
        and stiffness of meshing, amplitude and frequency of the forcing, half the backlash, restitution, meshing speed.
        The other parameters have the paper's values. ``rm.gear_pair().help`` lists meanings and ranges.

    Returns
    -------
    Model

    Raises
    ------
    SceneError
        For an unknown name, a value out of its range, or values without a motion.

    Examples
    --------
    >>> rm.gear_pair(F=50, e=0.6)
    Model('gear-pair', e=0.6)
    """
    return load_model("gear-pair", **parameters)


def load_model(model: str | os.PathLike[str], /, **parameters: float) -> Model:
    """Return a built-in model, or read one from a file.

    Parameters
    ----------
    model
        A name that :func:`rattlemap.models` lists, or the path of a model's file (``docs/models.md`` describes it).
    **parameters
        Values by name; the other parameters keep the values of the file.

    Returns
    -------
    Model

    Raises
    ------
    ModelError
        If there is no such model, or its file is wrong.
    SceneError
        For an unknown parameter, a value out of its range, or values without a motion.

    Examples
    --------
    >>> rm.load_model("impact-oscillator", omega=2.8)
    Model('impact-oscillator', omega=2.8)
    """
    found = _native.Model.find(os.fspath(model))
    return Model(found.replace(assignments(parameters)) if parameters else found)
