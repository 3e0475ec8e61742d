"""Processors that lack features of the build are refused before the module is loaded."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import PACKAGE
from rattlemap import _processor

BUILT = _processor.built_for(PACKAGE)
needs_x86 = pytest.mark.skipif(not _processor.is_x86(), reason="another kind of processor")
needs_fast_build = pytest.mark.skipif(not BUILT >= _processor.NEEDED.keys(), reason="built without AVX2 and FMA")

@needs_x86
@pytest.mark.skipif(sys.platform != "linux", reason="/proc/cpuinfo is Linux's")
def test_features_are_those_of_the_system() -> None:
    flags = Path("/proc/cpuinfo").read_text().partition("flags")[2].partition("\n")[0].split()
    assert _processor.features() == {name for name in _processor.NEEDED if name in flags}


@needs_x86
@needs_fast_build
@pytest.mark.parametrize(("features", "lacking"), [((), "AVX2 and FMA"), (("avx2",), "FMA")])
def test_an_old_processor_is_refused(monkeypatch: pytest.MonkeyPatch, features: tuple[str, ...], lacking: str) -> None:
    monkeypatch.setattr(_processor, "features", lambda: frozenset(features))
    with pytest.raises(ImportError) as raised:
        _processor.require(PACKAGE)
    assert f"lacks {lacking};" in str(raised.value) and 'RUSTFLAGS="" pip install' in str(raised.value)


@needs_x86
def test_a_slower_build_warns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_processor, "built_for", lambda _: frozenset(("sse2",)))
    monkeypatch.setattr(_processor, "features", frozenset)
    _processor.require(PACKAGE)
    assert _processor.slower("x86_64-unknown-linux-gnu fxsr,sse,sse2") is None
    monkeypatch.setattr(_processor, "features", lambda: frozenset(_processor.NEEDED))
    assert "without AVX2 and FMA" in str(_processor.slower("x86_64-unknown-linux-gnu fxsr,sse,sse2"))
    assert _processor.slower("x86_64-unknown-linux-gnu avx,avx2,fma,sse") is None
    assert _processor.slower("aarch64-apple-darwin neon") is None


@needs_x86
@needs_fast_build
def test_an_emulated_processor_is_refused() -> None:
    emulator = shutil.which("qemu-x86_64")
    if emulator is None:
        pytest.skip("no qemu-x86_64 (qemu-user) to emulate a processor without AVX2")
    # The interpreter itself, not a script that starts it.
    command = [emulator, "-cpu", "Westmere", os.path.realpath(sys.executable), "-S", "-c", "import rattlemap"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (PACKAGE.parent, Path(np.__file__).parents[1])))}
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 1, done.stderr
    assert "ImportError: rattlemap was built for processors with AVX2 and FMA" in done.stderr
