"""Progress of a long computation: told to a function, or shown by tqdm where that is installed."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

#: Called with what is done and the total, some times a second, from the thread that called the package.
Tell = Callable[[int, int], object]

#: Seconds that pass before a bar is shown.
_DELAY = 0.5


@contextmanager
def telling(progress: bool | Tell, unit: str) -> Iterator[Tell | None]:
    """What to tell of progress: a function of one's own, a bar of tqdm, or none.

    Parameters
    ----------
    progress
        A function, which may raise to end the computation; True for a bar; False for silence.
    unit
        What is counted.
    """
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

    def tell(done: int, total: int) -> None:
        nonlocal bar
        if bar is None:
            with warnings.catch_warnings():
                # A notebook without widgets gets a bar of text.
                warnings.simplefilter("ignore", TqdmWarning)
                bar = tqdm(total=total, initial=done, unit=f" {unit}", leave=False, delay=_DELAY)
        # That of an adaptive map grows.
        bar.total = total
        bar.update(done - bar.n)

    try:
        yield tell
    finally:
        if bar is not None:
            bar.close()
