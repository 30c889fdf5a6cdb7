"""Compares how fast mateval loads a scene's views and meshes in Python with imageio, OpenEXR and trimesh.

python tools/bench_views.py DATASET [SCENE], by a Python with an optimised build of mateval and these packages. Prints
the shortest of 15 runs, in milliseconds. First, both sides read every picture once: their values must be equal, and the
files are then in the disk's cache.
"""

import argparse
import pathlib
import time
from collections.abc import Callable

import imageio.v3
import numpy as np
import OpenEXR
import trimesh

import mateval

RUNS = 15
#: By the file of a view: its channels if it is an EXR, and its field of `View`.
FILES = {
    "rgb.exr": ("RGB", "rgb"),
    "rgb.png": ("", "preview"),
    "depth.exr": ("V", "depth"),
    "normal.exr": ("XYZ", "normal"),
    "instance.png": ("", "instance"),
    "part.png": ("", "part"),
    "valid.png": ("", "valid"),
    "unobserved.png": ("", "unobserved"),
}


def exr(path: pathlib.Path, channels: str) -> np.ndarray:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        planes = [file.channels()[channel].pixels.astype(np.float32) for channel in channels]
    return np.stack(planes, -1) if len(planes) > 1 else planes[0]


def others(folder: pathlib.Path) -> dict[str, np.ndarray]:
    """The pictures of a view by the fields of `View`."""
    return {
        field: exr(folder / name, channels) if channels else imageio.v3.imread(folder / name)
        for name, (channels, field) in FILES.items()
        if (folder / name).exists()
    }


def ours(view: mateval.View) -> dict[str, np.ndarray]:
    # The input view observes every pixel that it shows; other views have no photo.
    left_out = ("unobserved",) if view.id == "input" else ("rgb", "preview")
    return {field: getattr(view, field) for _, field in FILES.values() if field not in left_out}


def milliseconds(work: Callable[[], object]) -> float:
    times = []
    for _ in range(RUNS):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return 1000 * min(times)


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("dataset", type=pathlib.Path)
    words.add_argument("scene", nargs="?")
    given = words.parse_args()
    dataset = mateval.open(given.dataset)
    scene = dataset[given.scene or 0]
    folder = given.dataset / "scenes" / scene.id
    for view in scene.views.values():
        theirs = others(folder / "views" / view.id)
        for field, array in ours(view).items():
            assert np.array_equal(array, theirs[field] > 0 if array.dtype == bool else theirs[field]), (view.id, field)
    width, height = scene.input.camera.size
    glb = folder / "geometry/instances.glb"
    rows = (
        (
            f"{len(scene.views)} views of {width}x{height} pixels",
            lambda: [ours(view) for view in scene.views.values()],
            lambda: [others(folder / "views" / id) for id in scene.views],
        ),
        (
            f"meshes of {len(scene.instances)} instances",
            # A scene keeps its meshes, so each run opens it anew.
            lambda: [(mesh.vertices, mesh.faces) for mesh in (i.mesh for i in dataset[scene.id].instances.values())],
            lambda: [(mesh.vertices, mesh.faces) for mesh in trimesh.load(glb, process=False).geometry.values()],
        ),
    )
    for name, by_mateval, by_others in rows:
        print(f"{name}: mateval {milliseconds(by_mateval):.0f} ms, others {milliseconds(by_others):.0f} ms")


if __name__ == "__main__":
    main()
