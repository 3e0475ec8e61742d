"""The program `rattlemap`, run in this process."""

import os
import signal
import sys

from . import _native

__all__ = ["main"]


def main() -> None:
    """Run the command in `sys.argv` and exit with the program's code: 0 done, 1 failed, 2 bad usage, 130 interrupted."""
    # Commands that do not listen for Ctrl-C end by it, as the program does; the others put their own handler in its place.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    variable = _native.missing_variable()
    if variable is not None:
        os.environ.setdefault(*variable)
    sys.exit(_native.main(["rattlemap", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
