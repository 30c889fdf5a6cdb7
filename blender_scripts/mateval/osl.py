"""Shaders in OSL: compiled anew from their text, and refused where they could write a file.

OSL is no Python. Besides colours its only output is `fprintf`, and the opcodes of a compiled shader are plain text.
"""

import re
from pathlib import Path

import bpy

from mateval.baking_job import Findings, place_of

WRITES = re.compile(rb"\bfprintf\b")
INCLUDE = re.compile(r"^[ \t]*#[ \t]*include(.*)$", re.MULTILINE)
NAME = re.compile(r'\s*(?:"([\w.-]+)"|<([\w.-]+)>)')


class ShaderError(Exception):
    """A shader that is not run. The message says why."""


def prepare_scripts(*, folder: Path, work: Path, findings: Findings) -> bool:
    """Compiles the scripts of all materials into `work`. Returns whether the scene has any."""
    nodes = [node for tree in shader_trees() for node in tree.nodes if node.bl_idname == "ShaderNodeScript"]
    for number, node in enumerate(nodes):
        try:
            compiled = compile_node(node=node, folder=folder, work=work / f"script_{number}")
        except ShaderError as error:
            place = f"{node.id_data.name}, node '{node.name}'"
            action = "change it, or bake it to a picture"
            findings.fault(code="osl", place=place, message=f"an OSL shader that {error}", action=action)
        else:
            use_compiled(node=node, path=compiled)
    return bool(nodes)


def shader_trees() -> list[bpy.types.NodeTree]:
    """Returns the trees of materials and worlds, and their groups."""
    owners = [*bpy.data.materials, *bpy.data.worlds]
    groups = [tree for tree in bpy.data.node_groups if tree.bl_idname == "ShaderNodeTree"]
    return [owner.node_tree for owner in owners if owner.node_tree is not None] + groups


def compile_node(*, node: bpy.types.Node, folder: Path, work: Path) -> Path:
    """Compiles a node's source; returns the compiled file."""
    # Part of Blender's Cycles add-on, which only exists inside of Blender.
    import _cycles

    work.mkdir(parents=True)
    source, compiled = work / "shader.osl", work / "shader.oso"
    text, beside = text_of(node=node, folder=folder)
    source.write_text(text, encoding="utf-8")
    copy_includes(text=text, beside=beside, folder=folder, work=work)
    if not _cycles.osl_compile(str(source), str(compiled)) or not compiled.is_file():
        raise ShaderError("does not compile")
    if WRITES.search(compiled.read_bytes()):
        raise ShaderError("writes files")
    return compiled


def text_of(*, node: bpy.types.Node, folder: Path) -> tuple[str, Path | None]:
    """Returns a node's source, and the folder that it may include files of."""
    if node.mode == "INTERNAL":
        if node.script is None:
            raise ShaderError("has no text")
        return node.script.as_string(), None
    path = Path(bpy.path.abspath(node.filepath, library=node.id_data.library))
    if path.suffix != ".osl" or place_of(path=path, folder=folder) is None or not path.is_file():
        raise ShaderError("is no .osl file inside of the scene's folder")
    return path.read_text(encoding="utf-8", errors="replace"), path.parent


def copy_includes(*, text: str, beside: Path | None, folder: Path, work: Path) -> None:
    """Copies what a source includes, from its own folder. Blender's own headers are found by the compiler."""
    for line in INCLUDE.findall(text):
        found = NAME.match(line)
        if found is None:
            raise ShaderError(f"includes {line.strip()}, which is no plain name of a file")
        name = found.group(1) or found.group(2)
        path = None if beside is None else beside / name
        if (work / name).exists():
            continue
        if path is not None and place_of(path=path, folder=folder) is not None and path.is_file():
            included = path.read_text(encoding="utf-8", errors="replace")
            (work / name).write_text(included, encoding="utf-8")
            copy_includes(text=included, beside=beside, folder=folder, work=work)
        elif not (Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core/cycles/shader" / name).is_file():
            raise ShaderError(f"includes '{name}', which is not beside it")


def use_compiled(*, node: bpy.types.Node, path: Path) -> None:
    """Makes a node run a compiled file, with the inputs, outputs and links that it has."""
    sockets = {kind: {socket.name for socket in getattr(node, kind)} for kind in ("inputs", "outputs")}
    node.mode, node.filepath = "EXTERNAL", str(path)
    if any(names - {socket.name for socket in getattr(node, kind)} for kind, names in sockets.items()):
        raise RuntimeError(f"Blender changed the sockets of the script node '{node.name}'")
