"""Pictures that a material looks up as they are, which need no baking."""

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from mateval.channels import LUMINANCE, Channels, Linked, MaterialGraph, Value
from mateval.nodes import Socket

KINDS = {"BMP", "PNG", "JPEG", "TARGA", "TARGA_RAW", "TIFF", "WEBP"}
"""Formats whose texels glTF can hold; others have a wider range."""

CHANNEL = {"Red": 0, "Green": 1, "Blue": 2, "Alpha": 3}


@dataclass(frozen=True)
class Lookup:
    """Where a picture is looked up."""

    uv: str
    extension: str = "EXTEND"
    interpolation: str = "Linear"
    location: tuple[float, float] = (0.0, 0.0)
    angle: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)


@dataclass(frozen=True)
class Picture:
    """A picture, or one channel of it: `channel` counts from 0, -1 is its brightness, none all colours."""

    image: bpy.types.Image
    channel: int | None
    lookup: Lookup


@dataclass(frozen=True)
class Kept:
    """The pictures of a material that are kept; a channel without one is constant."""

    pictures: dict[str, Picture]
    lookup: Lookup


def kept_pictures(*, graph: MaterialGraph, channels: Channels, mesh: bpy.types.Mesh) -> Kept | None:
    """Returns the pictures if every channel is constant or a picture, all at one place; none if one must be baked."""
    pictures = {}
    for name in ("base_color", "alpha", "roughness", "metallic", "emission"):
        value = getattr(channels, name)
        if isinstance(value, Linked):
            found = picture_of(graph=graph, value=value, mesh=mesh, is_color=name in ("base_color", "emission"))
            if found is None:
                return None
            pictures[name] = found
    if any(isinstance(value, Linked) for value in (channels.transmission, channels.ior)):
        return None
    places = {picture.lookup for picture in pictures.values()}
    if len(places) != 1:
        return None
    alpha, color = pictures.get("alpha"), pictures.get("base_color")
    # glTF holds the opacity in the picture of the base colour.
    if alpha is not None and (color is None or color.image != alpha.image or alpha.channel != CHANNEL["Alpha"]):
        return None
    if alpha is None and any(is_see_through(image=picture.image) for picture in pictures.values()):
        return None
    return Kept(pictures=pictures, lookup=places.pop())


def is_see_through(*, image: bpy.types.Image) -> bool:
    """Returns whether an image has transparent texels, which Cycles shows black where nothing uses its opacity."""
    if image.channels < 4 or image.alpha_mode not in ("STRAIGHT", "PREMUL"):
        return False
    return bool(texels_of(image=image, size=image.size)[..., 3].min() < 1.0)


def picture_of(*, graph: MaterialGraph, value: Value, mesh: bpy.types.Mesh, is_color: bool) -> Picture | None:
    """Returns the picture that a value is; none for one that nodes change."""
    origin = value.origin
    if origin is None:
        return None
    channel = None if is_color else -1
    if origin.node.bl_idname == "ShaderNodeSeparateColor" and origin.node.mode == "RGB" and not is_color:
        channel = CHANNEL[origin.name]
        origin = graph.origin(socket=origin.node.inputs[0])
    node = origin.node
    if not origin.is_output or node.bl_idname != "ShaderNodeTexImage" or node.image is None:
        return None
    if origin.name == "Alpha":
        channel = CHANNEL["Alpha"]
    image = node.image
    space = "sRGB" if is_color else "Non-Color"
    # The opacity has no colour space.
    is_plain = image.colorspace_settings.name == space or channel == CHANNEL["Alpha"]
    if image.source != "FILE" or image.file_format not in KINDS or image.is_float or not is_plain:
        return None
    if node.projection != "FLAT" or node.extension == "CLIP" or (is_color and channel is not None):
        return None
    lookup = lookup_of(graph=graph, node=node, mesh=mesh)
    return None if lookup is None else Picture(image=image, channel=channel, lookup=lookup)


def lookup_of(*, graph: MaterialGraph, node: bpy.types.Node, mesh: bpy.types.Mesh) -> Lookup | None:
    """Returns where an image node looks, if that is a uv of the mesh, moved, turned and scaled at most."""
    place = graph.origin(socket=node.inputs["Vector"])
    moved: dict[str, object] = {}
    mapping = place.node
    if place.is_output and mapping.bl_idname == "ShaderNodeMapping" and mapping.vector_type == "POINT":
        inputs = [mapping.inputs[name] for name in ("Location", "Rotation", "Scale")]
        if any(socket.is_linked for socket in inputs):
            return None
        location, rotation, scale = (tuple(socket.default_value) for socket in inputs)
        if rotation[0] != 0.0 or rotation[1] != 0.0:
            return None
        moved = {"location": location[:2], "angle": rotation[2], "scale": scale[:2]}
        place = graph.origin(socket=mapping.inputs["Vector"])
    uv = uv_of(place=place, mesh=mesh, is_default=not moved)
    if uv is None:
        return None
    return Lookup(uv=uv, extension=node.extension, interpolation=node.interpolation, **moved)


def uv_of(*, place: Socket, mesh: bpy.types.Mesh, is_default: bool) -> str | None:
    """Returns the uv that a vector is. An image node without a vector looks at the mesh's uv, if `is_default`."""
    active = next((layer.name for layer in mesh.uv_layers if layer.active_render), None)
    node = place.node
    if not place.is_output:
        return active if is_default else None
    if getattr(node, "from_instancer", False):
        return None
    if node.bl_idname == "ShaderNodeTexCoord" and place.name == "UV":
        return active
    if node.bl_idname == "ShaderNodeUVMap":
        name = node.uv_map or active
        return name if name in mesh.uv_layers else None
    return None


def texels_of(*, image: bpy.types.Image, size: Sequence[int]) -> np.ndarray:
    """Returns an image's stored values, resized where it has another size, with the shape (height, width, 4)."""
    work = image
    if tuple(image.size) != tuple(size):
        work = image.copy()
        work.scale(*size)
    found = np.empty(size[0] * size[1] * 4, dtype=np.float32)
    work.pixels.foreach_get(found)
    if work is not image:
        bpy.data.images.remove(work)
    return found.reshape(size[1], size[0], 4)


def packed_data(*, kept: Kept, channels: Channels) -> np.ndarray | None:
    """Returns roughness as green and metallic as blue, as glTF has them, or None if both are constant."""
    used = [kept.pictures[name].image for name in ("roughness", "metallic") if name in kept.pictures]
    if not used:
        return None
    size = tuple(max(image.size[k] for image in used) for k in (0, 1))
    packed = np.ones((size[1], size[0], 4), dtype=np.float32)
    for place, name, default in ((1, "roughness", 1.0), (2, "metallic", 0.0)):
        picture = kept.pictures.get(name)
        if picture is None:
            value = getattr(channels, name)
            packed[..., place] = default if value is None else value[0]
            continue
        texels = texels_of(image=picture.image, size=size)
        is_brightness = picture.channel == -1
        packed[..., place] = texels[..., :3] @ np.float32(LUMINANCE) if is_brightness else texels[..., picture.channel]
    return packed
