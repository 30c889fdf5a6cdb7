"""Times Mitsuba's path tracer on the shared scene `bench/dense`, on one thread, whenever its caller requests it.

Usage: path_speed_mitsuba.py VARIANT SCENE_FOLDER SIZE MAX_DEPTH. Each line on standard input is a number of samples a
pixel; the answer is a line with the CPU seconds of that render. There is no roulette. The first answer includes
compilation.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from pathlib import Path

import mitsuba as mi


def main() -> None:
    """Renders on request until the input ends."""
    variant, folder, size, max_depth = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)
    import drjit as dr
    from five_views_mitsuba import scene_dict, sensor

    dr.set_thread_count(1)
    with tempfile.TemporaryDirectory() as work:
        scene = mi.load_dict(scene_dict(folder=folder, work=Path(work)), optimize=False)
        camera = json.loads((folder / "scene.json").read_text())["camera"]
        view = sensor(camera=camera["camera_to_world"], size=[size, size], fov_x_deg=camera["fov_x_deg"])
        integrator = mi.load_dict({"type": "path", "max_depth": max_depth, "rr_depth": 1000})
        for seed, line in enumerate(sys.stdin):
            before = sum(os.times()[:2])
            picture = mi.render(scene, sensor=view, integrator=integrator, spp=int(line), seed=seed)
            dr.eval(picture)
            dr.sync_thread()
            print(sum(os.times()[:2]) - before, flush=True)


if __name__ == "__main__":
    main()
