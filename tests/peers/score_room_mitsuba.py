"""Scores one submission in one room with other projects' software: Mitsuba, scikit-image, lpips.

Reads one job file (JSON), writes pictures and one result file into the job's folder. Emitter radiances are fitted as in
`five_views_mitsuba.py`; each track's views are rendered by the integrator that its scene names; albedo comes from the
`aov` integrator; `score_room_metrics.py` compares the pictures. CPU time (of all threads) and wall time of every stage
are measured. Importing modules and compiling kernels (by a short render of everything that follows) is the separate
stage `uncounted`.

Usage: score_room_mitsuba.py JOB.json
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np

TRACKS = ("true", "fitted")
ALBEDO_SAMPLES = 16
# Below four samples Mitsuba accumulates them in a different way.
WARM_UP_SAMPLES = 4


def main() -> None:
    """Runs the job that the command line names."""
    job = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    mi.set_variant(job["variant"])
    mi.set_log_level(mi.LogLevel.Error)
    # Both need a variant to be set.
    import five_views_mitsuba as five_views
    import score_room_metrics as metrics

    stages: list[dict] = []
    with five_views.timed(stages, name="load", samples=0):
        scenes = {track: mi.load_file(job["scenes"][track], optimize=False) for track in TRACKS}
        network = metrics.network(job["lpips_weights"])
        truth = [read_truth(view) for view in job["views"]]
    with five_views.timed(stages, name="uncounted", samples=WARM_UP_SAMPLES):
        warm_up(scenes=scenes, job=job, five_views=five_views)
    result: dict = {"stages": stages}
    if job["fit"]["iterations"] > 0:
        with five_views.timed(stages, name="fit", samples=job["fit"]["samples"]):
            result["losses"] = five_views.fit(scene=scenes["fitted"], job=job)["losses"]
    pictures = {}
    for track in TRACKS:
        with five_views.timed(stages, name=f"render {track}", samples=job["samples"][track]):
            pictures[track] = [
                render(scene=scenes[track], view=view, samples=job["samples"][track], seed=1000 * job["seed"] + k)
                for k, view in enumerate(sensors(job=job, five_views=five_views))
            ]
    with five_views.timed(stages, name="albedo", samples=ALBEDO_SAMPLES):
        pictures["albedo"] = [
            albedo(scene=scenes["fitted"], view=view) for view in sensors(job=job, five_views=five_views)
        ]
    scores = metrics.Scores(network=network, exposure=job["exposure"], stages=stages, timed=five_views.timed)
    result["values"] = [
        value
        for k, shown in enumerate(truth)
        for value in scores.view(truth=shown, pictures={name: views[k] for name, views in pictures.items()}, view=k)
    ]
    for track in TRACKS:
        for k, picture in enumerate(pictures[track]):
            picture.astype("<f4").tofile(Path(job["out"], f"{track}{k}.f32"))
    result["whole_lpips"] = [
        scores.whole_lpips(prediction=picture, truth=shown["rgb"])
        for picture, shown in zip(pictures["true"], truth)
    ]
    Path(job["out"], "result.json").write_text(json.dumps(result), encoding="utf-8")
    # Skips Mitsuba's shutdown, which has nothing left to do and takes seconds.
    sys.stdout.flush()
    os._exit(0)


def warm_up(*, scenes: dict, job: dict, five_views) -> None:
    """Compiles everything that the job will use."""
    view = sensors(job=job, five_views=five_views)[0]
    for scene in scenes.values():
        render(scene=scene, view=view, samples=WARM_UP_SAMPLES, seed=0)
    albedo(scene=scenes["fitted"], view=view)
    if job["fit"]["iterations"] > 0:
        short = {**job["fit"], "iterations": 2, "samples": WARM_UP_SAMPLES}
        five_views.fit(scene=scenes["fitted"], job={**job, "fit": short})
        render(scene=scenes["fitted"], view=view, samples=WARM_UP_SAMPLES, seed=0)


def sensors(*, job: dict, five_views) -> list[mi.Sensor]:
    """The cameras of all views."""
    return [
        five_views.sensor(camera=camera, size=job["size"], fov_x_deg=job["fov_x_deg"]) for camera in job["cameras"]
    ]


def render(*, scene: mi.Scene, view: mi.Sensor, samples: int, seed: int) -> np.ndarray:
    """Renders a picture with the scene's own integrator, linear RGB."""
    return np.array(mi.render(scene, sensor=view, spp=samples, seed=seed))[:, :, :3]


def albedo(*, scene: mi.Scene, view: mi.Sensor) -> np.ndarray:
    """Base colours as the camera sees them, linear: the channels that follow those of the picture."""
    integrator = mi.load_dict({"type": "aov", "aovs": "albedo:albedo"})
    return np.array(mi.render(scene, sensor=view, integrator=integrator, spp=ALBEDO_SAMPLES, seed=0))[:, :, -3:]


def read_truth(view: dict) -> dict:
    """The reference pictures of a view, linear, and its masks by region."""
    picture = lambda path: np.array(mi.Bitmap(path).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
    mask = lambda path: np.array(mi.Bitmap(path)).reshape(-1, view["size"][0]) > 0
    masks = {name: mask(path) for name, path in view["masks"].items()}
    return {"rgb": picture(view["rgb"]), "albedo": picture(view["albedo"]), "masks": masks}


if __name__ == "__main__":
    main()
