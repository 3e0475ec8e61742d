"""The notebook's cells run, in its order, and show what it says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pytest
from conftest import REPOSITORY

NOTEBOOK = REPOSITORY / "docs/python.ipynb"


def test_its_cells_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "__main__"}
    figures = 0
    for number, cell in enumerate(json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]):
        if cell["cell_type"] != "code":
            continue
        exec(compile("".join(cell["source"]), f"{NOTEBOOK.name}[{number}]", "exec"), names)
        kept = sum("image/png" in output.get("data", {}) for output in cell["outputs"])
        assert len(plt.get_fignums()) == kept, f"cell {number}: the file has {kept} figures"
        figures += kept
        plt.close("all")
    assert figures >= 5


def test_it_is_small() -> None:
    assert NOTEBOOK.stat().st_size < 600_000
