"""Messages name arguments and functions of Python, not options and commands of the program."""

from __future__ import annotations

import _thread
import pickle
from pathlib import Path

import pytest
import rattlemap as rm
from rattlemap.terms import in_python

SMALL = {"e": (0.0, 1.0, 4), "omega": (1.0, 12.0, 3), "engine": "cpu", "progress": False}

TEXTS = [
    ("--set e=2: `parameters.e = 2` is out of range", "e=2: `parameters.e = 2` is out of range"),
    (
        "--out out/a b: the folder is not empty; choose another one with --out, or give --force to replace the files",
        'out="out/a b": the folder is not empty; choose another one with out=, or give force=True to replace the files',
    ),
    (
        "--precision f32: the CPU engine computes in f64; leave out --precision, or give --engine gpu",
        'precision="f32": the CPU engine computes in f64; leave out precision=, or give engine="gpu"',
    ),
    ("give --precision f32 or --adapter 1 (llvmpipe)", 'give precision="f32" or adapter=1 (llvmpipe)'),
    ("--adapter names it", "adapter= names it"),
    ("--start: it must be four finite numbers", "start: it must be four finite numbers"),
    ("take a line with --along e --at omega=VALUE, or", 'take a line with along="e" at={"omega": VALUE}, or'),
    ("--at omega=fast: it has the wrong type", 'at={"omega": fast}: it has the wrong type'),
    ("`rattlemap map SCENE --out 'a b' --set e=1 --resume`", '`rm.map(..., out="a b", resume=True, set=["e=1"])`'),
    ("`rattlemap check x --repair` makes it again", '`rm.check("x", repair=True)` makes it again'),
    ("`rattlemap merge OUT PART...` makes the map", "`rattlemap merge OUT PART...` makes the map"),
    ("a - b -- c", "a - b -- c"),
]


@pytest.mark.parametrize(("text", "expected"), TEXTS, ids=[text for text, _ in TEXTS])
def test_options_and_commands_are_arguments_and_calls(text: str, expected: str) -> None:
    assert in_python(text) == expected
    assert in_python(expected) == expected


def test_errors_name_arguments(tmp_path: Path) -> None:
    rm.map(rm.gear_pair(), **SMALL, out=tmp_path)
    with pytest.raises(rm.FolderError, match="or give force=True to replace") as raised:
        rm.map(rm.gear_pair(), **SMALL, out=tmp_path)
    assert "--" not in str(raised.value) and 'out="' in str(raised.value)
    assert str(pickle.loads(pickle.dumps(raised.value))) == str(raised.value)
    with pytest.raises(rm.SceneError, match=r"^e=2\.0: "):
        rm.orbit(rm.gear_pair(), e=2)


@pytest.mark.parametrize("has_folder", [False, True])
def test_ctrl_c_says_how_to_continue(tmp_path: Path, has_folder: bool) -> None:
    out = tmp_path / "out" if has_folder else None

    def interrupt(done: int, total: int) -> None:
        if done > 0:
            _thread.interrupt_main()

    settings = {"early_stop": False, "transient_periods": 20_000, "engine": "cpu", "progress": interrupt, "out": out}
    with pytest.raises(KeyboardInterrupt) as raised:
        rm.map(rm.gear_pair(), e=(0, 1, 200), omega=(1, 12, 200), **settings)
    remedy = "resume=True" if has_folder else "With out=FOLDER"
    assert remedy in str(raised.value), raised.value
