"""Parameter maps of vibro-impact oscillators: the program `rattlemap` as a package.

All quantities are dimensionless. The answers are those of the program, to the bit.
"""

from pathlib import Path as _Path

from . import _processor

# Before the module is loaded: what a processor does not know ends the process.
_processor.require(_Path(__file__).parent)

from . import _native  # noqa: E402
from .about import about  # noqa: E402
from .errors import EngineError, FolderError, ModelError, RattlemapError, SceneError  # noqa: E402
from .folder import open  # noqa: A004, E402

__all__ = ["EngineError", "FolderError", "ModelError", "RattlemapError", "SceneError", "about", "open"]

__version__: str = _native.__version__
