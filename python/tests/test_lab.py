"""The widget in JupyterLab, in a headless browser without network.

Needs Chromium and two packages that the other tests do not need: ``pip install jupyterlab playwright``.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rattlemap as rm

pytest.importorskip("jupyterlab")
sync_api = pytest.importorskip("playwright.sync_api")
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")

CELLS = (
    "import rattlemap as rm\npage = rm.explore(rm.gear_pair(F=50), e=(0.3, 0.9), omega=(4, 9), progress=False)\npage",
    "open('said.json', 'w').write(__import__('json').dumps([page.command, page.orbit.word]))",
)


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[str]:
    """Starts JupyterLab with a notebook of CELLS; its address."""
    cells = [
        {"cell_type": "code", "id": f"cell{n}", "metadata": {}, "source": source, "outputs": [], "execution_count": None}
        for n, source in enumerate(CELLS)
    ]
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    notebook = {"cells": cells, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}
    (tmp_path / "walk.ipynb").write_text(json.dumps(notebook))
    with socket.socket() as free:
        free.bind(("localhost", 0))
        port = free.getsockname()[1]
    options = ["--no-browser", "--allow-root", "--ServerApp.token=", "--ServerApp.password=", f"--port={port}"]
    environment = {**os.environ, "PYTHONPATH": str(Path(rm.__file__).parents[1])}
    server = subprocess.Popen(
        [sys.executable, "-m", "jupyterlab", *options], cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True
    )
    assert server.stderr is not None
    try:
        assert any("is running at" in line for line in server.stderr)
        yield f"http://localhost:{port}/lab/tree/walk.ipynb"
    finally:
        server.terminate()
        server.wait()


@pytest.mark.skipif(BROWSER is None, reason="no Chromium")
def test_a_click_in_a_notebook_puts_the_orbit_into_a_variable(lab: str, tmp_path: Path) -> None:
    foreign: list[str] = []

    def only_local(route: Any) -> None:
        url = route.request.url
        is_local = not url.startswith("http") or "//localhost" in url
        route.continue_() if is_local else (foreign.append(url), route.abort())

    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1500, "height": 1100})
        page.route("**/*", only_local)
        page.goto(lab)
        cells = page.locator(".jp-Notebook .jp-Cell")
        cells.first.locator(".cm-content").click(timeout=60_000)
        page.wait_for_selector("text=Python 3 (ipykernel) | Idle")
        page.keyboard.press("Shift+Enter")
        frame = page.wait_for_selector(".jp-OutputArea iframe").content_frame()
        frame.wait_for_function("() => document.getElementById('live').textContent.includes('computed in this page')", timeout=60_000)
        box = frame.locator("#canvas").bounding_box()
        page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.4 * box["height"])
        frame.wait_for_function("() => document.getElementById('computing').textContent.includes('computed in this page')")
        command = frame.text_content("#command")
        cells.nth(1).locator(".cm-content").click()
        page.keyboard.press("Shift+Enter")
        page.wait_for_function("() => document.querySelectorAll('.jp-Cell')[1].textContent.includes('[2]')")
        browser.close()
    assert foreign == []
    assert json.loads((tmp_path / "said.json").read_text()) == [command, "36"]
