"""Bodies: evaluated meshes with their materials, shared by all instances whose materials look alike.

Most materials look alike on each instance of a mesh, which then is baked once. One that depends on the object (its
place, its random number) is baked for each instance: the cost is that of as many meshes.
"""

from dataclasses import dataclass, field

import bpy
import numpy as np
from mathutils import Matrix

from mateval.baking_job import Findings
from mateval.channels import Channels, Linked, MaterialGraph
from mateval.evaluated import Evaluated, Instance, Shape, positions_of
from mateval.pictures import Kept, kept_pictures

PER_INSTANCE = {
    "ShaderNodeAmbientOcclusion", "ShaderNodeBevel", "ShaderNodeHairInfo", "ShaderNodeObjectInfo",
    "ShaderNodeParticleInfo", "ShaderNodeScript", "ShaderNodeVectorTransform", "ShaderNodeWireframe",
}  # fmt: skip
"""Nodes whose value depends on the object or its place."""

SURROUNDED = {"ShaderNodeAmbientOcclusion"}
"""Nodes that see other objects."""

PER_PLACE = {"Position", "Normal", "True Normal", "Tangent", "Incoming"}
"""Outputs of the Geometry node in world space."""

UNCONNECTED = {
    "ShaderNodeTexCoord", "ShaderNodeTexIES", "ShaderNodeTexImage", "ShaderNodeTexSky", "ShaderNodeTexWhiteNoise",
}  # fmt: skip
"""Texture nodes that do not use generated coordinates where nothing is linked to them."""

GENERATED = "mateval_generated"
"""The attribute that holds generated coordinates."""


@dataclass
class Look:
    """A material, read once."""

    name: str
    channels: Channels
    graph: MaterialGraph | None
    """None for a material without nodes."""
    is_per_instance: bool = False
    is_surrounded: bool = False
    is_generated: bool = False
    randoms: tuple[bpy.types.Node, ...] = ()
    """The nodes that stand for `Random` of Object Info nodes."""

    @property
    def varies(self) -> bool:
        """Whether a channel differs from place to place."""
        return any(isinstance(value, Linked) for value in vars(self.channels).values())

    def set_random(self, *, value: float) -> None:
        """Sets `Random` of the Object Info nodes, which Cycles would make of the name that the object has now."""
        for node in self.randoms:
            node.inputs[0].default_value = value


def replaced_random(*, node: bpy.types.Node) -> bpy.types.Node:
    """Puts a sum in place of an Object Info node's `Random`, and returns it. A Value would be read as a constant."""
    tree = node.id_data
    made = tree.nodes.new("ShaderNodeMath")
    made.operation, made.inputs[1].default_value = "ADD", 0.0
    for link in list(node.outputs["Random"].links):
        tree.links.new(made.outputs[0], link.to_socket)
    return made


def use_attribute(*, node: bpy.types.Node) -> None:
    """Makes a node give or use the attribute in place of generated coordinates."""
    tree = node.id_data
    source = tree.nodes.new("ShaderNodeAttribute")
    source.attribute_name = GENERATED
    if node.bl_idname == "ShaderNodeTexCoord":
        targets = [link.to_socket for link in node.outputs["Generated"].links]
    else:
        targets = [node.inputs["Vector"]]
    for target in targets:
        tree.links.new(source.outputs["Vector"], target)


def write_attribute(*, mesh: bpy.types.Mesh, rest: np.ndarray | None) -> None:
    """Stores generated coordinates: undeformed places in the texture space (Cycles, `blender/mesh.cpp`)."""
    if GENERATED in mesh.attributes:
        return
    location, size = np.array(mesh.texspace_location), np.array(mesh.texspace_size)
    positions = positions_of(mesh=mesh) if rest is None else rest
    attribute = mesh.attributes.new(GENERATED, "FLOAT_VECTOR", "POINT")
    attribute.data.foreach_set("vector", ((positions - location) / (2.0 * size) + 0.5).astype(np.float32).ravel())


@dataclass
class Slot:
    """A material of a body."""

    look: Look | None
    kept: Kept | None = None
    uv: str | None = None
    """The uv that is baked to; absent if nothing is baked."""
    edge: int = 0

    @property
    def is_baked(self) -> bool:
        """Whether a channel has to be baked."""
        return self.look is not None and self.look.varies and self.kept is None


@dataclass
class Body:
    """A mesh, its materials and its instances."""

    mesh: bpy.types.Mesh
    slots: list[Slot]
    random: float
    objects: list[bpy.types.Object] = field(default_factory=list)


def read_look(*, material: bpy.types.Material, is_stored: bool, findings: Findings) -> Look:
    """Reads a material. `is_stored` states whether meshes have generated coordinates as an attribute."""
    if not material.use_nodes or material.node_tree is None:
        color, numbers = tuple(material.diffuse_color)[:3], ((material.roughness,), (material.metallic,))
        channels = Channels(base_color=color, roughness=numbers[0], metallic=numbers[1])
        return Look(name=material.name, channels=channels, graph=None)
    graph = MaterialGraph(material=material, findings=findings)
    nodes = graph.nodes()
    kinds = {node.bl_idname for node in nodes}
    generated = [node for node in nodes if is_generated(node=node)]
    # Before the channels are read, which name the sockets of nodes.
    randoms = tuple(replaced_random(node=node) for node in nodes if node.bl_idname == "ShaderNodeObjectInfo")
    for node in generated if is_stored else ():
        use_attribute(node=node)
    return Look(
        name=material.name,
        is_per_instance=bool(kinds & PER_INSTANCE) or any(is_per_place(node=node) for node in nodes),
        is_surrounded=bool(kinds & SURROUNDED),
        is_generated=bool(generated),
        randoms=randoms,
        channels=graph.surface(),
        graph=graph,
    )


def is_per_place(*, node: bpy.types.Node) -> bool:
    """Returns whether a node gives coordinates of the world, or attributes of the object."""
    linked = {output.name for output in node.outputs if output.is_linked}
    match node.bl_idname:
        case "ShaderNodeNewGeometry":
            return bool(linked & PER_PLACE)
        case "ShaderNodeTexCoord":
            return bool(linked & {"Camera", "Window", "Reflection"}) or ("Object" in linked and node.object is not None)
        case "ShaderNodeAttribute":
            return node.attribute_type != "GEOMETRY"
        case _:
            return False


def is_generated(*, node: bpy.types.Node) -> bool:
    """Returns whether a node uses generated coordinates."""
    if node.bl_idname == "ShaderNodeTexCoord":
        return node.outputs["Generated"].is_linked
    is_texture = node.bl_idname.startswith("ShaderNodeTex") and node.bl_idname not in UNCONNECTED
    return is_texture and "Vector" in node.inputs and not node.inputs["Vector"].is_linked


def make_bodies(*, found: Evaluated, scene: bpy.types.Scene, findings: Findings) -> list[Body]:
    """Puts all instances into the scene, and returns their bodies."""
    looks: dict[str, Look] = {}
    # Cycles takes generated coordinates from the mesh that it is given, which is already deformed.
    is_stored = any(instance.shape.rest is not None for instance in found.instances)
    bodies: dict[tuple, Body] = {}
    for number, instance in enumerate(found.instances):
        shape = instance.shape
        for material in shape.materials:
            if material is not None and material.name_full not in looks:
                looks[material.name_full] = read_look(material=material, is_stored=is_stored, findings=findings)
        used = [looks[material.name_full] if material is not None else None for material in shape.materials]
        is_own = is_sheared(matrix=instance.world_from_object) or any(
            look is not None and look.is_per_instance and look.varies for look in used
        )
        key = (id(shape), number if is_own else None)
        if key not in bodies:
            bodies[key] = new_body(shape=shape, looks=used, random=instance.random, is_copied=is_own)
            if any(look is not None and look.varies and look.is_generated for look in used):
                report_generated(instance=instance, findings=findings)
                if is_stored:
                    write_attribute(mesh=bodies[key].mesh, rest=shape.rest)
        bodies[key].objects.append(place(instance=instance, mesh=bodies[key].mesh, scene=scene))
    return list(bodies.values())


def new_body(*, shape: Shape, looks: list[Look | None], random: float, is_copied: bool) -> Body:
    """Makes a body. Faces of a material that occurs twice get its first slot; slots without faces are left out."""
    mesh = shape.mesh.copy() if is_copied else shape.mesh
    indices = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("material_index", indices)
    indices = np.clip(indices, 0, max(len(looks) - 1, 0))
    slots: list[Slot] = []
    kept: dict[int, int] = {}
    target = np.zeros_like(indices)
    for index in np.unique(indices):
        look = looks[index] if looks else None
        if id(look) not in kept:
            kept[id(look)] = len(slots)
            slots.append(new_slot(look=look, mesh=mesh))
        target[indices == index] = kept[id(look)]
    # Clearing the materials also sets all indices to 0.
    mesh.materials.clear()
    for _ in slots:
        mesh.materials.append(None)
    mesh.polygons.foreach_set("material_index", target)
    return Body(mesh=mesh, slots=slots, random=random)


def new_slot(*, look: Look | None, mesh: bpy.types.Mesh) -> Slot:
    """Makes a slot, with the pictures that can be kept."""
    if look is None or look.graph is None or not look.varies:
        return Slot(look=look)
    return Slot(look=look, kept=kept_pictures(graph=look.graph, channels=look.channels, mesh=mesh))


def place(*, instance: Instance, mesh: bpy.types.Mesh, scene: bpy.types.Scene) -> bpy.types.Object:
    """Puts a mesh at an instance's place, with the properties that materials can ask for."""
    made = bpy.data.objects.new(instance.name, mesh)
    scene.collection.objects.link(made)
    matrix, original = instance.world_from_object, instance.original
    if is_sheared(matrix=matrix):
        # An object has no shear of its own, but what stands between it and its parent may.
        made.parent = bpy.data.objects.new(f"parent of {instance.name}", None)
        made.matrix_parent_inverse = matrix
    else:
        made.matrix_world = matrix
    made.color, made.pass_index = original.color, original.pass_index
    for key, value in original.items():
        if isinstance(value, (int, float, str)) or hasattr(value, "to_list"):
            made[key] = value
    return made


def world_from_object(*, thing: bpy.types.Object) -> Matrix:
    """Returns where `place` put an object, which Blender's own matrix shows only later."""
    return thing.matrix_parent_inverse if thing.parent is not None else thing.matrix_basis


def is_sheared(*, matrix: Matrix) -> bool:
    """Returns whether a matrix is more than a place, a rotation and a scale, which is all that a node of glTF has."""
    rebuilt = Matrix.LocRotScale(*matrix.decompose())
    size = max(abs(value) for row in matrix.to_3x3() for value in row)
    return any(
        abs(a - b) > 1e-5 * size
        for p, q in zip(matrix, rebuilt, strict=True)
        for a, b in zip(p[:3], q[:3], strict=True)
    )


def apply_shear(*, body: Body) -> None:
    """Moves the vertices of a sheared object, which has a body of its own, to their place in the world."""
    thing = body.objects[0]
    if thing.parent is not None:
        matrix = thing.matrix_parent_inverse.copy()
        body.mesh.transform(matrix)
        if matrix.is_negative:
            body.mesh.flip_normals()
        bpy.data.objects.remove(thing.parent)
        thing.matrix_parent_inverse.identity()


def report_generated(*, instance: Instance, findings: Findings) -> None:
    """Reports textures that follow a deformed shape, where Blender would use the shape before."""
    if instance.shape.is_deformed and instance.shape.rest is None:
        findings.note(
            code="generated_coordinates",
            place=instance.name,
            message="generated coordinates of a mesh that modifiers or shape keys deform",
            action="measured them after the deformation",
        )
