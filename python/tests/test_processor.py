"""A processor that lacks what the module was built for is refused before the module is loaded."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import rattlemap
from rattlemap import _processor

PACKAGE = Path(rattlemap.__file__).parent
BUILT = _processor.built_for(PACKAGE)
needs_x86 = pytest.mark.skipif(not _processor.is_x86(), reason="another kind of processor")
needs_fast_build = pytest.mark.skipif(not BUILT >= _processor.NEEDED, reason="built without AVX2 and FMA")

OLD = "processor : 0\nflags\t\t: fpu sse sse2 ssse3 sse4_1 sse4_2 avx\nbugs :\n"
MIXED = OLD.replace(" avx", " avx avx2")


def test_cpuinfo_is_read() -> None:
    assert _processor.of_cpuinfo(OLD) == frozenset()
    assert _processor.of_cpuinfo(MIXED) == {"avx2"}
    assert _processor.of_cpuinfo(OLD.replace(" avx", " avx avx2 fma")) == _processor.NEEDED
    assert _processor.of_cpuinfo("Processor : ARMv8\n") == _processor.NEEDED


@needs_x86
@pytest.mark.skipif(sys.platform != "linux", reason="Linux's file")
def test_glibc_and_the_system_agree() -> None:
    told = _processor.of_glibc()
    assert told in (None, _processor.of_cpuinfo(Path("/proc/cpuinfo").read_text()))


@needs_x86
@needs_fast_build
@pytest.mark.parametrize(("flags", "lacking"), [(OLD, "AVX2 and FMA"), (MIXED, "FMA")])
def test_an_old_processor_is_told_the_remedy(monkeypatch: pytest.MonkeyPatch, flags: str, lacking: str) -> None:
    monkeypatch.setattr(_processor, "features", lambda: _processor.of_cpuinfo(flags))
    with pytest.raises(ImportError) as raised:
        _processor.require(PACKAGE)
    told = str(raised.value)
    assert f"lacks {lacking};" in told and 'RUSTFLAGS="" pip install' in told


@needs_x86
def test_a_slower_build_runs_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_processor, "built_for", lambda _: frozenset(("sse2",)))
    monkeypatch.setattr(_processor, "features", frozenset)
    _processor.require(PACKAGE)
    assert _processor.slower("x86_64-unknown-linux-gnu fxsr,sse,sse2") is None
    monkeypatch.setattr(_processor, "features", lambda: _processor.NEEDED)
    assert "without AVX2 and FMA" in str(_processor.slower("x86_64-unknown-linux-gnu fxsr,sse,sse2"))
    assert _processor.slower("x86_64-unknown-linux-gnu avx,avx2,fma,sse") is None
    assert _processor.slower("aarch64-apple-darwin neon") is None


@needs_x86
@needs_fast_build
@pytest.mark.skipif(sys.platform != "linux" or platform.libc_ver()[0] != "glibc", reason="asks glibc")
def test_the_package_on_an_emulated_processor() -> None:
    emulator = shutil.which("qemu-x86_64")
    if emulator is None:
        pytest.skip("no qemu-x86_64 (qemu-user) to emulate a processor without AVX2")
    # The interpreter itself, not a script that starts one.
    command = [emulator, "-cpu", "Westmere", os.path.realpath(sys.executable), "-S", "-c", "import rattlemap"]
    environment = os.environ | {"PYTHONPATH": str(PACKAGE.parent)}
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 1, done.stderr
    assert "ImportError: rattlemap was built for processors with AVX2 and FMA" in done.stderr
