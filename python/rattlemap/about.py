"""Version and build of the package."""

from __future__ import annotations

import warnings

from . import _native, _processor


def about() -> dict[str, str]:
    """Return version and build, for an error report or a manuscript.

    Returns
    -------
    dict
        ``version``. ``sources``, the hash of the sources that decide the bits of results: two installations with equal
        ``sources`` and ``target`` can compute parts of one map. ``target``, the system and the processor features that the
        module was built for. ``note``, a remark if a faster build would run here, otherwise empty.

    Examples
    --------
    >>> rm.about()["version"] == rm.__version__
    True
    """
    note = _processor.slower(_native.TARGET) or ""
    return {"version": _native.__version__, "sources": _native.SOURCES, "target": _native.TARGET, "note": note}


if _slower := _processor.slower(_native.TARGET):
    warnings.warn(_slower, RuntimeWarning, stacklevel=2)
