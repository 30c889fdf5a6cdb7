"""Meshes, materials, lights and camera of a job in Blender."""

from pathlib import Path

import bpy
from mathutils import Matrix

from mateval.camera import lens
from mateval.job import Job, group_name, lights_of_surfaces, read_numbers
from mateval.materials import INSTANCE, PART, UV_LAYER, Textures, approximation, geometry_material, surface_material
from mateval.world import add_world

SENSOR_WIDTH = 36.0
"""Width of the sensor in millimetres; any value will do, because the field of view is given as an angle."""


class BuiltScene:
    """A job's scene. Each object has a material for geometry passes and one for light."""

    def __init__(self, *, job: Job, folder: Path) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        self.approximations = approximations(job=job)
        textures = Textures(job=job, folder=folder)
        for group in range(len(job["lights"])):
            self.scene.view_layers[0].lightgroups.add(name=group_name(group=group))
        self._objects = add_surfaces(job=job, folder=folder, textures=textures)
        add_world(scene=self.scene, job=job, textures=textures)
        self._camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        self.scene.collection.objects.link(self._camera)
        self.scene.camera = self._camera

    def show_geometry(self) -> None:
        """Gives every surface the material that shows its ids."""
        for thing, (geometry, _) in self._objects:
            thing.data.materials[0] = geometry

    def show_light(self) -> None:
        """Gives every surface the material that reflects and emits as the job describes."""
        for thing, (_, lit) in self._objects:
            thing.data.materials[0] = lit

    def look_from(self, *, camera: Job) -> None:
        """Sets the camera's pose, the lens and the picture's size of a view."""
        intrinsics = camera["intrinsics"]
        shape = lens(intrinsics=intrinsics)
        data = self._camera.data
        data.sensor_fit = "HORIZONTAL"
        data.sensor_width = SENSOR_WIDTH
        data.angle = shape.angle_x
        data.shift_x, data.shift_y = shape.shift_x, shape.shift_y
        data.clip_start, data.clip_end = 1e-4, 1e6
        self._camera.matrix_world = Matrix(camera["world_from_camera"])
        render = self.scene.render
        render.resolution_x, render.resolution_y = intrinsics["width"], intrinsics["height"]
        render.resolution_percentage = 100
        render.pixel_aspect_x, render.pixel_aspect_y = 1.0, shape.pixel_aspect_y


def approximations(*, job: Job) -> list[str]:
    """Returns how Cycles deviates from the job, one line per used material."""
    used = sorted({surface["material"] for surface in job["surfaces"]})
    said = ((job["materials"][k]["name"], approximation(model=job["materials"][k]["model"])) for k in used)
    return [f"material '{name}': {why}" for name, why in said if why is not None]


def add_surfaces(*, job: Job, folder: Path, textures: Textures) -> list[tuple]:
    """Makes one object per surface, with its two materials."""
    light_of = lights_of_surfaces(job=job)
    geometry: dict[int, bpy.types.Material] = {}
    lit: dict[tuple[int, int | None], bpy.types.Material] = {}
    objects = []
    for number, surface in enumerate(job["surfaces"]):
        index, group = surface["material"], light_of.get(number)
        material = job["materials"][index]
        if index not in geometry:
            geometry[index] = geometry_material(textures=textures, material=material)
        if (index, group) not in lit:
            light = None if group is None else job["lights"][group]
            lit[index, group] = surface_material(textures=textures, material=material, light=light)
        thing = add_mesh(surface=surface, number=number, folder=folder)
        if group is not None:
            thing.lightgroup = group_name(group=group)
        thing.data.materials.append(lit[index, group])
        objects.append((thing, (geometry[index], lit[index, group])))
    return objects


def add_mesh(*, surface: Job, number: int, folder: Path) -> bpy.types.Object:
    """Makes a surface's mesh, smooth where it has normals. Face attributes hold the instance and the part."""
    mesh = bpy.data.meshes.new(f"surface {number}")
    corners = read_numbers(path=folder / surface["triangles"], code="I")
    positions = read_numbers(path=folder / surface["positions"], code="f")
    triangles = len(corners) // 3
    mesh.vertices.add(len(positions) // 3)
    mesh.vertices.foreach_set("co", positions)
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", corners)
    mesh.polygons.add(triangles)
    mesh.polygons.foreach_set("loop_start", range(0, len(corners), 3))
    mesh.update(calc_edges=True)
    if surface["uvs"] is not None:
        add_uvs(mesh=mesh, corners=corners, uvs=read_numbers(path=folder / surface["uvs"], code="f"))
    if surface["normals"] is None:
        mesh.shade_flat()
    else:
        normals = read_numbers(path=folder / surface["normals"], code="f")
        mesh.shade_smooth()
        mesh.normals_split_custom_set_from_vertices(list(zip(*[iter(normals)] * 3, strict=True)))
    mark(mesh=mesh, name=INSTANCE, values=[surface["instance"]] * triangles)
    mark(mesh=mesh, name=PART, values=read_numbers(path=folder / surface["parts"], code="H"))
    thing = bpy.data.objects.new(f"surface {number}", mesh)
    # By default Blender moves the shadow terminator of smooth surfaces, which the material does not describe.
    thing.cycles.shadow_terminator_offset = 0.0
    thing.cycles.shadow_terminator_geometry_offset = 0.0
    bpy.context.scene.collection.objects.link(thing)
    return thing


def add_uvs(*, mesh: bpy.types.Mesh, corners: list, uvs: list) -> None:
    """Sets the uv of each corner from those of its vertex."""
    layer = mesh.uv_layers.new(name=UV_LAYER)
    layer.uv.foreach_set("vector", [number for k in corners for number in uvs[2 * k : 2 * k + 2]])


def mark(*, mesh: bpy.types.Mesh, name: str, values: list) -> None:
    """Gives each face a number; floats represent 16-bit integers exactly."""
    attribute = mesh.attributes.new(name=name, type="FLOAT", domain="FACE")
    attribute.data.foreach_set("value", [float(value) for value in values])
