"""Progress of a long computation, for a function, or for a bar of tqdm if it is installed."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

#: Receives the number of finished units and the total, several times a second, on the thread that called the package.
Report = Callable[[int, int], object]

#: Seconds before a bar appears.
_DELAY = 0.5


@contextmanager
def reporter(progress: bool | Report, unit: str) -> Iterator[Report | None]:
    """Provide the function that receives progress: ``progress`` itself, or if it is True a bar of tqdm that counts ``unit``s."""
    if callable(progress):
        yield progress
        return
    if not progress:
        yield None
        return
    try:
        from tqdm import TqdmWarning
        from tqdm.auto import tqdm
    except ImportError:
        yield None
        return
    bar: Any = None

    def report(done: int, total: int) -> None:
        nonlocal bar
        if bar is None:
            with warnings.catch_warnings():
                # A notebook without widgets gets a bar of text.
                warnings.simplefilter("ignore", TqdmWarning)
                bar = tqdm(total=total, initial=done, unit=f" {unit}", leave=False, delay=_DELAY)
        # The total of an adaptive map grows.
        bar.total = total
        bar.update(done - bar.n)

    try:
        yield report
    finally:
        if bar is not None:
            bar.close()
