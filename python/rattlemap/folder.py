"""Finished folders as Datasets."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from xarray.backends import BackendArray, BackendEntrypoint
from xarray.core import indexing

from . import _native, dataset
from .errors import FolderError

_MANIFEST, _CELLS, _WORDS, _RECORDS = "manifest.json", "cells.npy", "words.csv", "records.bin"
_ATTRACTORS, _POINTS, _COLUMNS = "attractors.csv", "bifurcation.csv", "bifurcation_columns.csv"


def open(folder: str | os.PathLike[str]) -> xr.Dataset:  # noqa: A001
    """Open the folder of a finished map, basin map, list of cells or bifurcation diagram.

    Only the manifest and the axes are read at first. Numbers are views of the memory-mapped file ``cells.npy``. Codes and
    words are converted to text on access, for the accessed cells only.

    Parameters
    ----------
    folder
        Folder that ``rattlemap map`` or ``rattlemap bifurcation`` wrote.

    Returns
    -------
    xarray.Dataset
        A map has the dimensions (second axis, first axis) and the values of the axes as coordinates. Its variables are
        the columns of ``cells.npy``. ``class``, ``status`` and ``source`` are text of fixed width. ``word`` and
        ``pattern`` are Python strings that begin with ``w``. Absent values are NaN for floats, 0 for ``period``, -1 for
        ``symmetric`` and the empty string for words. Quantities have the units of the model.

        A list of cells has the dimension ``cell``, with its parameters as coordinates. A basin map has the variable
        ``attractor``, the label of the attractor (-1 without one), and the table of attractors over the dimension
        ``label``. A diagram has the dimension of its parameter, and its section points over ``point``.

        ``attrs`` contains the manifest: text and numbers unchanged, lists and objects as JSON.

    Raises
    ------
    FolderError
        If the folder does not exist, is not finished, is a shard's, has another format, has no ``cells.npy``, or is
        damaged.

    Notes
    -----
    Arrays are read-only views until xarray copies them. Windows cannot remove a folder whose Dataset is in use.
    ``xarray.open_dataset(folder, engine="rattlemap", chunks={})`` opens maps with dask arrays.

    Examples
    --------
    >>> ds = rattlemap.open("out/e_omega")
    >>> ds["lyapunov"].sel(e=0.6, method="nearest").plot()
    >>> (ds["class"] == "chaotic").mean().item()
    """
    return xr.open_dataset(os.fspath(folder), engine=FolderBackend)


class FolderBackend(BackendEntrypoint):
    """The backend of ``xarray.open_dataset(folder, engine="rattlemap")``."""

    description = "Finished folders of rattlemap"
    open_dataset_parameters = ("filename_or_obj", "drop_variables")

    def open_dataset(
        self, filename_or_obj: Any, *, drop_variables: str | Iterable[str] | None = None
    ) -> xr.Dataset:
        folder = Path(os.fspath(filename_or_obj))
        manifest = json.loads(_native.manifest(os.fspath(folder)))
        ds = _diagram(folder, manifest) if manifest["command"] == "bifurcation" else _map(folder, manifest)
        ds.encoding["source"] = str(folder)
        left_out = [drop_variables] if isinstance(drop_variables, str) else [*(drop_variables or ())]
        return ds.drop_vars(left_out, errors="ignore")

    def guess_can_open(self, filename_or_obj: Any) -> bool:
        is_path = isinstance(filename_or_obj, (str, os.PathLike))
        # Opening a pipe would block.
        if not is_path or not (Path(os.fspath(filename_or_obj)) / _MANIFEST).is_file():
            return False
        manifest = Path(os.fspath(filename_or_obj)) / _MANIFEST
        try:
            return json.loads(manifest.read_text(encoding="utf-8")).get("command") in ("map", "bifurcation")
        except (OSError, ValueError, AttributeError):
            return False


def _require(folder: Path, manifest: dict[str, Any], name: str, kind: str) -> Path:
    """Return the path of a file in the folder; if it is missing, raise FolderError with the remedy."""
    path = folder / name
    if path.is_file():
        return path
    command = manifest["command"]
    if any(entry["name"] == name for entry in manifest["files"]):
        has_records = (folder / _RECORDS).is_file()
        again = f"rattlemap check {folder} --repair" if has_records else f"rattlemap {command} SCENE --out {folder} --force"
        raise FolderError(f"{folder}: {name} is missing; `{again}` recreates it")
    again = "--resume" if command == "map" else "--force"
    raise FolderError(
        f"{folder}: there is no {name}, because outputs.files of the scene lacks {kind!r}; add it and write the files again: "
        f"`rattlemap {command} SCENE --out {folder} {again}`"
    )


def _map(folder: Path, manifest: dict[str, Any]) -> xr.Dataset:
    path = _require(folder, manifest, _CELLS, "npy")
    cells = _Cells(path, int(manifest["cells"]))
    array = cells.array
    fields = array.dtype.names or ()
    if any(name in fields for name in dataset.TEXT_COLUMNS):
        _require(folder, manifest, _WORDS, "npy")

    def read(name: str, shape: tuple[int, ...], table: str | None) -> indexing.LazilyIndexedArray:
        codes = manifest["codes"].get(table)
        return indexing.LazilyIndexedArray(_Column(cells, name, shape, table, codes))

    ds = dataset.arrange(fields, manifest, array.__getitem__, read)
    if "attractor" in fields:
        # The table is written together with cells.csv.
        attractors = folder / _ATTRACTORS
        if attractors.is_file() or any(entry["name"] == _ATTRACTORS for entry in manifest["files"]):
            ds = dataset.with_attractors(ds, dataset.text_table(_require(folder, manifest, _ATTRACTORS, "csv")))
    return ds


def _diagram(folder: Path, manifest: dict[str, Any]) -> xr.Dataset:
    columns, points = (dataset.text_table(_require(folder, manifest, name, "csv")) for name in (_COLUMNS, _POINTS))
    return dataset.diagram(columns, points, manifest)


class _Cells:
    """The memory-mapped ``cells.npy`` and the texts of its words. A copy in another process maps the file again."""

    def __init__(self, path: Path, count: int) -> None:
        self.path = path.absolute()
        self.count = count

    def __getstate__(self) -> dict[str, Any]:
        return {"path": self.path, "count": self.count}

    @cached_property
    def array(self) -> npt.NDArray[Any]:
        try:
            array: npt.NDArray[Any] = np.load(self.path, mmap_mode="r", allow_pickle=False)
        except (ValueError, OSError, EOFError) as error:
            raise self._damage_error(self.path.name, str(error)) from error
        if array.shape != (self.count,) or array.dtype.names is None:
            raise self._damage_error(self.path.name, f"it has the shape {array.shape}, not ({self.count},)")
        return array

    @cached_property
    def texts(self) -> npt.NDArray[Any]:
        return dataset.text_array(dataset.text_table(self.path.with_name(_WORDS))["text"])

    def _damage_error(self, name: str, why: str) -> FolderError:
        folder = self.path.parent
        return FolderError(f"{folder}: {name} is damaged: {why}; `rattlemap check {folder} --repair` recreates it")

    def convert(self, table: str, codes: dict[str, int] | None, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
        try:
            return dataset.look_up(self.texts if codes is None else dataset.code_names(codes), rows)
        except IndexError as error:
            raise self._damage_error(_WORDS, str(error)) from error


class _Column(BackendArray):
    """A column of ``cells.npy`` over its axes, converted to text on access."""

    def __init__(
        self, cells: _Cells, name: str, shape: tuple[int, ...], table: str | None, codes: dict[str, int] | None
    ) -> None:
        self.cells, self.name, self.shape, self.table, self.codes = cells, name, shape, table, codes
        if table is None:
            self.dtype = cells.array.dtype[name]
        else:
            self.dtype = dataset.STRINGS if codes is None else dataset.code_names(codes).dtype

    def __getitem__(self, key: indexing.ExplicitIndexer) -> npt.NDArray[Any]:
        raw = indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._raw)
        return raw if self.table is None else self.cells.convert(self.table, self.codes, raw)

    def _raw(self, key: tuple[Any, ...]) -> npt.NDArray[Any]:
        return np.asarray(self.cells.array[self.name].reshape(self.shape)[key])
