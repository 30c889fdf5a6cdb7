"""What the tests of `blender_scripts/bake_blend.py` share: scenes that are built and baked, and a reader of GLB."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import tempfile
import unittest
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

SCRIPTS = Path(__file__).resolve().parents[2] / "blender_scripts"
# Tests compare with functions of the scripts.
sys.path.insert(0, str(SCRIPTS))


LIMITS = {
    "texels": 64,
    "texel_m": None,
    "most_texels": 256,
    "samples": 1,
    "world_rows": 32,
    "threads": 1,
    "most_instances": 1000,
    "most_triangles": 1_000_000,
    "most_baked_texels": 100_000_000,
}
ONE_BYTE = 1.0 / 255.0


@dataclass
class Texels:
    """The texels whose centres lie on a primitive: stored values, and where they are in Blender's object space."""

    values: np.ndarray
    positions: np.ndarray


class Glb:
    """A GLB file, read without the library that wrote it."""

    def __init__(self, *, path: Path) -> None:
        data = path.read_bytes()
        length = struct.unpack_from("<I", data, 12)[0]
        self.json = json.loads(data[20 : 20 + length])
        self.binary = data[28 + length :]
        self.folder = path.parent

    def view(self, *, index: int) -> bytes:
        """The bytes of a buffer view."""
        view = self.json["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.binary[start : start + view["byteLength"]]

    def numbers(self, *, accessor: int) -> np.ndarray:
        """The values of an accessor."""
        found = self.json["accessors"][accessor]
        kind = {5126: np.float32, 5125: np.uint32, 5123: np.uint16, 5121: np.uint8}[found["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[found["type"]]
        return np.frombuffer(self.view(index=found["bufferView"]), dtype=kind)[: found["count"] * width].reshape(
            -1, width
        )

    def node(self, *, name: str) -> dict:
        """A node by its name."""
        return next(node for node in self.json["nodes"] if node["name"] == name)

    def primitives(self, *, name: str) -> list[dict]:
        """The primitives of a node's mesh."""
        return self.json["meshes"][self.node(name=name)["mesh"]]["primitives"]

    def material(self, *, name: str, primitive: int = 0) -> dict:
        """The material of a node's primitive."""
        return self.json["materials"][self.primitives(name=name)[primitive]["material"]]

    def picture(self, *, info: dict) -> np.ndarray:
        """The stored values of a texture, its first row at the top."""
        source = self.json["images"][self.json["textures"][info["index"]]["source"]]
        path = self.folder / f"read.{source['mimeType'].split('/')[1]}"
        path.write_bytes(self.view(index=source["bufferView"]))
        image = bpy.data.images.load(str(path))
        image.colorspace_settings.name, image.alpha_mode = "Non-Color", "CHANNEL_PACKED"
        width, height = image.size
        values = np.array(image.pixels[:], dtype=np.float32).reshape(height, width, 4)[::-1]
        bpy.data.images.remove(image)
        return values

    def texels(self, *, name: str, info: dict, primitive: int = 0) -> Texels:
        """The texels of a texture that show a node."""
        picture = self.picture(info=info)
        side = len(picture)
        found = self.primitives(name=name)[primitive]
        corners = self.numbers(accessor=found["indices"]).reshape(-1, 3)
        uvs = self.numbers(accessor=found["attributes"][f"TEXCOORD_{info.get('texCoord', 0)}"])[corners]
        places = self.numbers(accessor=found["attributes"]["POSITION"])[corners].astype(np.float64)
        rows, columns = (grid.ravel() for grid in np.mgrid[0:side, 0:side])
        centres = np.stack([columns + 0.5, rows + 0.5], axis=1) / side
        values, positions = [], []
        for uv, place in zip(uvs.astype(np.float64), places, strict=True):
            edges = np.stack([uv[1] - uv[0], uv[2] - uv[0]], axis=1)
            if abs(np.linalg.det(edges)) < 1e-12:
                continue
            weights = (centres - uv[0]) @ np.linalg.inv(edges).T
            inside = (weights.min(axis=1) > 1e-4) & (weights.sum(axis=1) < 1.0 - 1e-4)
            at = place[0] + weights[inside] @ (place[1:] - place[0])
            values.append(picture[rows[inside], columns[inside]])
            # The exporter's axes: x, z, -y.
            positions.append(np.stack([at[:, 0], -at[:, 2], at[:, 1]], axis=1))
        return Texels(values=np.concatenate(values), positions=np.concatenate(positions))


def checker(*, at: np.ndarray) -> np.ndarray:
    """Cycles' checker at scaled coordinates: 1 for the first colour (`svm/checker.h`)."""
    cells = np.floor((at + 1e-6) * 0.999999).astype(int)
    return (cells.sum(axis=1) % 2 != 0).astype(float)


class Bake(unittest.TestCase):
    """Each test builds a scene, bakes it in a process of its own and reads the result."""

    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)
        self.folder = self.root / "scene"
        self.folder.mkdir()
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene

    def bake(self, *, is_good: bool = True, before: str = "", **changes: object) -> dict:
        """Saves the scene, bakes it and returns the result."""
        path = self.folder / "scene.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
        out = self.root / "out"
        job = {"format": "mateval-bake/1", "blend": str(path), "folder": str(self.folder), "out": str(out)}
        (self.root / "job.json").write_text(json.dumps({**job, **LIMITS, **changes}))
        command = [sys.executable, str(SCRIPTS / "bake_blend.py"), str(self.root / "job.json")]
        if before:
            run = "runpy.run_path(sys.argv[0], run_name='__main__')"
            code = f"import sys, runpy; sys.argv = sys.argv[1:]; {before}; {run}"
            command = [sys.executable, "-c", code, *command[1:]]
        ran = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
        result = json.loads((out / "result.json").read_text())
        self.assertEqual(ran.returncode, 0 if is_good else 1, ran.stdout[-2000:] + ran.stderr[-2000:])
        self.assertEqual((out / "scene.glb").is_file(), is_good)
        return result

    def glb(self) -> Glb:
        """The scene that was written."""
        return Glb(path=self.root / "out" / "scene.glb")

    def material(self, *, name: str) -> tuple[bpy.types.Material, bpy.types.NodeTree, bpy.types.Node]:
        """A new material, its tree and its Principled."""
        made = bpy.data.materials.new(name)
        made.use_nodes = True
        return made, made.node_tree, made.node_tree.nodes["Principled BSDF"]

    def cube(self, *, material: bpy.types.Material, name: str = "cube", **place: object) -> bpy.types.Object:
        """A cube from -1 to 1, whose uv is a cross."""
        bpy.ops.mesh.primitive_cube_add(size=2.0, **place)
        return self._added(material=material, name=name)

    def plane(self, *, material: bpy.types.Material, name: str = "plane", **place: object) -> bpy.types.Object:
        """A plane from -1 to 1, whose uv is the whole square."""
        bpy.ops.mesh.primitive_plane_add(size=2.0, **place)
        return self._added(material=material, name=name)

    def _added(self, *, material: bpy.types.Material, name: str) -> bpy.types.Object:
        """Names the object that was added last and gives it the material."""
        made = bpy.context.object
        made.name = name
        made.data.materials.append(material)
        return made

    def coordinates(self, *, tree: bpy.types.NodeTree, kind: str = "Object") -> bpy.types.NodeSocket:
        """Coordinates of the surface."""
        return tree.nodes.new("ShaderNodeTexCoord").outputs[kind]

    def checks(
        self, *, tree: bpy.types.NodeTree, scale: float, colors: tuple, kind: str = "Object"
    ) -> bpy.types.NodeSocket:
        """A checker of two colours."""
        node = tree.nodes.new("ShaderNodeTexChecker")
        node.inputs["Scale"].default_value = scale
        node.inputs["Color1"].default_value, node.inputs["Color2"].default_value = (*colors[0], 1.0), (*colors[1], 1.0)
        tree.links.new(self.coordinates(tree=tree, kind=kind), node.inputs["Vector"])
        return node.outputs["Color"]

    def codes(self, result: dict) -> set[str]:
        """The codes of a result's findings."""
        return {finding["code"] for finding in result["findings"]}

    def close(self, found: np.ndarray, expected: np.ndarray, *, tolerance: float, least: int = 500) -> None:
        """Asserts that arrays agree, and that there is enough to compare."""
        self.assertGreaterEqual(len(found), least)
        worst = float(np.abs(found - expected).max())
        print(f"{self.id().split('.')[-1]}: {len(found)} texels, largest error {worst * 255:.3f}/255", file=sys.stderr)
        self.assertLessEqual(worst, tolerance)


def run() -> None:
    """Runs the tests of the script that was started."""
    finished = unittest.main(exit=False).result
    # bpy 4.5 may hang in an ordinary exit.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0 if finished.wasSuccessful() else 1)
