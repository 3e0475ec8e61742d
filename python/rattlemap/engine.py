"""What the native functions need around them."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO
from typing import Any, Literal

import pandas as pd
import xarray as xr

from . import _native, decode

Engine = Literal["auto", "cpu", "gpu"]
Precision = Literal["f32", "f64"]
#: A graphics adapter by its number in `rattlemap devices`, by a part of its name that no other has, or "all" equal ones.
Adapter = int | str


def adapter_text(adapter: Adapter | None) -> str | None:
    """An adapter as the program's ``--adapter`` takes it."""
    return None if adapter is None else str(adapter)


@contextmanager
def no_display() -> Iterator[None]:
    """Keeps a Vulkan driver from complaining that there is no screen, where none can be."""
    variable = _native.missing_variable()
    if variable is None:
        yield
        return
    name, value = variable
    before = os.environ.get(name)
    os.environ[name] = value
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = before


def table(text: str) -> pd.DataFrame:
    """A table of the program, every field as text: :mod:`rattlemap.decode` gives types."""
    return pd.read_csv(StringIO(text), dtype=str, keep_default_na=False)


def dataset(made: _native.MadeMap) -> xr.Dataset:
    """The Dataset of a map that the native module has made."""
    for warning in made["warnings"]:
        # The one who called the package's function.
        warnings.warn(warning, RuntimeWarning, stacklevel=3)
    ds = decode.dataset(made["columns"], json.loads(made["manifest"]), made["texts"])
    attractors: Any = made["attractors"]
    return ds if attractors is None else decode.with_attractors(ds, table(attractors))
