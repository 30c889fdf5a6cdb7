"""Times one view of a job with MatEval's settings and with BlenderProc's, in turn.

    PYTHON_WITH_BPY -I -B blender_scripts/benches/blenderproc_settings.py JOB.json [ROUNDS]

`prep render` leaves a job in `DATASET/.render/<scene>/` when it is interrupted. Both settings render the first view of
the job with the same materials, lights and passes. BlenderProc's settings are those of its 3D-FRONT examples: up to
1024 samples, adaptive to 0.01, 200 bounces, indirect light clamped at 10, glossy filter 1, Blackman-Harris, denoised in
the same run.
"""

import os
import statistics
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy  # noqa: E402 (the folder above must come first)
from mateval.cycles import render_to, set_up  # noqa: E402
from mateval.job import read_job  # noqa: E402
from mateval.scene import BuiltScene  # noqa: E402
from render import render_view  # noqa: E402

BLENDERPROC_SAMPLES = 1024
BLENDERPROC_BOUNCES = 200


def main() -> None:
    """Prints the seconds of every round and the ratio of the medians."""
    path = Path(sys.argv[1]).resolve()
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    job, folder = read_job(path=path), path.parent
    built = BuiltScene(job=job, folder=folder)
    set_up(scene=built.scene, job=job)
    built.show_light()
    view = job["views"][0]
    (folder / view["id"]).mkdir(exist_ok=True)
    built.look_from(camera=view["camera"])
    settings = built.scene.cycles
    own = {name: getattr(settings, name) for name in BLENDERPROC}
    seconds: dict[str, list[float]] = {"ours": [], "blenderproc": []}
    for _ in range(rounds):
        apply(settings=settings, values=own)
        start = time.monotonic()
        render_view(built=built, job=job, view=view, folder=folder)
        seconds["ours"].append(time.monotonic() - start)
        apply(settings=settings, values=BLENDERPROC)
        start = time.monotonic()
        render_to(scene=built.scene, path=folder / "blenderproc.exr", samples=BLENDERPROC_SAMPLES, seed=0)
        seconds["blenderproc"].append(time.monotonic() - start)
    for name, values in seconds.items():
        print(f"{name}: " + ", ".join(f"{value:.1f} s" for value in values))
    ratio = statistics.median(seconds["ours"]) / statistics.median(seconds["blenderproc"])
    print(f"two halves of {job['samples_each_half']} samples take {ratio:.2f} times as long as BlenderProc's settings")
    sys.stdout.flush()
    # As in render.py: bpy may hang in an ordinary exit.
    os._exit(0)


BLENDERPROC = {
    "use_adaptive_sampling": True,
    "adaptive_threshold": 0.01,
    "use_denoising": True,
    "denoiser": "OPENIMAGEDENOISE",
    "denoising_input_passes": "RGB_ALBEDO_NORMAL",
    "sample_clamp_indirect": 10.0,
    "blur_glossy": 1.0,
    "pixel_filter_type": "BLACKMAN_HARRIS",
    "filter_width": 1.5,
    "max_bounces": BLENDERPROC_BOUNCES,
    "diffuse_bounces": BLENDERPROC_BOUNCES,
    "glossy_bounces": BLENDERPROC_BOUNCES,
    "transmission_bounces": BLENDERPROC_BOUNCES,
    "transparent_max_bounces": BLENDERPROC_BOUNCES,
    "volume_bounces": 0,
}
"""Settings of Cycles as BlenderProc sets or leaves them."""


def apply(*, settings: bpy.types.PropertyGroup, values: dict) -> None:
    """Sets each attribute."""
    for name, value in values.items():
        setattr(settings, name, value)


if __name__ == "__main__":
    main()
