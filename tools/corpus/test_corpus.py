#!/usr/bin/env python3
"""Builds, renders and verifies every scene file below a folder, and writes a page of the outcomes.

Scene files are `.glb`, `.gltf` and `.blend` files, `.xml` files whose root is `<scene>` (Mitsuba), and `.json` files
that hold an object with `mesh` and `scene` (houses of 3D-FRONT; the rooms with the most children are built).
Each gets a small recipe and the three commands `prep build`, `prep render` and `prep verify`. A scene is

- failed, after a signal, a panic, a traceback, an exit code other than 0, 1 and 2, more time or memory than allowed, a
  refusal that names no cause or a file that MatEval wrote itself, a dataset that `prep verify` calls unsound, or a
  picture of a single colour;
- refused, if a command ends with exit code 2 and names the cause;
- built otherwise.

Exit code 1: a scene failed. 2: nothing could be tried. `--self-test` checks the outcomes of files that it makes.
"""

from __future__ import annotations

import argparse
import base64
import json
import os
import resource
import shutil
import struct
import sys
import tempfile
import zlib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any, NoReturn

from files import find_cases
from page import write_page
from run import Outcome, Result, Step, fault, judge, png_pixels, run_limited, try_case


def try_folder(*, folder: Path, out: Path, words: argparse.Namespace) -> list[Result]:
    """Tries the scenes below a folder. Ends the program where there is nothing to try, or `out` holds other files."""
    folder, out = folder.resolve(), out.resolve()
    if not folder.is_dir():
        give_up(f"'{folder}' is no folder")
    if out.is_dir() and {entry.name for entry in out.iterdir()} - {"index.html", "index.html.new", "scenes"}:
        give_up(f"'{out}' holds files that this tool has not made; name another folder for the page")
    cases = list(find_cases(folder=folder, out=out, most_rooms=words.rooms, allow=words.allow))
    if not cases:
        give_up(f"no scene files were found below '{folder}'; looked for .glb, .gltf, .blend, Mitsuba XML and houses")
    shutil.rmtree(out / "scenes", ignore_errors=True)
    out.mkdir(parents=True, exist_ok=True)
    results: list[Result] = []
    with ThreadPoolExecutor(max_workers=words.jobs) as pool:
        pending = [
            pool.submit(
                try_case,
                case=case,
                folder=out / "scenes" / f"{number:04}",
                mateval=words.mateval,
                seconds=words.time_limit,
            )
            for number, case in enumerate(cases, start=1)
        ]
        for done in as_completed(pending):
            result = done.result()
            results.append(result)
            write_page(results=sorted(results, key=lambda each: each.folder), tried=len(cases), folder=folder, out=out)
            seconds = sum(step.seconds for step in result.steps)
            progress = f"{len(results)}/{len(cases)} {result.outcome.value} {seconds:.0f} s {result.case.name}"
            print(progress + (f": {result.cause}" if result.cause else ""), file=sys.stderr, flush=True)
    return results


def give_up(message: str) -> NoReturn:
    print(f"error: {message}", file=sys.stderr)
    sys.exit(2)


def summary(*, results: list[Result]) -> str:
    counts = Counter(result.outcome for result in results)
    files = len({result.case.file for result in results})
    seconds = sum(step.seconds for result in results for step in result.steps)
    numbers = ", ".join(f"{counts[outcome]} {outcome.value}" for outcome in reversed(Outcome))
    return f"{len(results)} scenes of {files} files: {numbers}; {seconds:.0f} s"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="where scene files are searched")
    parser.add_argument("out", type=Path, nargs="?", help="folder of the page, replaced [default: target/corpus]")
    parser.add_argument("--jobs", type=int, default=1, help="scenes at once, up to the number of CPUs")
    parser.add_argument("--time-limit", type=float, default=300, metavar="SECONDS", help="of each command")
    parser.add_argument("--memory-limit", type=float, default=12, metavar="GIB", help="address space of each command")
    parser.add_argument("--rooms", type=int, default=3, help="most rooms of a house")
    parser.add_argument("--allow", action="store_true", help="accept missing files and unstated colours")
    parser.add_argument("--self-test", action="store_true")
    parser.add_argument("--mateval", default="mateval", help=argparse.SUPPRESS)
    parser.add_argument("--default-out", type=Path, default=Path("target/corpus"), help=argparse.SUPPRESS)
    words = parser.parse_args()
    words.jobs = max(1, min(words.jobs, os.cpu_count() or 1))
    words.mateval = shutil.which(words.mateval) or give_up(f"'{words.mateval}' cannot be run; set MATEVAL")
    # Inherited by every command.
    most = int(words.memory_limit * 2**30)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    if words.self_test:
        self_test(words=words)
        return
    if words.folder is None:
        parser.error("name a folder, or --self-test")
    out = words.out or words.default_out
    results = try_folder(folder=words.folder, out=out, words=words)
    print(f"{summary(results=results)}; {out / 'index.html'}")
    sys.exit(any(result.outcome is Outcome.FAILED for result in results))


Corner = tuple[float, float, float]


def write_gltf(*, file: Path, quads: list[tuple[list[Corner], list[float]]], candela: float) -> None:
    """Writes a glTF of quads with a base colour each, a camera at the origin along -Z, and a light above it."""
    data = b"".join(struct.pack("<3f", *corner) for corners, _ in quads for corner in corners)
    indices = struct.pack("<6H", 0, 1, 2, 0, 2, 3)
    uri = "data:application/octet-stream;base64," + base64.b64encode(data + indices).decode()
    count = len(quads)
    views = [{"buffer": 0, "byteOffset": 48 * k, "byteLength": 48} for k in range(count)]
    views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(indices)})
    accessors: list[dict[str, Any]] = [
        {
            "bufferView": k,
            "componentType": 5126,
            "count": 4,
            "type": "VEC3",
            "min": [min(axis) for axis in zip(*corners, strict=True)],
            "max": [max(axis) for axis in zip(*corners, strict=True)],
        }
        for k, (corners, _) in enumerate(quads)
    ]
    accessors.append({"bufferView": count, "componentType": 5123, "count": 6, "type": "SCALAR"})
    look = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    tree = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": candela}]}},
        "buffers": [{"byteLength": len(data) + len(indices), "uri": uri}],
        "bufferViews": views,
        "accessors": accessors,
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [*color, 1.0], **look}} for _, color in quads],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": k}, "indices": count, "material": k}]} for k in range(count)
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1, "aspectRatio": 4 / 3}}],
        "nodes": [
            *({"mesh": k} for k in range(count)),
            {"camera": 0},
            {"extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [0.0, 1.0, 0.0]},
        ],
        "scenes": [{"nodes": list(range(count + 2))}],
    }
    file.write_text(json.dumps(tree))


def write_corpus(*, folder: Path) -> None:
    """Writes a room of triangles, a file that breaks off, and a wall that is lit until it is white."""
    floor = [(-3.0, -1.0, 0.0), (3.0, -1.0, 0.0), (3.0, -1.0, -4.0), (-3.0, -1.0, -4.0)]
    wall = [(-4.0, -3.0, -4.0), (4.0, -3.0, -4.0), (4.0, 3.0, -4.0), (-4.0, 3.0, -4.0)]
    quads = [(floor, [0.6, 0.3, 0.1]), (wall, [0.2, 0.4, 0.7])]
    write_gltf(file=folder / "room.gltf", quads=quads, candela=20_000.0)
    (folder / "broken.gltf").write_text((folder / "room.gltf").read_text()[:1000])
    write_gltf(file=folder / "white.gltf", quads=[(wall, [1.0, 1.0, 1.0])], candela=1e9)


REASON = "error: cannot read 'a.glb': No such file or directory"
ENDS = [
    ("build", 0, "", Outcome.FAILED, "no picture"),
    ("build", 2, REASON, Outcome.REFUSED, "cannot read"),
    ("build", 2, "error: '/bug/a.glb' cannot be built; it holds no mesh", Outcome.REFUSED, "no mesh"),
    ("build", 2, "error: it does not work", Outcome.FAILED, "names no cause"),
    ("build", 2, "", Outcome.FAILED, "nothing on stderr"),
    ("build", 2, "error: the source 'living-room/a.glb' is not valid:", Outcome.FAILED, "names no cause"),
    ("build", 2, "error: the source is not valid:\n  error [bad_json] '/a'", Outcome.REFUSED, "[bad_json] '/a'"),
    ("build", 2, "error: cannot read 'out/baking/scene.glb': it holds no nodes", Outcome.FAILED, "MatEval's own"),
    ("build", 2, "error: cannot read 'outside/scene.glb': it holds no nodes", Outcome.REFUSED, "no nodes"),
    ("build", 2, "error: 'a.glb' cannot be built; this is a bug, please report it", Outcome.FAILED, "names no cause"),
    ("build", 101, "thread 'main' panicked at src/a.rs:1:2:\nindex", Outcome.FAILED, "src/a.rs:1:2: index"),
    ("build", -6, "memory allocation of 9 bytes failed", Outcome.FAILED, "out of memory"),
    ("render", -11, "", Outcome.FAILED, "render: ended by SIGSEGV"),
    ("build", 3, REASON, Outcome.FAILED, "exit code 3"),
    ("build", 2, f"Traceback (most recent call last)\n{REASON}", Outcome.FAILED, "traceback"),
    ("verify", 1, "the file 'a' differs", Outcome.FAILED, "not sound: the file 'a' differs"),
]
"""A subcommand, its exit code, its output, the outcome, and words of the cause."""


def self_test(*, words: argparse.Namespace) -> None:
    """Ends the program with a message where an outcome is not the expected one."""
    for name, code, text, outcome, cause in ENDS:
        step = Step(f"mateval prep {name} x --out out", code, 1.0, stdout=text, stderr=text)
        found = judge(steps=[step], picture=None)
        if found[0] is not outcome or cause not in found[1]:
            sys.exit(f"{step}: expected '{outcome.value}' and '{cause}', found {found}")
    if fault(step=run_limited(words=["sleep", "60"], seconds=0.1)) != "took longer than 0 s":
        sys.exit("a command over the time limit is not noticed")
    most = int(words.memory_limit * 2**30)
    for size, code in ((2 * most, 1), (1000, 0)):
        step = run_limited(words=[sys.executable, "-c", f"bytearray({size})"], seconds=60)
        if (step.code, "MemoryError" in step.stderr) != (code, bool(code)):
            sys.exit(f"{size} bytes of {most}: {step}")
    check_png()
    with tempfile.TemporaryDirectory() as place:
        folder, out = Path(place) / "corpus", Path(place) / "out"
        folder.mkdir()
        write_corpus(folder=folder)
        (folder / "other.json").write_text("[]")
        (folder / "other.xml").write_text("<mesh/>")
        expected = {"broken.gltf": Outcome.REFUSED, "room.gltf": Outcome.BUILT, "white.gltf": Outcome.FAILED}
        results = try_folder(folder=folder, out=out, words=words)
        outcomes = {result.case.name: result.outcome for result in results}
        if outcomes != expected:
            sys.exit(f"expected {expected}, found {outcomes}: {[result.cause for result in results]}")
        page = (out / "index.html").read_text()
        at = [page.index(f"<th>{name}") for name in ("white.gltf", "broken.gltf", "room.gltf")]
        if at != sorted(at):
            sys.exit("the page does not list failures first and refusals next")
        # The twin: the same wall under little light is no failure.
        wall = [(-4.0, -3.0, -4.0), (4.0, -3.0, -4.0), (4.0, 3.0, -4.0), (-4.0, 3.0, -4.0)]
        write_gltf(file=folder / "white.gltf", quads=[(wall, [1.0, 1.0, 1.0])], candela=20_000.0)
        results = try_folder(folder=folder, out=out, words=words)
        if any(result.outcome is Outcome.FAILED for result in results):
            sys.exit(f"a lit wall fails: {[result.cause for result in results]}")
    print(f"self-test: {len(ENDS)} ends of commands, 2 limits, 5 filters of PNG, 3 files and a twin")


def check_png() -> None:
    """Decodes rows that each filter encodes, computed by hand: left 10, above 20, corner 5, byte 1."""
    header = struct.pack(">IIBBBBB", 2, 2, 8, 0, 0, 0, 0)
    for kind, value in enumerate((1, 11, 21, 16, 21)):
        # The second row's first byte is 10 after any filter, because its neighbours are known.
        first = 10 - (0, 0, 5, 2, 5)[kind]
        rows = zlib.compress(bytes([0, 5, 20, kind, first, 1]))
        chunks = b"".join(
            struct.pack(">I4s", len(content), name) + content + bytes(4)
            for name, content in ((b"IHDR", header), (b"IDAT", rows))
        )
        if (found := png_pixels(data=b"\x89PNG\r\n\x1a\n" + chunks)) != {(5,), (20,), (10,), (value,)}:
            sys.exit(f"filter {kind} of PNG: {found}")


if __name__ == "__main__":
    main()
