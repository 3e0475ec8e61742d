"""What goes wrong, as exceptions: their texts are those of the program."""

__all__ = ["EngineError", "FolderError", "ModelError", "RattlemapError", "SceneError"]


class RattlemapError(Exception):
    """The base of all exceptions of this package."""


class SceneError(RattlemapError, ValueError):
    """What is asked is wrong: an unknown name, a value out of its range, axes that do not fit."""


class ModelError(RattlemapError, ValueError):
    """A model's file is wrong, or the model has no motion at the values that it is given."""


class EngineError(RattlemapError, RuntimeError):
    """The engine that is asked for is not there, or failed on the way."""


class FolderError(RattlemapError, ValueError):
    """A folder cannot be opened: it is not finished, not whole, or not of a map."""
