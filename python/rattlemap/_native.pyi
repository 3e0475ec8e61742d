"""The native module: what the package is built on. Nothing here is for users."""

from collections.abc import Sequence

__version__: str
# Hash of the sources that decide the bits of results, and what they were built for: a manifest's fields of these names.
SOURCES: str
TARGET: str

def main(arguments: Sequence[str]) -> int: ...
def missing_variable() -> tuple[str, str] | None: ...
