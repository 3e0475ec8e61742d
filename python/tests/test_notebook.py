"""The cells of the notebook run in order, and draw the figures that it contains."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pytest
from conftest import REPOSITORY

NOTEBOOK = REPOSITORY / "docs/python.ipynb"


def smaller(source: str) -> str:
    """Reduces the number of values of every axis in ``(min, max, count)`` to a third."""
    numbers = r"(\(-?[\d.]+, -?[\d.]+), (\d{2,})\)"
    return re.sub(numbers, lambda found: f"{found[1]}, {max(8, int(found[2]) // 3)})", source)


@pytest.mark.long
def test_its_cells_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "__main__"}
    count = 0
    for number, cell in enumerate(json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]):
        if cell["cell_type"] != "code":
            continue
        exec(compile(smaller("".join(cell["source"])), f"{NOTEBOOK.name}[{number}]", "exec"), names)
        figures = sum("image/png" in output.get("data", {}) for output in cell["outputs"])
        assert len(plt.get_fignums()) == figures, f"cell {number}: the file has {figures} figures"
        count += figures
        plt.close("all")
    assert count >= 5


def test_it_is_small() -> None:
    assert NOTEBOOK.stat().st_size < 600_000
