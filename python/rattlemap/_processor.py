"""Check of the processor before the native module is loaded: an unknown instruction would end the process.

On x86-64 the module is built for AVX2 and FMA, unless ``RUSTFLAGS`` is set otherwise.
"""

from __future__ import annotations

import importlib
import mmap
import os
import platform
import re
from pathlib import Path

#: Processor features of the default build, by the compiler's names, with NumPy's names.
NEEDED = {"avx2": "AVX2", "fma": "FMA3"}
#: Message if the processor lacks features of the build.
MISFIT = (
    "rattlemap was built for processors with AVX2 and FMA, and this one lacks {lacking}; build it for this one in the "
    'source folder: RUSTFLAGS="" pip install --force-reinstall ./python'
)
#: Message if the processor has features that the build does not use.
SLOWER = (
    "rattlemap was built without {missing}, which this processor has: the reference takes about twice as long; build it "
    "again in the source folder, with RUSTFLAGS unset: pip install --force-reinstall ./python"
)

# The target among the module's constants, as build.rs writes it.
_TARGET = re.compile(rb"x86_64-[a-z0-9_-]+ ([a-z0-9.,_-]+)")


def require(package: Path) -> None:
    """Raise ImportError, with the remedy, if the processor lacks features that the native module in this folder was built for."""
    lacking = NEEDED.keys() - features()
    # The module has tens of megabytes, so it is searched only on old processors.
    if lacking:
        lacking &= built_for(package)
    if lacking:
        raise ImportError(MISFIT.format(lacking=_list(lacking)))


def slower(target: str) -> str | None:
    """Return a message if the build does not use all features of this processor. ``target`` is the field of manifests."""
    if not target.startswith("x86_64-"):
        return None
    missing = (NEEDED.keys() - {*target.partition(" ")[2].split(",")}) & features()
    return SLOWER.format(missing=_list(missing)) if missing and is_x86() else None


def built_for(package: Path) -> frozenset[str]:
    """Return the features that the native module in this folder was built for; :data:`NEEDED` if it does not list them."""
    for path in sorted(package.glob("_native.*")):
        if path.suffix in (".so", ".pyd"):
            with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as module:
                found = _TARGET.search(module)
                if found:
                    return frozenset(found[1].decode().split(","))
    return frozenset(NEEDED)


def is_x86() -> bool:
    """Whether this process runs x86-64 instructions."""
    return platform.machine().lower() in ("x86_64", "amd64")


def features() -> frozenset[str]:
    """Return the features of :data:`NEEDED` that this processor has; all if NumPy does not report them, or off x86-64."""
    # With this variable NumPy reports less than the processor has.
    if not is_x86() or "NPY_DISABLE_CPU_FEATURES" in os.environ:
        return frozenset(NEEDED)
    for package in ("numpy._core", "numpy.core"):
        try:
            reported = importlib.import_module(f"{package}._multiarray_umath").__cpu_features__
        except (ImportError, AttributeError):
            continue
        return frozenset(name for name, of_numpy in NEEDED.items() if reported.get(of_numpy, True))
    return frozenset(NEEDED)


def _list(names: set[str]) -> str:
    return " and ".join(sorted(name.upper() for name in names))
