"""rattlemap.map: equal to the program's map; errors, interruption and resuming."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import rattlemap as rm
import xarray as xr
from conftest import SCENES, Program, Rerun, assert_same

ALL = ["class", "lyapunov", "impacts", "mesh", "symmetric", "word", "pattern"]
SMALL = {"e": (0.0, 1.0, 12), "omega": (1.0, 12.0, 9)}


def test_a_map_is_the_programs(map_folder: Path) -> None:
    folder = rm.open(map_folder)
    ds = rm.map(rm.gear_pair(F=50), e=(0, 1, 24), omega=(1, 12, 18), engine="cpu", quantities=ALL, undecided_periods=1584)
    ds.attrs.update({name: folder.attrs[name] for name in ("title", "quantities")})
    assert_same(ds, folder)
    sets = ["axis.0.count=24", "axis.1.count=18", "outputs.files=['csv', 'npy']"]
    assert_same(rm.map(scene=SCENES / "e_omega.toml", set=sets, engine="cpu"), folder)


def test_files_are_the_programs(rerun: Rerun, tmp_path: Path) -> None:
    model = rm.gear_pair(F=60)
    ds = rm.map(model, **SMALL, engine="cpu", start="up", max_period=16, k=90, out=tmp_path / "python")
    assert_same(ds, rerun(ds))
    names = {path.name for path in (tmp_path / "program").iterdir()}
    assert {path.name for path in (tmp_path / "python").iterdir()} == names
    for name in names - {"manifest.json", "records.bin"}:
        assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "program" / name).read_bytes(), name
    assert {"F = 60.0", "k = 90.0", "max_period = 16", 'policy = "up"'} <= {*ds.attrs["scene"].splitlines()}
    with pytest.raises(rm.FolderError, match="the folder is not empty"):
        rm.map(model, **SMALL, engine="cpu", out=tmp_path / "python")


def test_values_of_an_array_are_exact() -> None:
    values = np.linspace(0.1, 0.9, 7)
    ds = rm.map(rm.gear_pair(), omega=[2.0, 5.6, np.nextafter(5.6, 6)], e=values, engine="cpu")
    assert ds["e"].values.tobytes() == values.tobytes()
    assert ds["omega"].values.tolist() == [2.0, 5.6, np.nextafter(5.6, 6)]
    assert ds["lyapunov"].dims == ("e", "omega")
    # The program's axis, and one that differs from it in the last digit of a value.
    linear = np.minimum(0.1 + 0.8 * np.arange(7.0) / 6, 0.9)
    scene = rm.map(rm.gear_pair(), e=linear, omega=(2, 6, 2), engine="cpu").attrs["scene"]
    assert "count = 7" in scene and "values" not in scene
    linear[3] = np.nextafter(linear[3], 1)
    assert "values" in rm.map(rm.gear_pair(), e=linear, omega=(2, 6, 2), engine="cpu").attrs["scene"]


def test_lanes_are_the_programs(rerun: Rerun, tmp_path: Path) -> None:
    # Without words and exponents a software driver compiles in half the time.
    axes = {"e": (0.1, 0.9, 3), "omega": (4.0, 8.0, 2), "quantities": ["impacts"]}
    ds = rm.map(rm.gear_pair(), **axes, engine="gpu", out=tmp_path / "python")
    assert (ds.attrs["engine"], ds.attrs["precision"]) == ("gpu", "f32")
    assert_same(ds, rerun(ds, engine="gpu"))
    number = json.loads(ds.attrs["adapter"])["number"]
    with pytest.raises(rm.EngineError, match="^adapter=99: "):
        rm.map(rm.gear_pair(), **axes, engine="gpu", adapter=99)
    assert_same(rm.map(rm.gear_pair(), **axes, engine="gpu", adapter=number), ds)


def test_adaptive_maps_and_several_starts(rerun: Rerun) -> None:
    model = rm.gear_pair()
    settings = {"refine.minimum_grid": 4, "refine.audit": 5}
    adaptive = rm.map(model, e=(0, 1, 17), omega=(1, 12, 17), engine="cpu", settings=settings)
    assert_same(adaptive, rerun(adaptive, out="adaptive"))
    settings = {"start.count": 3, "start.seed": 7}
    starts = rm.map(model, e=(0, 1, 6), omega=(1, 12, 6), engine="cpu", settings=settings)
    assert_same(starts, rerun(starts, out="starts"))
    assert "attractors" in starts


def test_derived_parameters_replace_the_models_values(rerun: Rerun) -> None:
    settings = {"derived.k2": "0.5*k1", "integration.max_period": 8}
    ds = rm.map(rm.gear_pair(k2=40), k1=(20, 40, 4), omega=(2, 6, 3), engine="cpu", settings=settings)
    assert_same(ds, rerun(ds))
    assert json.loads(ds.attrs["derived"])["k2"]["max"] == 20.0


def test_a_model_of_a_file(rerun: Rerun, tmp_path: Path) -> None:
    text = (SCENES.parent / "models/impact_oscillator.toml").read_text()
    (tmp_path / "mine.toml").write_text(text.replace('name = "impact-oscillator"', 'name = "mine"'))
    model = rm.load_model(tmp_path / "mine.toml", omega=2.8)
    assert pickle.loads(pickle.dumps(model)) == model and model.parameters["omega"] == 2.8
    ds = rm.map(model, zeta=(0.01, 0.02, 3), F=(0.5, 1.0, 3), engine="cpu", out=tmp_path / "python")
    assert (tmp_path / "python/model.toml").read_text() == model.text
    assert_same(ds, rerun(ds))


def test_columns_are_not_copied() -> None:
    values = rm.map(rm.gear_pair(), **SMALL, engine="cpu")["lyapunov"].values
    owner = values
    while isinstance(owner, np.ndarray):
        last, owner = owner, owner.base
    assert type(owner).__name__ == "PySliceContainer" and not last.flags.owndata


def test_errors_are_the_programs(program: Program, tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(
        "[[axis]]\nparameter = 'e'\nmin = 0\nmax = 1.5\ncount = 4\n[[axis]]\nparameter = 'omega'\nmin = 1\nmax = 2\ncount = 4\n"
    )
    printed = program("map", tmp_path / "scene.toml", fails=True).stderr
    words = "is out of range: it must be between 0 and 1, as `e` is"
    assert words in printed
    with pytest.raises(rm.SceneError, match=words):
        rm.map(rm.gear_pair(), e=(0, 1.5, 4), omega=(1, 2, 4))
    with pytest.raises(rm.SceneError, match="did you mean `omega`"):
        rm.map(rm.gear_pair(), e=(0, 1, 4), omegaa=(1, 2, 4))
    with pytest.raises(rm.SceneError, match="unknown field `parameters.G"):
        rm.map(rm.gear_pair(), **SMALL, G=3)
    with pytest.raises(rm.SceneError, match="two axes must be given, and these are: e;"):
        rm.map(rm.gear_pair(), e=(0, 1, 4))
    with pytest.raises(rm.SceneError, match="did you mean `max_period`"):
        rm.map(rm.gear_pair(), **SMALL, settings={"integration.max_periods": 3})
    with pytest.raises(rm.SceneError, match=r"axis.0.count = 0.9` has the wrong type"):
        rm.map(rm.gear_pair(), e=(0.1, 0.5, 0.9), omega=(1, 2, 4))
    with pytest.raises(rm.EngineError, match="the CPU engine computes in f64"):
        rm.map(rm.gear_pair(), **SMALL, engine="cpu", precision="f32")
    with pytest.raises(rm.SceneError, match="of memory, and"):
        rm.map(rm.gear_pair(), e=(0, 1, 60_000), omega=(1, 12, 60_000), engine="cpu")
    with pytest.raises(rm.SceneError, match=r"`e = \['a', 'b'\]`: it must be numbers"):
        rm.map(rm.gear_pair(), e=["a", "b"], omega=(1, 2, 4))
    with pytest.raises(rm.SceneError, match="`omega = .*: it must be numbers"):
        rm.map(rm.gear_pair(), e=(0, 1, 4), omega=np.array([1, 2j]))
    with pytest.raises(rm.SceneError, match="start.state"):
        rm.map(rm.gear_pair(), **SMALL, v1="fast")
    with pytest.raises(rm.EngineError, match='the adapter "": it must be a number or'):
        rm.map(rm.gear_pair(), **SMALL, engine="gpu", adapter="")
    for function in (rm.map, rm.basins, rm.bifurcation, rm.orbit):
        with pytest.raises(TypeError, match=r"'gear-pair' is not a model; rm.gear_pair\(\) is one"):
            function("gear-pair", **SMALL)
    for kind in (rm.SceneError, rm.ModelError, rm.FolderError):
        assert issubclass(kind, rm.RattlemapError) and issubclass(kind, ValueError)
    assert issubclass(rm.EngineError, rm.RattlemapError) and issubclass(rm.EngineError, RuntimeError)


#: A map that takes minutes, for tests that interrupt it.
LONG = "rm.gear_pair(), e=(0, 1, 400), omega=(1, 12, 400), engine='cpu', early_stop=False, transient_periods=20_000"


def test_ctrl_c_ends_a_map_within_a_second_and_keeps_its_finished_cells(tmp_path: Path) -> None:
    code = f"""
        import _thread, pathlib, threading, time
        import rattlemap as rm
        begun, out = [], pathlib.Path({str(tmp_path / "out/records.bin")!r})
        def interrupt():
            while not out.is_file() or not out.stat().st_size:
                time.sleep(0.02)
            begun.append(out.stat().st_size)
            time.sleep(1)
            begun.append(time.monotonic())
            _thread.interrupt_main()
        threading.Thread(target=interrupt).start()
        try:
            rm.map({LONG}, out={str(tmp_path / "out")!r}, progress=False)
        except KeyboardInterrupt:
            print(time.monotonic() - begun[1])
            print(out.stat().st_size - begun[0])
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    seconds, bytes_of_cells = map(float, done.stdout.split())
    assert seconds < 1.0 and bytes_of_cells > 0


def test_a_map_waits_for_the_folder_of_an_abandoned_one(tmp_path: Path) -> None:
    code = f"""
        import _thread, threading, time
        import rattlemap as rm
        ask = dict(e=(0.4, 0.6, 3), omega=(5, 6, 2), engine="gpu", progress=False)
        ask |= dict(quantities=["impacts"], out={str(tmp_path / "out")!r})
        threading.Timer(1.5, _thread.interrupt_main).start()
        try:
            rm.map(rm.gear_pair(), **ask)
            print("compiled before it was interrupted")
        except KeyboardInterrupt:
            print(rm.map(rm.gear_pair(), **ask, resume=True).sizes)
    """
    ask = [sys.executable, "-W", "ignore", "-c", textwrap.dedent(code)]
    # An empty cache, so that the driver compiles.
    cold = {**os.environ, "MESA_SHADER_CACHE_DIR": str(tmp_path / "shaders")}
    done = subprocess.run(ask, capture_output=True, text=True, timeout=120, env=cold)
    assert done.returncode == 0, done.stderr
    assert "'e': 3" in done.stdout, done.stdout


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_a_forked_process_computes() -> None:
    code = """
        import multiprocessing
        import rattlemap as rm
        def maps(e):
            ds = rm.map(rm.gear_pair(), e=(e, 0.9, 3), omega=(5, 6, 2), engine="cpu", progress=False)
            return ds["lyapunov"].values.tobytes()
        own = [maps(e) for e in (0.5, 0.6)]
        with multiprocessing.get_context("fork").Pool(2) as pool:
            print(pool.map(maps, (0.5, 0.6)) == own)
    """
    ask = [sys.executable, "-W", "ignore", "-c", textwrap.dedent(code)]
    assert subprocess.run(ask, capture_output=True, text=True, timeout=60).stdout == "True\n"


def test_an_interrupted_map_is_resumed(tmp_path: Path) -> None:
    axes = {"e": (0.0, 1.0, 16), "omega": (1.0, 12.0, 16)}

    class Enough(Exception):
        pass

    def stop(done: int, total: int) -> None:
        if 0 < done < total:
            raise Enough

    setting = {"engine": "cpu", "early_stop": False, "transient_periods": 4000, "out": tmp_path / "out"}
    with pytest.raises(Enough):
        rm.map(rm.gear_pair(), **axes, **setting, progress=stop)
    with pytest.raises(rm.FolderError, match="unfinished"):
        rm.open(tmp_path / "out")
    setting["resume"] = True
    ds = rm.map(rm.gear_pair(), **axes, **setting)
    assert 0 < ds.attrs["resumed_cells"] < 256
    whole = rm.map(rm.gear_pair(), **axes, **{**setting, "out": None, "resume": False})
    whole.attrs["resumed_cells"] = ds.attrs["resumed_cells"]
    assert_same(ds, whole)


def test_resuming_warns_of_damage(tmp_path: Path) -> None:
    out = tmp_path / "out"
    whole = rm.map(rm.gear_pair(), **SMALL, engine="cpu", out=out)
    (out / "manifest.json").unlink()
    records = out / "records.bin"
    records.write_bytes(records.read_bytes()[:-10])
    with pytest.warns(RuntimeWarning, match="records.bin: .* others are computed again"):
        again = rm.map(rm.gear_pair(), **SMALL, engine="cpu", out=out, resume=True)
    xr.testing.assert_equal(again, whole)


def test_resuming_with_fewer_files_warns_of_removed_ones(tmp_path: Path) -> None:
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    axes = (f"[[axis]]\nparameter = '{name}'\nmin = {low}\nmax = {high}\ncount = {n}\n" for name, (low, high, n) in SMALL.items())
    scene.write_text("".join(axes))
    rm.map(scene=scene, engine="cpu", out=out, set=["outputs.files=['csv', 'png']"])
    assert (out / "map.png").exists()
    with pytest.warns(RuntimeWarning, match="removed files of the earlier run: .*map.png"):
        rm.map(scene=scene, engine="cpu", out=out, set=["outputs.files=['csv']"], resume=True)
    assert not (out / "map.png").exists()


def test_other_threads_run_and_progress_is_reported() -> None:
    reports: list[tuple[int, int]] = []
    ticks, is_over = 0, threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not is_over.is_set():
            ticks += 1
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    try:
        rm.map(
            rm.gear_pair(),
            e=(0, 1, 16),
            omega=(1, 12, 16),
            engine="cpu",
            early_stop=False,
            transient_periods=600,
            progress=lambda done, total: reports.append((done, total)),
        )
    finally:
        is_over.set()
        thread.join()
    assert ticks > 100
    assert reports[-1] == (256, 256) and reports == sorted(reports)
