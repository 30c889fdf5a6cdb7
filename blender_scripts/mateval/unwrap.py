"""The uv that a material is baked to: the mesh's own where it can hold a texture, else a new one."""

from collections.abc import Callable

import bpy
import numpy as np

from mateval.baking_job import MARGIN, Findings, Job, texture_edge
from mateval.bodies import Body, Slot, world_from_object
from mateval.evaluated import positions_of
from mateval.uv_charts import covered_share, holds_texture

UV_LAYER, NO_UV = "mateval", "mateval none"
"""Names of the uv that is made, and of one that stands for a missing uv, which materials see as 0."""

ANGLE_LIMIT = 1.15192
"""Blender's default in radians for Smart UV Project, 66 degrees."""

USUAL_SHARE = 0.5
"""Share of the square that charts cover, before it is known."""

MOST_GAP = 1.0 / 32.0
"""Widest gap between charts, so that those of small textures have an area."""


def plan_uvs(*, body: Body, bench: bpy.types.Scene, job: Job, findings: Findings) -> None:
    """Chooses the uv of each slot that is baked, and the edge of its texture."""
    chosen = [(index, slot) for index, slot in enumerate(body.slots) if slot.is_baked]
    if not chosen:
        return
    mesh = body.mesh
    if len(mesh.uv_layers) == 0:
        mesh.uv_layers.new(name=NO_UV, do_init=False)
    mesh.calc_loop_triangles()
    areas = world_areas(body=body)
    active = next(layer for layer in mesh.uv_layers if layer.active_render)
    open_slots = []
    for index, slot in chosen:
        own = triangles_of(mesh=mesh, slot=index)
        if holds_texture(uvs=uvs_of(mesh=mesh, layer=active.name)[own], areas=areas[own]):
            slot.uv = active.name
        else:
            open_slots.append((index, slot))
    if open_slots:
        # A mesh has at most eight.
        layer = mesh.uv_layers.new(name=UV_LAYER, do_init=False)
        if layer is None:
            layer = mesh.uv_layers[-1]
            action = f"wrote over '{layer.name}'"
            findings.note(code="uv_layers", place=body.objects[0].name, message="eight uv layers", action=action)
        name = layer.name
        for index, slot in open_slots:
            slot.uv = name
            area = float(areas[triangles_of(mesh=mesh, slot=index)].sum())
            gap = 2 * MARGIN / texture_edge(job=job, area=area, covered=USUAL_SHARE)
            if not unwrap(body=body, bench=bench, slot=index, name=name, gap=min(gap, MOST_GAP), areas=areas):
                message, action = "faces that overlap when they are unwrapped", "baked them over each other"
                findings.note(code="uv_overlap", place=body.objects[0].name, message=message, action=action)
    for index, slot in chosen:
        own = triangles_of(mesh=mesh, slot=index)
        share = covered_share(uvs=uvs_of(mesh=mesh, layer=slot.uv)[own])
        slot.edge = texture_edge(job=job, area=float(areas[own].sum()), covered=share)


def drop_missing_uv(*, body: Body) -> None:
    """Removes what stood for a missing uv while the body was baked."""
    layer = body.mesh.uv_layers.get(NO_UV)
    if layer is not None:
        body.mesh.uv_layers.remove(layer)


def unwrap(*, body: Body, bench: bpy.types.Scene, slot: int, name: str, gap: float, areas: np.ndarray) -> bool:
    """Unwraps the faces of a slot to the whole square: by Smart UV Project, or each face apart where that overlaps.

    `gap` is that between charts, as a share of the square. Returns whether the result can hold a texture.
    """
    mesh, thing = body.mesh, body.objects[0]
    indices = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("material_index", indices)
    mesh.uv_layers.active = mesh.uv_layers[name]

    # Operators leave hidden faces as they are.
    for hidden in [each for each in mesh.attributes if each.name.startswith(".hide_")]:
        mesh.attributes.remove(hidden)

    def project(*, pack: Callable[[], object]) -> bool:
        mesh.polygons.foreach_set("select", indices == slot)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.context.tool_settings.mesh_select_mode = (False, False, True)
        pack()
        bpy.ops.object.mode_set(mode="OBJECT")
        mesh.calc_loop_triangles()
        own = triangles_of(mesh=mesh, slot=slot)
        return holds_texture(uvs=uvs_of(mesh=mesh, layer=name)[own], areas=areas[own])

    with on_bench(bench=bench, thing=thing):
        smart = {"angle_limit": ANGLE_LIMIT, "margin_method": "FRACTION", "island_margin": gap}
        apart = {"PREF_CONTEXT": "SEL_FACES", "PREF_MARGIN_DIV": 0.1}
        return project(pack=lambda: bpy.ops.uv.smart_project(**smart)) or project(
            pack=lambda: bpy.ops.uv.lightmap_pack(**apart)
        )


class on_bench:  # noqa: N801 (used as a function)
    """Shows one object in the scene that baking happens in, selected and active."""

    def __init__(self, *, bench: bpy.types.Scene, thing: bpy.types.Object) -> None:
        self._bench, self._thing = bench, thing
        self._is_guest = thing.name not in bench.collection.objects

    def __enter__(self) -> None:
        if self._is_guest:
            self._bench.collection.objects.link(self._thing)
        bpy.context.window.scene = self._bench
        bpy.context.view_layer.objects.active = self._thing
        self._thing.select_set(True)

    def __exit__(self, *_: object) -> None:
        self._thing.select_set(False)
        if self._is_guest:
            self._bench.collection.objects.unlink(self._thing)


def uvs_of(*, mesh: bpy.types.Mesh, layer: str) -> np.ndarray:
    """Returns the uvs of each triangle's corners, shape (n, 3, 2)."""
    uvs = np.empty(len(mesh.loops) * 2, dtype=np.float32)
    mesh.uv_layers[layer].uv.foreach_get("vector", uvs)
    corners = np.empty(len(mesh.loop_triangles) * 3, dtype=np.int32)
    mesh.loop_triangles.foreach_get("loops", corners)
    return uvs.reshape(-1, 2)[corners].reshape(-1, 3, 2)


def triangles_of(*, mesh: bpy.types.Mesh, slot: int) -> np.ndarray:
    """Returns which triangles have a slot's material."""
    found = np.empty(len(mesh.loop_triangles), dtype=np.int32)
    mesh.loop_triangles.foreach_get("material_index", found)
    return found == slot


def world_areas(*, body: Body) -> np.ndarray:
    """Returns the area of each triangle in square metres, at the largest instance."""
    mesh = body.mesh
    matrices = [world_from_object(thing=thing) for thing in body.objects]
    matrix = max(matrices, key=lambda each: abs(each.determinant()))
    corners = np.empty(len(mesh.loop_triangles) * 3, dtype=np.int32)
    mesh.loop_triangles.foreach_get("vertices", corners)
    places = positions_of(mesh=mesh).astype(np.float64) @ np.array(matrix.to_3x3()).T
    triangles = places[corners].reshape(-1, 3, 3)
    sides = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.linalg.norm(sides, axis=1) / 2.0


def slots_of(*, bodies: list[Body]) -> list[Slot]:
    """Returns all slots that are baked."""
    return [slot for body in bodies for slot in body.slots if slot.is_baked]
