"""Compares settings of Cycles by the noise that they leave for their cost, on the first view of a job.

    PYTHON_WITH_BPY -I -B blender_scripts/benches/noise_for_cost.py JOB.json [SAMPLES] [ROUNDS]

`prep render` leaves a job in `DATASET/.render/<scene>/` when it is interrupted. Every round renders two halves with each
setting, in turn and with seeds of their own. A setting's noise is the mean of ((a - b) / 2)^2 over pixels and channels,
linear, as in `render.json`; and the same after each value is cut at 1, which fireflies do not decide. Its cost is the CPU
seconds of the process. Noise falls with the number of samples and cost rises with it, so that their product compares
settings: half the product is the same noise for half the cost.
"""

import os
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy  # noqa: E402 (the folder above must come first)
import numpy as np  # noqa: E402
from mateval.cycles import render_to, set_up  # noqa: E402
from mateval.job import read_job  # noqa: E402
from mateval.scene import BuiltScene  # noqa: E402

SETTINGS = {
    "light tree": {"use_light_tree": True},
    "no light tree": {"use_light_tree": False},
    "light threshold 0.01": {"use_light_tree": False, "light_sampling_threshold": 0.01},
    "guiding": {"use_light_tree": False, "use_guiding": True},
}
"""Each changes these attributes of `set_up`'s."""


def main() -> None:
    """Prints one line for each setting: cost, noise, and both products relative to the first setting."""
    path = Path(sys.argv[1]).resolve()
    samples = int(sys.argv[2]) if len(sys.argv) > 2 else 32
    rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 2
    job, folder = read_job(path=path), path.parent
    built = BuiltScene(job=job, folder=folder)
    set_up(scene=built.scene, job=job)
    built.scene.render.image_settings.file_format = "OPEN_EXR"
    built.show_light()
    built.look_from(camera=job["views"][0]["camera"])
    usual = {name: getattr(built.scene.cycles, name) for values in SETTINGS.values() for name in values}
    found = {name: np.zeros(3) for name in SETTINGS}
    pictures: dict[str, list[np.ndarray]] = {name: [] for name in SETTINGS}
    for number in range(rounds):
        for name, values in SETTINGS.items():
            for attribute, value in {**usual, **values}.items():
                setattr(built.scene.cycles, attribute, value)
            halves, seconds = [], 0.0
            for half in range(2):
                file = folder / f"{half}.exr"
                start = time.process_time()
                render_to(scene=built.scene, path=file, samples=samples, seed=100 * number + half)
                seconds += time.process_time() - start
                halves.append(pixels(path=file))
            found[name] += [seconds, noise(halves=halves), noise(halves=[np.minimum(half, 1.0) for half in halves])]
            pictures[name] += halves
    first = next(iter(SETTINGS))
    for name, (seconds, plain, cut) in found.items():
        mean = float(np.mean([half.mean() for half in pictures[name]]))
        products = [seconds * plain, seconds * cut] / (found[first][0] * found[first][1:])
        print(
            f"{name}: {seconds / rounds:.1f} CPU s, noise {plain / rounds:.3e}, cut at 1 {cut / rounds:.3e}, "
            f"cost times noise {products[0]:.2f} and {products[1]:.2f} of the first, mean {mean:.5f}"
        )
    sys.stdout.flush()
    # As in render.py: bpy may hang in an ordinary exit.
    os._exit(0)


def pixels(*, path: Path) -> np.ndarray:
    """Returns the linear RGB of a file."""
    image = bpy.data.images.load(str(path))
    values = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values.reshape(-1, 4)[:, :3].astype(np.float64)


def noise(*, halves: list) -> float:
    """Returns the expected squared error of the mean of both halves."""
    return float(np.mean((halves[0] - halves[1]) ** 2) / 4.0)


if __name__ == "__main__":
    main()
