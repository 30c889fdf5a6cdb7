"""A baking job, its result and the sizes of baked textures. Needs no bpy."""

import json
import math
from pathlib import Path
from typing import Any

from mateval.job import JobError

Job = dict[str, Any]

FORMAT = "mateval-bake/1"
RESULT_FORMAT = "mateval-baked/1"

KEYS = {
    "blend": str,
    "folder": str,
    "out": str,
    "texels": int,
    "texel_m": (int, float, type(None)),
    "most_texels": int,
    "samples": int,
    "world_rows": int,
    "threads": int,
    "most_instances": int,
    "most_triangles": int,
    "most_baked_texels": int,
}
"""The keys of a job besides `format`, and their types."""

SMALLEST_EDGE = 16
"""Edge in texels below which a texture would hold little more than its margin."""

MARGIN = 4
"""Width in texels by which each chart is extended, so that interpolation finds no background."""


def read_job(*, path: Path) -> Job:
    """Returns the job, after checking its keys and that its file and folder exist."""
    job: Job = json.loads(path.read_text(encoding="utf-8"))
    if job.get("format") != FORMAT:
        raise JobError(f"'{path}': expected the format '{FORMAT}', found {job.get('format')!r}")
    for key, kind in KEYS.items():
        if key not in job or not isinstance(job[key], kind) or isinstance(job[key], bool):
            raise JobError(f"'{path}': /{key}: found {job.get(key)!r}, which is not of the documented type")
    for key in ("texels", "most_texels", "samples", "world_rows"):
        if job[key] < 1:
            raise JobError(f"'{path}': /{key}: expected 1 or more, found {job[key]}")
    if job["texel_m"] is not None and not job["texel_m"] > 0:
        raise JobError(f"'{path}': /texel_m: expected a length in metres, found {job['texel_m']}")
    if not Path(job["blend"]).is_file():
        raise JobError(f"'{job['blend']}' is not a file")
    if not Path(job["folder"]).is_dir():
        raise JobError(f"'{job['folder']}' is not a folder")
    return job


def texture_edge(*, job: Job, area: float, covered: float) -> int:
    """Returns the edge of a square texture in texels: a power of two, unless a bound is none.

    `area` is that of the surface in square metres, `covered` the share of the texture that shows it.
    """
    if job["texel_m"] is None:
        return min(job["texels"], job["most_texels"])
    wanted = math.sqrt(area / max(covered, 1e-6)) / job["texel_m"]
    # A millionth less, so that rounding does not double an exact power.
    edge = 2 ** math.ceil(math.log2(max(wanted, 1.0)) - 1e-6)
    return min(max(edge, SMALLEST_EDGE), job["most_texels"])


def halvings(*, edges: list[int], most: int) -> int:
    """Returns how often all edges must be halved until their squares, summed, are at most `most`."""
    times = 0
    while sum(max(edge >> times, SMALLEST_EDGE) ** 2 for edge in edges) > most and max(edges) >> times > SMALLEST_EDGE:
        times += 1
    return times


class Findings:
    """What could not be read as it is. Each is kept once; `faults` forbid baking."""

    def __init__(self) -> None:
        self._notes: set[tuple[str, str, str, str]] = set()
        self._faults: set[tuple[str, str, str, str]] = set()

    def note(self, *, code: str, place: str, message: str, action: str) -> None:
        """Records a deviation and what was done instead."""
        self._notes.add((code, place, message, action))

    def fault(self, *, code: str, place: str, message: str, action: str) -> None:
        """Records a reason not to bake and what its user can do."""
        self._faults.add((code, place, message, action))

    @property
    def notes(self) -> list[dict[str, str]]:
        """The deviations, sorted."""
        return listed(findings=self._notes)

    @property
    def faults(self) -> list[dict[str, str]]:
        """The reasons not to bake, sorted."""
        return listed(findings=self._faults)


def listed(*, findings: set[tuple[str, str, str, str]]) -> list[dict[str, str]]:
    """Returns findings as JSON has them, sorted."""
    return [dict(zip(("code", "place", "message", "action"), each, strict=True)) for each in sorted(findings)]


def place_of(*, path: Path, folder: Path) -> str | None:
    """Returns a file's path relative to the folder, links resolved; none for a file outside of it."""
    real = path.resolve()
    return real.relative_to(folder.resolve()).as_posix() if real.is_relative_to(folder.resolve()) else None


def random_of_name(*, name: str) -> float:
    """Returns what Cycles' Object Info node gives as `Random` for an object that is no instance.

    Cycles 4.5, `intern/cycles/util/hash.h`: `hash_string`, then Jenkins' `hash_uint2` with 0.
    """
    text = 0
    for byte in name.encode():
        text = (text * 37 + byte) & 0xFFFFFFFF
    start = (0xDEADBEEF + (2 << 2) + 13) & 0xFFFFFFFF
    a, b, c = (start + text) & 0xFFFFFFFF, start, start

    def mixed(x: int, y: int, turn: int) -> int:
        return ((x ^ y) - ((y << turn | y >> (32 - turn)) & 0xFFFFFFFF)) & 0xFFFFFFFF

    c = mixed(c, b, 14)
    a = mixed(a, c, 11)
    b = mixed(b, a, 25)
    c = mixed(c, b, 16)
    a = mixed(a, c, 4)
    b = mixed(b, a, 14)
    c = mixed(c, b, 24)
    return random_of_id(number=c)


def random_of_id(*, number: int) -> float:
    """Returns `Random` of an instance with this 32-bit id, which Blender shows as a signed number."""
    return (number & 0xFFFFFFFF) / 0xFFFFFFFF
