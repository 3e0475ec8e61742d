"""The Python examples of the READMEs run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from conftest import REPOSITORY


@pytest.mark.parametrize("name", ["README.md", "python/README.md"])
def test_its_lines_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = (REPOSITORY / name).read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert blocks
    for block in blocks:
        exec(compile(block, name, "exec"), {"__name__": "__main__"})
