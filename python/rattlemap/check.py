"""Check of the files of a finished folder."""

from __future__ import annotations

import os
from typing import NamedTuple

from . import _native
from .engine import warn


class FileFault(NamedTuple):
    """A file that differs from the manifest of its folder."""

    name: str
    """Name in the folder."""
    kind: str
    """``damaged``, ``missing``, or ``unknown``: the manifest does not list the file."""
    reason: str
    """Description of the damage; otherwise empty."""
    is_repaired: bool
    """Whether the file has been recreated."""


def check(folder: str | os.PathLike[str], repair: bool = False) -> list[FileFault]:
    """Compare the files of a folder with its manifest, like ``rattlemap check``.

    Parameters
    ----------
    folder
        Folder that any command of the program, or ``out=``, has written.
    repair
        Whether to recreate damaged and missing tables, figures and the report of a map from its records.

    Returns
    -------
    list of FileFault
        Files that differ from the manifest; empty if all agree.

    Raises
    ------
    FolderError
        If the folder has no readable manifest, or ``repair`` is true and a damaged file cannot be recreated from the records.

    Examples
    --------
    >>> _ = rm.map(rm.gear_pair(), e=(0, 1, 4), omega=(1, 12, 4), engine="cpu", out="checked", force=True)
    >>> rm.check("checked")
    []
    """
    faults, repaired, warnings = _native.check_folder(os.fspath(folder), repair)
    warn(warnings)
    return [FileFault(*fault, fault[0] in repaired) for fault in faults]
