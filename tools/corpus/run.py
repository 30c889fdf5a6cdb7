"""Builds, renders and verifies a scene within limits of time, and judges how the commands ended."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import struct
import subprocess
import time
import zlib
from collections import Counter
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

from files import Case

RESOLUTION = (96, 72)
SAMPLES = 4
SHORTEST_CAUSE = 40
"""Characters of the shortest first line that can name a file and a reason."""


class Outcome(Enum):
    """In the order of the page."""

    FAILED = "failed"
    REFUSED = "refused"
    BUILT = "built"


@dataclass
class Step:
    """A command that ended, or was ended."""

    command: str
    code: int
    """Its exit code; negative for a signal, as in `subprocess`."""
    seconds: float
    stdout: str = ""
    stderr: str = ""
    over_time: bool = False

    def error(self) -> str:
        """The first line that starts with `error:`, with the lines after it where it ends with a colon; or nothing."""
        found = re.search(r"^error:.*(?:(?<=:)\n[\s\S]*)?", self.stderr, re.MULTILINE)
        return " ".join(found[0].split()) if found else ""


@dataclass
class Result:
    """What became of a scene."""

    case: Case
    steps: list[Step]
    outcome: Outcome
    cause: str
    folder: Path
    """Where its recipe and its log are."""
    findings: Counter[str] = field(default_factory=Counter)
    picture: bytes | None = None


def run_limited(*, words: list[str], seconds: float) -> Step:
    """Runs a command in a process group of its own, which is ended after this time."""
    start = time.monotonic()
    child = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
    over_time = False
    try:
        stdout, stderr = child.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        over_time = True
        os.killpg(child.pid, signal.SIGKILL)
        stdout, stderr = child.communicate()
    spent = time.monotonic() - start
    out, error = stdout.decode(errors="replace"), stderr.decode(errors="replace")
    return Step(" ".join(words), child.returncode, spent, out, error, over_time)


def fault(*, step: Step) -> str:
    """What is wrong with how a command ended; nothing if it was done, or names what it refused."""
    if step.over_time:
        return f"took longer than {step.seconds:.0f} s"
    if "memory allocation of" in step.stderr:
        return "ran out of memory"
    if panic := re.search(r"panicked at .*(\n.+)?", step.stderr):
        return " ".join(panic[0].split())
    if step.code < 0:
        return f"ended by {signal.Signals(-step.code).name}"
    if "Traceback (most recent call last)" in step.stderr:
        return "a traceback"
    if step.code not in (0, 1, 2):
        return f"exit code {step.code}"
    if step.code == 2:
        error = step.error()
        # Not within quotes, where a path may hold any word.
        is_bug = re.search(r"\bbug\b", re.sub("'[^']*'", "", error), re.IGNORECASE)
        if len(error) < SHORTEST_CAUSE or error.endswith(":") or is_bug:
            return f"a refusal that names no cause: {error or step.stderr[-200:] or 'nothing on stderr'}"
        _, option, dataset = step.command.partition(" --out ")
        if option and f"{dataset}/" in error:
            return f"a refusal that names a file of MatEval's own: {error}"
    elif step.code == 1 and not step.stdout:
        return "exit code 1 without an answer"
    return ""


def judge(*, steps: list[Step], picture: bytes | None) -> tuple[Outcome, str]:
    """The outcome of the commands that were run. The last may have ended early."""
    last = steps[-1]
    if found := fault(step=last):
        return Outcome.FAILED, f"{last_word(step=last)}: {found}"
    if last.code == 2:
        return Outcome.REFUSED, last.error()
    if last.code == 1:
        codes = ", ".join(sorted(verify_codes(step=last))) or last.stdout[:200]
        return Outcome.FAILED, f"{last_word(step=last)}: the dataset is not sound: {codes}"
    try:
        pixels = set() if picture is None else png_pixels(data=picture)
    except (ValueError, LookupError, zlib.error, struct.error) as error:
        return Outcome.FAILED, f"render: rgb.png cannot be read: {error}"
    if len(pixels) < 2:
        return Outcome.FAILED, f"render: {f'a single colour, {pixels.pop()}' if pixels else 'no picture'}"
    return Outcome.BUILT, ""


def last_word(*, step: Step) -> str:
    """The subcommand of `mateval prep`."""
    return next((word for word in ("build", "render", "verify") if f" prep {word} " in step.command), "command")


def verify_codes(*, step: Step) -> list[str]:
    """The codes of the errors that `prep verify` found."""
    try:
        findings = json.loads(step.stdout)["findings"]
        return [finding["code"] for finding in findings if finding["severity"] == "error"]
    except (ValueError, LookupError, TypeError):
        return []


def png_pixels(*, data: bytes) -> set[tuple[int, ...]]:
    """The colours of a PNG of 8 bits a channel that is not interlaced, with the filters of PNG, third edition, 9.2."""
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        raise ValueError("not a PNG")
    at, packed = 8, b""
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        content = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, color, _, _, interlaced = struct.unpack(">IIBBBBB", content)
        elif kind == b"IDAT":
            packed += content
        at += 12 + length
    channels = {0: 1, 2: 3, 4: 2, 6: 4}.get(color, 0)
    if depth != 8 or interlaced or not channels:
        raise ValueError(f"depth {depth}, colour type {color}, interlace {interlaced}")
    rows, stride = zlib.decompress(packed), channels * width
    above = bytes(stride)
    found: set[tuple[int, ...]] = set()
    for row in range(height):
        kind, *filtered = rows[row * (stride + 1) : (row + 1) * (stride + 1)]
        line = bytearray(stride)
        for k, value in enumerate(filtered):
            left, corner = (line[k - channels], above[k - channels]) if k >= channels else (0, 0)
            line[k] = value + predicted(kind=kind, left=left, up=above[k], corner=corner) & 255
        found.update(tuple(line[k : k + channels]) for k in range(0, stride, channels))
        above = bytes(line)
    return found


def predicted(*, kind: int, left: int, up: int, corner: int) -> int:
    """What a filter of PNG adds to a byte."""
    if kind == 4:
        # Paeth's: the neighbour nearest to left + up - corner, the first of equal ones.
        return min((left, up, corner), key=lambda value: abs(left + up - corner - value))
    return (0, left, up, (left + up) // 2)[kind]


def try_case(*, case: Case, folder: Path, mateval: str, seconds: float) -> Result:
    """Runs the three commands on a scene. Its recipe and its log are kept, its dataset is not."""
    folder.mkdir(parents=True)
    recipe, dataset = folder / "recipe.toml", folder / "dataset"
    head = f'name = "corpus"\nresolution = [{RESOLUTION[0]}, {RESOLUTION[1]}]\nviews = []\n\n'
    recipe.write_text(f'{head}[[scene]]\nid = "scene"\n{case.scene}', encoding="utf-8")
    steps: list[Step] = []
    for words in (
        ["build", recipe, "--source", case.source, "--out", dataset],
        ["render", dataset, "--renderer", "builtin", "--samples", SAMPLES, "--scorer-samples", SAMPLES],
        ["verify", dataset, "--format", "json"],
    ):
        steps.append(run_limited(words=[mateval, "prep", *map(str, words)], seconds=seconds))
        if steps[-1].code != 0:
            break
    log = "".join(f"$ {step.command}\n{step.stderr}{step.stdout}[exit code {step.code}]\n\n" for step in steps)
    (folder / "log.txt").write_text(log, encoding="utf-8")
    # Notes are in the dataset; a refused scene has only what was printed.
    findings = Counter(re.findall(r"^scene: \w+ \[(\w+)\]", steps[0].stderr, re.MULTILINE))
    description = dataset / "scenes/scene/scene.json"
    if description.is_file():
        findings = Counter(finding["code"] for finding in json.loads(description.read_text())["findings"])
    file = dataset / "scenes/scene/views/input/rgb.png"
    picture = file.read_bytes() if file.is_file() else None
    outcome, cause = judge(steps=steps, picture=picture)
    shutil.rmtree(dataset, ignore_errors=True)
    return Result(case, steps, outcome, cause, folder, findings, picture)
