"""The command ``mateval``."""

import os
import signal
import sys

from . import _core


def main() -> int:
    """Runs the command with the words of ``sys.argv`` and returns its exit code."""
    # Python would only note the signal, and act on it when the command has ended.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # `mateval fetch` downloads with the pip of this Python.
    os.environ.setdefault("MATEVAL_PYTHON", sys.executable)
    return _core.main(["mateval", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
