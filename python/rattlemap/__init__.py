"""Parameter maps of vibro-impact oscillators: the program `rattlemap` as a package.

Quantities have the units of the model. Results are identical to those of the program, to the bit.
"""

from pathlib import Path as _Path

from . import _processor

# This check precedes the native module: an unknown instruction would end the process.
_processor.require(_Path(__file__).parent)

from . import _native  # noqa: E402
from .about import about  # noqa: E402
from .basins import basins  # noqa: E402
from .bifurcation import bifurcation  # noqa: E402
from .cells import cells  # noqa: E402
from .check import FileFault, check  # noqa: E402
from .compare import Comparison, compare  # noqa: E402
from .curves import Curves, curves  # noqa: E402
from .devices import Devices, devices  # noqa: E402
from .errors import EngineError, FolderError, ModelError, RattlemapError, SceneError  # noqa: E402
from .explore import Explorer, explore  # noqa: E402
from .folder import open  # noqa: A004, E402
from .map import map  # noqa: A004, E402
from .model import Model, gear_pair, load_model  # noqa: E402
from .models import models  # noqa: E402
from .orbit import Orbit, orbit  # noqa: E402
from .plot import plot  # noqa: E402
from .validate import Validation, validate  # noqa: E402

__all__ = [
    "Comparison",
    "Curves",
    "Devices",
    "EngineError",
    "Explorer",
    "FileFault",
    "FolderError",
    "Model",
    "ModelError",
    "Orbit",
    "RattlemapError",
    "SceneError",
    "Validation",
    "about",
    "basins",
    "bifurcation",
    "cells",
    "check",
    "compare",
    "curves",
    "devices",
    "explore",
    "gear_pair",
    "load_model",
    "map",
    "models",
    "open",
    "orbit",
    "plot",
    "validate",
]

__version__: str = _native.__version__
