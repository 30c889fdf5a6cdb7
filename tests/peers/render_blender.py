"""Renders the pictures of one job with Cycles and writes them as raw floats.

    python render_blender.py JOB.json

The job (made by blender.rs) names a result file and lists pictures: a scene (meshes as raw files, materials, lamps, the
light from outside), a camera, a number of samples and the seeds to render it with. The result holds, picture by picture and
seed by seed, linear RGB as little-endian float32, rows from the top. Space is the job's own: +Y up, as no axis matters to
Cycles, and Blender's camera looks along its -Z as the job's does.
"""

import array
import json
import math
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix

Job = dict[str, Any]

UV_LAYER = "uv"


def main() -> None:
    """Carries out the job named on the command line."""
    job: Job = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    with open(job["result"], "wb") as result:
        for picture in job["pictures"]:
            build(picture=picture)
            for seed in picture["seeds"]:
                result.write(render(picture=picture, seed=seed))
    # bpy 4.5 may hang when it is taken down in the ordinary way.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


def build(*, picture: Job) -> None:
    """Replaces whatever is loaded by the picture's scene, camera and settings."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    materials = [material(spec=spec) for spec in picture["materials"]]
    for surface in picture["surfaces"]:
        add_mesh(surface=surface, made_of=materials[surface["material"]])
    add_world(scene=scene, radiance=picture["world"])
    add_camera(scene=scene, spec=picture["camera"])
    set_up(scene=scene, samples=picture["samples"], bounces=picture["bounces"])


def read_floats(*, path: str, code: str = "f") -> array.array:
    """A file of little-endian 4-byte numbers."""
    numbers = array.array(code)
    numbers.frombytes(Path(path).read_bytes())
    if sys.byteorder == "big":
        numbers.byteswap()
    return numbers


def triples(*, numbers: array.array) -> list[tuple]:
    """The numbers, three by three."""
    return list(zip(numbers[0::3], numbers[1::3], numbers[2::3], strict=True))


def add_mesh(*, surface: Job, made_of: bpy.types.Material) -> None:
    """A mesh object; smooth where the surface has normals of its own."""
    mesh = bpy.data.meshes.new("mesh")
    faces = triples(numbers=read_floats(path=surface["triangles"], code="I"))
    mesh.from_pydata(triples(numbers=read_floats(path=surface["positions"])), [], faces)
    if surface["normals"]:
        mesh.shade_smooth()
        mesh.normals_split_custom_set_from_vertices(triples(numbers=read_floats(path=surface["normals"])))
    if surface["uvs"]:
        numbers = read_floats(path=surface["uvs"])
        layer = mesh.uv_layers.new(name=UV_LAYER)
        corners = [corner for face in faces for corner in face]
        layer.uv.foreach_set("vector", [number for k in corners for number in numbers[2 * k : 2 * k + 2]])
    mesh.materials.append(made_of)
    thing = bpy.data.objects.new("object", mesh)
    # Blender moves shadow rays off curved surfaces by default, which is no part of the material.
    thing.cycles.shadow_terminator_offset = 0.0
    thing.cycles.shadow_terminator_geometry_offset = 0.0
    bpy.context.scene.collection.objects.link(thing)


def material(*, spec: Job) -> bpy.types.Material:
    """A material that reflects, and may glow, or reflect for the camera and glow for all else."""
    made = bpy.data.materials.new("material")
    made.use_nodes = True
    made.cycles.emission_sampling = "FRONT_BACK"
    made.cycles.use_bump_map_correction = False
    tree = made.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    shader = reflecting(tree=tree, spec=spec)
    if spec["radiance"] is not None:
        emission = tree.nodes.new("ShaderNodeEmission")
        emission.inputs["Color"].default_value = (*spec["radiance"], 1.0)
        if spec["map"]:
            tree.links.new(emission_map(tree=tree, spec=spec["map"]).outputs["Color"], emission.inputs["Color"])
        combine = glowing if spec["camera_visible"] else hidden_from_camera
        shader = combine(tree=tree, surface=shader, emission=emission)
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return made


def emission_map(*, tree: bpy.types.NodeTree, spec: Job) -> bpy.types.Node:
    """A lamp's radiance, place by place."""
    image = bpy.data.images.new("map", width=spec["width"], height=spec["height"], float_buffer=True, is_data=True)
    image.pixels.foreach_set(read_floats(path=spec["texels"]))
    image.update()
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    texture.interpolation = "Linear"
    texture.extension = spec["extension"]
    uv = tree.nodes.new("ShaderNodeUVMap")
    uv.uv_map = UV_LAYER
    tree.links.new(uv.outputs["UV"], texture.inputs["Vector"])
    return texture


def glowing(*, tree: bpy.types.NodeTree, surface: bpy.types.Node, emission: bpy.types.Node) -> bpy.types.Node:
    """A surface that reflects and glows."""
    add = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(emission.outputs[0], add.inputs[0])
    tree.links.new(surface.outputs[0], add.inputs[1])
    return add


def hidden_from_camera(
    *, tree: bpy.types.NodeTree, surface: bpy.types.Node, emission: bpy.types.Node
) -> bpy.types.Node:
    """BlenderProc's lamp: the camera sees the surface, every other ray sees the light alone."""
    mix = tree.nodes.new("ShaderNodeMixShader")
    light_path = tree.nodes.new("ShaderNodeLightPath")
    tree.links.new(light_path.outputs["Is Camera Ray"], mix.inputs[0])
    tree.links.new(emission.outputs[0], mix.inputs[1])
    tree.links.new(surface.outputs[0], mix.inputs[2])
    return mix


def reflecting(*, tree: bpy.types.NodeTree, spec: Job) -> bpy.types.Node:
    """Lambert's diffuse, or Principled with all at its default but what the job sets."""
    color = (*spec["base_color"], 1.0)
    if spec["roughness"] is None:
        shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
        shader.inputs["Color"].default_value = color
        shader.inputs["Roughness"].default_value = 0.0
        return shader
    shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = color
    shader.inputs["Roughness"].default_value = spec["roughness"]
    shader.inputs["Metallic"].default_value = spec["metallic"]
    shader.inputs["Specular IOR Level"].default_value = spec["specular"]
    return shader


def add_world(*, scene: bpy.types.Scene, radiance: list[float]) -> None:
    """The same light from everywhere outside."""
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*radiance, 1.0)
    background.inputs["Strength"].default_value = 1.0
    scene.world = world


def add_camera(*, scene: bpy.types.Scene, spec: Job) -> None:
    """A square pinhole camera."""
    data = bpy.data.cameras.new("camera")
    data.sensor_fit = "HORIZONTAL"
    data.angle = spec["fov_x"]
    data.clip_start = 1e-4
    camera = bpy.data.objects.new("camera", data)
    camera.matrix_world = Matrix(spec["world_from_camera"])
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x = spec["size"]
    scene.render.resolution_y = spec["size"]
    scene.render.resolution_percentage = 100
    assert math.isclose(data.angle_x, spec["fov_x"], rel_tol=1e-5)


def set_up(*, scene: bpy.types.Scene, samples: int, bounces: int) -> None:
    """Cycles on the processor, with nothing clamped, blurred, guessed or denoised."""
    scene.render.engine = "CYCLES"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.image_settings.color_depth = "32"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = samples
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.use_guiding = False
    cycles.sampling_pattern = "TABULATED_SOBOL"
    cycles.pixel_filter_type = "BOX"
    cycles.film_exposure = 1.0
    cycles.sample_clamp_direct = 0.0
    cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = 0.0
    cycles.caustics_reflective = True
    cycles.caustics_refractive = True
    cycles.light_sampling_threshold = 0.0
    cycles.min_light_bounces = 0
    cycles.max_bounces = bounces
    for kind in ("diffuse", "glossy", "transmission", "volume"):
        setattr(cycles, f"{kind}_bounces", bounces)


def render(*, picture: Job, seed: int) -> bytes:
    """Linear RGB of one render, rows from the top."""
    scene = bpy.context.scene
    scene.cycles.seed = seed
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "picture.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        image.colorspace_settings.name = "Non-Color"
        size = picture["camera"]["size"]
        assert tuple(image.size) == (size, size)
        numbers = array.array("f", bytes(4 * image.channels * size * size))
        image.pixels.foreach_get(numbers)
        rows = from_the_top(numbers=numbers, channels=image.channels, size=size)
        bpy.data.images.remove(image)
    if sys.byteorder == "big":
        rows.byteswap()
    return rows.tobytes()


def from_the_top(*, numbers: array.array, channels: int, size: int) -> array.array:
    """Blender's rows run from the bottom and have alpha: RGB from the top."""
    rows = array.array("f")
    for y in reversed(range(size)):
        for x in range(size):
            start = (y * size + x) * channels
            rows.extend(numbers[start : start + 3])
    return rows


if __name__ == "__main__":
    main()
