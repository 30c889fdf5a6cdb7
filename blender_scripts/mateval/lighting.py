"""Lamps, camera and world of a scene that is read, as glTF and the result can hold them."""

import math
from pathlib import Path

import bpy
from mathutils import Matrix, Vector

from mateval.baking_job import Findings, Job
from mateval.evaluated import Placed
from mateval.nodes import new

CORNERS = 32
"""Corners of a polygon that stands for an elliptic lamp."""

IDENTITY = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def add_light(*, light: Placed, scene: bpy.types.Scene, findings: Findings) -> dict | None:
    """Adds a lamp: an area lamp as a surface that emits, any other as one of KHR_lights_punctual.

    Returns the node of a surface, which in Blender casts no shadow and is seen by the camera only if it is `visible`.
    """
    source = light.original.data
    color = color_of(light=light, findings=findings)
    if max(color) <= 0.0:
        return None
    if source.type == "AREA":
        made = add_area(light=light, power=color, scene=scene, findings=findings)
        return made and {"node": made.name, "visible": light.original.visible_camera}
    made = bpy.data.lights.new(source.name, source.type)
    made.energy = max(color)
    made.color = tuple(channel / made.energy for channel in color)
    if source.type == "SPOT":
        made.spot_size, made.spot_blend = source.spot_size, source.spot_blend
    add(name=light.name, data=made, matrix=light.world_from_object, scene=scene)
    return None


def color_of(*, light: Placed, findings: Findings) -> tuple[float, ...]:
    """Returns a lamp's power in watts (of a sun, its irradiance in W/m^2) by colour channel."""
    source, name = light.original.data, light.name
    strength = source.energy * 2.0**source.exposure
    if not source.normalize:
        strength *= source.area(matrix_world=light.world_from_object)
    color = [channel * strength for channel in source.color]
    if source.use_temperature:
        color = [a * b for a, b in zip(color, source.temperature_color, strict=True)]
    if source.use_nodes and source.node_tree is not None:
        node = emission_of(tree=source.node_tree)
        if node is None:
            action = "used the lamp's own colour and power"
            findings.note(code="light_nodes", place=name, message="nodes beyond one constant Emission", action=action)
        else:
            factor = node.inputs["Strength"].default_value
            color = [a * b * factor for a, b in zip(color, node.inputs["Color"].default_value, strict=False)]
    return tuple(max(channel, 0.0) for channel in color)


def emission_of(*, tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    """Returns the shader of a lamp or a world if it is a single one of constant colour and strength."""
    output = tree.get_output_node("CYCLES")
    links = output.inputs["Surface"].links if output is not None else ()
    node = links[0].from_node if links else None
    if node is None or node.bl_idname not in ("ShaderNodeEmission", "ShaderNodeBackground"):
        return None
    return None if any(node.inputs[name].is_linked for name in ("Color", "Strength")) else node


def add_area(
    *, light: Placed, power: tuple[float, ...], scene: bpy.types.Scene, findings: Findings
) -> bpy.types.Object | None:
    """Adds an area lamp as a polygon that emits towards its -Z; none for one without an area.

    A lamp of power P and area A in the world has the radiance P / (pi A) (Cycles 4.5, `scene/light.cpp`).
    """
    source = light.original.data
    if source.spread < math.pi - 1e-3:
        action = "let it shine in every direction of its front"
        findings.note(code="spread", place=light.name, message="an area lamp with a spread", action=action)
    is_round = source.shape in ("DISK", "ELLIPSE")
    width = source.size
    height = source.size_y if source.shape in ("RECTANGLE", "ELLIPSE") else width
    outline = outline_of(width=width, height=height, is_round=is_round)
    scale = [column.length for column in light.world_from_object.to_3x3().col]
    area = polygon_area(outline=outline) * scale[0] * scale[1]
    if area <= 0.0:
        return None
    mesh = bpy.data.meshes.new(source.name)
    # Clockwise seen from +Z, so that the front faces -Z.
    mesh.from_pydata([(x, y, 0.0) for x, y in reversed(outline)], [], [range(len(outline))])
    radiance = tuple(channel / (math.pi * area) for channel in power)
    mesh.materials.append(emitting(name=f"light {light.name}", radiance=radiance))
    return add(name=light.name, data=mesh, matrix=light.world_from_object, scene=scene)


def outline_of(*, width: float, height: float, is_round: bool) -> list[tuple[float, float]]:
    """Returns the corners of a lamp, counter-clockwise. A polygon for an ellipse has the ellipse's area."""
    if not is_round:
        x, y = width / 2.0, height / 2.0
        return [(-x, -y), (x, -y), (x, y), (-x, y)]
    step = 2.0 * math.pi / CORNERS
    grown = math.sqrt(step / math.sin(step))
    return [
        (math.cos(k * step) * width / 2.0 * grown, math.sin(k * step) * height / 2.0 * grown) for k in range(CORNERS)
    ]


def polygon_area(*, outline: list[tuple[float, float]]) -> float:
    """Returns the area of a polygon (the shoelace formula)."""
    turned = [*outline[1:], outline[0]]
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(outline, turned, strict=True)) / 2.0


def emitting(*, name: str, radiance: tuple[float, ...]) -> bpy.types.Material:
    """Makes a black material that emits on its front only."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    made.use_backface_culling = True
    tree = made.node_tree
    tree.nodes.clear()
    peak = max(radiance)
    shader = new(
        tree=tree,
        kind="ShaderNodeBsdfPrincipled",
        Base_Color=(0.0, 0.0, 0.0, 1.0),
        Roughness=1.0,
        Emission_Color=(*(channel / peak for channel in radiance), 1.0),
        Emission_Strength=peak,
    )
    new(tree=tree, kind="ShaderNodeOutputMaterial", Surface=shader.outputs[0])
    return made


def add_camera(*, camera: Placed | None, source: bpy.types.Scene, scene: bpy.types.Scene, findings: Findings) -> None:
    """Adds the scene's camera, with the proportions of its picture."""
    if camera is None:
        findings.note(code="camera", place="scene", message="the scene has no camera", action="wrote none")
        return
    data, name = camera.original.data, camera.name
    if data.type != "PERSP":
        message = f"a camera of the type {data.type.lower()}"
        findings.note(code="camera", place=name, message=message, action="left it out")
        return
    if data.shift_x != 0.0 or data.shift_y != 0.0:
        findings.note(code="camera", place=name, message="a shifted lens", action="left the shift out")
    for key in ("resolution_x", "resolution_y", "pixel_aspect_x", "pixel_aspect_y"):
        setattr(scene.render, key, getattr(source.render, key))
    scene.camera = add(name=name, data=data, matrix=camera.world_from_object, scene=scene)


def add(*, name: str, data: bpy.types.ID, matrix: Matrix, scene: bpy.types.Scene) -> bpy.types.Object:
    """Adds an object to the scene."""
    made = bpy.data.objects.new(name, data)
    scene.collection.objects.link(made)
    made.matrix_world = matrix
    return made


def read_world(*, source: bpy.types.Scene, bench: bpy.types.Scene, job: Job, findings: Findings) -> dict:
    """Returns the world's radiance, or renders its map of directions to `world.exr`.

    The map's left edge looks to the -Z of glTF, and u grows towards +X: format/truth.md, "Environment lookup", without
    a rotation.
    """
    world = source.world
    if world is None:
        return {"radiance": [0.0, 0.0, 0.0]}
    if not world.use_nodes or world.node_tree is None:
        return {"radiance": list(world.color)}
    node = emission_of(tree=world.node_tree)
    if node is not None:
        strength = node.inputs["Strength"].default_value
        return {"radiance": [max(channel * strength, 0.0) for channel in node.inputs["Color"].default_value[:3]]}
    if any(each.bl_idname == "ShaderNodeLightPath" for each in world.node_tree.nodes):
        action = "used what the camera sees"
        findings.note(code="view_dependent", place=f"world '{world.name}'", message="Light Path", action=action)
    path = Path(job["out"]) / "world.exr"
    render_world(world=world, bench=bench, path=path, rows=job["world_rows"])
    return {"image": path.name, "world_from_environment": IDENTITY}


def render_world(*, world: bpy.types.World, bench: bpy.types.Scene, path: Path, rows: int) -> None:
    """Renders all directions of a world, as the map that `read_world` describes."""
    camera = bpy.data.cameras.new("directions")
    camera.type, camera.panorama_type = "PANO", "EQUIRECTANGULAR"
    thing = add(name="directions", data=camera, matrix=world_from_directions(), scene=bench)
    bench.world, bench.camera = world, thing
    output = next(iter(world.node_tree.get_output_node("CYCLES").inputs["Volume"].links), None)
    if output is not None:
        world.node_tree.links.remove(output)
    render = bench.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 2 * rows, rows, 100
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.filepath, render.use_file_extension = str(path), False
    render.film_transparent = False
    bpy.context.window.scene = bench
    bpy.ops.render.render(write_still=True, scene=bench.name)
    bpy.data.objects.remove(thing)
    bench.world = None
    if not path.is_file():
        raise RuntimeError(f"Blender did not write '{path}'")


def world_from_directions() -> Matrix:
    """Returns the pose of a panoramic camera whose left edge looks to Blender's +Y, which is -Z in glTF."""
    back, up = Vector((0.0, 1.0, 0.0)), Vector((0.0, 0.0, 1.0))
    right = up.cross(back)
    return Matrix((right, up, back)).transposed().to_4x4()
