"""Differentiates pictures by base colours with Mitsuba 3's path replay backpropagation (`prb`).

The job (JSON) holds `scene` (the XML of an exported scene), `out` (the file to write), `seeds` (a list), `samples` (a
pixel and seed), `max_depth`, `block` (the side of a block in pixels) and `materials` (a count). `out` then holds
little-endian floats: for each seed, block (row by row) and material (in order), the derivative of the block's mean by
the base colour, red, green, blue.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import numpy as np


def color_keys(*, keys: list[str], materials: int) -> list[str]:
    """Returns the parameter that is the base colour of each exported material."""
    found = []
    for index in range(materials):
        own = [key for key in keys if key.startswith(f"material_{index}.")]
        (color,) = [key for key in own if key.endswith((".reflectance.value", ".base_color.value"))]
        found.append(color)
    return found


def block_weights(*, width: int, height: int, block: int) -> list[np.ndarray]:
    """Returns one picture for each block, whose product with a picture sums to the mean of the block."""
    weights = []
    for top in range(0, height, block):
        for left in range(0, width, block):
            weight = np.zeros((height, width, 3), dtype=np.float32)
            weight[top : top + block, left : left + block] = 1.0
            weights.append(weight / weight[:, :, 0].sum())
    return weights


def derivatives(*, job: dict) -> np.ndarray:
    """Returns the derivatives by seed, block, material and channel."""
    import drjit as dr
    import mitsuba as mi

    # Shapes and materials are not merged: each surface keeps its own parameters.
    scene = mi.load_file(job["scene"], optimize=False)
    parameters = mi.traverse(scene)
    keys = color_keys(keys=list(parameters.keys()), materials=job["materials"])
    for key in keys:
        dr.enable_grad(parameters[key])
    parameters.update()
    integrator = mi.load_dict({"type": "prb", "max_depth": job["max_depth"]})
    width, height = scene.sensors()[0].film().size()
    weights = block_weights(width=width, height=height, block=job["block"])
    found = np.zeros((len(job["seeds"]), len(weights), len(keys), 3), dtype="<f4")
    for at_seed, seed in enumerate(job["seeds"]):
        for at_block, weight in enumerate(weights):
            for key in keys:
                dr.set_grad(parameters[key], 0)
            # Each block has its own numbers.
            own = seed * len(weights) + at_block
            picture = mi.render(scene, parameters, integrator=integrator, spp=job["samples"], seed=own)
            dr.backward(dr.sum(picture * mi.TensorXf(weight), axis=None))
            for at_key, key in enumerate(keys):
                found[at_seed, at_block, at_key] = np.array(dr.grad(parameters[key])).ravel()
    return found


def main(job_file: Path) -> None:
    """Runs the job."""
    import mitsuba as mi

    job = json.loads(job_file.read_text(encoding="utf-8"))
    mi.set_variant("llvm_ad_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    Path(job["out"]).write_bytes(derivatives(job=job).tobytes())
    # Skips Mitsuba's shutdown, which has nothing left to do and takes seconds.
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
