"""Engines, and the conversion of native results."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from io import StringIO
from pathlib import Path
from typing import Any, Literal

import xarray as xr

from . import _native, dataset
from .terms import in_python

Engine = Literal["auto", "cpu", "gpu"]
Precision = Literal["f32", "f64"]
#: A graphics adapter: its number in :func:`rattlemap.devices`, or a part of its name that no other has.
Adapter = int | str


def adapter_text(adapter: Adapter | None) -> str | None:
    """Return an adapter in the form of the program's ``--adapter``."""
    return None if adapter is None else str(adapter)


@contextmanager
def no_display() -> Iterator[None]:
    """Set the environment variable that keeps Vulkan drivers from reporting a missing screen, if there is no screen."""
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


@contextmanager
def interruptible(folder: str | None, *, resumable: bool = True) -> Iterator[None]:
    """Add to a KeyboardInterrupt what is stored and how to continue. ``folder`` receives the finished cells."""
    try:
        yield
    except KeyboardInterrupt:
        if not resumable:
            text = "interrupted; nothing is stored, so the same call starts from the beginning"
        elif folder is None:
            text = (
                "interrupted; nothing is stored. With out=FOLDER, finished cells are stored, and the same call with resume=True "
                "continues"
            )
        elif not Path(folder, "records.bin").exists():
            text = "interrupted before the first cell; the same call starts from the beginning"
        else:
            text = f"interrupted; the finished cells are in {folder}; the same call with resume=True continues"
        raise KeyboardInterrupt(text) from None


def warn(lines: Iterable[str]) -> None:
    """Issue warnings that point to the caller of the public function, which must call this one directly."""
    for line in lines:
        warnings.warn(in_python(line), RuntimeWarning, stacklevel=3)


def map_dataset(result: _native.MapResult) -> xr.Dataset:
    """Return the Dataset of a map that the native module has computed."""
    ds = dataset.from_columns(result["columns"], json.loads(result["manifest"]), result["texts"])
    attractors = result["attractors"]
    return ds if attractors is None else dataset.with_attractors(ds, dataset.text_table(StringIO(attractors)))
