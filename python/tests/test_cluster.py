"""A map on a Dask cluster: equal to the bit, even if a worker is killed."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rattlemap as rm
from conftest import assert_same
from rattlemap import _native, cluster, scenes

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.long

#: Attributes that differ between a map of one run and a merged map.
OF_ONE_RUN = ("commit", "processor", "shards", "elapsed_seconds", "timings")


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """A cluster of two processes with a thread each."""
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as local,
        distributed.Client(local) as client,
    ):
        yield client


AXES: dict[str, Any] = {"e": (0.5, 0.99, 20), "omega": np.linspace(2, 7, 20)}
WHAT: dict[str, Any] = {"quantities": ["class", "lyapunov", "impacts", "mesh", "symmetric", "word", "pattern"]}


def test_the_shards_of_a_killed_worker_are_computed_by_another(client: Any) -> None:
    model = rm.gear_pair(F=55)
    # Long enough that a worker can be killed in time.
    how: dict[str, Any] = {"engine": "cpu", "early_stop": False, "observed_periods": 256, **AXES, **WHAT}
    plain = rm.map(model, **how)
    before = client.run(os.getpid)
    killed: list[int] = []

    def kill(done: int, total: int) -> None:
        assert total == 12
        while done >= 2 and not killed:
            # A busy worker whose results have all been fetched.
            busy = [worker for worker, keys in client.processing().items() if keys]
            victims = [worker for worker in busy if not client.has_what([worker])[worker]]
            killed.extend(before[worker] for worker in victims[:1])
            for pid in killed:
                os.kill(pid, signal.SIGKILL)

    ds = rm.map(model, **how, client=client, shards=12, progress=kill)
    assert killed and killed[0] not in client.run(os.getpid).values()
    assert_same(ds, plain, OF_ONE_RUN)
    # Each shard was finished once.
    ended = client.run_on_scheduler(_ended)
    assert len(ended) == 12 and len(set(ended)) == 12, ended


def _ended(dask_scheduler: Any) -> list[str]:
    """Returns a key each time that a shard ended on a worker."""
    changes = [change[:3] for change in dask_scheduler.transition_log]
    return [key for key, _, state in changes if str(key).startswith("rattlemap-shard") and state == "memory"]


def test_an_abandoned_shard_ends_soon(client: Any, tmp_path: Path) -> None:
    long: dict[str, Any] = {"early_stop": False, "observed_periods": 200_000, "e": (0.5, 0.99, 64), "omega": (2, 7, 64)}

    def give_up() -> None:
        while not any(client.processing().values()):
            time.sleep(0.05)
        time.sleep(0.5)
        signal.raise_signal(signal.SIGINT)

    threading.Thread(target=give_up).start()
    with pytest.raises(KeyboardInterrupt):
        rm.map(rm.gear_pair(), **long, engine="cpu", client=client, shards=4, progress=False, out=tmp_path / "map")
    began = time.monotonic()
    while any(client.run(_executing).values()):
        assert time.monotonic() - began < 5
        time.sleep(0.05)
    assert not any(tmp_path.iterdir())


def _executing(dask_worker: Any) -> int:
    return int(dask_worker.state.executing_count)


def test_a_folder_and_basins(client: Any, tmp_path: Path) -> None:
    model = rm.gear_pair(e=0.98, omega=9.2)
    starts: dict[str, Any] = {"x1": (-0.6, 0.6, 12), "v1": (-6, 6, 9)}
    plain = rm.basins(model, engine="cpu", **starts)
    ds = rm.basins(model, engine="cpu", **starts, client=client, shards=3, out=tmp_path / "map")
    assert ds.attrs["shards"] == 3
    assert_same(ds, plain, OF_ONE_RUN)
    assert [path.name for path in tmp_path.iterdir()] == ["map"]
    assert_same(rm.open(tmp_path / "map"), plain, OF_ONE_RUN)
    with pytest.raises(rm.FolderError, match="map"):
        rm.basins(model, engine="cpu", **starts, client=client, out=tmp_path / "map")


def test_maps_that_cannot_be_split_are_refused(client: Any) -> None:
    model, axes = rm.gear_pair(), {"e": (0, 1, 4), "omega": (1, 12, 4)}
    with pytest.raises(rm.EngineError, match='engine="auto" may choose different engines on different machines'):
        rm.map(model, **axes, client=client)
    with pytest.raises(rm.SceneError, match="use at most 16 shards"):
        rm.map(model, **axes, engine="cpu", client=client, shards=17)
    with pytest.raises(rm.SceneError, match="adaptive"):
        rm.map(model, **axes, engine="cpu", client=client, settings={"refine.minimum_grid": 8})
    with pytest.raises(rm.SceneError, match="give its client"):
        rm.map(model, **axes, engine="cpu", shards=2)


def test_a_shard_of_another_map_is_refused_at_once(client: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    began: list[int] = []

    def of_two_runs(scene: Any, client: Any, count: int, choice: cluster.Choice, *_: Any) -> Iterator[Path]:
        other = scenes.scene_of(rm.gear_pair(F=51), None, {"e": (0, 1, 8), "omega": (1, 12, 8)}, purpose="map", axes=2)
        for index, request in enumerate((scene, other, scene), 1):
            began.append(index)
            part = tmp_path / f"part-{index}"
            _native.shard(request, index, count, *choice[:2], str(part))
            yield part

    monkeypatch.setattr(cluster, "_parts", of_two_runs)
    with pytest.raises(rm.FolderError, match=r"F.* is 50.0 in the first and 51.0 in the other"):
        rm.map(rm.gear_pair(), e=(0, 1, 8), omega=(1, 12, 8), engine="cpu", client=client, shards=3)
    assert began == [1, 2]


def test_a_full_folder_is_refused_before_shards_are_computed(client: Any, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    reports: list[int] = []
    with pytest.raises(rm.FolderError, match="the folder is not empty"):
        rm.map(
            rm.gear_pair(), **AXES, engine="cpu", client=client, out=tmp_path, progress=lambda done, _: reports.append(done)
        )
    assert not reports
