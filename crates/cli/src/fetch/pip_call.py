"""Calls pip and turns errors into exit codes, for `lpips_weights.py` and `blender_module.py`.

`mateval` gives Python the scripts as text, and this text as their module `pip_call`.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

NO_PIP = (
    "'{python}' has no pip; install it (on Debian, as root: apt-get install python3-pip), or set MATEVAL_PYTHON to a "
    "Python that has it"
)
# Words in pip's messages, in lower case, and their cause. The first that occurs counts.
CAUSES = (
    ("no module named pip", NO_PIP),
    ("no space left on device", "the disk is full"),
    ("sslerror", "the package index was not reached: its certificate is not trusted here"),
    ("connection broken", "the package index was not reached; is the network reachable?"),
    ("timed out", "the connection to the package index was lost"),
    ("no matching distribution found", "no matching distribution was found; is the network reachable?"),
)


class FetchError(Exception):
    """An error with a message for the user."""


def call_pip(
    *, command: list[str], what: str, instead: str, environment: Mapping[str, str] = MappingProxyType({})
) -> None:
    """Runs pip and passes its messages on to stderr, up to a traceback. Raises an error that names why it failed."""
    # Python keeps messages back where it writes to a pipe.
    variables = {**os.environ, "PYTHONUNBUFFERED": "1", **environment}
    pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    lines = []
    passed_on = True
    with subprocess.Popen(command, env=variables, text=True, errors="replace", **pipes) as pip:
        for line in pip.stdout:
            lines.append(line.strip())
            passed_on = passed_on and not line.startswith("Traceback")
            if passed_on:
                print(line, end="", file=sys.stderr, flush=True)
    if pip.returncode != 0:
        raise FetchError(f"pip could not fetch {what}: {cause(pip=pip, lines=lines)}; {instead}")


def cause(*, pip: subprocess.Popen, lines: list[str]) -> str:
    """Returns why pip failed, by its messages; the last of them where none is known."""
    if pip.returncode < 0:
        return f"it was ended by signal {-pip.returncode}"
    text = "\n".join(lines).lower()
    known = (known.format(python=pip.args[0]) for words, known in CAUSES if words in text)
    last = next((line for line in reversed(lines) if line), f"exit code {pip.returncode}")
    return next(known, last)


def exit_code(*, work: Callable[[], None], folder: Path) -> int:
    """Does the work in the folder, prints its error, and returns the exit code: 0, 2 for an error, 130 for Ctrl-C."""
    try:
        work()
    except KeyboardInterrupt:
        return 130
    except FetchError as problem:
        reason = str(problem)
    except OSError as problem:
        reason = f"cannot use '{problem.filename or folder}': {problem.strerror or problem}"
    except Exception as problem:  # noqa: BLE001 (a traceback is no message for a user)
        reason = f"{type(problem).__name__}: {problem}; this is a bug, please report it"
    else:
        return 0
    # One line, whatever the reason quotes.
    print(f"error: {' '.join(reason.split())}", file=sys.stderr)
    return 2
