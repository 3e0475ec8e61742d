"""The examples in docstrings run as they stand, and give what they say."""

from __future__ import annotations

import doctest
import sys

import matplotlib
import numpy as np
import pandas as pd
import pytest
import rattlemap as rm
from conftest import REPOSITORY

matplotlib.use("Agg")


@pytest.mark.parametrize("name", ["map", "basins", "cells", "bifurcation", "orbit", "model"])
def test_examples_run(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import matplotlib.pyplot as plt

    monkeypatch.chdir(REPOSITORY)
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
        made = eval(code, test.globs)
        assert example.want in ("", f"{made!r}\n"), source
    plt.close("all")
