"""The native module: what the package is built on. Nothing here is for users."""

from collections.abc import Sequence

__version__: str

def main(arguments: Sequence[str]) -> int: ...
def missing_variable() -> tuple[str, str] | None: ...
