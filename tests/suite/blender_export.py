"""Builds a scene of MatEval in Blender and writes it with Blender's own glTF exporter.

The job is a JSON file: `surfaces`, `materials`, `lights` and `camera` as in a dataset's `reference.json`, `lights.json`
and `scene.json`, `textures` as files, and `lamps` of Blender's own.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix, Vector

Job = dict[str, Any]

WORLD = Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))
"""Blender's world, +Z up, from MatEval's, +Y up."""

EXTENSIONS = {"repeat": "REPEAT", "clamp": "EXTEND", "mirror": "MIRROR"}


def texture_node(*, tree: bpy.types.NodeTree, job: Job, lookup: Job, is_color: bool) -> bpy.types.Node:
    """Adds a lookup of a texture at the surface's uv."""
    node = tree.nodes.new("ShaderNodeTexImage")
    texture = job["textures"][lookup["texture"]]
    node.image = bpy.data.images.load(texture["file"], check_existing=True)
    node.image.colorspace_settings.name = "sRGB" if is_color else "Non-Color"
    node.extension = EXTENSIONS[texture["wrap"]]
    (scale_u, _, offset_u), (_, scale_v, offset_v) = lookup["uv"]
    if (scale_u, scale_v, offset_u, offset_v) != (1, 1, 0, 0):
        mapping = tree.nodes.new("ShaderNodeMapping")
        mapping.inputs["Scale"].default_value = (scale_u, scale_v, 1)
        mapping.inputs["Location"].default_value = (offset_u, offset_v, 0)
        tree.links.new(tree.nodes.new("ShaderNodeUVMap").outputs["UV"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs["Vector"], node.inputs["Vector"])
    return node


def put_color(*, tree: bpy.types.NodeTree, job: Job, socket: bpy.types.NodeSocket, value: Job) -> None:
    """Gives a socket a constant colour or a texture."""
    if "constant" in value:
        socket.default_value = (*value["constant"], 1.0)
    else:
        node = texture_node(tree=tree, job=job, lookup=value["texture"], is_color=True)
        tree.links.new(node.outputs["Color"], socket)


def put_number(*, tree: bpy.types.NodeTree, job: Job, socket: bpy.types.NodeSocket, value: Job) -> None:
    """Gives a socket a constant number or one channel of a texture."""
    if "constant" in value:
        socket.default_value = value["constant"]
    else:
        node = texture_node(tree=tree, job=job, lookup=value["texture"], is_color=False)
        channels = tree.nodes.new("ShaderNodeSeparateColor")
        tree.links.new(node.outputs["Color"], channels.inputs["Color"])
        tree.links.new(channels.outputs[value["texture"]["channel"]], socket)


def made_material(*, job: Job, material: Job, light: Job | None) -> bpy.types.Material:
    """Makes a principled material; one of a light emits."""
    made = bpy.data.materials.new(material["name"])
    made.use_nodes = True
    tree = made.node_tree
    inputs = tree.nodes["Principled BSDF"].inputs
    model = material["model"]
    if model["type"] == "thin_dielectric":
        inputs["Transmission Weight"].default_value = 1.0
        inputs["Roughness"].default_value = 0.0
        inputs["IOR"].default_value = model["eta"]
        put_color(tree=tree, job=job, socket=inputs["Base Color"], value=model["specular_transmittance"])
    else:
        put_color(tree=tree, job=job, socket=inputs["Base Color"], value=model["base_color"])
        put_number(tree=tree, job=job, socket=inputs["Roughness"], value=model["roughness"])
        put_number(tree=tree, job=job, socket=inputs["Metallic"], value=model["metallic"])
    if light is not None:
        strength = max(light["radiance"])
        inputs["Emission Color"].default_value = (*(value / strength for value in light["radiance"]), 1.0)
        inputs["Emission Strength"].default_value = strength
        made.use_backface_culling = not light["two_sided"]
    return made


def made_mesh(*, surface: Job) -> bpy.types.Mesh:
    """Makes the mesh of a surface in Blender's world."""
    mesh = bpy.data.meshes.new(surface["name"])
    corners = [tuple(WORLD @ Vector(place)) for place in surface["positions"]]
    mesh.from_pydata(corners, [], surface["triangles"])
    if surface["uvs"] is not None:
        layer = mesh.uv_layers.new(name="uv")
        for loop in mesh.loops:
            layer.data[loop.index].uv = surface["uvs"][loop.vertex_index]
    if surface["normals"] is not None:
        mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
        turned = [tuple(WORLD.to_3x3() @ Vector(normal)) for normal in surface["normals"]]
        mesh.normals_split_custom_set_from_vertices(turned)
    return mesh


def add_surfaces(*, job: Job) -> None:
    """Adds all surfaces with their materials. A surface that emits has a material of its own."""
    emissions = [light["emission"] for light in job["lights"] if light["emission"]["type"] == "area"]
    lamps = {surface: emission for emission in emissions for surface in emission["surfaces"]}
    shared: dict[int, bpy.types.Material] = {}
    for number, surface in enumerate(job["surfaces"]):
        mesh, index, light = made_mesh(surface=surface), surface["material"], lamps.get(number)
        if light is None and index not in shared:
            shared[index] = made_material(job=job, material=job["materials"][index], light=None)
        own = shared[index] if light is None else made_material(job=job, material=job["materials"][index], light=light)
        mesh.materials.append(own)
        bpy.context.collection.objects.link(bpy.data.objects.new(surface["name"], mesh))


def add_camera(*, camera: Job) -> None:
    """Adds the camera."""
    data = bpy.data.cameras.new("camera")
    lens = camera["intrinsics"]
    data.sensor_fit, data.angle = "HORIZONTAL", 2 * math.atan(lens["width"] / 2 / lens["fx"])
    made = bpy.data.objects.new("camera", data)
    made.matrix_world = WORLD @ Matrix(camera["world_from_camera"])
    bpy.context.collection.objects.link(made)
    bpy.context.scene.camera = made
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = lens["width"], lens["height"]


def add_lamps(*, lamps: list[Job]) -> None:
    """Adds lamps of Blender's own kinds. They shine down, as they do without a rotation."""
    for lamp in lamps:
        data = bpy.data.lights.new(lamp["name"], lamp["type"])
        data.energy = lamp["energy"]
        if lamp["type"] == "SPOT":
            data.spot_size, data.spot_blend = lamp["spot_size"], lamp["spot_blend"]
        made = bpy.data.objects.new(lamp["name"], data)
        made.matrix_world = Matrix.Translation(WORLD @ Vector(lamp["position"]))
        bpy.context.collection.objects.link(made)


def main() -> None:
    """Reads the job and writes the file that it names."""
    job = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    add_surfaces(job=job)
    add_camera(camera=job["camera"])
    add_lamps(lamps=job["lamps"])
    bpy.ops.export_scene.gltf(
        filepath=job["out"],
        export_format=job["format"],
        export_cameras=True,
        export_lights=True,
        export_import_convert_lighting_mode="SPEC",
    )


if __name__ == "__main__":
    main()
