"""Exceptions of the package. Their messages are the program's, in the terms of Python."""

from .terms import in_python

__all__ = ["EngineError", "FolderError", "ModelError", "RattlemapError", "SceneError"]


class RattlemapError(Exception):
    """Base class of all exceptions of this package."""

    def __init__(self, message: str = "") -> None:
        super().__init__(in_python(message))


class SceneError(RattlemapError, ValueError):
    """The request is wrong: an unknown name, a value out of its range, unsuitable axes, or a map larger than this machine."""


class ModelError(RattlemapError, ValueError):
    """The file of a model is wrong, or the model has no motion at some values of its parameters."""


class EngineError(RattlemapError, RuntimeError):
    """The requested engine does not exist on this machine, or it failed."""


class FolderError(RattlemapError, ValueError):
    """A folder cannot be used: it is not finished, damaged, not a map's, or not empty."""
