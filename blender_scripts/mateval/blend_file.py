"""Opens a scene of an untrusted user: runs no Python of it and reads no file outside of its folder.

Blender reads linked libraries while it opens the file, before they can be listed. A library outside of the folder is
therefore read, but nothing is made of it: the file is refused.
"""

import glob
import re
from pathlib import Path

import bpy

from mateval.baking_job import Findings, Job, place_of

TILE = re.compile(r"<UDIM>|<UVTILE>")


def open_scene(*, job: Job, findings: Findings) -> tuple[bpy.types.Scene, list[str]]:
    """Opens the file, keeps its scene alone and returns it with the external files that it uses, sorted."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.preferences.filepaths.use_scripts_auto_execute = False
    bpy.ops.wm.open_mainfile(filepath=job["blend"], use_scripts=False, load_ui=False)
    if bpy.app.autoexec_fail:
        findings.note(
            code="scripts_disabled",
            place=job["blend"],
            message=f"the file wants to run Python: {bpy.app.autoexec_fail_message}",
            action="ran none; a value that a Python expression drives is the one that was saved, or 0",
        )
    scene = bpy.context.scene
    report_settings(scene=scene, findings=findings)
    drop_unused(scene=scene)
    check_libraries(findings=findings)
    files = external_files(folder=Path(job["folder"]), findings=findings)
    if not findings.faults:
        check_images(findings=findings)
    return scene, files


def report_settings(*, scene: bpy.types.Scene, findings: Findings) -> None:
    """Reports settings of the scene that change its size or its materials."""
    scale = scene.unit_settings.scale_length
    if scene.unit_settings.system != "NONE" and abs(scale - 1.0) > 1e-6:
        message, action = f"a unit of {scale:.6g} m", "took a unit as 1 m, as Blender's glTF exporter does"
        findings.note(code="unit", place="scene", message=message, action=action)
    for layer in scene.view_layers:
        if layer.use and layer.material_override is not None:
            message, action = "one material overrides all others", "used each object's own"
            findings.note(code="material_override", place=layer.name, message=message, action=action)


def drop_unused(*, scene: bpy.types.Scene) -> None:
    """Removes the other scenes, and then everything that this one does not use, so that unused files are not missed."""
    for other in [each for each in bpy.data.scenes if each != scene]:
        bpy.data.scenes.remove(other)
    scene.sequence_editor_clear()
    if scene.node_tree is not None:
        scene.node_tree.nodes.clear()
    for sound in list(bpy.data.sounds):
        bpy.data.sounds.remove(sound)
    for text, users in bpy.data.user_map(subset=bpy.data.texts).items():
        if not users:
            bpy.data.texts.remove(text)
    for item in bpy.data.user_map():
        item.use_fake_user = False
    bpy.data.orphans_purge(do_local_ids=True, do_linked_ids=True, do_recursive=True)


def step_aside(*, items: bpy.types.bpy_prop_collection) -> None:
    """Renames data of the file, so that what is made of it can have its names."""
    for item in list(items):
        if item.library is None:
            item.name = f"source {item.name}"


def check_libraries(*, findings: Findings) -> None:
    """Reports data that a library should hold and does not."""
    for item in bpy.data.user_map():
        if item.is_missing:
            findings.fault(
                code="data_missing",
                place=item.library.filepath if item.library else "",
                message=f"expected {item.id_type.lower()} '{item.name}' in the linked file, found none",
                action="link it again, or remove its users",
            )


def check_images(*, findings: Findings) -> None:
    """Reports images that Blender cannot read, which it would show pink."""
    for image in bpy.data.images:
        if image.source == "FILE" and min(image.size) < 1:
            action = "save the image again, or remove its users"
            findings.fault(code="file_unreadable", place=image.filepath, message="is no image", action=action)


def external_files(*, folder: Path, findings: Findings) -> list[str]:
    """Returns the files that the scene uses, relative to the folder; reports those outside of it or missing."""
    used = set()
    for name in [*bpy.utils.blend_paths(absolute=True, packed=False, local=False), *imported_files(findings=findings)]:
        for path in tiles_of(name=name):
            place = place_of(path=path, folder=folder)
            if place is None:
                message, action = f"lies outside of '{folder}'", "pack it into the file, or move it below that folder"
                findings.fault(code="file_outside", place=str(path), message=message, action=action)
            elif not path.is_file():
                action = "restore it, or remove its users"
                findings.fault(code="file_missing", place=place, message="does not exist", action=action)
            else:
                used.add(place)
    return sorted(used)


def tiles_of(*, name: str) -> list[Path]:
    """Returns the files that a path stands for: all tiles of a tiled image, else itself."""
    if not TILE.search(name):
        return [Path(name)]
    pattern = "*".join(glob.escape(piece) for piece in TILE.split(name))
    return [Path(found) for found in sorted(glob.glob(pattern))] or [Path(name)]


def imported_files(*, findings: Findings) -> list[str]:
    """Returns the files that geometry nodes import. A path that nodes compute cannot be checked and is refused."""
    files = []
    for tree in bpy.data.node_groups:
        for node in tree.nodes:
            if not node.bl_idname.startswith("GeometryNodeImport"):
                continue
            path = node.inputs["Path"]
            if path.is_linked:
                findings.fault(
                    code="file_computed",
                    place=f"{tree.name}/{node.name}",
                    message="imports a file whose path other nodes compute",
                    action="write the path into the node, or apply the modifier",
                )
            elif path.default_value:
                files.append(bpy.path.abspath(path.default_value, library=tree.library))
    return files
