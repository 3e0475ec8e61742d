"""Maps on a Dask cluster: the workers compute shards, which are merged here."""

from __future__ import annotations

import json
import os
import tempfile
import threading
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from . import _native
from .errors import SceneError

if TYPE_CHECKING:
    from .progress import Report

#: Engine, precision and adapter.
Choice = tuple[str, str | None, str | None]

#: Default number of shards per thread of the cluster. Shards differ in cost, so small ones balance the load at the end.
SHARDS_PER_THREAD = 4
#: Least number of runs of a shard, if the number of shards is the default.
FEWEST_RUNS = 64

#: Fields of a manifest that must agree between shards.
_IDENTITY = ("engine", "precision", "device", "sources", "target", "set", "scene")

#: Lock, because a worker computes one shard at a time on its card.
_CARD = threading.Lock()


class _Cancelled(Exception):
    """The client no longer needs the shard."""


def compute_shards(
    scene: _native.Scene,
    client: Any,
    *,
    choice: Choice,
    shards: int | None,
    out: str | None,
    force: bool,
    report: Report | None,
) -> _native.MapResult:
    """Return a map whose shards the workers of a cluster compute.

    Each task computes a shard on one thread of its worker; on a graphics card a worker computes one shard at a time. A finished
    shard is fetched at once. If a worker is lost, Dask gives its unfinished shards to other workers. ``report`` receives the
    number of finished shards and of all shards.
    """
    if getattr(client, "asynchronous", False):
        raise SceneError("the client is asynchronous, and this call waits for results; make one with Client(...) outside of a coroutine")
    count = _default_count(scene, client) if shards is None else shards
    _native.check_shards(scene, count, *choice, out, force)
    parent = None if out is None else Path(out).absolute().parent
    if parent is not None:
        parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".rattlemap-parts-", dir=parent) as root:
        parts = []
        for part in _parts(scene, client, count, choice, Path(root)):
            parts.append(part)
            _require_same_run(parts)
            if report is not None:
                report(len(parts), count)
        folder = os.path.join(root, "map") if out is None else out
        return _native.merge([*map(str, parts)], folder, force, out is not None)


def _default_count(scene: _native.Scene, client: Any) -> int:
    threads: int = sum(client.nthreads().values())
    return max(1, min(SHARDS_PER_THREAD * max(threads, 1), scene.runs // FEWEST_RUNS))


def _parts(scene: _native.Scene, client: Any, count: int, choice: Choice, root: Path) -> Iterator[Path]:
    """Yield the folders of finished shards. If the caller stops, the other shards are cancelled."""
    import distributed

    as_completed: Any = distributed.as_completed
    run = uuid4().hex
    index_of = {
        client.submit(
            _shard, scene, index, count, choice, key=f"rattlemap-shard-{run}-{index}-of-{count}", pure=False
        ): index
        for index in range(1, count + 1)
    }
    try:
        for future, files in as_completed([*index_of], with_results=True):
            folder = root / f"shard-{index_of[future]}-of-{count}"
            folder.mkdir()
            for name, content in files.items():
                (folder / name).write_bytes(content)
            future.release()
            yield folder
    finally:
        client.cancel([*index_of])


def _require_same_run(parts: list[Path]) -> None:
    """Raise at once the error that merging would raise at the end."""
    first, last = (_identity(part) for part in (parts[0], parts[-1]))
    if first != last:
        _native.merge([str(parts[0]), str(parts[-1])], str(parts[0].parent / "refused"), False, False)


def _identity(part: Path) -> list[Any]:
    manifest = json.loads((part / "manifest.json").read_text(encoding="utf-8"))
    return [manifest.get(name) for name in _IDENTITY]


def _shard(scene: _native.Scene, index: int, count: int, choice: Choice) -> dict[str, bytes]:
    """Compute a shard on a worker. Returns the files of its folder."""
    from distributed import get_worker

    engine, precision, adapter = choice
    worker = get_worker()
    key = worker.get_current_task()

    def check(_done: int, _total: int) -> None:
        task = worker.state.tasks.get(key)
        if task is None or task.state == "cancelled":
            raise _Cancelled

    with (
        tempfile.TemporaryDirectory(prefix="rattlemap-", dir=worker.local_directory) as root,
        _CARD if engine == "gpu" else nullcontext(),
    ):
        folder = Path(root) / "part"
        check(0, 0)
        _native.shard(scene, index, count, engine, precision, str(folder), threads=1, progress=check, adapter=adapter)
        return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
