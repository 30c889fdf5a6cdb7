"""Opens COLMAP exports with pycolmap and compares where they and nerfstudio's exports show the same points.

nerfstudio itself is not installed, as it needs a build of torch for the graphics card: its files are read by its
documentation (https://docs.nerf.studio/quickstart/data_conventions.html).
"""

import importlib.metadata
import json
import sys
from pathlib import Path

import numpy as np
import pycolmap
from PIL import Image

TOLERANCE = 1e-6
"""How far apart two places of a point may be, in pixels."""


def place(*, transforms: dict, frame: dict, point: np.ndarray) -> np.ndarray:
    """The place of a point in a frame's picture, by nerfstudio's conventions."""
    x, y, z, _ = np.linalg.inv(np.array(frame["transform_matrix"])) @ np.append(point, 1.0)
    column = transforms["cx"] + transforms["fl_x"] * x / -z
    row = transforms["cy"] - transforms["fl_y"] * y / -z
    return np.array([column, row])


def depth_is_right(*, dataset: Path, out: Path, scene: str, frame: dict, model: pycolmap.Reconstruction) -> None:
    """Fails where the depth picture is not the depth of a point in millimetres, to the half of one."""
    image = next(image for image in model.images.values() if image.name == Path(frame["file_path"]).name)
    depth = np.array(Image.open(out / scene / frame["depth_file_path"]))
    assert depth.dtype == np.uint16 or depth.dtype == np.int32, depth.dtype
    if image.name != "input.png":
        return
    for seen in image.points2D:
        x, y = (int(value) for value in seen.xy)
        z = (image.cam_from_world() * model.points3D[seen.point3D_id].xyz)[2]
        assert abs(depth[y, x] - 1000.0 * z) <= 0.501, (depth[y, x], z)


def main(*, dataset: Path, colmap: Path, nerfstudio: Path) -> None:
    """Fails where a model cannot be read or two places of a point differ."""
    scenes = json.loads((dataset / "dataset.json").read_text())["scenes"]
    for scene in scenes:
        model = pycolmap.Reconstruction(colmap / scene / "sparse/0")
        transforms = json.loads((nerfstudio / scene / "transforms.json").read_text())
        assert transforms["camera_model"] == "OPENCV"
        frames = {Path(frame["file_path"]).name: frame for frame in transforms["frames"]}
        assert len(frames) == len(model.images) == 5
        worst, observations = 0.0, 0
        for image in model.images.values():
            size = Image.open(colmap / scene / "images" / image.name).size
            camera = model.cameras[image.camera_id]
            assert size == (camera.width, camera.height) == (transforms["w"], transforms["h"])
            for seen in image.points2D:
                point = model.points3D[seen.point3D_id].xyz
                found = image.project_point(point)
                other = place(transforms=transforms, frame=frames[image.name], point=point)
                worst = max(worst, np.abs(found - seen.xy).max(), np.abs(found - other).max())
                observations += 1
        for frame in frames.values():
            depth_is_right(dataset=dataset, out=nerfstudio, scene=scene, frame=frame, model=model)
        assert observations > 1000 and worst < TOLERANCE, (observations, worst)
        print(f"{scene}: {model.summary()}\n{observations} observations, at most {worst:.1e} pixels apart")
    print(f"pycolmap {importlib.metadata.version('pycolmap')}")


if __name__ == "__main__":
    main(dataset=Path(sys.argv[1]), colmap=Path(sys.argv[2]), nerfstudio=Path(sys.argv[3]))
