"""Functions that add nodes to shader graphs."""

from collections.abc import Sequence

import bpy

Socket = bpy.types.NodeSocket
Tree = bpy.types.NodeTree


def new(*, tree: Tree, kind: str, **inputs: object) -> bpy.types.Node:
    """Adds a node; each input is a socket to link or a value."""
    node = tree.nodes.new(kind)
    for name, value in inputs.items():
        put(tree=tree, socket=node.inputs[name.replace("_", " ")], value=value)
    return node


def put(*, tree: Tree, socket: Socket, value: object) -> None:
    """Links a socket to the input, or sets the input's value."""
    if isinstance(value, Socket):
        tree.links.new(value, socket)
    else:
        socket.default_value = value


def constant(*, tree: Tree, color: Sequence[float]) -> Socket:
    """Adds a linear colour."""
    node = tree.nodes.new("ShaderNodeRGB")
    node.outputs[0].default_value = (*color, 1.0)
    return node.outputs[0]


def number(*, tree: Tree, value: float) -> Socket:
    """Adds a number."""
    node = tree.nodes.new("ShaderNodeValue")
    node.outputs[0].default_value = value
    return node.outputs[0]


def math(*, tree: Tree, operation: str, values: Sequence[Socket | float]) -> Socket:
    """Adds an operation on numbers."""
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    for socket, value in zip(node.inputs, values, strict=False):
        put(tree=tree, socket=socket, value=value)
    return node.outputs[0]


def vector_math(*, tree: Tree, operation: str, values: Sequence[Socket | Sequence[float]]) -> Socket:
    """Adds an operation on vectors or colours, channel by channel."""
    node = tree.nodes.new("ShaderNodeVectorMath")
    node.operation = operation
    for socket, value in zip(node.inputs, values, strict=False):
        put(tree=tree, socket=socket, value=value)
    return node.outputs["Vector"]


def times(*, tree: Tree, color: Socket, factor: Socket | Sequence[float]) -> Socket:
    """Adds the product of two colours, channel by channel."""
    return vector_math(tree=tree, operation="MULTIPLY", values=[color, factor])


def scaled(*, tree: Tree, color: Socket, factor: Socket) -> Socket:
    """Adds the product of a colour and a number."""
    node = tree.nodes.new("ShaderNodeVectorMath")
    node.operation = "SCALE"
    tree.links.new(color, node.inputs[0])
    tree.links.new(factor, node.inputs["Scale"])
    return node.outputs["Vector"]


def linear_map(*, tree: Tree, vector: Socket, rows: Sequence[Sequence[float]]) -> Socket:
    """Adds the product of a matrix and the vector; missing rows are zero."""
    combine = tree.nodes.new("ShaderNodeCombineXYZ")
    for row, target in zip(rows, combine.inputs, strict=False):
        dot = tree.nodes.new("ShaderNodeVectorMath")
        dot.operation = "DOT_PRODUCT"
        tree.links.new(vector, dot.inputs[0])
        dot.inputs[1].default_value = tuple(row)
        tree.links.new(dot.outputs["Value"], target)
    return combine.outputs[0]


def mix(*, tree: Tree, factor: Socket | float, first: Socket, second: Socket) -> Socket:
    """Adds a mixture: the first shader where the factor is 0, the second where it is 1."""
    node = tree.nodes.new("ShaderNodeMixShader")
    put(tree=tree, socket=node.inputs[0], value=factor)
    tree.links.new(first, node.inputs[1])
    tree.links.new(second, node.inputs[2])
    return node.outputs[0]


def backfacing(*, tree: Tree) -> Socket:
    """Adds 1 where the surface is seen from behind, else 0."""
    return tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"]


def is_camera_ray(*, tree: Tree) -> Socket:
    """Adds 1 for camera rays, else 0."""
    return tree.nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"]
