"""What is installed."""

from __future__ import annotations

import warnings

from . import _native, _processor


def about() -> dict[str, str]:
    """What is installed, for a report of a fault or for a manuscript.

    Returns
    -------
    dict
        ``version``; ``sources``, the hash of what decides the bits of results: two installations with the same
        ``sources`` and ``target`` can compute parts of one map; ``target``, the system and the processor features that
        the module was built for; ``note``, empty unless a faster build would run here.
    """
    note = _processor.slower(_native.TARGET) or ""
    return {"version": _native.__version__, "sources": _native.SOURCES, "target": _native.TARGET, "note": note}


if _slower := _processor.slower(_native.TARGET):
    warnings.warn(_slower, RuntimeWarning, stacklevel=2)
