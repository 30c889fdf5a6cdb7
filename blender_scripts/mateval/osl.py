"""Shaders in OSL: compiled anew from their text, and refused where they could write a file.

OSL is no Python, and its only output besides colours is `fprintf`. The opcodes of a compiled shader are plain text.
"""

import re
from pathlib import Path

import bpy

from mateval.baking_job import Findings, place_of

WRITES = re.compile(rb"\bfprintf\b")
INCLUDE = re.compile(r'^\s*#\s*include\s*["<]([^">]+)[">]', re.MULTILINE)
KNOWN_INCLUDES = {"stdosl.h", "node_color.h", "node_noise.h", "node_math.h", "oslutil.h", "vector2.h", "vector4.h"}


def prepare_scripts(*, folder: Path, work: Path, findings: Findings) -> bool:
    """Compiles the scripts of all materials into `work`. Returns whether the scene has any."""
    nodes = [node for tree in shader_trees() for node in tree.nodes if node.bl_idname == "ShaderNodeScript"]
    for number, node in enumerate(nodes):
        place = f"{node.id_data.name}, node '{node.name}'"
        text = text_of(node=node, folder=folder)
        if text is None:
            action = "put its text into the file"
            findings.fault(code="osl", place=place, message="an OSL shader without text inside the folder", action=action)
            continue
        unknown = sorted(set(INCLUDE.findall(text)) - KNOWN_INCLUDES)
        if unknown:
            message = f"an OSL shader includes '{unknown[0]}'"
            findings.fault(code="osl", place=place, message=message, action="put its text in place of the include")
            continue
        compiled = compile_text(text=text, path=work / f"script_{number}.osl")
        if compiled is None or WRITES.search(compiled.read_bytes()):
            message = "an OSL shader that " + ("does not compile" if compiled is None else "writes files")
            findings.fault(code="osl", place=place, message=message, action="change the shader")
            continue
        use_compiled(node=node, path=compiled)
    return bool(nodes)


def shader_trees() -> list[bpy.types.NodeTree]:
    """Returns the trees of materials and worlds, and their groups."""
    owners = [*bpy.data.materials, *bpy.data.worlds]
    groups = [tree for tree in bpy.data.node_groups if tree.bl_idname == "ShaderNodeTree"]
    return [owner.node_tree for owner in owners if owner.node_tree is not None] + groups


def text_of(*, node: bpy.types.Node, folder: Path) -> str | None:
    """Returns a node's source; none where it has none that may be read."""
    if node.mode == "INTERNAL":
        return node.script.as_string() if node.script is not None else None
    path = Path(bpy.path.abspath(node.filepath, library=node.id_data.library))
    is_source = path.suffix == ".osl" and place_of(path=path, folder=folder) is not None and path.is_file()
    return path.read_text(encoding="utf-8", errors="replace") if is_source else None


def compile_text(*, text: str, path: Path) -> Path | None:
    """Compiles a shader; returns the compiled file."""
    # Part of Blender's Cycles add-on, which only exists inside of Blender.
    import _cycles

    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    compiled = path.with_suffix(".oso")
    return compiled if _cycles.osl_compile(str(path), str(compiled)) and compiled.is_file() else None


def use_compiled(*, node: bpy.types.Node, path: Path) -> None:
    """Makes a node run a compiled file, with the inputs, outputs and links that it has."""
    sockets = {kind: {s.name for s in getattr(node, kind)} for kind in ("inputs", "outputs")}
    node.mode = "EXTERNAL"
    node.filepath = str(path)
    if any(sockets[kind] - {s.name for s in getattr(node, kind)} for kind in sockets):
        raise RuntimeError(f"Blender changed the sockets of the script node '{node.name}'")
