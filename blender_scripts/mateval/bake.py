"""Bakes the channels of a body: each as the light of an Emission shader, which Cycles evaluates without lamps."""

from dataclasses import dataclass

import bpy
import numpy as np

from mateval.baking_job import MARGIN, Findings, Job
from mateval.bodies import Body, Look, Slot
from mateval.channels import Channels, Linked, Numbers, socket_of
from mateval.nodes import Socket, new
from mateval.unwrap import on_bench

PASSES: dict[str, tuple[tuple[str, Numbers], ...]] = {
    "color": (("base_color", (1.0, 1.0, 1.0)),),
    "data": (("alpha", (1.0,)), ("roughness", (1.0,)), ("metallic", (0.0,))),
    "light": (("emission", (0.0, 0.0, 0.0)),),
    "glass": (("transmission", (0.0,)), ("ior", (1.5,)), ("alpha", (1.0,))),
}
"""What is baked at once, as three colours, and the values of what no shader states."""

UNIFORM = 1e-4
"""Largest range of a channel that becomes a constant."""

SEED = 0


@dataclass
class Baked:
    """A baked channel: texels of shape (edge, edge) or (edge, edge, 3), the first row that of v near 0."""

    texels: np.ndarray


Result = dict[str, Numbers | Baked]
"""Each channel of a material, as a constant or baked."""


def make_bench(*, job: Job, source: bpy.types.Scene, is_osl: bool) -> bpy.types.Scene:
    """Makes the scene that one object at a time is baked in."""
    bench = bpy.data.scenes.new("mateval bench")
    set_up(scene=bench, job=job, source=source, is_osl=is_osl)
    return bench


def set_up(*, scene: bpy.types.Scene, job: Job, source: bpy.types.Scene, is_osl: bool) -> None:
    """Sets up Cycles on the CPU, without denoising and clamping, at the source's frame."""
    scene.frame_set(source.frame_current)
    scene.render.engine = "CYCLES"
    if job["threads"] > 0:
        scene.render.threads_mode, scene.render.threads = "FIXED", job["threads"]
    cycles = scene.cycles
    cycles.device, cycles.shading_system = "CPU", is_osl
    cycles.samples, cycles.seed = job["samples"], SEED
    cycles.use_adaptive_sampling = cycles.use_denoising = cycles.use_guiding = False
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0


def bake_body(
    *, body: Body, bench: bpy.types.Scene, surroundings: bpy.types.Scene, findings: Findings
) -> list[Result | None]:
    """Bakes every slot of a body that needs it; the others get none."""
    slots = [slot if slot.is_baked else None for slot in body.slots]
    results: list[Result | None] = [{} if slot else None for slot in slots]
    if not any(slots):
        return results
    used = [slot.look for slot in slots if slot is not None]
    for look in used:
        look.set_random(value=body.random)
    scene = surroundings if any(look.is_surrounded for look in used) else bench
    # Slots may have different uvs, and Blender bakes to one at a time.
    for uv in sorted({slot.uv for slot in slots if slot is not None}):
        for name, channels in PASSES.items():
            chosen = {
                index: slot.look
                for index, slot in enumerate(slots)
                if slot is not None and slot.uv == uv and varies(look=slot.look, channels=channels)
            }
            if chosen:
                texels = bake_pass(body=body, scene=scene, uv=uv, name=name, looks=chosen)
                for index, found in texels.items():
                    split(into=results[index], texels=found, look=chosen[index], name=name, findings=findings)
    for index, slot in enumerate(slots):
        if slot is not None:
            fill_constants(result=results[index], channels=slot.look.channels)
    return results


def varies(*, look: Look, channels: tuple[tuple[str, Numbers], ...]) -> bool:
    """Returns whether a pass has a channel that differs from place to place."""
    return any(isinstance(getattr(look.channels, name), Linked) for name, _ in channels)


def bake_pass(
    *, body: Body, scene: bpy.types.Scene, uv: str, name: str, looks: dict[int, Look]
) -> dict[int, np.ndarray]:
    """Bakes one pass of the given slots. Returns texels of shape (edge, edge, 4), with alpha 0 where no surface is."""
    images: dict[int, bpy.types.Image] = {}
    idle, nothing = idle_material()
    for index, slot in enumerate(body.slots):
        if index not in looks:
            body.mesh.materials[index] = idle
            continue
        images[index] = empty_image(edge=slot.edge)
        show(look=slot.look, name=name, image=images[index])
        body.mesh.materials[index] = slot.look.graph.material
    with on_bench(bench=scene, thing=body.objects[0]):
        bpy.ops.object.bake(
            type="EMIT",
            target="IMAGE_TEXTURES",
            save_mode="INTERNAL",
            margin=MARGIN,
            margin_type="EXTEND",
            use_clear=False,
            use_selected_to_active=False,
            uv_layer=uv,
        )
    texels = {index: pixels_of(image=image) for index, image in images.items()}
    for image in [*images.values(), nothing]:
        bpy.data.images.remove(image)
    bpy.data.materials.remove(idle)
    return texels


def idle_material() -> tuple[bpy.types.Material, bpy.types.Image]:
    """A material for faces that are not baked: Blender asks for a target of every material."""
    made, image = bpy.data.materials.new("idle"), empty_image(edge=1)
    made.use_nodes = True
    target = made.node_tree.nodes.new("ShaderNodeTexImage")
    target.image = image
    made.node_tree.nodes.active = target
    return made, image


def empty_image(*, edge: int) -> bpy.types.Image:
    """An image of 32-bit floats whose alpha is 0."""
    image = bpy.data.images.new("bake", edge, edge, alpha=True, float_buffer=True, is_data=True)
    image.pixels.foreach_set(np.zeros(edge * edge * 4, dtype=np.float32))
    return image


def pixels_of(*, image: bpy.types.Image) -> np.ndarray:
    """Returns an image's values."""
    width, height = image.size
    found = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(found)
    return found.reshape(height, width, 4)


def show(*, look: Look, name: str, image: bpy.types.Image) -> None:
    """Makes a material emit a pass, and the image its target."""
    graph = look.graph
    tree, output = graph.tree, graph.output
    for socket in output.inputs:
        for link in list(socket.links):
            tree.links.remove(link)
    emission = tree.nodes.get("mateval emission") or tree.nodes.new("ShaderNodeEmission")
    emission.name = "mateval emission"
    tree.links.new(color_of_pass(look=look, name=name), emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    target = tree.nodes.get("mateval target") or tree.nodes.new("ShaderNodeTexImage")
    target.name = "mateval target"
    target.image = image
    tree.nodes.active = target


def color_of_pass(*, look: Look, name: str) -> Socket:
    """Adds a pass as one colour: its only channel, or its three numbers."""
    tree = look.graph.tree
    values = [getattr(look.channels, channel) for channel, _ in PASSES[name]]
    stated = [default if value is None else value for value, (_, default) in zip(values, PASSES[name], strict=True)]
    sockets = [socket_of(tree=tree, value=value) for value in stated]
    if len(sockets) == 1:
        return sockets[0]
    node = new(tree=tree, kind="ShaderNodeCombineColor", Red=sockets[0], Green=sockets[1], Blue=sockets[2])
    return node.outputs[0]


def split(*, into: Result, texels: np.ndarray, look: Look, name: str, findings: Findings) -> None:
    """Adds the channels of a baked pass, those that are the same everywhere as constants."""
    place = f"material '{look.name}'"
    covered = texels[..., 3] > 0.0
    if not np.isfinite(texels).all():
        findings.note(code="not_finite", place=place, message=f"{name} is not finite somewhere", action="used 0 there")
        texels = np.nan_to_num(texels, nan=0.0, posinf=0.0, neginf=0.0)
    if name in ("color", "data") and covered.any():
        inside = texels[covered][:, :3]
        if inside.min() < -UNIFORM or inside.max() > 1.0 + UNIFORM:
            message = f"{name} from {inside.min():.3g} to {inside.max():.3g}"
            findings.note(code="out_of_range", place=place, message=message, action="limited it to 0 to 1")
    channels = PASSES[name]
    for index, (channel, _) in enumerate(channels):
        if not isinstance(getattr(look.channels, channel), Linked):
            continue
        values = texels[..., :3] if len(channels) == 1 else texels[..., index]
        into[channel] = constant_or_baked(values=values, covered=covered)


def constant_or_baked(*, values: np.ndarray, covered: np.ndarray) -> Numbers | Baked:
    """Returns the mean where the covered texels are alike, else all texels."""
    inside = values[covered]
    if len(inside) and np.ptp(inside, axis=0).max() <= UNIFORM:
        return tuple(np.atleast_1d(inside.mean(axis=0, dtype=np.float64)).tolist())
    return Baked(texels=values)


def fill_constants(*, result: Result, channels: Channels) -> None:
    """Adds the channels that need no baking."""
    for name, default in (pair for each in PASSES.values() for pair in each):
        if name not in result:
            value = getattr(channels, name)
            result[name] = default if value is None or isinstance(value, Linked) else value


def constants_of(*, channels: Channels) -> Result:
    """Returns the channels of a material that is not baked."""
    result: Result = {}
    fill_constants(result=result, channels=channels)
    return result


def edges_of(*, slots: list[Slot]) -> list[int]:
    """Returns the edge of each texture that will be baked, one per pass."""
    return [slot.edge for slot in slots for channels in PASSES.values() if varies(look=slot.look, channels=channels)]
