"""Reads a job: its JSON and the files beside it. Needs no bpy."""

import array
import json
import os
import sys
from pathlib import Path
from typing import Any

Job = dict[str, Any]

FORMAT = "mateval-blender-job/1"
RESULT_FORMAT = "mateval-blender-result/1"


class JobError(Exception):
    """A job that cannot be run. The message states what was expected and what was found."""


def read_job(*, path: Path) -> Job:
    """Returns the job, after checking that every file that it names exists."""
    job: Job = json.loads(path.read_text(encoding="utf-8"))
    if job.get("format") != FORMAT:
        raise JobError(f"'{path}': expected the format '{FORMAT}', found {job.get('format')!r}")
    folder = path.parent
    missing = [name for name in files_of(job=job) if not (folder / name).is_file()]
    if missing:
        names = ", ".join(f"'{name}'" for name in missing)
        raise JobError(f"'{folder}' lacks {names}")
    return job


def files_of(*, job: Job) -> list[str]:
    """Returns every file that the job names, relative to its folder."""
    files = [texture["file"] for texture in job["textures"]]
    for surface in job["surfaces"]:
        keys = ("positions", "triangles", "normals", "uvs", "parts")
        files.extend(surface[key] for key in keys if surface[key] is not None)
    return files


def read_numbers(*, path: Path, code: str) -> array.array:
    """Reads little-endian numbers: `f` for 32-bit floats, `I` for 32-bit and `H` for 16-bit unsigned integers."""
    numbers = array.array(code)
    numbers.frombytes(path.read_bytes())
    if sys.byteorder == "big":
        numbers.byteswap()
    return numbers


def write_result(*, folder: Path, result: Job) -> None:
    """Replaces `result.json`, which never exists incomplete."""
    place = folder / "result.json"
    work = folder / ".result.json.partial"
    work.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    os.replace(work, place)


def lights_of_surfaces(*, job: Job) -> dict[int, int]:
    """Returns the light group of every emitting surface."""
    owner: dict[int, int] = {}
    for group, light in enumerate(job["lights"]):
        emission = light["emission"]
        if emission["type"] != "area":
            continue
        for surface in emission["surfaces"]:
            if surface in owner:
                raise JobError(
                    f"surface {surface} is in the light groups {owner[surface]} and {group}; Blender supports one"
                )
            owner[surface] = group
    return owner


def light_of_world(*, job: Job) -> int | None:
    """Returns the light group that surrounds the scene. Blender has one world, so there can be one at most."""
    groups = [k for k, light in enumerate(job["lights"]) if light["emission"]["type"] != "area"]
    if len(groups) > 1:
        raise JobError(f"the light groups {groups} all surround the scene; Blender has one world")
    return groups[0] if groups else None


def group_name(*, group: int) -> str:
    """Returns the name of a light group in Blender, which its pass has too."""
    return f"group_{group:02}"
