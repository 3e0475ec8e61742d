"""The native module: what the package is built on. Nothing here is for users."""

from collections.abc import Callable, Sequence
from typing import Any, TypedDict

import numpy as np
import numpy.typing as npt

__version__: str
# Hash of the sources that decide the bits of results, and what they were built for: a manifest's fields of these names.
SOURCES: str
TARGET: str

_Tell = Callable[[int, int], object] | None

def main(arguments: Sequence[str]) -> int: ...
_Color = tuple[int, int, int]

def colors() -> tuple[dict[str, _Color], list[_Color]]: ...
def manifest(folder: str) -> str: ...
def missing_variable() -> tuple[str, str] | None: ...

class Model:
    def __new__(cls, text: str, file: str) -> Model: ...
    @staticmethod
    def find(name: str) -> Model: ...
    def replace(self, sets: list[str]) -> Model: ...
    @property
    def file(self) -> str: ...
    @property
    def name(self) -> str: ...
    @property
    def title(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def is_built_in(self) -> bool: ...
    @property
    def state_names(self) -> list[str]: ...
    @property
    def equations(self) -> list[str]: ...
    @property
    def parameters(self) -> dict[str, float]: ...
    @property
    def changed(self) -> dict[str, float]: ...
    @property
    def meanings(self) -> list[tuple[str, str, str]]: ...

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
    @property
    def text(self) -> str: ...
    @property
    def sets(self) -> list[str]: ...
    @property
    def runs(self) -> int: ...
    @property
    def is_basin(self) -> bool: ...

class MadeMap(TypedDict):
    manifest: str
    columns: dict[str, npt.NDArray[Any]]
    texts: list[str]
    attractors: str | None
    why: str
    warnings: list[str]
    files: list[str]

def map(
    scene: Scene,
    engine: str,
    precision: str | None = ...,
    out: str | None = ...,
    force: bool = ...,
    resume: bool = ...,
    progress: _Tell = ...,
    adapter: str | None = ...,
) -> MadeMap: ...

def shard(
    scene: Scene,
    index: int,
    count: int,
    engine: str,
    precision: str | None,
    out: str,
    resume: bool = ...,
    threads: int | None = ...,
    progress: _Tell = ...,
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
def merge(parts: list[str], out: str, force: bool = ..., writes: bool = ..., progress: _Tell = ...) -> MadeMap: ...

class MadeDiagram(TypedDict):
    manifest: str
    columns: str
    points: dict[str, npt.NDArray[Any]]
    kinds: list[str]
    directions: list[str]

def bifurcation(scene: Scene, progress: _Tell = ...) -> MadeDiagram: ...

class Orbit:
    def json(self) -> str: ...
    @property
    def cycle_periods(self) -> int: ...
    @property
    def forcing_period(self) -> float: ...
    @property
    def state_names(self) -> list[str]: ...
    def moments(self, samples_per_period: int) -> dict[str, list[str] | npt.NDArray[np.float64] | npt.NDArray[np.int8]]: ...

def orbit(model: Model, sets: list[str], transient: int, periods: int, start: list[float] | None = ...) -> Orbit: ...
