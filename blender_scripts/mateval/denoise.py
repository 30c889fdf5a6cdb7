"""The mean of two halves, denoised by the compositor's OpenImageDenoise."""

from pathlib import Path

import bpy

ALBEDO, NORMAL = "Denoising Albedo", "Denoising Normal"


def denoise_to(*, scene: bpy.types.Scene, halves: tuple[Path, Path], passes: list[str], path: Path) -> None:
    """Writes the averaged and denoised passes of both halves to one file under their own names."""
    scene.use_nodes = True
    tree = scene.node_tree
    tree.nodes.clear()
    sources = [image_node(tree=tree, path=half) for half in halves]
    guides = {
        "Albedo": denoised(tree=tree, image=mean(tree=tree, sources=sources, name=ALBEDO), hdr=False),
        "Normal": denoised(tree=tree, image=mean(tree=tree, sources=sources, name=NORMAL), hdr=False),
    }
    output = tree.nodes.new("CompositorNodeOutputFile")
    output.base_path = str(path.with_suffix("")) + "_"
    output.format.file_format = "OPEN_EXR_MULTILAYER"
    output.format.color_depth = "32"
    output.format.exr_codec = "ZIP"
    output.layer_slots.clear()
    for name in passes:
        picture = denoised(tree=tree, image=mean(tree=tree, sources=sources, name=name), hdr=True, guides=guides)
        output.layer_slots.new(name)
        tree.links.new(picture, output.inputs[name])
    composite(scene=scene)
    written = sorted(path.parent.glob(f"{path.stem}_*.exr"))
    if len(written) != 1:
        raise RuntimeError(f"Blender's compositor wrote {len(written)} files for '{path}', expected one")
    written[0].rename(path)
    for node in sources:
        bpy.data.images.remove(node.image)


def composite(*, scene: bpy.types.Scene) -> None:
    """Runs the compositor only; without a render-layers node nothing is rendered."""
    scene.render.use_compositing = True
    bpy.ops.render.render(write_still=False)
    scene.render.use_compositing = False
    scene.use_nodes = False


def image_node(*, tree: bpy.types.NodeTree, path: Path) -> bpy.types.Node:
    """Adds a node with all passes of a file."""
    node = tree.nodes.new("CompositorNodeImage")
    node.image = bpy.data.images.load(str(path))
    return node


def mean(*, tree: bpy.types.NodeTree, sources: list, name: str) -> bpy.types.NodeSocket:
    """Adds the mean of one pass of both halves."""
    node = tree.nodes.new("CompositorNodeMixRGB")
    node.inputs[0].default_value = 0.5
    for source, target in zip(sources, node.inputs[1:], strict=True):
        tree.links.new(output_of(node=source, name=name), target)
    return node.outputs[0]


def output_of(*, node: bpy.types.Node, name: str) -> bpy.types.NodeSocket:
    """Returns the pass with this name."""
    found = next((output for output in node.outputs if output.name == name), None)
    if found is None:
        names = ", ".join(output.name for output in node.outputs)
        raise RuntimeError(f"Blender's file has no pass '{name}'; it has {names}")
    return found


def denoised(
    *, tree: bpy.types.NodeTree, image: bpy.types.NodeSocket, hdr: bool, guides: dict | None = None
) -> bpy.types.NodeSocket:
    """Adds the denoised picture. The guides are denoised before, so that this happens only once."""
    node = tree.nodes.new("CompositorNodeDenoise")
    node.use_hdr = hdr
    node.prefilter = "NONE"
    node.quality = "HIGH"
    tree.links.new(image, node.inputs["Image"])
    for name, guide in (guides or {}).items():
        tree.links.new(guide, node.inputs[name])
    return node.outputs["Image"]
