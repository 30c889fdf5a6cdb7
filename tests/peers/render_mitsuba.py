"""Renders scenes with Mitsuba 3, several times each with different seeds.

The job (JSON) holds `variant` and `scenes`, a list of objects with `scene` (the XML), `out` (the file to write),
`seeds` (a list) and `samples` (a pixel and seed). Each `out` then holds the pictures one after another as little-endian
floats, row by row from the top, red, green, blue. `result.json` beside the job holds the `seconds` of each scene's
renders.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path

import numpy as np


def render(*, scene_file: Path, out: Path, seeds: list[int], samples: int) -> float:
    """Writes one picture for each seed and returns the seconds that rendering took."""
    import mitsuba as mi

    # Shapes are not merged: it would not be faster here.
    scene = mi.load_file(str(scene_file), optimize=False)
    started = time.monotonic()
    with out.open("wb") as file:
        for seed in seeds:
            picture = np.array(mi.render(scene, spp=samples, seed=seed), dtype="<f4")
            file.write(picture[:, :, :3].tobytes())
    return time.monotonic() - started


def main(job_file: Path) -> None:
    """Runs the job."""
    import mitsuba as mi

    job = json.loads(job_file.read_text(encoding="utf-8"))
    mi.set_variant(job.get("variant", "llvm_ad_rgb"))
    mi.set_log_level(mi.LogLevel.Error)
    seconds = [
        render(
            scene_file=Path(entry["scene"]),
            out=Path(entry["out"]),
            seeds=entry["seeds"],
            samples=entry["samples"],
        )
        for entry in job["scenes"]
    ]
    result = job_file.with_name("result.json")
    result.write_text(json.dumps({"seconds": seconds, "version": mi.__version__}), encoding="utf-8")
    # Skips Mitsuba's shutdown, which has nothing left to do and takes seconds.
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
