"""Can this processor run the native module? Asked before it is loaded: the first instruction that is unknown ends a process.

On x86-64 the module is built for AVX2 and FMA, unless ``RUSTFLAGS`` said otherwise.
"""

from __future__ import annotations

import ctypes
import mmap
import platform
import re
import sys
from pathlib import Path

#: What the module is built for, by the compiler's names.
NEEDED = frozenset(("avx2", "fma"))
#: What is told where the processor lacks it.
MISFIT = (
    "rattlemap was built for processors with AVX2 and FMA, and this one lacks {lacking}; build it for this one, in its "
    'sources: RUSTFLAGS="" pip install --force-reinstall ./python'
)
#: What is told where it was built without, and the processor has it.
SLOWER = (
    "rattlemap was built without {missing}, which this processor has: the reference takes about twice as long; build it "
    "again, in its sources, with RUSTFLAGS unset: pip install --force-reinstall ./python"
)

# What build.rs notes of the target, among the module's constants.
_TARGET = re.compile(rb"x86_64-[a-z0-9_-]+ ([a-z0-9.,_-]+)")


def require(package: Path) -> None:
    """Refuse a processor that lacks what the native module in this folder was built for.

    Raises
    ------
    ImportError
        With the remedy.
    """
    lacking = NEEDED - features()
    # The module is looked into on old processors alone: it has tens of megabytes.
    if lacking:
        lacking &= built_for(package)
    if lacking:
        raise ImportError(MISFIT.format(lacking=_listed(lacking)))


def slower(target: str) -> str | None:
    """What to tell of a module that was built for less than this processor has; ``target`` as manifests have it."""
    if not target.startswith("x86_64-"):
        return None
    missing = (NEEDED - frozenset(target.partition(" ")[2].split(","))) & features()
    return SLOWER.format(missing=_listed(missing)) if missing and is_x86() else None


def built_for(package: Path) -> frozenset[str]:
    """What the native module in this folder was built for; all that is needed if it does not tell."""
    for path in sorted(package.glob("_native.*")):
        if path.suffix in (".so", ".pyd"):
            with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as module:
                found = _TARGET.search(module)
                if found:
                    return frozenset(found[1].decode().split(","))
    return NEEDED


def is_x86() -> bool:
    """Whether this process runs x86-64 instructions."""
    return platform.machine().lower() in ("x86_64", "amd64")


def features() -> frozenset[str]:
    """Which of :data:`NEEDED` this processor has; all of them where they cannot lack or nothing tells."""
    if not is_x86():
        return NEEDED
    try:
        if sys.platform == "linux":
            told = of_glibc()
            return of_cpuinfo(Path("/proc/cpuinfo").read_text(errors="replace")) if told is None else told
        if sys.platform == "win32":
            return _of_windows()
        if sys.platform == "darwin":
            return _of_macos()
    except (OSError, AttributeError, ValueError):
        pass
    return NEEDED


def of_glibc() -> frozenset[str] | None:
    """What CPUID says, by glibc 2.33 and later (sys/platform/x86.h); nothing where there is none."""
    leaf_of = getattr(ctypes.CDLL(None), "__x86_get_cpuid_feature_leaf", None)
    if leaf_of is None:
        return None

    class Leaf(ctypes.Structure):
        # eax, ebx, ecx, edx as CPUID has them, then those that the system lets programs use.
        _fields_ = [("told", ctypes.c_uint * 4), ("active", ctypes.c_uint * 4)]

    leaf_of.argtypes, leaf_of.restype = [ctypes.c_uint], ctypes.POINTER(Leaf)
    # CPUID_INDEX_1 and CPUID_INDEX_7. Bits: Intel, Software developer's manual 2A, CPUID.
    basic, extended = leaf_of(0).contents.active, leaf_of(1).contents.active
    has = {"fma": basic[2] >> 12 & 1, "avx2": extended[1] >> 5 & 1}
    return frozenset(name for name, bit in has.items() if bit)


def of_cpuinfo(text: str) -> frozenset[str]:
    """What the flags of /proc/cpuinfo say; all where there are none."""
    flags = re.search(r"^flags\s*:(.*)$", text, re.MULTILINE)
    return NEEDED if flags is None else NEEDED.intersection(flags[1].split())


def _of_windows() -> frozenset[str]:
    # PF_AVX2_INSTRUCTIONS_AVAILABLE. Windows has no number for FMA, which came with AVX2.
    has_avx2 = ctypes.windll.kernel32.IsProcessorFeaturePresent(40)  # type: ignore[attr-defined,unused-ignore]
    return NEEDED if has_avx2 else frozenset()


def _of_macos() -> frozenset[str]:
    system = ctypes.CDLL(None)

    def is_set(name: bytes) -> bool:
        value, size = ctypes.c_int(0), ctypes.c_size_t(ctypes.sizeof(ctypes.c_int))
        failed = system.sysctlbyname(name, ctypes.byref(value), ctypes.byref(size), None, ctypes.c_size_t(0))
        return not failed and bool(value.value)

    names = {"avx2": b"hw.optional.avx2_0", "fma": b"hw.optional.fma"}
    return frozenset(name for name, key in names.items() if is_set(key))


def _listed(names: frozenset[str]) -> str:
    return " and ".join(sorted(name.upper() for name in names))
