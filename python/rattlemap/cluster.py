"""Maps on a Dask cluster: shards on its workers, merged here."""

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
    from .progress import Tell

#: Engine, precision, adapter.
How = tuple[str, str | None, str | None]

#: Shards for each thread of the cluster unless told: shards differ in what they cost, and the last ones should be short.
SHARDS_PER_THREAD = 4
#: Runs that a shard of those has at least.
FEWEST_RUNS = 64

#: What merging compares, as far as manifests tell it.
_IDENTITY = ("engine", "precision", "device", "sources", "target", "set", "scene")

#: A card computes one shard of a worker at a time.
_CARD = threading.Lock()


class _Cancelled(Exception):
    """Nobody waits for the shard any more."""


def merged(
    scene: _native.Scene,
    client: Any,
    *,
    how: How,
    shards: int | None,
    out: str | None,
    force: bool,
    tell: Tell | None,
) -> _native.MadeMap:
    """A map whose shards the workers of a cluster compute.

    A task is a shard and takes one thread of its worker; on a graphics card a worker computes one shard at a time. What a
    worker has computed is fetched at once, so that a worker that is lost costs the shards it was at, which Dask gives to
    others.

    Parameters
    ----------
    scene
        What is asked.
    client
        A ``distributed.Client``; the workers have this package, built from the same sources.
    how
        Engine, precision and adapter as :func:`rattlemap.map` takes them, but for ``"auto"``.
    shards
        How many; 4 for each thread of the cluster unless told.
    out, force
        As :func:`rattlemap.map` takes them.
    tell
        Called with the shards that are there and their number.

    Raises
    ------
    SceneError
        If the engine is left open, the map cannot be split, or workers are of different builds: with the program's words.
    EngineError
        If a worker's engine fails.
    distributed.KilledWorker
        If a shard ends its worker time and again.
    """
    if getattr(client, "asynchronous", False):
        raise SceneError("the client is asynchronous, and this call waits for it; make one with Client(...) outside of a coroutine")
    count = _default_count(scene, client) if shards is None else shards
    _native.check_shards(scene, count, *how, out, force)
    beside = None if out is None else Path(out).absolute().parent
    if beside is not None:
        beside.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".rattlemap-parts-", dir=beside) as root:
        parts = []
        for part in _parts(scene, client, count, how, Path(root)):
            parts.append(part)
            _require_same_run(parts)
            if tell is not None:
                tell(len(parts), count)
        where = os.path.join(root, "map") if out is None else out
        return _native.merge([*map(str, parts)], where, force, out is not None)


def _default_count(scene: _native.Scene, client: Any) -> int:
    threads: int = sum(client.nthreads().values())
    return max(1, min(SHARDS_PER_THREAD * max(threads, 1), scene.runs // FEWEST_RUNS))


def _parts(scene: _native.Scene, client: Any, count: int, how: How, root: Path) -> Iterator[Path]:
    """The shards' folders, as they come; those that are not wanted any more are cancelled."""
    import distributed

    as_completed: Any = distributed.as_completed
    run = uuid4().hex
    index_of = {
        client.submit(
            _shard, scene, index, count, how, key=f"rattlemap-shard-{run}-{index}-of-{count}", pure=False
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
    """Refuses at once what merging would refuse at the end."""
    first, last = (_identity(part) for part in (parts[0], parts[-1]))
    if first != last:
        _native.merge([str(parts[0]), str(parts[-1])], str(parts[0].parent / "refused"), False, False)


def _identity(part: Path) -> list[Any]:
    manifest = json.loads((part / "manifest.json").read_text(encoding="utf-8"))
    return [manifest.get(name) for name in _IDENTITY]


def _shard(scene: _native.Scene, index: int, count: int, how: How) -> dict[str, bytes]:
    """Computes a shard, on a worker: the files of its folder."""
    from distributed import get_worker

    engine, precision, adapter = how
    worker = get_worker()
    key = worker.get_current_task()

    def tell(_done: int, _total: int) -> None:
        task = worker.state.tasks.get(key)
        if task is None or task.state == "cancelled":
            raise _Cancelled

    with (
        tempfile.TemporaryDirectory(prefix="rattlemap-", dir=worker.local_directory) as root,
        _CARD if engine == "gpu" else nullcontext(),
    ):
        folder = Path(root) / "part"
        tell(0, 0)
        _native.shard(scene, index, count, engine, precision, str(folder), threads=1, progress=tell, adapter=adapter)
        return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
