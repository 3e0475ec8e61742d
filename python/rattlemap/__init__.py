"""Parameter maps of vibro-impact oscillators: the program `rattlemap` as a package.

All quantities are dimensionless. The answers are those of the program, to the bit.
"""

from . import _native
from .errors import EngineError, ModelError, RattlemapError, SceneError

__all__ = ["EngineError", "ModelError", "RattlemapError", "SceneError"]

__version__: str = _native.__version__
