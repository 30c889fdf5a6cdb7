#!/usr/bin/env python3
"""Installs Blender 4.5 LTS as a Python module (0.8 GB) where `mateval` searches for it.

Input: the cache folder, and pip's requirements. Output: a virtual environment in `CACHE/blender`, and on stdout the
path of its Python. An environment that was installed from the same requirements is kept.

Blender's wheels are for Python 3.11 only, and are linked to libraries of X and GL. At the end the script tests whether
the module can be imported.

Exit code 0: the module works; 2: it could not be installed, or it lacks a library.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

PYTHON = "python3.11"
LIBRARIES = "libxrender1 libxfixes3 libxi6 libxkbcommon0 libsm6 libgl1"
INSTEAD = "or set MATEVAL_BLENDER to a Blender 4.5 of your own"
# Written last, so that it marks a complete installation.
MARK = "requirements.txt"


class FetchError(Exception):
    """An error with a message for the user."""


def python_3_11() -> str:
    """Returns a Python 3.11: the running one, or the one on the PATH."""
    if sys.version_info[:2] == (3, 11):
        return sys.executable
    found = shutil.which(PYTHON)
    if found is None:
        running = ".".join(map(str, sys.version_info[:2]))
        raise FetchError(
            f"Blender's module needs Python 3.11; this is {running}, and no {PYTHON} is on the PATH; "
            f"install {PYTHON}, {INSTEAD}"
        )
    return found


def run(*, command: list[str], problem: str) -> None:
    """Runs a command whose messages go to stderr; raises `problem` if it fails."""
    result = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=sys.stderr, check=False)
    if result.returncode != 0:
        raise FetchError(f"{problem} (exit code {result.returncode}, its messages are above)")


def install(*, folder: Path, requirements: str) -> None:
    """Makes the virtual environment, in place of an incomplete or older one."""
    python = python_3_11()
    if folder.exists():
        shutil.rmtree(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    print(f"installing Blender into '{folder}'", file=sys.stderr)
    problem = "cannot make a virtual environment; on Debian, apt-get install python3-venv"
    run(command=[python, "-m", "venv", str(folder)], problem=problem)
    unmarked = folder / f"{MARK}.partial"
    unmarked.write_text(requirements, encoding="utf-8")
    command = [str(folder / "bin" / "python"), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    run(command=[*command, "--requirement", str(unmarked)], problem="pip could not install Blender")
    unmarked.rename(folder / MARK)


def is_installed(*, folder: Path, requirements: str) -> bool:
    """Returns whether the environment was installed from these requirements, and completely."""
    mark = folder / MARK
    return mark.is_file() and mark.read_text(encoding="utf-8") == requirements


def check_import(*, python: Path) -> None:
    """Raises an error that names what is missing if the module cannot be imported."""
    result = subprocess.run(
        [str(python), "-c", "import bpy"], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    if result.returncode == 0:
        return
    lines = result.stderr.strip().splitlines() or [f"exit code {result.returncode}"]
    raise FetchError(
        f"Blender's module is installed but cannot be imported: {lines[-1]}; "
        f"on Debian, apt-get install {LIBRARIES}, then run this again; {INSTEAD}"
    )


def fetch(*, cache: Path, requirements: str) -> Path:
    """Installs Blender unless it is installed, and returns the Python that has it."""
    folder = cache / "blender"
    if not is_installed(folder=folder, requirements=requirements):
        install(folder=folder, requirements=requirements)
    python = folder / "bin" / "python"
    check_import(python=python)
    return python


def main(arguments: list[str] | None = None) -> int:
    """Runs the tool with command-line arguments and returns the exit code."""
    parser = argparse.ArgumentParser(prog="blender_module", description="install Blender 4.5 for MatEval")
    parser.add_argument("--cache", type=Path, required=True, metavar="DIR", help="MatEval's cache folder")
    parser.add_argument("--requirements", required=True, metavar="TEXT", help="the text of pip's requirements file")
    words = parser.parse_args(arguments)
    try:
        print(fetch(cache=words.cache, requirements=words.requirements.strip() + "\n"))
    except FetchError as problem:
        print(f"error: {problem}", file=sys.stderr)
        return 2
    except OSError as problem:
        print(f"error: cannot install into '{words.cache / 'blender'}': {problem}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
