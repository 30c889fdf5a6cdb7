"""Evaluates OSL shaders in Blender's Cycles at 64 x 64 places.

    evaluate_osl.py JOB.json

The job has `cases`, each with the path of an OSL shader whose output is a colour, and `inputs`: name, step, start,
modulus, scale and offset. At place k an input is ((k * step + start) mod modulus) * scale + offset, whose arithmetic is
exact. Writes 4,096 colours of three 32-bit floats for each case to the job's `out`.
"""

import json
import os
import re
import sys
from pathlib import Path

import bpy
import numpy as np

# Part of bpy, so importable only after it.
import _cycles

SIDE = 64


def make_scene() -> bpy.types.Object:
    """A square that fills the picture, lit by its own material only."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.shading_system = True
    scene.cycles.samples = 1
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.cycles.pixel_filter_type = "BOX"
    # A sample anywhere in the pixel will do, since the shader rounds the place down to the pixel.
    scene.cycles.filter_width = 0.01
    scene.render.resolution_x = scene.render.resolution_y = SIDE
    scene.view_settings.view_transform = "Raw"
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR", "32", "NONE"
    mesh = bpy.data.meshes.new("square")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
    square = bpy.data.objects.new("square", mesh)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", 1.0, (0.5, 0.5, 1.0)
    scene.collection.objects.link(square)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return square


def compiled(*, source: Path) -> str:
    """The path of the compiled shader."""
    out = source.with_suffix(".oso")
    if not _cycles.osl_compile(str(source), str(out)):
        raise RuntimeError(f"'{source}' does not compile")
    return str(out)


def inputs_shader(*, case: dict) -> str:
    """A shader with the case's inputs at every pixel."""
    outputs = ", ".join(f"output float {each['name']} = 0" for each in case["inputs"])
    pixel = f"int k = int(floor(P[1] * {SIDE})) * {SIDE} + int(floor(P[0] * {SIDE}));"
    lines = [
        f"{each['name']} = (float)((k * {each['step']} + {each['start']}) % {each['modulus']})"
        f" * {each['scale']!r} + {each['offset']!r};"
        for each in case["inputs"]
    ]
    return f'#include "stdosl.h"\nshader inputs({outputs}) {{\n{pixel}\n' + "\n".join(lines) + "\n}\n"


def script_node(*, tree: bpy.types.NodeTree, path: str) -> bpy.types.Node:
    """A node that runs a compiled shader. Its sockets are made by hand: bpy of PyPI cannot query shaders."""
    node = tree.nodes.new("ShaderNodeScript")
    node.mode, node.filepath = "EXTERNAL", path
    return node


def material(*, case: dict) -> bpy.types.Material:
    """A material that glows in the shader's colour."""
    shader = Path(case["shader"])
    source = shader.with_name(shader.stem + "_inputs.osl")
    source.write_text(inputs_shader(case=case))
    made = bpy.data.materials.new(shader.stem)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    inputs = script_node(tree=tree, path=compiled(source=source))
    tested = script_node(tree=tree, path=compiled(source=shader))
    for each in case["inputs"]:
        out = inputs.outputs.new("NodeSocketFloat", each["name"])
        tree.links.new(out, tested.inputs.new("NodeSocketFloat", each["name"]))
    name = re.search(r"output color (\w+)", shader.read_text()[shader.read_text().index("shader generated"):]).group(1)
    color = tested.outputs.new("NodeSocketColor", name)
    glow = tree.nodes.new("ShaderNodeEmission")
    surface = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(color, glow.inputs["Color"])
    tree.links.new(glow.outputs[0], surface.inputs["Surface"])
    return made


def colors(*, square: bpy.types.Object, case: dict, picture: Path) -> np.ndarray:
    """The shader's colours, place by place."""
    square.data.materials.clear()
    square.data.materials.append(material(case=case))
    bpy.context.scene.render.filepath = str(picture)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(picture))
    image.colorspace_settings.name = "Non-Color"
    pixels = np.array(image.pixels[:], dtype=np.float32).reshape(-1, 4)[:, :3]
    bpy.data.images.remove(image)
    return pixels


def main() -> None:
    """Carries out the job."""
    job = json.loads(Path(sys.argv[1]).read_text())
    square = make_scene()
    picture = Path(job["out"]).with_suffix(".exr")
    found = [colors(square=square, case=case, picture=picture) for case in job["cases"]]
    Path(job["out"]).write_bytes(np.stack(found).astype("<f4").tobytes())
    sys.stdout.flush()
    # Blender's own exit may hang.
    os._exit(0)


if __name__ == "__main__":
    main()
