"""Finds the scene files below a folder, and writes the recipe of each.

A glTF without a camera gets one. Of a house of 3D-FRONT, the rooms that have a floor are scenes.
"""

from __future__ import annotations

import itertools
import json
import os
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

MODEL_FOLDERS = re.compile(r"3d-future-model.*|models", re.IGNORECASE)
TEXTURE_FOLDERS = re.compile(r"3d-front-texture.*|textures", re.IGNORECASE)
Matrix = list[list[float]]


@dataclass
class Case:
    """A scene to try."""

    file: Path
    name: str
    """The path below the folder, with the room of a house."""
    kind: str
    scene: str
    """The lines of the recipe's `[[scene]]`."""
    source: Path
    """The folder that the recipe's paths are relative to."""


def find_cases(*, folder: Path, out: Path, most_rooms: int, allow: bool) -> Iterator[Case]:
    """Yields the scenes below the folder, by path. Links to folders are not followed."""
    extra = "allow_missing = true\nallow_unstated = true\n" if allow else ""
    for place, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if (Path(place) / name).resolve() != out)
        for file in (Path(place) / name for name in sorted(files)):
            if not file.is_file():
                continue
            for kind, room, scene in scenes_of(file=file, folder=folder, most_rooms=most_rooms):
                name = f"{file.relative_to(folder)}{room and f' ({room})'}"
                yield Case(file=file, name=name, kind=kind, scene=scene + extra, source=folder)


def scenes_of(*, file: Path, folder: Path, most_rooms: int) -> Iterator[tuple[str, str, str]]:
    """Yields kind, room and recipe lines of each scene of a file; nothing if it is of another kind."""
    ending = file.suffix.lower()
    if ending in (".glb", ".gltf"):
        yield "glTF", "", f"gltf = {quoted(file)}\n{gltf_camera(file=file)}"
    elif ending == ".blend":
        yield "Blender", "", f"blend = {quoted(file)}\n"
    elif ending == ".xml" and has_root(file=file, root="scene"):
        yield "Mitsuba", "", f"bitterli = {quoted(file)}\n"
    elif ending == ".json" and (house := read_house(file=file)):
        # Without a folder of models, the house's own: then every model is missing, and the architecture remains.
        models = folder_beside(file=file, top=folder, names=MODEL_FOLDERS) or file.parent
        textures = folder_beside(file=file, top=folder, names=TEXTURE_FOLDERS)
        keys = f"models = {quoted(models)}" + (f", textures = {quoted(textures)}" if textures else "")
        for room in rooms_with_floor(house=house)[:most_rooms]:
            front3d = f"front3d = {{ house = {quoted(file)}, room = {quoted(room)}, {keys} }}"
            yield "3D-FRONT", room, f"{front3d}\ncamera = {{ seed = 1 }}\n"


def quoted(value: object) -> str:
    """A string of TOML, whose escapes are those of JSON but for DEL. Bytes that are not UTF-8 are replaced."""
    text = os.fsencode(str(value)).decode(errors="replace")
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")


def has_root(*, file: Path, root: str) -> bool:
    """Whether an XML file's first element has this name."""
    try:
        _, element = next(ElementTree.iterparse(file, events=("start",)))
    except (ElementTree.ParseError, StopIteration, ValueError, LookupError):
        return False
    return bool(element.tag == root)


def read_house(*, file: Path) -> dict[str, Any] | None:
    """A JSON object with `mesh` and `scene`, or nothing."""
    try:
        house = json.loads(file.read_bytes())
    except (ValueError, RecursionError):
        return None
    return house if isinstance(house, dict) and "mesh" in house and isinstance(house.get("scene"), dict) else None


def records(*, tree: dict[str, Any], key: str) -> list[dict[str, Any]]:
    """The objects of a list, which may be absent or of another type."""
    found = tree.get(key)
    return [record for record in found if isinstance(record, dict)] if isinstance(found, list) else []


def rooms_with_floor(*, house: dict[str, Any]) -> list[str]:
    """The ids of the rooms that have a floor, those with the most children first."""
    floors = {str(mesh.get("uid")) for mesh in records(tree=house, key="mesh") if mesh.get("type") == "Floor"}
    found = []
    for room in records(tree=house["scene"], key="room"):
        children = [str(child.get("ref")) for child in records(tree=room, key="children")]
        if isinstance(room.get("instanceid"), str) and floors.intersection(children):
            found.append((-len(children), room["instanceid"]))
    return [room for _, room in sorted(found)]


def folder_beside(*, file: Path, top: Path, names: re.Pattern[str]) -> Path | None:
    """The nearest folder with such a name beside the file, or beside one of its folders up to `top`."""
    for place in itertools.takewhile(lambda place: place != top.parent, file.parents):
        for entry in sorted(place.iterdir()):
            if names.fullmatch(entry.name) and entry.is_dir():
                return entry
    return None


def gltf_camera(*, file: Path) -> str:
    """The recipe's line with a camera for a glTF that has none: before its box, at one and a half times its size.

    Nothing for a file that cannot be understood, which is then tried as it is.
    """
    try:
        data = file.read_bytes()
        if data[:4] == b"glTF":
            data = data[20 : 20 + struct.unpack_from("<I", data, 12)[0]]
        tree = json.loads(data.rstrip(b"\0"))
        corners, has_camera = gltf_corners(tree=tree)
        low, high = (tuple(map(pick, zip(*corners, strict=True))) for pick in (min, max))
        size = max(b - a for a, b in zip(low, high, strict=True))
        target = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
        position = [a + size * b for a, b in zip(target, (0.4, 0.5, 1.5), strict=True)]
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError, struct.error):
        return ""
    if has_camera or not 0 < size < 1e5:
        return ""
    return f"camera = {{ position = {position}, target = {target}, fov_y_deg = 50.0 }}\n"


def gltf_corners(*, tree: dict[str, Any]) -> tuple[list[tuple[float, ...]], bool]:
    """The corners of the boxes of all primitives in the world, and whether a node has a perspective camera."""
    corners: list[tuple[float, ...]] = []
    has_camera = False
    unit = [[float(row == column) for column in range(4)] for row in range(4)]
    pending = [(node, unit) for node in tree["scenes"][tree.get("scene", 0)]["nodes"]]
    seen: set[int] = set()
    while pending:
        number, parent = pending.pop()
        if number in seen:
            continue
        seen.add(number)
        node = tree["nodes"][number]
        world = product(parent, node_matrix(node=node))
        pending += [(child, world) for child in node.get("children", [])]
        if "camera" in node:
            has_camera |= tree["cameras"][node["camera"]]["type"] == "perspective"
        for primitive in tree["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
            box = tree["accessors"][primitive["attributes"]["POSITION"]]
            for corner in itertools.product(*zip(box["min"], box["max"], strict=True)):
                corners.append(tuple(sum(a * b for a, b in zip(row, (*corner, 1.0), strict=True)) for row in world[:3]))
    return corners, has_camera


def node_matrix(*, node: dict[str, Any]) -> Matrix:
    """A node's transform, by rows. glTF stores matrices by columns, and quaternions as x, y, z, w."""
    if "matrix" in node:
        return [list(node["matrix"][row::4]) for row in range(4)]
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    rotation = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    scale, shift = node.get("scale", (1.0, 1.0, 1.0)), node.get("translation", (0.0, 0.0, 0.0))
    rows = [[a * b for a, b in zip(rotation[k], scale, strict=True)] + [shift[k]] for k in range(3)]
    return [*rows, [0.0, 0.0, 0.0, 1.0]]


def product(a: Matrix, b: Matrix) -> Matrix:
    return [[sum(x * y for x, y in zip(row, column, strict=True)) for column in zip(*b, strict=True)] for row in a]
