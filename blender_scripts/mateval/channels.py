"""What a surface shader states: base colour, roughness, metallic, emission and opacity, as constants or as sockets.

Works on a copy of a material. Its node groups become groups of its own, and a value inside of a group is handed out
through a socket that is added to the group, so that no node is copied.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import bpy

from mateval.baking_job import Findings
from mateval.metal import reflectance
from mateval.nodes import Socket, Tree, constant, number, scaled, vector_math

Numbers = tuple[float, ...]

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights by which Blender makes a number of a colour (Rec. 709)."""

BLACK = (0.0, 0.0, 0.0)
ZERO, ONE = (0.0,), (1.0,)


@dataclass(frozen=True)
class Linked:
    """A value that differs from place to place."""

    socket: Socket
    """In the tree that is looked at."""
    origin: Socket | None = None
    """The output of the node that makes the value, which may lie in another group; none for what was computed here."""
    scale: float = 1.0
    """The constant that the origin's value is multiplied with."""


Value = Numbers | Linked


@dataclass(frozen=True)
class Channels:
    """A surface. What a shader does not state, as the roughness of an Emission, is none."""

    base_color: Value | None = None
    roughness: Value | None = None
    metallic: Value | None = None
    emission: Value | None = None
    alpha: Value | None = None
    transmission: Value | None = None
    ior: Value | None = None
    is_unstated: bool = False
    """Whether a shader had no known base colour."""

    def each(self, *, change: Callable[[Value], Value]) -> "Channels":
        """Returns the channels with every stated value changed."""
        values = {key: getattr(self, key) for key in CHANNELS}
        return replace(self, **{key: change(value) for key, value in values.items() if value is not None})


CHANNELS = tuple(each.name for each in fields(Channels) if each.name != "is_unstated")

OMITTED = {
    "Coat Weight": "coat",
    "Sheen Weight": "sheen",
    "Subsurface Weight": "subsurface scattering",
    "Anisotropic": "anisotropy",
    "Thin Film Thickness": "thin film",
    "Normal": "normal or bump map",
}
"""Inputs of Principled that the result has no place for, and the words for what they add."""

VIEWED = {
    "ShaderNodeFresnel": {"Fac"},
    "ShaderNodeLayerWeight": {"Fresnel", "Facing"},
    "ShaderNodeCameraData": {"View Vector", "View Z Depth", "View Distance"},
    "ShaderNodeNewGeometry": {"Backfacing", "Incoming"},
    "ShaderNodeLightPath": None,
}
"""Outputs that depend on who looks; none stands for all of a node. Baking looks along the normal, as a camera."""

SEEN = {"Is Camera Ray": 1.0, "Ray Length": 1.0}
"""Outputs of Light Path that are not 0 where Cycles bakes."""


class MaterialGraph:
    """The copy of a material whose channels are read."""

    def __init__(self, *, material: bpy.types.Material, findings: Findings) -> None:
        self.material = material.copy()
        self.name = material.name
        self.tree: Tree = self.material.node_tree
        self._findings = findings
        self._owners: dict[str, bpy.types.Node] = {}
        self._known: dict[tuple[str, str, str], Channels] = {}
        self._own_groups(tree=self.tree)
        self.output = self.tree.get_output_node("CYCLES")

    def nodes(self) -> list[bpy.types.Node]:
        """Returns the nodes of all groups."""
        trees = [self.tree, *(node.node_tree for node in self._owners.values())]
        return [node for tree in trees for node in tree.nodes]

    def surface(self) -> Channels:
        """Returns the channels of the surface, as values of the outermost tree."""
        if self.output is None or self._source(socket=self.output.inputs["Surface"]) is None:
            self._note(
                code="no_surface", message="no shader is linked to the surface", action="left its base colour open"
            )
            return Channels(is_unstated=True)
        if self.output.inputs["Displacement"].is_linked:
            self._note(code="displacement", message="displacement", action="left it out")
        for node in self.nodes():
            linked = {output.name for output in node.outputs if output.is_linked}
            viewed = VIEWED.get(node.bl_idname, set())
            if linked if viewed is None else linked & viewed:
                action = "used its value for a camera that looks along the normal"
                self._note(code="view_dependent", node=node, message="depends on the view", action=action)
        return self._of_shader(socket=self.output.inputs["Surface"])

    def origin(self, *, socket: Socket) -> Socket:
        """Returns what decides an input's value: an output of a node that is no group, or an input without a link."""
        while True:
            entry, out = self._end(socket=socket)
            if out is None:
                return entry
            inner = self._across(out=out)
            if inner is None:
                return out
            socket = inner

    def _own_groups(self, *, tree: Tree) -> None:
        for node in tree.nodes:
            if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
                node.node_tree = node.node_tree.copy()
                self._owners[node.node_tree.name] = node
                self._own_groups(tree=node.node_tree)

    @staticmethod
    def _end(*, socket: Socket) -> tuple[Socket, Socket | None]:
        """Follows reroutes and muted nodes. Returns the last input, and the output linked to it if any."""
        while True:
            link = next((each for each in socket.links if each.is_valid and not each.is_muted), None)
            if link is None:
                return socket, None
            out, node = link.from_socket, link.from_node
            if node.bl_idname == "NodeReroute":
                socket = node.inputs[0]
            elif node.mute:
                passed = next((each.from_socket for each in node.internal_links if each.to_socket == out), None)
                if passed is None:
                    return socket, out
                socket = passed
            else:
                return socket, out

    def _source(self, *, socket: Socket) -> Socket | None:
        return self._end(socket=socket)[1]

    def _across(self, *, out: Socket) -> Socket | None:
        """The input at the other side of a group's border; none for an output of any other node."""
        node = out.node
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
            inside = next((each for each in node.node_tree.nodes if is_group_output(node=each)), None)
            return None if inside is None else by_identifier(sockets=inside.inputs, identifier=out.identifier)
        if node.bl_idname == "NodeGroupInput":
            return by_identifier(sockets=self._owners[node.id_data.name].inputs, identifier=out.identifier)
        return None

    def value(self, *, socket: Socket) -> Value:
        """Returns an input's value, in the tree of its node."""
        origin = self.origin(socket=socket)
        found = constant_of(origin=origin, as_color=socket.type in ("RGBA", "VECTOR"))
        return Linked(socket=self._source(socket=socket), origin=origin) if found is None else found

    def _of_shader(self, *, socket: Socket) -> Channels:
        """The channels of the shader that is linked to an input, as values of the input's tree."""
        out = self._source(socket=socket)
        if out is None:
            # Cycles shows no shader as black.
            return Channels(base_color=BLACK, alpha=ONE)
        node = out.node
        key = (node.id_data.name if node.id_data.name in self._owners else "", node.name, out.identifier)
        if key not in self._known:
            self._known[key] = self._of_output(node=node, out=out)
        return self._known[key]

    def _of_output(self, *, node: bpy.types.Node, out: Socket) -> Channels:
        beyond = self._across(out=out)
        if beyond is not None:
            is_group = node.bl_idname == "ShaderNodeGroup"
            tree = node.node_tree if is_group else node.id_data
            hand = hand_out if is_group else hand_in
            owner = self._owners[tree.name]
            return self._of_shader(socket=beyond).each(change=lambda value: hand(owner=owner, value=value))
        reader = READERS.get(node.bl_idname)
        if reader is not None:
            return reader(self, node=node)
        action = "left its base colour open"
        self._note(code="unknown_shader", node=node, message="a shader without a known base colour", action=action)
        return Channels(is_unstated=True)

    def principled(self, *, node: bpy.types.Node) -> Channels:
        """Principled BSDF."""
        for name, words in OMITTED.items():
            socket = node.inputs[name]
            if socket.is_linked or (name != "Normal" and socket.default_value > 0.0):
                self._note(code="omitted", node=node, message=words, action="left it out")
        return Channels(
            base_color=self.value(socket=node.inputs["Base Color"]),
            roughness=self.value(socket=node.inputs["Roughness"]),
            metallic=self.value(socket=node.inputs["Metallic"]),
            emission=self._emitted(node=node, color="Emission Color", strength="Emission Strength"),
            alpha=self.value(socket=node.inputs["Alpha"]),
            transmission=self.value(socket=node.inputs["Transmission Weight"]),
            ior=self.value(socket=node.inputs["IOR"]),
        )

    def diffuse(self, *, node: bpy.types.Node) -> Channels:
        """Diffuse BSDF, and shaders that keep only their colour."""
        if node.bl_idname != "ShaderNodeBsdfDiffuse":
            action = "used its colour as that of a rough surface"
            self._note(code="approximated", node=node, message="light that passes through the surface", action=action)
        return Channels(base_color=self.value(socket=node.inputs["Color"]), roughness=ONE, metallic=ZERO, alpha=ONE)

    def glossy(self, *, node: bpy.types.Node) -> Channels:
        """Glossy and Metallic BSDF: a metal."""
        name = "Base Color" if node.bl_idname == "ShaderNodeBsdfMetallic" else "Color"
        color = self.value(socket=node.inputs[name])
        if name == "Base Color" and node.fresnel_type == "PHYSICAL_CONDUCTOR":
            indices = [self.value(socket=node.inputs[each]) for each in ("IOR", "Extinction")]
            if any(isinstance(each, Linked) for each in indices):
                action = "left its base colour open"
                self._note(code="unknown_shader", node=node, message="a metal of a varying index", action=action)
                return Channels(is_unstated=True)
            color = tuple(reflectance(cosine=1.0, eta=eta, k=k) for eta, k in zip(*indices, strict=True))
        roughness = self.value(socket=node.inputs["Roughness"])
        return Channels(base_color=color, roughness=roughness, metallic=ONE, alpha=ONE)

    def glass(self, *, node: bpy.types.Node) -> Channels:
        """Glass and Refraction BSDF."""
        return Channels(
            base_color=self.value(socket=node.inputs["Color"]),
            roughness=self.value(socket=node.inputs["Roughness"]),
            metallic=ZERO,
            alpha=ONE,
            transmission=ONE,
            ior=self.value(socket=node.inputs["IOR"]),
        )

    def emission(self, *, node: bpy.types.Node) -> Channels:
        """Emission: black, apart from its light."""
        light = self._emitted(node=node, color="Color", strength="Strength")
        return Channels(base_color=BLACK, emission=light, alpha=ONE)

    def transparent(self, *, node: bpy.types.Node) -> Channels:
        """Transparent BSDF: no surface. Its tint is lost."""
        color = self.value(socket=node.inputs["Color"])
        if color != (1.0, 1.0, 1.0):
            self._note(code="omitted", node=node, message="the tint of a transparent shader", action="made it clear")
        return Channels(alpha=ZERO)

    def mix_shader(self, *, node: bpy.types.Node) -> Channels:
        """Mix Shader: each channel is mixed, except where only one of both shaders states it."""
        first, second = (self._of_shader(socket=node.inputs[k]) for k in (1, 2))
        factor = self.value(socket=node.inputs[0])
        tree = node.id_data
        # Without a transmission, a shader transmits nothing; the light of a shader without emission is black.
        light = mixed(tree=tree, pair=(first.emission or BLACK, second.emission or BLACK), factor=factor)
        clear = None
        if first.transmission is not None or second.transmission is not None:
            clear = mixed(tree=tree, pair=(first.transmission or ZERO, second.transmission or ZERO), factor=factor)
        names = ("base_color", "roughness", "metallic", "alpha", "ior")
        pairs = {name: (getattr(first, name), getattr(second, name)) for name in names}
        rest = {name: mixed(tree=tree, pair=pair, factor=factor) for name, pair in pairs.items()}
        unstated = first.is_unstated or second.is_unstated
        return Channels(**rest, emission=light, transmission=clear, is_unstated=unstated)

    def add_shader(self, *, node: bpy.types.Node) -> Channels:
        """Add Shader: known where one of both only emits."""
        first, second = (self._of_shader(socket=node.inputs[k]) for k in (0, 1))
        for light, rest in ((first, second), (second, first)):
            only_emits = light.base_color in (None, BLACK) and light.roughness is None and not light.is_unstated
            if only_emits and light.alpha in (None, ONE):
                total = added(tree=node.id_data, pair=(light.emission or BLACK, rest.emission or BLACK))
                return replace(rest, emission=total)
        action = "used the first, and left its base colour open"
        self._note(code="unknown_shader", node=node, message="the sum of two reflecting shaders", action=action)
        return replace(first, is_unstated=True)

    def _emitted(self, *, node: bpy.types.Node, color: str, strength: str) -> Value:
        light, factor = self.value(socket=node.inputs[color]), self.value(socket=node.inputs[strength])
        if factor == ZERO or light == BLACK:
            return BLACK
        if isinstance(light, tuple) and isinstance(factor, tuple):
            return tuple(channel * factor[0] for channel in light)
        tree = node.id_data
        product = scaled(tree=tree, color=socket_of(tree=tree, value=light), factor=socket_of(tree=tree, value=factor))
        if isinstance(light, Linked) and isinstance(factor, tuple):
            return replace(light, socket=product, scale=factor[0])
        return Linked(socket=product)

    def _note(self, *, code: str, message: str, action: str, node: bpy.types.Node | None = None) -> None:
        place = f"material '{self.name}'" + (f", node '{node.name}'" if node is not None else "")
        if node is not None:
            message = f"{node.bl_label}: {message}"
        self._findings.note(code=code, place=place, message=message, action=action)


READERS = {
    "ShaderNodeBsdfPrincipled": MaterialGraph.principled,
    "ShaderNodeBsdfDiffuse": MaterialGraph.diffuse,
    "ShaderNodeBsdfTranslucent": MaterialGraph.diffuse,
    "ShaderNodeSubsurfaceScattering": MaterialGraph.diffuse,
    "ShaderNodeBsdfAnisotropic": MaterialGraph.glossy,
    "ShaderNodeBsdfMetallic": MaterialGraph.glossy,
    "ShaderNodeBsdfGlass": MaterialGraph.glass,
    "ShaderNodeBsdfRefraction": MaterialGraph.glass,
    "ShaderNodeEmission": MaterialGraph.emission,
    "ShaderNodeBsdfTransparent": MaterialGraph.transparent,
    "ShaderNodeMixShader": MaterialGraph.mix_shader,
    "ShaderNodeAddShader": MaterialGraph.add_shader,
}


def is_group_output(*, node: bpy.types.Node) -> bool:
    """Returns whether a node holds the results of its group."""
    return node.bl_idname == "NodeGroupOutput" and node.is_active_output


def by_identifier(*, sockets: bpy.types.bpy_prop_collection, identifier: str) -> Socket | None:
    """Returns the socket with an identifier, which is unique where a name is not."""
    return next((each for each in sockets if each.identifier == identifier), None)


def constant_of(*, origin: Socket, as_color: bool) -> Numbers | None:
    """Returns a value that is the same everywhere; none for one that nodes compute."""
    if origin.is_output and origin.node.bl_idname == "ShaderNodeLightPath":
        return (SEEN.get(origin.name, 0.0),) * (3 if as_color else 1)
    if origin.is_output and origin.node.bl_idname not in ("ShaderNodeRGB", "ShaderNodeValue"):
        return None
    found = getattr(origin, "default_value", None)
    if found is None:
        return None
    if isinstance(found, (int, float)):
        return (float(found),) * (3 if as_color else 1)
    channels = tuple(float(channel) for channel in found)[:3]
    if as_color:
        return channels
    weights = LUMINANCE if origin.type == "RGBA" else (1 / 3,) * 3
    return (sum(weight * channel for weight, channel in zip(weights, channels, strict=True)),)


def socket_of(*, tree: Tree, value: Value) -> Socket:
    """Returns a value as a socket of the tree, a constant as a new node."""
    if isinstance(value, Linked):
        return value.socket
    return number(tree=tree, value=value[0]) if len(value) == 1 else constant(tree=tree, color=value)


def mixed(*, tree: Tree, pair: tuple[Value | None, Value | None], factor: Value) -> Value | None:
    """Returns the mixture of two values: the first at the factor 0, the second at 1; the only one where one is none."""
    first, second = pair
    if first is None or second is None or first == second:
        return second if first is None else first
    if isinstance(factor, tuple):
        share = min(max(factor[0], 0.0), 1.0)
        if share in (0.0, 1.0):
            return second if share == 1.0 else first
        if isinstance(first, tuple) and isinstance(second, tuple):
            return tuple(a + share * (b - a) for a, b in zip(first, second, strict=True))
    is_number = any(isinstance(each, tuple) and len(each) == 1 for each in pair)
    node = tree.nodes.new("ShaderNodeMix")
    # Numbers mixed as colours are grey, which is the same number again.
    node.data_type = "FLOAT" if is_number else "RGBA"
    kind = "Float" if is_number else "Color"
    for name, value in ((f"A_{kind}", first), (f"B_{kind}", second), ("Factor_Float", factor)):
        socket = by_identifier(sockets=node.inputs, identifier=name)
        tree.links.new(socket_of(tree=tree, value=value), socket)
    return Linked(socket=by_identifier(sockets=node.outputs, identifier=f"Result_{kind}"))


def added(*, tree: Tree, pair: tuple[Value, Value]) -> Value:
    """Returns the sum of two colours."""
    if BLACK in pair:
        return pair[1] if pair[0] == BLACK else pair[0]
    if all(isinstance(each, tuple) for each in pair):
        return tuple(a + b for a, b in zip(*pair, strict=True))
    values = [socket_of(tree=tree, value=each) for each in pair]
    return Linked(socket=vector_math(tree=tree, operation="ADD", values=values))


def hand_out(*, owner: bpy.types.Node, value: Value) -> Value:
    """Returns a value inside of a group as an output of the group's node."""
    if not isinstance(value, Linked):
        return value
    tree = owner.node_tree
    item = tree.interface.new_socket("mateval", in_out="OUTPUT", socket_type=kind_of(socket=value.socket))
    inside = next(each for each in tree.nodes if is_group_output(node=each))
    tree.links.new(value.socket, by_identifier(sockets=inside.inputs, identifier=item.identifier))
    return replace(value, socket=by_identifier(sockets=owner.outputs, identifier=item.identifier))


def hand_in(*, owner: bpy.types.Node, value: Value) -> Value:
    """Returns a value outside of a group as an output of the group's input node."""
    if not isinstance(value, Linked):
        return value
    tree = owner.node_tree
    item = tree.interface.new_socket("mateval", in_out="INPUT", socket_type=kind_of(socket=value.socket))
    outside = by_identifier(sockets=owner.inputs, identifier=item.identifier)
    owner.id_data.links.new(value.socket, outside)
    inside = tree.nodes.new("NodeGroupInput")
    return replace(value, socket=by_identifier(sockets=inside.outputs, identifier=item.identifier))


def kind_of(*, socket: Socket) -> str:
    """Returns the type of a group's socket that holds a value: a number or a colour."""
    return "NodeSocketFloat" if socket.type in ("VALUE", "INT", "BOOLEAN") else "NodeSocketColor"
