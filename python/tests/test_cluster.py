"""A map on a Dask cluster: the same to the bit, whatever becomes of a worker."""

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
import xarray as xr
from rattlemap import _native, asking, cluster

distributed = pytest.importorskip("distributed")

#: What a map is on one machine, and what it took.
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


def assert_same(ds: xr.Dataset, plain: xr.Dataset) -> None:
    for either in (ds, plain):
        either.attrs = {name: value for name, value in either.attrs.items() if name not in OF_ONE_RUN}
    xr.testing.assert_identical(ds, plain)
    for name, variable in plain.variables.items():
        if variable.dtype != object:
            assert ds[name].values.tobytes() == variable.values.tobytes(), name


AXES: dict[str, Any] = {"e": (0.5, 0.99, 28), "omega": np.linspace(2, 7, 28)}
WHAT: dict[str, Any] = {"quantities": ["class", "lyapunov", "impacts", "mesh", "symmetric", "word", "pattern"]}


def test_a_worker_is_killed_on_the_way(client: Any) -> None:
    model = rm.gear_pair(F=55)
    # Work enough to be killed at.
    how: dict[str, Any] = {"engine": "cpu", "early_stop": False, "observed_periods": 256, **AXES, **WHAT}
    plain = rm.map(model, **how)
    before = client.run(os.getpid)
    killed: list[int] = []

    def kill(done: int, total: int) -> None:
        assert total == 12
        while done >= 2 and not killed:
            # One that is at work, and has nothing that has not been fetched.
            busy = [worker for worker, keys in client.processing().items() if keys]
            victims = [worker for worker in busy if not client.has_what([worker])[worker]]
            killed.extend(before[worker] for worker in victims[:1])
            for pid in killed:
                os.kill(pid, signal.SIGKILL)

    ds = rm.map(model, **how, client=client, shards=12, progress=kill)
    assert killed and killed[0] not in client.run(os.getpid).values()
    assert_same(ds, plain)
    # What was computed was computed once; the shard that was lost ended elsewhere.
    ended = client.run_on_scheduler(_ended)
    assert len(ended) == 12 and len(set(ended)) == 12, ended


def _ended(dask_scheduler: Any) -> list[str]:
    """Shards that ended on a worker, once for each time."""
    changes = [change[:3] for change in dask_scheduler.transition_log]
    return [key for key, _, state in changes if str(key).startswith("rattlemap-shard") and state == "memory"]


def test_a_shard_that_nobody_wants_ends_soon(client: Any, tmp_path: Path) -> None:
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
    assert_same(ds, plain)
    assert [path.name for path in tmp_path.iterdir()] == ["map"]
    assert_same(rm.open(tmp_path / "map"), plain)
    with pytest.raises(rm.FolderError, match="map"):
        rm.basins(model, engine="cpu", **starts, client=client, out=tmp_path / "map")


def test_what_cannot_be_split_is_refused_before_anything_is_computed(client: Any) -> None:
    model, axes = rm.gear_pair(), {"e": (0, 1, 4), "omega": (1, 12, 4)}
    with pytest.raises(rm.EngineError, match="auto may choose otherwise on another machine"):
        rm.map(model, **axes, client=client)
    with pytest.raises(rm.SceneError, match="use at most 16 shards"):
        rm.map(model, **axes, engine="cpu", client=client, shards=17)
    with pytest.raises(rm.SceneError, match="adaptive"):
        rm.map(model, **axes, engine="cpu", client=client, settings={"refine.minimum_grid": 8})
    with pytest.raises(rm.SceneError, match="give its client"):
        rm.map(model, **axes, engine="cpu", shards=2)


def test_a_part_of_another_run_ends_it_at_once(client: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    began: list[int] = []

    def of_two_runs(scene: Any, client: Any, count: int, how: cluster.How, *_: Any) -> Iterator[Path]:
        other = asking.scene(rm.gear_pair(F=51), {"e": (0, 1, 8), "omega": (1, 12, 8)}, purpose="map", axes=2)
        for index, asked in enumerate((scene, other, scene), 1):
            began.append(index)
            part = tmp_path / f"part-{index}"
            _native.shard(asked, index, count, *how[:2], str(part))
            yield part

    monkeypatch.setattr(cluster, "_parts", of_two_runs)
    with pytest.raises(rm.FolderError, match=r"F.* is 50.0 in the first and 51.0 in the other"):
        rm.map(rm.gear_pair(), e=(0, 1, 8), omega=(1, 12, 8), engine="cpu", client=client, shards=3)
    assert began == [1, 2]


def test_a_folder_that_cannot_be_used_is_refused_before_shards_are_computed(client: Any, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    told: list[int] = []
    with pytest.raises(rm.FolderError, match="the folder is not empty"):
        rm.map(
            rm.gear_pair(), **AXES, engine="cpu", client=client, out=tmp_path, progress=lambda done, _: told.append(done)
        )
    assert not told
