"""The light that surrounds a scene."""

import bpy

from mateval.environment import blender_from_world
from mateval.job import Job, group_name, light_of_world
from mateval.materials import Textures
from mateval.nodes import constant, is_camera_ray, linear_map, mix, new, times


def add_world(*, scene: bpy.types.Scene, job: Job, textures: Textures) -> None:
    """Makes the world of the job's surrounding light group; black where there is none."""
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    scene.world = world
    tree = world.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputWorld")
    group = light_of_world(job=job)
    if group is None:
        return
    light = job["lights"][group]
    world.lightgroup = group_name(group=group)
    shader = new(
        tree=tree, kind="ShaderNodeBackground", Color=radiance(tree=tree, textures=textures, light=light), Strength=1.0
    ).outputs[0]
    if not light["camera_visible"]:
        black = new(tree=tree, kind="ShaderNodeBackground", Strength=0.0).outputs[0]
        shader = mix(tree=tree, factor=is_camera_ray(tree=tree), first=shader, second=black)
    tree.links.new(shader, output.inputs["Surface"])


def radiance(*, tree: bpy.types.NodeTree, textures: Textures, light: Job) -> bpy.types.NodeSocket:
    """Adds the surrounding radiance: constant, or from a latitude-longitude map."""
    emission = light["emission"]
    if emission["type"] == "constant":
        return constant(tree=tree, color=emission["radiance"])
    direction = tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"]
    rows = blender_from_world(world_from_environment=emission["world_from_environment"])
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = textures.image(index=emission["texture"])
    node.interpolation = "Linear"
    node.projection = "EQUIRECTANGULAR"
    tree.links.new(linear_map(tree=tree, vector=direction, rows=rows), node.inputs["Vector"])
    scale = emission["scale"]
    return times(tree=tree, color=node.outputs["Color"], factor=(scale, scale, scale))
