"""The program `rattlemap`, run in this process."""

import os
import signal
import sys

from . import _native

__all__ = ["main"]


def main() -> None:
    """Run the command in `sys.argv` and exit with the program's code: 0 done, 1 failed, 2 wrong usage, 130 interrupted."""
    # Ctrl-C ends commands that have no signal handler of their own.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    variable = _native.missing_variable()
    if variable is not None:
        os.environ.setdefault(*variable)
    sys.exit(_native.main(["rattlemap", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
