#!/usr/bin/env python3
"""Writes the licences of the crates that the Python package links: `third_party_licenses.py FILE TARGET...`.

Input: `cargo metadata` for these Rust targets and the sources of the crates, which cargo downloads. Output: one text
file: the crates with their licences, then each licence text once, with the crates that it belongs to.

The licences ask that their text goes with binaries. `mateval-python` itself and the other crates of this workspace are
left out: their licences are LICENSE-MIT and LICENSE-APACHE.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = "mateval-python"
LICENCE_FILE = re.compile(r"(licen[cs]e|copying|copyright|notice|unlicense)\b.*", re.IGNORECASE)
INTRODUCTION = """\
The compiled part of mateval contains the Rust crates below and Rust's standard library (MIT OR Apache-2.0, copyright
The Rust Project Contributors). The texts of their licences follow. A crate under a choice of licences is used under any
of them.
"""


def read_metadata(*, targets: list[str]) -> dict[str, Any]:
    """Returns the output of `cargo metadata` for this workspace, with the versions of Cargo.lock."""
    command = ["cargo", "metadata", "--format-version", "1", "--locked"]
    for target in targets:
        command += ["--filter-platform", target]
    return json.loads(subprocess.check_output(command, cwd=Path(__file__).resolve().parent.parent))


def linked_packages(*, metadata: dict[str, Any]) -> list[dict[str, Any]]:
    """Returns the packages of others that `mateval-python` depends on when it runs, sorted by name and version."""
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    pending = [name for name, package in packages.items() if package["name"] == ROOT]
    found: set[str] = set()
    while pending:
        current = pending.pop()
        if current in found:
            continue
        found.add(current)
        for dependency in nodes[current]["deps"]:
            # Dependencies for builds and tests have a kind; those that are linked have none.
            if any(kind["kind"] is None for kind in dependency["dep_kinds"]):
                pending.append(dependency["pkg"])
    others = [packages[name] for name in found if packages[name]["source"] is not None]
    return sorted(others, key=lambda package: (package["name"], package["version"]))


def licence_texts(*, package: dict[str, Any]) -> list[str]:
    """Returns the texts of the licence files beside the package's manifest."""
    folder = Path(package["manifest_path"]).parent
    files = {path for path in folder.iterdir() if path.is_file() and LICENCE_FILE.fullmatch(path.name)}
    if package["license_file"]:
        files.add(folder / package["license_file"])
    return [path.read_text(encoding="utf-8", errors="replace") for path in sorted(files)]


def document(*, packages: list[dict[str, Any]]) -> str:
    """Returns the whole file. A package without any licence ends the program."""
    lines = [INTRODUCTION]
    # Texts that differ in white space only are one; the first is kept as it is written.
    texts: dict[str, str] = {}
    owners: dict[str, list[str]] = {}
    for package in packages:
        title = f"{package['name']} {package['version']}"
        found = licence_texts(package=package)
        by = "" if found or not package["authors"] else f", by {', '.join(package['authors'])}"
        if not found and not package["license"]:
            sys.exit(f"error: {title} states no licence and has no licence file; ask its authors, or do without it")
        lines.append(f"{title}: {package['license'] or 'the licence whose text follows'}{by}")
        for text in found:
            key = " ".join(text.split())
            texts.setdefault(key, text.strip())
            owners.setdefault(key, []).append(title)
    for key, text in texts.items():
        lines += ["", "-" * 80, ", ".join(dict.fromkeys(owners[key])), "", text]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path, help="the file to write")
    parser.add_argument("targets", nargs="+", help="Rust targets, as in x86_64-unknown-linux-gnu")
    words = parser.parse_args()
    packages = linked_packages(metadata=read_metadata(targets=words.targets))
    words.file.write_text(document(packages=packages), encoding="utf-8")


if __name__ == "__main__":
    main()
