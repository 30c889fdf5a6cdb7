"""Scores one of the shared bench scenes as one would with Mitsuba: fits radiances, then renders five views.

Reads one job file (JSON), writes pictures and one result file into the job's folder. Emitter radiances are fitted with
`prb` and Adam by L1 on linear RGB, as one logarithm for each channel; then each view is rendered by `path`. CPU time
(of all threads) and wall time of every stage are measured. `scalar_rgb` cannot differentiate and therefore only
renders.

Usage: five_views_mitsuba.py JOB.json
"""

from __future__ import annotations

import json
import os
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import mitsuba as mi
import numpy as np


def main() -> None:
    """Runs the job that the command line names."""
    job = json.loads(Path(sys.argv[1]).read_text())
    mi.set_variant(job["variant"])
    stages: list[dict] = []
    with timed(stages, name="load", samples=0):
        scene = mi.load_dict(scene_dict(folder=Path(job["scene"]), work=Path(job["out"])), optimize=False)
    result = {"variant": job["variant"], "stages": stages}
    if job["fit"]["iterations"] > 0:
        with timed(stages, name="fit", samples=job["fit"]["samples"]):
            result["fit"] = fit(scene=scene, job=job)
    integrator = mi.load_dict({"type": "path", "max_depth": job["max_depth"]})
    for samples in job["samples"]:
        with timed(stages, name="render", samples=samples):
            render_views(scene=scene, integrator=integrator, job=job, samples=samples)
    Path(job["out"], "result.json").write_text(json.dumps(result, indent=1))


@contextmanager
def timed(stages: list[dict], *, name: str, samples: int):
    """Adds a stage with its CPU and wall times in seconds."""
    cpu, wall = sum(os.times()[:2]), time.perf_counter()
    yield
    spent = {"cpu": sum(os.times()[:2]) - cpu, "wall": time.perf_counter() - wall}
    stages.append({"name": name, "samples": samples, **spent})


def scene_dict(*, folder: Path, work: Path) -> dict:
    """The scene of `scene.json` as a Mitsuba dictionary; its one mesh file is split by parts into `work`."""
    description = json.loads((folder / "scene.json").read_text())
    vertices, triangles = read_ply(folder / "dense.ply")
    scene: dict = {"type": "scene"}
    for texture in sorted({part["texture"] for part in description["parts"] if part["texture"]}):
        scene[texture_id(texture)] = {"type": "bitmap", "filename": str(folder / texture)}
    first = 0
    for part in description["parts"]:
        own = triangles[first : first + part["triangles"]]
        first += part["triangles"]
        path = work / f"{part['name']}.ply"
        if not path.exists():
            write_ply(path=path, vertices=vertices[own.min() : own.max() + 1], triangles=own - own.min())
        scene[part["name"]] = shape_dict(part=part, mesh=path)
    return scene


def texture_id(file: str) -> str:
    """The name of a texture in the scene, which may hold no dot. Parts share textures, as in our reader."""
    return "texture_" + file.replace(".", "_").replace("/", "_")


def shape_dict(*, part: dict, mesh: Path) -> dict:
    """One part: its mesh, its two-sided `principled`, its emission."""
    color = {"type": "rgb", "value": part["base_color"]}
    if part["texture"]:
        color = {"type": "ref", "id": texture_id(part["texture"])}
    material = {
        "type": "principled",
        "base_color": color,
        "roughness": part["roughness"],
        "metallic": part["metallic"],
        "specular": 0.5,
    }
    shape: dict = {
        "type": "ply",
        "filename": str(mesh),
        "flip_tex_coords": True,
        "bsdf": {"type": "twosided", "material": material},
    }
    if any(part["emission"]):
        shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": part["emission"]}}
    return shape


VERTEX = np.dtype([(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz", "u", "v")])
FACE = np.dtype([("count", "u1"), ("index", "<i4", 3)])


def read_ply(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a binary PLY with positions, normals and uvs."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    counts = [int(line.split()[2]) for line in data[:end].decode().splitlines() if line.startswith("element")]
    vertices = np.frombuffer(data, VERTEX, counts[0], end)
    return vertices, np.frombuffer(data, FACE, counts[1], end + vertices.nbytes)["index"]


def write_ply(*, path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Writes a PLY that `read_ply` can read."""
    properties = "".join(f"property float {name}\n" for name in VERTEX.names)
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{properties}"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.zeros(len(triangles), FACE)
    faces["count"], faces["index"] = 3, triangles
    path.write_bytes(header.encode() + vertices.tobytes() + faces.tobytes())


def sensor(*, camera: dict, size: list[int], fov_x_deg: float) -> mi.Sensor:
    """A pinhole camera. Our cameras look along -Z, Mitsuba's along +Z with +X to the left."""
    turned = np.array(camera) @ np.diag([-1.0, 1.0, -1.0, 1.0])
    film = {
        "type": "hdrfilm",
        "width": size[0],
        "height": size[1],
        "pixel_format": "rgb",
        "component_format": "float32",
        "rfilter": {"type": "box"},
    }
    return mi.load_dict(
        {
            "type": "perspective",
            "fov": fov_x_deg,
            "fov_axis": "x",
            "to_world": mi.ScalarTransform4f(turned),
            "film": film,
            "sampler": {"type": "independent"},
        }
    )


def render_views(*, scene: mi.Scene, integrator: mi.Integrator, job: dict, samples: int) -> None:
    """Renders every camera of the job and writes `view<k>_<samples>.f32`: rows of linear RGB."""
    for k, camera in enumerate(job["cameras"]):
        view = sensor(camera=camera, size=job["size"], fov_x_deg=job["fov_x_deg"])
        seed = 1000 * job["seed"] + k
        picture = np.array(mi.render(scene, sensor=view, integrator=integrator, spp=samples, seed=seed))
        picture[:, :, :3].astype("<f4").tofile(Path(job["out"], f"view{k}_{samples}.f32"))


def fit(*, scene: mi.Scene, job: dict) -> dict:
    """Fits all emitters' radiances, starting from one common grey; returns their errors relative to the scene's own."""
    import drjit as dr

    plan = job["fit"]
    size = plan["size"]
    target = mi.TensorXf(np.fromfile(plan["target"], "<f4").reshape(size[1], size[0], 3))
    view = sensor(camera=job["cameras"][0], size=size, fov_x_deg=plan["fov_x_deg"])
    integrator = mi.load_dict({"type": "prb", "max_depth": job["max_depth"]})
    params = mi.traverse(scene)
    keys = sorted(key for key in params.keys() if key.endswith("emitter.radiance.value"))
    truth = {key: np.array(params[key]).ravel() for key in keys}
    start = float(np.log(np.mean(list(truth.values()))))
    optimiser = mi.ad.Adam(lr=plan["learning_rate"])
    for key in keys:
        optimiser[key] = mi.Color3f(start)
    losses = []
    for iteration in range(plan["iterations"]):
        for key in keys:
            params[key] = dr.exp(optimiser[key])
        params.update()
        picture = mi.render(scene, params, sensor=view, integrator=integrator, spp=plan["samples"], seed=iteration)
        loss = dr.mean(dr.abs(picture - target), axis=None)
        dr.backward(loss)
        optimiser.step()
        losses.append(float(loss.array[0]))
    errors = [np.abs(np.exp(np.array(optimiser[key]).ravel()) / truth[key] - 1.0) for key in keys]
    for key in keys:
        params[key] = mi.Color3f(*[float(v) for v in truth[key]])
    params.update()
    return {"losses": losses, "median_error": float(np.median(errors)), "largest_error": float(np.max(errors))}


if __name__ == "__main__":
    main()
