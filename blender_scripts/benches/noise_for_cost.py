"""Compares settings of Cycles by the noise that they leave for their cost, on the first view of a job.

    PYTHON_WITH_BPY -I -B blender_scripts/benches/noise_for_cost.py JOB.json [SAMPLES] [ROUNDS]

`prep render --renderer blender` leaves a job in `DATASET/.render/<scene>/` when it is interrupted. Every round renders two
halves with each setting, in turn and with seeds of their own. The noise of a picture is the mean of ((a - b) / 2)^2 over
pixels and channels, linear, after each value is cut at 1, so that single bright pixels do not decide; a light group's
pictures are scaled to the mean of the whole picture first. Cost is the CPU seconds of the process. Noise falls with the
number of samples and cost rises with it, so that their product compares settings: half the product is the same noise for
half the cost.
"""

import os
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy  # noqa: E402 (the folder above must come first)
import numpy as np  # noqa: E402
from mateval.cycles import light_passes, render_to, set_up  # noqa: E402
from mateval.job import read_job  # noqa: E402
from mateval.scene import BuiltScene  # noqa: E402

sys.path.append(str(Path(bpy.utils.resource_path("LOCAL"), "python/lib/python3.11/site-packages")))
import OpenImageIO  # noqa: E402 (comes with bpy, which does not put it on the path)

SETTINGS: dict[str, dict] = {
    "as rendered": {},
    "light tree": {"use_light_tree": True},
    "spatial splits": {"debug_use_spatial_splits": True},
    "blue noise": {"sampling_pattern": "BLUE_NOISE"},
    "guiding": {"use_guiding": True},
}
"""Each changes these attributes of `set_up`'s."""


def main() -> None:
    """Prints one line for each setting: cost, and cost times noise relative to the first setting."""
    path = Path(sys.argv[1]).resolve()
    samples = int(sys.argv[2]) if len(sys.argv) > 2 else 32
    rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 2
    job, folder = read_job(path=path), path.parent
    built = BuiltScene(job=job, folder=folder)
    set_up(scene=built.scene, job=job)
    built.show_light()
    built.look_from(camera=job["views"][0]["camera"])
    passes = light_passes(job=job)
    usual = {name: getattr(built.scene.cycles, name) for values in SETTINGS.values() for name in values}
    seconds = dict.fromkeys(SETTINGS, 0.0)
    found = {name: np.zeros(len(passes)) for name in SETTINGS}
    for number in range(rounds):
        for name, values in SETTINGS.items():
            for attribute, value in {**usual, **values}.items():
                setattr(built.scene.cycles, attribute, value)
            halves = []
            for half in range(2):
                file = folder / f"{half}.exr"
                start = time.process_time()
                render_to(scene=built.scene, path=file, samples=samples, seed=100 * number + half)
                seconds[name] += time.process_time() - start
                halves.append(pictures(path=file, passes=passes))
            found[name] += noise(halves=halves)
    first = next(iter(SETTINGS))
    for name in SETTINGS:
        products = seconds[name] * found[name] / (seconds[first] * found[first])
        groups = " ".join(f"{product:.2f}" for product in products[1:])
        print(
            f"{name}: {seconds[name] / rounds:.1f} CPU s, noise {found[name][0] / rounds:.3e}, "
            f"cost times noise {products[0]:.2f} of the first; by light group {groups}"
        )
    sys.stdout.flush()
    # As in render.py: bpy may hang in an ordinary exit.
    os._exit(0)


def pictures(*, path: Path, passes: list[str]) -> np.ndarray:
    """Returns the linear RGB of each of these passes, as (passes, pixels, 3)."""
    file = OpenImageIO.ImageInput.open(str(path))
    names = list(file.spec().channelnames)
    pixels = file.read_image(0, 0, 0, len(names), "float")
    file.close()
    layer = names[0].split(".")[0]
    planes = [[names.index(f"{layer}.{name}.{channel}") for channel in "RGB"] for name in passes]
    return np.stack([pixels[..., plane].reshape(-1, 3).astype(np.float64) for plane in planes])


def noise(*, halves: list) -> np.ndarray:
    """Returns the expected squared error of the mean of both halves, for each pass."""
    means = (halves[0] + halves[1]).mean(axis=(1, 2)) / 2.0
    scale = (means[0] / np.maximum(means, 1e-12))[:, None, None]
    cut = [np.minimum(half * scale, 1.0) for half in halves]
    return np.mean((cut[0] - cut[1]) ** 2, axis=(1, 2)) / 4.0


if __name__ == "__main__":
    main()
