"""Tables of the models and their parameters."""

from __future__ import annotations

import pandas as pd

from . import _native
from .model import Model, load_model


def models(name: str | Model | None = None) -> pd.DataFrame:
    """List the built-in models, or the parameters of one model, like ``rattlemap models``.

    Parameters
    ----------
    name
        A built-in model, the path of a model's file, or a :class:`Model`. None lists the built-in models.

    Returns
    -------
    pandas.DataFrame
        Without ``name``: the column ``summary``, indexed by ``model``.

        With ``name``: one row per parameter or component of the start that can be swept, indexed by ``name``, with the
        columns ``kind`` (``parameter`` or ``start``), ``default`` (NaN if every scene must set it), ``range`` and
        ``meaning``.

    Raises
    ------
    ModelError
        If there is no such model, or its file is wrong.

    Examples
    --------
    >>> "gear-pair" in rm.models().index
    True
    >>> rm.models("gear-pair").loc["e", "range"]
    'between 0 and 1'
    """
    if name is None:
        return pd.DataFrame(_native.models(), columns=["model", "summary"]).set_index("model")
    model = name if isinstance(name, Model) else load_model(name)
    rows = [("parameter", *row) for row in model._model.meanings]
    rows += [("start", component, f"{component} at phase 0", "any finite number", 0.0) for component in model.state_names]
    table = pd.DataFrame(rows, columns=["kind", "name", "meaning", "range", "default"]).set_index("name")
    return table[["kind", "default", "range", "meaning"]].astype({"default": float})
