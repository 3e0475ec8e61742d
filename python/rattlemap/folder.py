"""Finished folders as Datasets."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr
from xarray.backends import BackendArray, BackendEntrypoint
from xarray.core import indexing

from . import _native, dataset
from .errors import FolderError

_MANIFEST, _CELLS, _WORDS, _RECORDS = "manifest.json", "cells.npy", "words.csv", "records.bin"
_ATTRACTORS, _POINTS, _COLUMNS = "attractors.csv", "bifurcation.csv", "bifurcation_columns.csv"


def open(folder: str | os.PathLike[str]) -> xr.Dataset:  # noqa: A001
    """Open the folder of a finished map, basin map, list of cells or bifurcation diagram.

    Numbers are views of the memory-mapped file ``cells.npy``. Codes and words are converted to text on access, for the accessed
    cells only. Each file is compared with its size and hash in the manifest when it is first read: ``cells.npy``, which contains
    the axes, at once, and the table of words on access.

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
        damaged. Access to words raises it, too, if their table is damaged.

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
        with _folder_errors(folder):
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
        except (OSError, ValueError, AttributeError, RecursionError):
            return False


@contextmanager
def _folder_errors(folder: Path) -> Iterator[None]:
    """Turn every error of malformed files into FolderError."""
    try:
        yield
    except (FolderError, MemoryError):
        raise
    except Exception as error:
        why = f"{type(error).__name__}: {error}"
        raise FolderError(f"{folder}: the folder is damaged: {why}; `rattlemap check {folder}` lists damaged files") from error


class _Files:
    """The files of a finished folder, each compared with the manifest when it is first read."""

    def __init__(self, folder: Path, manifest: dict[str, Any]) -> None:
        self.folder, self.command = folder, manifest["command"]
        self.listed = {entry["name"]: (entry["bytes"], entry["sha256"]) for entry in manifest["files"]}

    def require(self, name: str, kind: str) -> None:
        """Raise FolderError with the remedy if a file is missing."""
        folder, command = self.folder, self.command
        if name in self.listed and not (folder / name).is_file():
            again = f"check {folder} --repair" if (folder / _RECORDS).is_file() else f"{command} SCENE --out {folder} --force"
            raise FolderError(f"{folder}: {name} is missing; `rattlemap {again}` recreates it")
        if name not in self.listed:
            again = "--resume" if command == "map" else "--force"
            raise FolderError(
                f"{folder}: there is no {name} in the list of {_MANIFEST}, because outputs.files of the scene lacks {kind!r}; add "
                f"it and write the files again: `rattlemap {command} SCENE --out {folder} {again}`"
            )

    def read(self, name: str, kind: str) -> pd.DataFrame:
        """Return a table with every field as text."""
        self.require(name, kind)
        content = (self.folder / name).read_bytes()
        self._compare(name, len(content), hashlib.sha256(content))
        return dataset.text_table(BytesIO(content))

    def check(self, name: str) -> None:
        """Compare a file that is not read as a whole."""
        digest, part = hashlib.sha256(), memoryview(bytearray(1 << 20))
        with (self.folder / name).open("rb", buffering=0) as file:
            while count := file.readinto(part):
                digest.update(part[:count])
            self._compare(name, file.tell(), digest)

    def _compare(self, name: str, size: int, digest: Any) -> None:
        if (size, digest.hexdigest()) != self.listed[name]:
            raise self.damage(name, f"its size or hash is not that of {_MANIFEST}")

    def damage(self, name: str, why: str) -> FolderError:
        folder = self.folder
        return FolderError(f"{folder}: {name} is damaged: {why}; `rattlemap check {folder} --repair` recreates it")


def _map(folder: Path, manifest: dict[str, Any]) -> xr.Dataset:
    files = _Files(folder.absolute(), manifest)
    files.require(_CELLS, "npy")
    cells = _Cells(files, int(manifest["cells"]))
    array = cells.array
    fields = array.dtype.names or ()
    if any(name in fields for name in dataset.TEXT_COLUMNS):
        files.require(_WORDS, "npy")

    def read(name: str, shape: tuple[int, ...], table: str | None) -> indexing.LazilyIndexedArray:
        codes = manifest["codes"].get(table)
        return indexing.LazilyIndexedArray(_Column(cells, name, shape, table, codes))

    ds = dataset.arrange(fields, manifest, array.__getitem__, read)
    # The table is written together with cells.csv.
    if "attractor" in fields and ((folder / _ATTRACTORS).is_file() or _ATTRACTORS in files.listed):
        ds = dataset.with_attractors(ds, files.read(_ATTRACTORS, "csv"))
    return ds


def _diagram(folder: Path, manifest: dict[str, Any]) -> xr.Dataset:
    files = _Files(folder.absolute(), manifest)
    columns, points = (files.read(name, "csv") for name in (_COLUMNS, _POINTS))
    return dataset.diagram(columns, points, manifest)


class _Cells:
    """The memory-mapped ``cells.npy`` and the texts of its words. A copy in another process maps the file again."""

    def __init__(self, files: _Files, count: int) -> None:
        self.files, self.count = files, count
        self.checked: tuple[int, int] | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {"files": self.files, "count": self.count, "checked": self.checked}

    @cached_property
    def array(self) -> npt.NDArray[Any]:
        path = self.files.folder / _CELLS
        with _folder_errors(self.files.folder):
            status = path.stat()
            # A copy does not compute the hash of an unchanged file again.
            if self.checked != (status.st_size, status.st_mtime_ns):
                self.files.check(_CELLS)
                self.checked = (status.st_size, status.st_mtime_ns)
            array: npt.NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
        if array.shape != (self.count,) or array.dtype.names is None:
            raise self.files.damage(_CELLS, f"it has the shape {array.shape}, not ({self.count},)")
        return array

    @cached_property
    def texts(self) -> npt.NDArray[Any]:
        return dataset.text_array(self.files.read(_WORDS, "npy")["text"])

    def convert(self, table: str, codes: dict[str, int] | None, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
        with _folder_errors(self.files.folder):
            return dataset.look_up(self.texts if codes is None else dataset.code_names(codes), rows)


class _Column(BackendArray):
    """A column of ``cells.npy`` over its axes, converted to text on access."""

    def __init__(
        self, cells: _Cells, name: str, shape: tuple[int, ...], table: str | None, codes: dict[str, int] | None
    ) -> None:
        self.cells, self.name, self.shape, self.table, self.codes = cells, name, shape, table, codes
        # Raises for a shape that does not fit, before any value is read.
        cells.array[name].reshape(shape)
        if table is None:
            self.dtype = cells.array.dtype[name]
        else:
            self.dtype = dataset.STRINGS if codes is None else dataset.code_names(codes).dtype

    def __getitem__(self, key: indexing.ExplicitIndexer) -> npt.NDArray[Any]:
        raw = indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._raw)
        return raw if self.table is None else self.cells.convert(self.table, self.codes, raw)

    def _raw(self, key: tuple[Any, ...]) -> npt.NDArray[Any]:
        return np.asarray(self.cells.array[self.name].reshape(self.shape)[key])
