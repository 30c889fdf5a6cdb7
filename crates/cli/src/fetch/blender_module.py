#!/usr/bin/env python3
"""Installs Blender 4.5 LTS as a Python module (0.8 GB) where `mateval` searches for it, or checks such a module.

Input: the cache folder, and pip's requirements. Output: a virtual environment in `CACHE/blender`, and on stdout the
path of its Python. An environment that was installed from the same requirements is kept; an incomplete one is made
again.

Blender's wheels are for Python 3.11 only, and are linked to libraries of X and GL, which pip does not install. The
script ends with the test whether the module can be imported. With `--check` it does nothing else, for the Python that
runs it.

Exit code 0: the module works; 2: it could not be downloaded, or cannot be imported; 130: interrupted.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
from pathlib import Path

from pip_call import FetchError, call_pip, exit_code

PYTHON = "python3.11"
BUILTIN = "or use --renderer builtin, which needs no Blender"
# Written last, so that it marks a complete installation.
MARK = "requirements.txt"
# The libraries of the system that Blender's are linked to, and their packages in Debian. `tools/setup.sh` reads them.
PACKAGES = {
    "libGL.so.1": "libgl1",
    "libICE.so.6": "libice6",
    "libSM.so.6": "libsm6",
    "libX11.so.6": "libx11-6",
    "libXext.so.6": "libxext6",
    "libXfixes.so.3": "libxfixes3",
    "libXi.so.6": "libxi6",
    "libXrender.so.1": "libxrender1",
    "libxkbcommon.so.0": "libxkbcommon0",
}
# Prints the module's file, and the reason if it cannot be imported. bpy 4.5 may hang in an ordinary exit.
PROBE = """
import importlib.util, os
spec = importlib.util.find_spec("bpy")
print(spec.origin if spec else "", flush=True)
try:
    import bpy, numpy
except Exception as problem:
    print(f"{type(problem).__name__}: {problem}", flush=True)
    os._exit(1)
os._exit(0)
"""


def run_quietly(*, command: list[str]) -> subprocess.CompletedProcess:
    """Runs a command that does not ask, and keeps what it prints."""
    return subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace", check=False
    )


def last_line(result: subprocess.CompletedProcess) -> str:
    """Returns the last line of a command that failed, or how it ended."""
    if result.returncode < 0:
        return f"signal {-result.returncode}"
    lines = (result.stderr + result.stdout).strip().split("\n")
    return lines[-1] or f"exit code {result.returncode}"


def python_3_11() -> str:
    """Returns a Python 3.11: the running one, or the one on the PATH."""
    if sys.version_info[:2] == (3, 11):
        return sys.executable
    found = shutil.which(PYTHON)
    # A program of that name may be a shim of pyenv's that only reports that no such version is selected.
    if found is None or run_quietly(command=[found, "-c", ""]).returncode != 0:
        running = ".".join(map(str, sys.version_info[:2]))
        raise FetchError(
            f"Blender's module needs Python 3.11; this is {running}, and no {PYTHON} is on the PATH; install it "
            f"(`uv python install 3.11`, or on Debian 12, as root: apt-get install {PYTHON}-venv), or set "
            f"MATEVAL_BLENDER to a Blender 4.5 of your own, {BUILTIN}"
        )
    return found


def install(*, folder: Path, requirements: str) -> None:
    """Makes the virtual environment, in place of an incomplete or older one."""
    python = python_3_11()
    inside = str(folder / "bin" / "python")
    pip = [inside, "-m", "pip"]
    venv = [python, "-m", "venv", str(folder)]
    # Debian keeps pip's installer apart, in python3-venv; then a pip outside installs into the environment.
    if run_quietly(command=[python, "-c", "import ensurepip"]).returncode != 0:
        pip = [python, "-m", "pip", "--python", inside]
        venv.append("--without-pip")
        if run_quietly(command=[python, "-m", "pip", "--version"]).returncode != 0:
            package = f"on Debian, as root: apt-get install {PYTHON}-venv"
            raise FetchError(f"'{python}' has no pip, with which Blender is downloaded; {package}; {BUILTIN}")
    if folder.exists():
        shutil.rmtree(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    try:
        made = run_quietly(command=venv)
        if made.returncode != 0:
            raise FetchError(f"cannot make a virtual environment in '{folder}': {last_line(made)}; {BUILTIN}")
        print(f"downloading Blender 4.5 (0.4 GB, 0.8 GB unpacked) into '{folder}'", file=sys.stderr, flush=True)
        unmarked = folder / f"{MARK}.partial"
        unmarked.write_text(requirements, encoding="utf-8")
        command = [*pip, "install", "--quiet", "--disable-pip-version-check", "--requirement", str(unmarked)]
        call_pip(command=command, what="Blender", instead=f"run this again, {BUILTIN}")
        unmarked.rename(folder / MARK)
    except BaseException:
        # `mateval` would take an incomplete environment for Blender.
        shutil.rmtree(folder, ignore_errors=True)
        raise


def is_installed(*, folder: Path, requirements: str) -> bool:
    """Returns whether the environment was installed from these requirements, completely, and its Python exists."""
    mark = folder / MARK
    is_complete = mark.is_file() and mark.read_text(encoding="utf-8") == requirements
    return is_complete and (folder / "bin" / "python").exists()


def missing_libraries(*, module: str, problem: str) -> list[str]:
    """Returns the missing libraries of the module: those that ldd does not find, or else the one that Python names."""
    ldd = shutil.which("ldd")
    listed = run_quietly(command=[ldd, module]).stdout if ldd else ""
    missing = re.findall(r"^\s*(\S+) => not found", listed, re.MULTILINE)
    return sorted(set(missing)) or re.findall(r"(\S+): cannot open shared object file", problem)


def check_import(*, python: str) -> None:
    """Raises an error that names everything that is missing if the module cannot be imported."""
    result = run_quietly(command=[python, "-I", "-B", "-c", PROBE])
    if result.returncode == 0:
        return
    module, _, problem = result.stdout.partition("\n")
    if result.returncode == 1 and not module:
        expected = "expected a Python 3.11 with Blender 4.5, as mateval fetch blender installs it"
        raise FetchError(f"'{python}' has no module bpy; {expected}, {BUILTIN}")
    missing = missing_libraries(module=module, problem=problem)
    if not missing:
        raise FetchError(f"Blender cannot be imported by '{python}': {last_line(result)}; install it again, {BUILTIN}")
    packages = " ".join(PACKAGES[name] for name in missing if name in PACKAGES)
    how = f"(on Debian, as root: apt-get install {packages}, then run this again)" if packages else "and run this again"
    raise FetchError(f"Blender lacks these libraries: {', '.join(missing)}; install them {how}, {BUILTIN}")


def fetch(*, cache: Path, requirements: str) -> Path:
    """Installs Blender unless it is installed, and returns the Python that has it."""
    folder = cache / "blender"
    present = is_installed(folder=folder, requirements=requirements)
    if not present:
        install(folder=folder, requirements=requirements)
    python = folder / "bin" / "python"
    try:
        check_import(python=str(python))
    except FetchError as problem:
        raise FetchError(f"downloaded into '{folder}', but {problem}") from None
    if present:
        print(f"already present: Blender 4.5 in '{folder}'", file=sys.stderr)
    return python


def main(arguments: list[str] | None = None) -> int:
    """Runs the tool with command-line arguments and returns the exit code."""
    parser = argparse.ArgumentParser(prog="blender_module", description="install Blender 4.5 for MatEval")
    parser.add_argument("--check", action="store_true", help="only check the module of the Python that runs this")
    parser.add_argument("--cache", type=Path, metavar="DIR", help="MatEval's cache folder")
    parser.add_argument("--requirements", metavar="TEXT", help="the text of pip's requirements file")
    words = parser.parse_args(arguments)
    if words.check:
        return exit_code(work=lambda: check_import(python=sys.executable), folder=Path(sys.prefix))
    if words.cache is None or words.requirements is None:
        parser.error("expected --check, or --cache and --requirements")

    def work() -> None:
        print(fetch(cache=words.cache, requirements=words.requirements.strip() + "\n"))

    return exit_code(work=work, folder=words.cache)


if __name__ == "__main__":
    sys.exit(main())
