"""The examples in docstrings run, and return the results that they show."""

from __future__ import annotations

import doctest
import shutil
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import rattlemap as rm
from conftest import SCENES

MODULES = [
    "about", "basins", "bifurcation", "cells", "check", "compare", "devices", "map", "model", "models", "orbit", "plot", "validate",
]  # fmt: skip


@pytest.mark.parametrize("name", MODULES)
def test_examples_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenes").mkdir()
    shutil.copy(SCENES / "e_omega.toml", tmp_path / "scenes")
    known = {"rm": rm, "np": np, "pd": pd, "plt": plt}
    tests = doctest.DocTestFinder().find(sys.modules[f"rattlemap.{name}"], globs=known)
    examples = [(test, example) for test in tests for example in test.examples]
    assert examples
    for test, example in examples:
        source = example.source.strip()
        try:
            code = compile(source, test.name, "eval")
        except SyntaxError:
            exec(compile(source, test.name, "exec"), test.globs)
            continue
        value = eval(code, test.globs)
        assert example.want in ("", f"{value!r}\n"), source
    plt.close("all")
