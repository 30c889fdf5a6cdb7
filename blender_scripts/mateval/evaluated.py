"""What Blender would render: the scene's evaluated instances, read by a render engine of our own.

Only a render engine is given a dependency graph in the mode of a render, where modifiers, subdivision levels and
visibility are those of the render and not those of the viewport.
"""

from dataclasses import dataclass, field

import bpy
import numpy as np
from mathutils import Matrix, Vector

from mateval.baking_job import Findings, random_of_id, random_of_name

SURFACES = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
"""Types of objects that Blender renders as meshes. Those of all but the first also appear as instances of a mesh."""

IGNORED = {"EMPTY", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE", "LIGHT", "CAMERA"}

DEFORMING = {
    "ARMATURE", "CAST", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LATTICE", "MESH_DEFORM", "SHRINKWRAP",
    "SIMPLE_DEFORM", "SMOOTH", "CORRECTIVE_SMOOTH", "LAPLACIANSMOOTH", "SURFACE_DEFORM", "WARP", "WAVE", "CLOTH",
    "SOFT_BODY",
}  # fmt: skip
"""Modifiers that move vertices, but not the generated coordinates of their textures."""


@dataclass
class Shape:
    """A mesh at one or more places."""

    mesh: bpy.types.Mesh
    materials: tuple[bpy.types.Material | None, ...]
    is_deformed: bool
    rest: np.ndarray | None = None
    """Positions of the vertices before the deformation, shape (n, 3), where they are known."""


@dataclass
class Instance:
    """A shape at its place."""

    name: str
    shape: Shape
    world_from_object: Matrix
    original: bpy.types.Object
    random: float
    """`Random` of the Object Info node."""


@dataclass
class Placed:
    """A lamp or a camera at its place."""

    name: str
    original: bpy.types.Object
    world_from_object: Matrix


@dataclass
class Evaluated:
    """All that is rendered."""

    instances: list[Instance] = field(default_factory=list)
    lights: list[Placed] = field(default_factory=list)
    camera: Placed | None = None


class TooMuchError(Exception):
    """The scene has more instances or triangles than the job allows."""


class Reading(bpy.types.RenderEngine):
    """Renders nothing, but hands the dependency graph to `take`."""

    bl_idname = "MATEVAL_READ"
    bl_label = "MatEval reads the scene"
    take = None

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Is called by Blender once per view layer."""
        Reading.take(depsgraph=depsgraph)


def evaluate(*, scene: bpy.types.Scene, most_instances: int, most_triangles: int, findings: Findings) -> Evaluated:
    """Returns what the active view layer of the scene would render."""
    collector = Collector(most_instances=most_instances, most_triangles=most_triangles, findings=findings)
    has_camera = scene.camera is not None
    if not has_camera:
        # Blender renders nothing without a camera, not even by an engine of our own.
        scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    run_engine(scene=scene, collector=collector)
    found = collector.found
    if any(instance.shape.is_deformed for instance in found.instances):
        switch_off_deformation()
        rest = RestCollector()
        run_engine(scene=scene, collector=rest)
        rest.give(instances=found.instances)
    if not has_camera:
        found.camera = None
        bpy.data.objects.remove(scene.camera)
    return found


def run_engine(*, scene: bpy.types.Scene, collector: "Collector | RestCollector") -> None:
    """Lets a collector take the dependency graph of a render."""
    shown = next((layer for layer in scene.view_layers if layer.use), scene.view_layers[0])
    for layer in scene.view_layers:
        layer.use = layer == shown
    engine, render = scene.render.engine, scene.render
    Reading.take = collector.take
    bpy.utils.register_class(Reading)
    try:
        render.engine, render.use_multiview = Reading.bl_idname, False
        render.use_compositing = render.use_sequencer = False
        bpy.ops.render.render(scene=scene.name)
    finally:
        render.engine = engine
        bpy.utils.unregister_class(Reading)
    # Blender prints an exception in an engine and continues.
    if collector.error is not None:
        raise collector.error


def switch_off_deformation() -> None:
    """Makes meshes evaluate to what they are before modifiers and shape keys move their vertices."""
    for thing in bpy.data.objects:
        for modifier in thing.modifiers:
            if modifier.type in DEFORMING:
                modifier.show_render = False
    for key in bpy.data.shape_keys:
        for block in key.key_blocks:
            block.mute = True


class Collector:
    """Copies the evaluated meshes while the dependency graph exists."""

    def __init__(self, *, most_instances: int, most_triangles: int, findings: Findings) -> None:
        self.found = Evaluated()
        self.error: Exception | None = RuntimeError("Blender did not evaluate the scene")
        self._shapes: dict[tuple, Shape] = {}
        self._instances, self._triangles = most_instances, most_triangles
        self._findings = findings

    def take(self, *, depsgraph: bpy.types.Depsgraph) -> None:
        """Reads every instance, and the camera."""
        try:
            camera = depsgraph.scene_eval.camera
            self.found.camera = placed(thing=camera, matrix=camera.matrix_world)
            for instance in depsgraph.object_instances:
                self._take_one(instance=instance)
            self.error = None
        except Exception as error:  # noqa: BLE001 (raised again outside of the engine)
            self.error = error

    def _take_one(self, *, instance: bpy.types.DepsgraphObjectInstance) -> None:
        thing = instance.object
        if not instance.show_self:
            return
        if thing.type == "LIGHT":
            self.found.lights.append(placed(thing=thing, matrix=instance.matrix_world))
        elif thing.type == "MESH":
            self._take_mesh(instance=instance)
        elif thing.type not in IGNORED | SURFACES:
            message = f"an object of the type {thing.type.lower()}"
            self._findings.note(code="object_type", place=thing.name, message=message, action="left it out")

    def _take_mesh(self, *, instance: bpy.types.DepsgraphObjectInstance) -> None:
        thing = instance.object
        if len(thing.data.polygons) == 0:
            return
        hidden = (thing.is_holdout, thing.is_shadow_catcher, not thing.visible_camera)
        for words, is_so in zip(("a holdout", "a shadow catcher", "hidden from the camera"), hidden, strict=True):
            if is_so:
                message = f"an object that is {words}"
                self._findings.note(
                    code="visibility", place=thing.name, message=message, action="showed it as any other"
                )
        shape = self._shape(thing=thing)
        self._triangles -= len(shape.mesh.loop_triangles)
        if len(self.found.instances) >= self._instances or self._triangles < 0:
            raise TooMuchError(
                f"the scene has more instances or triangles than allowed; '{thing.name}' is the first left"
            )
        number = instance.random_id
        self.found.instances.append(
            Instance(
                name=thing.name,
                shape=shape,
                world_from_object=instance.matrix_world.copy(),
                original=thing.original,
                random=random_of_id(number=number) if instance.is_instance else random_of_name(name=thing.name),
            )
        )

    def _shape(self, *, thing: bpy.types.Object) -> Shape:
        """The copy of an evaluated mesh, shared by all instances with the same materials."""
        slots = [slot.material for slot in thing.material_slots] or list(thing.data.materials)
        materials = tuple(material and material.original for material in slots)
        key = (thing.data.as_pointer(), tuple(material and material.name_full for material in materials))
        if key not in self._shapes:
            mesh = thing.data.copy()
            # Generated coordinates are measured in the texture space, which would follow the new vertices.
            location, size = Vector(thing.data.texspace_location), Vector(thing.data.texspace_size)
            mesh.use_auto_texspace = False
            mesh.texspace_location, mesh.texspace_size = location, size
            mesh.calc_loop_triangles()
            self._shapes[key] = Shape(mesh=mesh, materials=materials, is_deformed=is_deformed(thing=thing.original))
        return self._shapes[key]


class RestCollector:
    """Reads the vertices of the same instances once more, without deformation."""

    def __init__(self) -> None:
        self.error: Exception | None = RuntimeError("Blender did not evaluate the scene again")
        self._meshes: list[tuple[str, np.ndarray]] = []

    def take(self, *, depsgraph: bpy.types.Depsgraph) -> None:
        """Reads every mesh, in the order of `Collector`."""
        for instance in depsgraph.object_instances:
            thing = instance.object
            if instance.show_self and thing.type == "MESH" and len(thing.data.polygons) > 0:
                self._meshes.append((thing.name, positions_of(mesh=thing.data)))
        self.error = None

    def give(self, *, instances: list[Instance]) -> None:
        """Gives deformed shapes the vertices, unless the deformation also changes what there is to see."""
        if [name for name, _ in self._meshes] != [instance.name for instance in instances]:
            return
        for (_, positions), instance in zip(self._meshes, instances, strict=True):
            if instance.shape.is_deformed and len(positions) == len(instance.shape.mesh.vertices):
                instance.shape.rest = positions


def positions_of(*, mesh: bpy.types.Mesh) -> np.ndarray:
    """Returns the vertices of a mesh, shape (n, 3)."""
    positions = np.empty(len(mesh.vertices) * 3, dtype=np.float32)
    mesh.vertices.foreach_get("co", positions)
    return positions.reshape(-1, 3)


def placed(*, thing: bpy.types.Object, matrix: Matrix) -> Placed:
    """Returns a lamp or camera of the dependency graph, as it stays when the graph is gone."""
    return Placed(name=thing.name, original=thing.original, world_from_object=matrix.copy())


def is_deformed(*, thing: bpy.types.Object) -> bool:
    """Returns whether a modifier or a shape key moves the object's vertices."""
    keys = getattr(thing.data, "shape_keys", None)
    return keys is not None or any(each.show_render and each.type in DEFORMING for each in thing.modifiers)
