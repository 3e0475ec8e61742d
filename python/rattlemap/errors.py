"""What goes wrong, as exceptions. Texts are those of the program: what, where, and what to do about it."""

from __future__ import annotations


class RattlemapError(Exception):
    """Everything that rattlemap raises on its own account."""


class FolderError(RattlemapError, ValueError):
    """A folder that cannot be opened: it is not finished, not whole, or not of a map."""
