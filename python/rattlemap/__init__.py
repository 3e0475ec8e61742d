"""Parameter maps of vibro-impact oscillators: the program `rattlemap` as a package.

All quantities are dimensionless. The answers are those of the program, to the bit.
"""

from pathlib import Path as _Path

from . import _processor

# Before the module is loaded: what a processor does not know ends the process.
_processor.require(_Path(__file__).parent)

from . import _native  # noqa: E402
from .about import about  # noqa: E402
from .basins import basins  # noqa: E402
from .bifurcation import bifurcation  # noqa: E402
from .cells import cells  # noqa: E402
from .errors import EngineError, FolderError, ModelError, RattlemapError, SceneError  # noqa: E402
from .folder import open  # noqa: A004, E402
from .map import map  # noqa: A004, E402
from .model import Model, gear_pair, load_model  # noqa: E402
from .orbit import Orbit, orbit  # noqa: E402
from .plot import plot  # noqa: E402

__all__ = [
    "EngineError",
    "FolderError",
    "Model",
    "ModelError",
    "Orbit",
    "RattlemapError",
    "SceneError",
    "about",
    "basins",
    "bifurcation",
    "cells",
    "gear_pair",
    "load_model",
    "map",
    "open",
    "orbit",
    "plot",
]

__version__: str = _native.__version__
