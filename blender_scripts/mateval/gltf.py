"""Materials as Blender's glTF exporter reads them, and the export."""

from pathlib import Path

import bpy
import numpy as np

from mateval.bake import Baked, Result, constants_of
from mateval.baking_job import Findings
from mateval.bodies import Body, Slot
from mateval.channels import ONE, ZERO, Numbers
from mateval.nodes import Socket, Tree, new
from mateval.pictures import CHANNEL, Kept, Lookup, packed_data
from mateval.uv_charts import srgb_bytes

SETTINGS = "glTF Material Output"
"""The group in which Blender's exporter looks for inputs that Principled lacks."""


class MaterialWriter:
    """Makes the materials of the result. Materials that are not baked are made once."""

    def __init__(self, *, findings: Findings) -> None:
        self.entries: list[dict] = []
        self._findings = findings
        self._known: dict[tuple, bpy.types.Material] = {}

    def assign(self, *, body: Body, results: list[Result | None]) -> None:
        """Gives a body the materials of the result. A slot without a material stays empty."""
        is_solid = is_closed(mesh=body.mesh)
        for index, (slot, result) in enumerate(zip(body.slots, results, strict=True)):
            made = None
            if slot.look is not None:
                made = self._material(slot=slot, result=result, owner=body.objects[0].name, is_solid=is_solid)
            body.mesh.materials[index] = made

    def _material(self, *, slot: Slot, result: Result | None, owner: str, is_solid: bool) -> bpy.types.Material:
        look = slot.look
        if result is not None:
            return self._make(slot=slot, result=result, name=f"{look.name} of {owner}", is_solid=is_solid)
        key = (id(look), slot.kept.lookup if slot.kept else None, is_solid)
        if key not in self._known:
            stated = constants_of(channels=look.channels)
            self._known[key] = self._make(slot=slot, result=stated, name=look.name, is_solid=is_solid)
        return self._known[key]

    def _make(self, *, slot: Slot, result: Result, name: str, is_solid: bool) -> bpy.types.Material:
        made = bpy.data.materials.new(name)
        made.use_nodes = True
        tree = made.node_tree
        tree.nodes.clear()
        shader, output = new(tree=tree, kind="ShaderNodeBsdfPrincipled"), tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(shader.outputs[0], output.inputs["Surface"])
        if slot.kept is not None:
            link_kept(tree=tree, shader=shader, slot=slot, result=result, name=made.name)
        else:
            link_baked(tree=tree, shader=shader, slot=slot, result=result, name=made.name)
        self._link_glass(tree=tree, shader=shader, result=result, name=slot.look.name, is_solid=is_solid)
        self.entries.append(entry_of(material=made, slot=slot, result=result))
        return made

    def _link_glass(self, *, tree: Tree, shader: bpy.types.Node, result: Result, name: str, is_solid: bool) -> None:
        for channel in ("transmission", "ior"):
            value = result[channel]
            if isinstance(value, Baked):
                action = f"used its mean, {float(value.texels.mean()):.3g}"
                place = f"material '{name}'"
                self._findings.note(code="glass", place=place, message=f"{channel} varies", action=action)
                result[channel] = (float(value.texels.mean()),)
        shader.inputs["Transmission Weight"].default_value = result["transmission"][0]
        shader.inputs["IOR"].default_value = result["ior"][0]
        if is_solid and result["transmission"] != ZERO:
            # Without a thickness, glTF's glass is a sheet.
            node = tree.nodes.new("ShaderNodeGroup")
            node.node_tree = settings_group()
            node.inputs["Thickness"].default_value = 1.0


def link_kept(*, tree: Tree, shader: bpy.types.Node, slot: Slot, result: Result, name: str) -> None:
    """Links the pictures that are looked up as they are."""
    kept: Kept = slot.kept
    pictures = kept.pictures
    set_constants(shader=shader, result=result)
    if "base_color" in pictures:
        node = image_node(tree=tree, image=pictures["base_color"].image, lookup=kept.lookup)
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        if "alpha" in pictures:
            tree.links.new(node.outputs["Alpha"], shader.inputs["Alpha"])
    packed = packed_data(kept=kept, channels=slot.look.channels)
    if packed is not None:
        link_data(tree=tree, shader=shader, texels=packed, name=name, lookup=kept.lookup)
    if "emission" in pictures:
        node = image_node(tree=tree, image=pictures["emission"].image, lookup=kept.lookup)
        tree.links.new(node.outputs["Color"], shader.inputs["Emission Color"])
        shader.inputs["Emission Strength"].default_value = slot.look.channels.emission.scale


def link_baked(*, tree: Tree, shader: bpy.types.Node, slot: Slot, result: Result, name: str) -> None:
    """Links baked textures, and sets what is constant."""
    lookup = Lookup(uv=slot.uv or "")
    set_constants(shader=shader, result=result)
    color, alpha = result["base_color"], result["alpha"]
    if isinstance(color, Baked) or isinstance(alpha, Baked):
        texels = np.ones((slot.edge, slot.edge, 4), dtype=np.float32)
        texels[..., :3] = srgb_bytes(linear=texels_or(value=color))
        texels[..., 3] = texels_or(value=alpha)
        image = new_image(name=f"{name} base color", texels=texels, is_data=False)
        node = image_node(tree=tree, image=image, lookup=lookup)
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        if alpha != ONE:
            tree.links.new(node.outputs["Alpha"], shader.inputs["Alpha"])
    roughness, metallic = result["roughness"], result["metallic"]
    if isinstance(roughness, Baked) or isinstance(metallic, Baked):
        texels = np.ones((slot.edge, slot.edge, 4), dtype=np.float32)
        texels[..., 1], texels[..., 2] = texels_or(value=roughness), texels_or(value=metallic)
        link_data(tree=tree, shader=shader, texels=texels, name=name, lookup=lookup)
    light = result["emission"]
    if isinstance(light, Baked):
        peak = max(float(light.texels.max()), 1e-9)
        texels = np.ones((slot.edge, slot.edge, 4), dtype=np.float32)
        texels[..., :3] = srgb_bytes(linear=light.texels / peak)
        image = new_image(name=f"{name} emission", texels=texels, is_data=False)
        node = image_node(tree=tree, image=image, lookup=lookup)
        tree.links.new(node.outputs["Color"], shader.inputs["Emission Color"])
        shader.inputs["Emission Strength"].default_value = peak


def set_constants(*, shader: bpy.types.Node, result: Result) -> None:
    """Sets the inputs whose channels are constant."""
    color, light = result["base_color"], result["emission"]
    if not isinstance(color, Baked):
        shader.inputs["Base Color"].default_value = (*(min(max(value, 0.0), 1.0) for value in color), 1.0)
    for channel, name in (("roughness", "Roughness"), ("metallic", "Metallic"), ("alpha", "Alpha")):
        if not isinstance(result[channel], Baked):
            shader.inputs[name].default_value = min(max(result[channel][0], 0.0), 1.0)
    if not isinstance(light, Baked):
        peak = max(*light, 0.0)
        shader.inputs["Emission Color"].default_value = (*(max(value, 0.0) / (peak or 1.0) for value in light), 1.0)
        shader.inputs["Emission Strength"].default_value = peak


def texels_or(*, value: Numbers | Baked) -> np.ndarray:
    """Returns texels, or a constant in their place."""
    if isinstance(value, Baked):
        return value.texels
    return np.array(value if len(value) > 1 else value[0], dtype=np.float32)


def link_data(*, tree: Tree, shader: bpy.types.Node, texels: np.ndarray, name: str, lookup: Lookup) -> None:
    """Links a texture of roughness (green) and metallic (blue)."""
    image = new_image(name=f"{name} metallic roughness", texels=texels, is_data=True)
    node = image_node(tree=tree, image=image, lookup=lookup)
    channels = new(tree=tree, kind="ShaderNodeSeparateColor", Color=node.outputs["Color"])
    tree.links.new(channels.outputs[CHANNEL["Green"]], shader.inputs["Roughness"])
    tree.links.new(channels.outputs[CHANNEL["Blue"]], shader.inputs["Metallic"])


def new_image(*, name: str, texels: np.ndarray, is_data: bool) -> bpy.types.Image:
    """Makes an 8-bit image of the values that it stores, 0 to 1."""
    height, width = texels.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=True, is_data=is_data)
    image.alpha_mode = "CHANNEL_PACKED"
    image.pixels.foreach_set(np.clip(texels, 0.0, 1.0).astype(np.float32).ravel())
    image.update()
    image.pack()
    return image


def image_node(*, tree: Tree, image: bpy.types.Image, lookup: Lookup) -> bpy.types.Node:
    """Adds a lookup of an image."""
    node, uv = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeUVMap")
    node.image, node.extension, node.interpolation = image, lookup.extension, lookup.interpolation
    uv.uv_map = lookup.uv
    place: Socket = uv.outputs["UV"]
    if lookup != Lookup(uv=lookup.uv, extension=lookup.extension, interpolation=lookup.interpolation):
        mapping = new(tree=tree, kind="ShaderNodeMapping", Vector=place)
        mapping.inputs["Location"].default_value = (*lookup.location, 0.0)
        mapping.inputs["Rotation"].default_value = (0.0, 0.0, lookup.angle)
        mapping.inputs["Scale"].default_value = (*lookup.scale, 1.0)
        place = mapping.outputs["Vector"]
    tree.links.new(place, node.inputs["Vector"])
    return node


def settings_group() -> bpy.types.NodeTree:
    """The group of the exporter's own inputs."""
    found = bpy.data.node_groups.get(SETTINGS)
    if found is None:
        found = bpy.data.node_groups.new(SETTINGS, "ShaderNodeTree")
        found.interface.new_socket("Thickness", in_out="INPUT", socket_type="NodeSocketFloat")
    return found


def entry_of(*, material: bpy.types.Material, slot: Slot, result: Result) -> dict:
    """Describes a material: for each channel whether it is constant, a picture or baked."""
    pictures = slot.kept.pictures if slot.kept is not None else {}

    def kind(channel: str) -> str:
        if channel == "base_color" and slot.look.channels.is_unstated:
            return "unstated"
        if channel in pictures:
            return "picture"
        return "baked" if isinstance(result[channel], Baked) else "constant"

    channels = ("base_color", "roughness", "metallic", "emission", "alpha")
    textured = any(kind(channel) == "baked" for channel in channels)
    return {
        "name": material.name,
        "source": slot.look.name,
        **{channel: kind(channel) for channel in channels},
        "uv": slot.kept.lookup.uv if slot.kept is not None else slot.uv if textured else None,
        "texels": slot.edge if textured else None,
    }


def is_closed(*, mesh: bpy.types.Mesh) -> bool:
    """Returns whether every edge joins two faces, so that glass has an inside."""
    edges = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("edge_index", edges)
    return bool((np.bincount(edges, minlength=len(mesh.edges)) == 2).all())


def export(*, scene: bpy.types.Scene, path: Path) -> None:
    """Writes the scene as GLB."""
    bpy.context.window.scene = scene
    bpy.ops.export_scene.gltf(
        filepath=str(path),
        export_format="GLB",
        use_active_scene=True,
        export_apply=False,
        export_yup=True,
        export_cameras=True,
        export_lights=True,
        export_import_convert_lighting_mode="SPEC",
        export_animations=False,
        export_skins=False,
        export_morph=False,
        export_extras=False,
        export_attributes=False,
        export_vertex_color="NONE",
        export_image_format="AUTO",
    )
    if not path.is_file():
        raise RuntimeError(f"Blender did not write '{path}'")
