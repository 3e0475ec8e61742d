"""The native module. The package uses it; nothing here is for users."""

from collections.abc import Callable, Sequence
from typing import Any, TypedDict

import numpy.typing as npt

__version__: str
# Hash of the sources that decide the bits of results, and the target of the build: fields `sources` and `target` of manifests.
SOURCES: str
TARGET: str

_Report = Callable[[int, int], object] | None

def main(arguments: Sequence[str]) -> int: ...
_Color = tuple[int, int, int]

def colors() -> tuple[dict[str, _Color], list[_Color]]: ...
def manifest(folder: str) -> str: ...
def explore_page(scene: Scene, progress: _Report = ...) -> str: ...
def missing_variable() -> tuple[str, str] | None: ...
def models() -> list[tuple[str, str]]: ...
def check_folder(folder: str, repair: bool = ...) -> tuple[list[tuple[str, str, str]], list[str], list[str]]: ...
def compare(a: str, b: str, tolerance: float) -> tuple[str, str, list[str]]: ...
def curves(
    folder: str,
    kinds: list[str],
    word: str | None,
    texts: list[str | None],
    unstable: bool,
    longest: int,
    most_curves: int,
    most_points: int,
    progress: _Report = ...,
) -> tuple[list[str], list[int] | None, list[str]]: ...
def validate(
    folder: str, samples: int, seed: int, chaos_periods: int, progress: _Report = ...
) -> tuple[str | None, list[str]]: ...

class DevicesResult(TypedDict):
    processor: str
    adapters: list[dict[str, Any]]
    engine: str
    precision: str
    reason: str

def devices() -> DevicesResult: ...

class Model:
    def __new__(cls, text: str, file: str) -> Model: ...
    @staticmethod
    def find(name: str) -> Model: ...
    def replace(self, sets: list[str]) -> Model: ...
    file: str
    name: str
    title: str
    text: str
    is_built_in: bool
    state_names: list[str]
    equations: list[str]
    parameters: dict[str, float]
    changed: dict[str, float]
    meanings: list[tuple[str, str, str, float | None]]

class Scene:
    def __new__(
        cls,
        text: str,
        sets: list[str] = ...,
        model: tuple[str, str] | None = ...,
        cells: str | None = ...,
        purpose: str = ...,
        along: tuple[str, list[str]] | None = ...,
    ) -> Scene: ...
    @staticmethod
    def load(
        path: str, sets: list[str] = ..., purpose: str = ..., along: tuple[str, list[str]] | None = ...
    ) -> Scene: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...
    runs: int

class MapResult(TypedDict):
    manifest: str
    columns: dict[str, npt.NDArray[Any]]
    texts: list[str]
    attractors: str | None
    warnings: list[str]

def map(
    scene: Scene,
    engine: str,
    precision: str | None = ...,
    out: str | None = ...,
    force: bool = ...,
    resume: bool = ...,
    progress: _Report = ...,
    adapter: str | None = ...,
) -> MapResult: ...

def shard(
    scene: Scene,
    index: int,
    count: int,
    engine: str,
    precision: str | None,
    out: str,
    threads: int | None = ...,
    progress: _Report = ...,
    adapter: str | None = ...,
) -> list[str]: ...
def check_shards(
    scene: Scene,
    count: int,
    engine: str,
    precision: str | None,
    adapter: str | None = ...,
    out: str | None = ...,
    force: bool = ...,
) -> None: ...
def merge(parts: list[str], out: str, force: bool = ..., writes: bool = ...) -> MapResult: ...

def bifurcation(scene: Scene, progress: _Report = ...) -> tuple[str, str, str]: ...

class Orbit:
    def json(self) -> str: ...
    lyapunov: float
    cycle_periods: int
    forcing_period: float
    state_names: list[str]
    def trajectory(self, samples_per_period: int) -> str: ...
    def spectrum(self) -> str | None: ...
    def refined(self, period: int | None = ..., word: str | None = ..., by: str | None = ...) -> str: ...
    def history(self, skipped: int, periods: int, samples: int) -> str: ...

def orbit(model: Model, transient: int, periods: int | None = ..., start: list[float] | None = ...) -> Orbit: ...
