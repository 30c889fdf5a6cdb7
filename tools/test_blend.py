#!/usr/bin/env python3
"""Bakes `.blend` scenes that it builds, and compares the result with closed forms and with Blender's own pictures.

Run it with a Python that has the bpy module: `~/.cache/mateval/blender/bin/python tools/test_blend.py`.
"""

from __future__ import annotations

import json
import math
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

SCRIPTS = Path(__file__).resolve().parents[1] / "blender_scripts"
sys.path.insert(0, str(SCRIPTS))

from mateval.bake import make_bench  # noqa: E402 (the folder above must come first)
from mateval.uv_charts import coverage, holds_texture, srgb_bytes  # noqa: E402

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
        made = bpy.context.object
        made.name = name
        made.data.materials.append(material)
        return made

    def plane(self, *, material: bpy.types.Material, name: str = "plane", **place: object) -> bpy.types.Object:
        """A plane from -1 to 1, whose uv is the whole square."""
        bpy.ops.mesh.primitive_plane_add(size=2.0, **place)
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


class ClosedForms(Bake):
    """Baked texels against formulas, at texel centres."""

    def test_checks_and_a_gradient_on_the_meshs_own_uv(self) -> None:
        made, tree, shader = self.material(name="checks")
        colors = ((0.8, 0.2, 0.1), (0.1, 0.3, 0.7))
        tree.links.new(self.checks(tree=tree, scale=3.7, colors=colors), shader.inputs["Base Color"])
        gradient = tree.nodes.new("ShaderNodeTexGradient")
        tree.links.new(self.coordinates(tree=tree, kind="UV"), gradient.inputs["Vector"])
        tree.links.new(gradient.outputs["Fac"], shader.inputs["Roughness"])
        self.plane(material=made)
        result = self.bake()
        self.assertEqual(result["materials"][0]["uv"], "UVMap")
        pbr = self.glb().material(name="plane")["pbrMetallicRoughness"]
        color = self.glb().texels(name="plane", info=pbr["baseColorTexture"])
        first = checker(at=color.positions * 3.7)[:, None]
        expected = srgb_bytes(linear=first * colors[0] + (1.0 - first) * colors[1])
        self.close(color.values[:, :3], expected, tolerance=ONE_BYTE)
        # The twin: checks a twentieth larger.
        other = checker(at=color.positions * 3.5)[:, None]
        wrong = srgb_bytes(linear=other * colors[0] + (1.0 - other) * colors[1])
        self.assertGreater(np.abs(color.values[:, :3] - wrong).max(), 0.2)
        data = self.glb().texels(name="plane", info=pbr["metallicRoughnessTexture"])
        self.close(data.values[:, 1], (data.positions[:, 0] + 1.0) / 2.0, tolerance=ONE_BYTE)
        self.assertEqual(np.abs(data.values[:, 2]).max(), 0.0)

    def test_checks_in_space_on_a_new_uv(self) -> None:
        """The cube's own uv reaches beyond 1."""
        made, tree, shader = self.material(name="checks")
        colors = ((0.9, 0.9, 0.9), (0.05, 0.1, 0.2))
        tree.links.new(self.checks(tree=tree, scale=2.3, colors=colors), shader.inputs["Base Color"])
        cube = self.cube(material=made)
        uvs = np.empty(48, dtype=np.float32)
        cube.data.uv_layers[0].uv.foreach_get("vector", uvs)
        cube.data.uv_layers[0].uv.foreach_set("vector", uvs * 3.0)
        result = self.bake()
        self.assertEqual(result["materials"][0]["uv"], "mateval")
        color = self.glb().texels(
            name="cube", info=self.glb().material(name="cube")["pbrMetallicRoughness"]["baseColorTexture"]
        )
        # Faces at -1 and 1 lie within a cell; rounding across the cell's border is left out.
        cells = color.positions * 2.3
        inside = (np.abs(cells - np.round(cells)) > 1e-3).all(axis=1)
        first = checker(at=cells[inside])[:, None]
        expected = srgb_bytes(linear=first * colors[0] + (1.0 - first) * colors[1])
        self.close(color.values[inside, :3], expected, tolerance=ONE_BYTE)

    def test_bands_and_bricks(self) -> None:
        made, tree, shader = self.material(name="bands")
        wave = tree.nodes.new("ShaderNodeTexWave")
        wave.inputs["Scale"].default_value, wave.inputs["Distortion"].default_value = 0.4, 0.0
        tree.links.new(self.coordinates(tree=tree), wave.inputs["Vector"])
        tree.links.new(wave.outputs["Fac"], shader.inputs["Base Color"])
        bricks = tree.nodes.new("ShaderNodeTexBrick")
        bricks.offset, bricks.squash = 0.5, 1.0
        for name, value in (("Scale", 3.0), ("Mortar Size", 0.02), ("Mortar Smooth", 0.0), ("Brick Width", 0.5)):
            bricks.inputs[name].default_value = value
        for name, value in (("Color1", 0.25), ("Color2", 0.25), ("Mortar", 0.75)):
            bricks.inputs[name].default_value = (value, value, value, 1.0)
        tree.links.new(self.coordinates(tree=tree), bricks.inputs["Vector"])
        tree.links.new(bricks.outputs["Color"], shader.inputs["Roughness"])
        self.plane(material=made)
        self.bake()
        pbr = self.glb().material(name="plane")["pbrMetallicRoughness"]
        color = self.glb().texels(name="plane", info=pbr["baseColorTexture"])
        # svm/wave.h: bands along x have a period of pi / 10 of the scaled coordinate.
        bands = 0.5 + 0.5 * np.sin(20.0 * 0.4 * (color.positions[:, 0] + 1e-6) * 0.999999 - math.pi / 2.0)
        self.close(color.values[:, 0], srgb_bytes(linear=bands), tolerance=1.01 * ONE_BYTE)
        data = self.glb().texels(name="plane", info=pbr["metallicRoughnessTexture"])
        # svm/brick.h: rows of 0.25, every second one shifted by half a brick.
        x, y = (data.positions[:, :2] * 3.0).T
        row = np.floor(y / 0.25)
        along = x + np.where(row % 2 == 0, 0.5 * 0.5, 0.0)
        inner = (along - np.floor(along / 0.5) * 0.5, y - row * 0.25)
        gap = np.minimum(np.minimum(inner[0], 0.5 - inner[0]), np.minimum(inner[1], 0.25 - inner[1]))
        sure = np.abs(gap - 0.02) > 1e-4
        self.close(data.values[sure, 1], np.where(gap[sure] < 0.02, 0.75, 0.25), tolerance=ONE_BYTE)


class Shaders(Bake):
    """Shaders as channels."""

    def test_groups_in_groups_with_shaders_in_and_out(self) -> None:
        inner = bpy.data.node_groups.new("inner", "ShaderNodeTree")
        inner.interface.new_socket("Tint", in_out="INPUT", socket_type="NodeSocketColor")
        inner.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
        entry, end = inner.nodes.new("NodeGroupInput"), inner.nodes.new("NodeGroupOutput")
        shader = inner.nodes.new("ShaderNodeBsdfPrincipled")
        inner.links.new(entry.outputs["Tint"], shader.inputs["Base Color"])
        gradient = inner.nodes.new("ShaderNodeTexGradient")
        inner.links.new(self.coordinates(tree=inner, kind="UV"), gradient.inputs["Vector"])
        inner.links.new(gradient.outputs["Fac"], shader.inputs["Metallic"])
        inner.links.new(shader.outputs[0], end.inputs[0])
        outer = bpy.data.node_groups.new("outer", "ShaderNodeTree")
        for name in ("First", "Second"):
            outer.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketShader")
        outer.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
        entry, end, mix = (
            outer.nodes.new(kind) for kind in ("NodeGroupInput", "NodeGroupOutput", "ShaderNodeMixShader")
        )
        mix.inputs[0].default_value = 0.25
        outer.links.new(entry.outputs["First"], mix.inputs[1])
        outer.links.new(entry.outputs["Second"], mix.inputs[2])
        outer.links.new(mix.outputs[0], end.inputs[0])
        made, tree, _ = self.material(name="grouped")
        mixer, dark, light = (tree.nodes.new("ShaderNodeGroup") for _ in range(3))
        mixer.node_tree, dark.node_tree, light.node_tree = outer, inner, inner
        dark.inputs["Tint"].default_value = (0.1, 0.2, 0.3, 1.0)
        tree.links.new(self.checks(tree=tree, scale=3.7, colors=((1, 1, 1), (0, 0, 0))), light.inputs["Tint"])
        tree.links.new(dark.outputs[0], mixer.inputs["First"])
        tree.links.new(light.outputs[0], mixer.inputs["Second"])
        tree.links.new(mixer.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        self.plane(material=made)
        result = self.bake()
        self.assertEqual(self.codes(result), {"camera"})
        pbr = self.glb().material(name="plane")["pbrMetallicRoughness"]
        color = self.glb().texels(name="plane", info=pbr["baseColorTexture"])
        mixed = 0.75 * np.array([0.1, 0.2, 0.3]) + 0.25 * checker(at=color.positions * 3.7)[:, None]
        self.close(color.values[:, :3], srgb_bytes(linear=mixed), tolerance=ONE_BYTE)
        data = self.glb().texels(name="plane", info=pbr["metallicRoughnessTexture"])
        self.close(data.values[:, 2], (data.positions[:, 0] + 1.0) / 2.0, tolerance=ONE_BYTE)

    def test_a_mixture_of_diffuse_and_glossy(self) -> None:
        made, tree, _ = self.material(name="mixed")
        diffuse, glossy = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeBsdfAnisotropic")
        diffuse.inputs["Color"].default_value, glossy.inputs["Color"].default_value = (
            (0.2, 0.4, 0.6, 1),
            (0.9, 0.8, 0.7, 1),
        )
        glossy.inputs["Roughness"].default_value = 0.2
        mix = tree.nodes.new("ShaderNodeMixShader")
        gradient = tree.nodes.new("ShaderNodeTexGradient")
        tree.links.new(self.coordinates(tree=tree, kind="UV"), gradient.inputs["Vector"])
        tree.links.new(gradient.outputs["Fac"], mix.inputs[0])
        tree.links.new(diffuse.outputs[0], mix.inputs[1])
        tree.links.new(glossy.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        self.plane(material=made)
        self.bake()
        pbr = self.glb().material(name="plane")["pbrMetallicRoughness"]
        color = self.glb().texels(name="plane", info=pbr["baseColorTexture"])
        u = (color.positions[:, :1] + 1.0) / 2.0
        expected = (1.0 - u) * [0.2, 0.4, 0.6] + u * [0.9, 0.8, 0.7]
        self.close(color.values[:, :3], srgb_bytes(linear=expected), tolerance=1.01 * ONE_BYTE)
        data = self.glb().texels(name="plane", info=pbr["metallicRoughnessTexture"])
        u = (data.positions[:, 0] + 1.0) / 2.0
        self.close(data.values[:, 1:3], np.stack([1.0 - 0.8 * u, u], axis=1), tolerance=ONE_BYTE)

    def test_emission_opacity_and_glass(self) -> None:
        made, tree, shader = self.material(name="lamp")
        strength = tree.nodes.new("ShaderNodeMath")
        strength.operation = "MULTIPLY"
        gradient = tree.nodes.new("ShaderNodeTexGradient")
        tree.links.new(self.coordinates(tree=tree, kind="UV"), gradient.inputs["Vector"])
        tree.links.new(gradient.outputs["Fac"], strength.inputs[0])
        strength.inputs[1].default_value = 8.0
        shader.inputs["Emission Color"].default_value = (1.0, 0.5, 0.25, 1.0)
        tree.links.new(strength.outputs[0], shader.inputs["Emission Strength"])
        tree.links.new(gradient.outputs["Fac"], shader.inputs["Alpha"])
        self.plane(material=made)
        glass, tree, shader = self.material(name="glass")
        node = tree.nodes.new("ShaderNodeBsdfGlass")
        node.inputs["IOR"].default_value = 1.33
        tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        self.cube(material=glass, location=(4, 0, 0))
        self.plane(material=glass, name="pane", location=(8, 0, 0))
        self.bake()
        found = self.glb().material(name="plane")
        emission = self.glb().texels(name="plane", info=found["emissiveTexture"])
        peak = found["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"]
        self.assertAlmostEqual(peak, 8.0 * (1.0 - 0.5 / 64), places=2)
        u = (emission.positions[:, :1] + 1.0) / 2.0
        expected = srgb_bytes(linear=8.0 * u / peak * [1.0, 0.5, 0.25])
        self.close(emission.values[:, :3], expected, tolerance=1.01 * ONE_BYTE)
        color = self.glb().texels(name="plane", info=found["pbrMetallicRoughness"]["baseColorTexture"])
        self.close(color.values[:, 3], (color.positions[:, 0] + 1.0) / 2.0, tolerance=ONE_BYTE)
        self.assertEqual(found["alphaMode"], "BLEND")
        for name, is_solid in (("cube", True), ("pane", False)):
            extensions = self.glb().material(name=name)["extensions"]
            self.assertEqual(extensions["KHR_materials_transmission"]["transmissionFactor"], 1)
            self.assertAlmostEqual(extensions["KHR_materials_ior"]["ior"], 1.33, places=5)
            self.assertEqual("KHR_materials_volume" in extensions, is_solid)

    def test_glass_that_lets_shadow_rays_through_is_glass(self) -> None:
        """What only shadow rays see is left out: baking sees what the camera does."""
        made, tree, _ = self.material(name="window")
        glass, clear, mix = (
            tree.nodes.new(f"ShaderNode{kind}") for kind in ("BsdfGlass", "BsdfTransparent", "MixShader")
        )
        glass.inputs["Roughness"].default_value = 0.0
        tree.links.new(tree.nodes.new("ShaderNodeLightPath").outputs["Is Shadow Ray"], mix.inputs[0])
        tree.links.new(glass.outputs[0], mix.inputs[1])
        tree.links.new(clear.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        self.plane(material=made)
        result = self.bake()
        self.assertEqual(self.codes(result), {"camera", "view_dependent"})
        found = self.glb().material(name="plane")
        self.assertEqual(found["extensions"]["KHR_materials_transmission"]["transmissionFactor"], 1)
        self.assertEqual(
            (found.get("alphaMode", "OPAQUE"), found["pbrMetallicRoughness"]["roughnessFactor"]), ("OPAQUE", 0)
        )

    def test_an_unknown_shader_leaves_the_base_color_open(self) -> None:
        made, tree, _ = self.material(name="toon")
        node = tree.nodes.new("ShaderNodeBsdfToon")
        tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        self.plane(material=made)
        plain = bpy.data.materials.new("plain")
        plain.use_nodes = False
        plain.diffuse_color, plain.roughness, plain.metallic = (0.25, 0.5, 0.75, 1.0), 0.3, 1.0
        self.plane(material=plain, name="other")
        bpy.ops.mesh.primitive_plane_add()
        bpy.context.object.name = "bare"
        result = self.bake()
        entries = {entry["source"]: entry["base_color"] for entry in result["materials"]}
        self.assertEqual(entries, {"toon": "unstated", "plain": "constant"})
        finding = next(each for each in result["findings"] if each["code"] == "unknown_shader")
        self.assertEqual(finding["place"], "material 'toon', node 'Toon BSDF'")
        pbr = self.glb().material(name="other")["pbrMetallicRoughness"]
        np.testing.assert_allclose(pbr["baseColorFactor"], [0.25, 0.5, 0.75, 1.0], atol=1e-6)
        self.assertAlmostEqual(pbr["roughnessFactor"], 0.3, places=6)
        self.assertNotIn("material", self.glb().primitives(name="bare")[0])

    def test_materials_of_one_mesh_are_baked_apart(self) -> None:
        """To the mesh's uv and to a new one, with a face of no material and one of a constant."""
        own, tree, shader = self.material(name="own")
        tree.links.new(self.checks(tree=tree, scale=2.3, colors=((1, 1, 1), (0, 0, 0))), shader.inputs["Base Color"])
        shared, tree, shader = self.material(name="painted")
        paint = tree.nodes.new("ShaderNodeVertexColor")
        paint.layer_name = "paint"
        tree.links.new(paint.outputs["Color"], shader.inputs["Base Color"])
        flat, _, shader = self.material(name="flat")
        shader.inputs["Base Color"].default_value = (0.5, 0.25, 0.125, 1.0)
        cube = self.cube(material=own)
        for material in (None, shared, flat, own):
            cube.data.materials.append(material)
        cube.data.polygons.foreach_set("material_index", [0, 1, 2, 2, 3, 4])
        # The faces of one material collapse in the uv, those of the other keep their place in the cross.
        uvs = np.empty(48, dtype=np.float32)
        cube.data.uv_layers[0].uv.foreach_get("vector", uvs)
        uvs[16:32] = 0.0
        cube.data.uv_layers[0].uv.foreach_set("vector", uvs)
        paint = cube.data.color_attributes.new("paint", "FLOAT_COLOR", "CORNER")
        for loop, value in zip(cube.data.loops, paint.data, strict=True):
            value.color = (*(each / 2.0 + 0.5 for each in cube.data.vertices[loop.vertex_index].co), 1.0)
        result = self.bake()
        uvs = {entry["source"]: entry["uv"] for entry in result["materials"]}
        self.assertEqual(uvs, {"own": "UVMap", "painted": "mateval", "flat": None})
        primitives = self.glb().primitives(name="cube")
        self.assertEqual(sum("material" not in each for each in primitives), 1)
        checked = set()
        for index, primitive in enumerate(primitives):
            if "material" not in primitive:
                continue
            found = self.glb().material(name="cube", primitive=index)
            source = found["name"].split()[0]
            checked.add(source)
            info = found["pbrMetallicRoughness"].get("baseColorTexture")
            if source == "flat":
                self.assertIsNone(info)
                continue
            texels = self.glb().texels(name="cube", info=info, primitive=index)
            cells = texels.positions * 2.3
            sure = (np.abs(cells - np.round(cells)) > 1e-3).all(axis=1)
            expected = checker(at=cells)[:, None] * np.ones(3) if source == "own" else texels.positions / 2.0 + 0.5
            self.close(texels.values[sure, :3], srgb_bytes(linear=expected[sure]), tolerance=1.01 * ONE_BYTE, least=300)
        self.assertEqual(checked, {"own", "painted", "flat"})

    def test_plain_pictures_are_kept(self) -> None:
        made, tree, shader = self.material(name="pictures")
        random = np.random.default_rng(1)
        stored = {}
        for name, socket, is_data in (("wood", "Base Color", False), ("rough", "Roughness", True)):
            image = bpy.data.images.new(name, 32, 16, is_data=is_data)
            stored[name] = np.round(random.random((16, 32, 4)) * 255.0) / 255.0
            stored[name][..., 3] = 1.0
            image.pixels.foreach_set(stored[name].astype(np.float32).ravel())
            image.filepath_raw, image.file_format = str(self.folder / f"{name}.png"), "PNG"
            image.save()
            node = tree.nodes.new("ShaderNodeTexImage")
            node.image = bpy.data.images.load(str(self.folder / f"{name}.png"))
            node.image.colorspace_settings.name = "Non-Color" if is_data else "sRGB"
            mapping = tree.nodes.new("ShaderNodeMapping")
            mapping.inputs["Scale"].default_value = (3.0, 3.0, 1.0)
            tree.links.new(self.coordinates(tree=tree, kind="UV"), mapping.inputs["Vector"])
            tree.links.new(mapping.outputs[0], node.inputs["Vector"])
            tree.links.new(node.outputs["Color"], shader.inputs[socket])
        self.plane(material=made)
        result = self.bake()
        self.assertEqual(result["files"], ["rough.png", "wood.png"])
        self.assertEqual(
            [result["materials"][0][key] for key in ("base_color", "roughness", "uv")], ["picture", "picture", "UVMap"]
        )
        pbr = self.glb().material(name="plane")["pbrMetallicRoughness"]
        color = self.glb().picture(info=pbr["baseColorTexture"])
        np.testing.assert_allclose(color[..., :3], stored["wood"][::-1, :, :3], atol=1e-6)
        self.assertEqual(pbr["baseColorTexture"]["extensions"]["KHR_texture_transform"]["scale"], [3, 3])
        data = self.glb().picture(info=pbr["metallicRoughnessTexture"])
        gray = stored["rough"][::-1, :, :3] @ [0.2126, 0.7152, 0.0722]
        self.assertLessEqual(np.abs(data[..., 1] - gray).max(), 0.51 * ONE_BYTE)


class Scenes(Bake):
    """What is read of a scene."""

    def render(self, *, thing: str, edge: int) -> np.ndarray:
        """Blender's own picture of the square from -1 to 1 from above, linear, its first row at the top."""
        bench = make_bench(job={"threads": 1, "samples": 1}, source=self.scene, is_osl=False)
        camera = bpy.data.cameras.new("above")
        camera.type, camera.ortho_scale = "ORTHO", 2.0
        above = bpy.data.objects.new("above", camera)
        above.location = (*bpy.data.objects[thing].location[:2], 5.0)
        bench.collection.objects.link(above)
        bench.collection.objects.link(bpy.data.objects[thing])
        bench.camera = above
        # Samples are drawn anywhere in a pixel.
        bench.cycles.filter_width = 0.01
        render = bench.render
        render.resolution_x = render.resolution_y = edge
        render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
        render.filepath = str(self.root / "above.exr")
        bpy.context.window.scene = bench
        bpy.ops.render.render(write_still=True, scene=bench.name)
        image = bpy.data.images.load(render.filepath)
        found = np.array(image.pixels[:], dtype=np.float32).reshape(edge, edge, 4)[::-1]
        bpy.context.window.scene = self.scene
        bpy.data.images.remove(image)
        bpy.data.scenes.remove(bench)
        return found

    def emitting(self, *, name: str) -> tuple[bpy.types.Material, bpy.types.NodeTree, bpy.types.Node]:
        """A material that shows a colour as it is."""
        made, tree, shader = self.material(name=name)
        tree.nodes.remove(shader)
        emission = tree.nodes.new("ShaderNodeEmission")
        tree.links.new(emission.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        return made, tree, emission

    def test_noise_is_that_of_blenders_picture(self) -> None:
        made, tree, emission = self.emitting(name="noise")
        noise = tree.nodes.new("ShaderNodeTexNoise")
        tree.links.new(noise.outputs["Color"], emission.inputs["Color"])
        self.plane(material=made)
        expected = self.render(thing="plane", edge=64)
        self.bake()
        found = self.glb().material(name="plane")
        peak = found.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        texels = self.glb().picture(info=found["emissiveTexture"])[..., :3]
        factor = np.array(found["emissiveFactor"]) * peak
        self.close(
            texels.reshape(-1, 3),
            srgb_bytes(linear=expected[..., :3] / factor).reshape(-1, 3),
            tolerance=2.01 * ONE_BYTE,
        )

    def test_random_numbers_are_those_of_blender(self) -> None:
        """Every object has its own; two instances of a mesh are baked apart."""
        made, tree, emission = self.emitting(name="random")
        tree.links.new(tree.nodes.new("ShaderNodeObjectInfo").outputs["Random"], emission.inputs["Color"])
        first = self.plane(material=made, name="first")
        second = bpy.data.objects.new("zweites Ding ä", first.data)
        second.location = (5.0, 0.0, 0.0)
        self.scene.collection.objects.link(second)
        expected = [float(self.render(thing=each.name, edge=4)[2, 2, 0]) for each in (first, second)]
        self.bake()
        for name, value in zip(("first", "zweites Ding ä"), expected, strict=True):
            found = self.glb().material(name=name)["emissiveFactor"]
            peak = self.glb().material(name=name).get("extensions", {})
            scale = peak.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
            self.assertAlmostEqual(found[0] * scale, value, places=4)

    def test_instances_share_a_mesh_and_its_textures(self) -> None:
        made, tree, shader = self.material(name="checks")
        tree.links.new(self.checks(tree=tree, scale=2.3, colors=((1, 1, 1), (0, 0, 0))), shader.inputs["Base Color"])
        cube = self.cube(material=made)
        group = bpy.data.collections.new("group")
        group.objects.link(cube)
        self.scene.collection.objects.unlink(cube)
        for x in (0.0, 5.0, 10.0):
            holder = bpy.data.objects.new("holder", None)
            holder.instance_type, holder.instance_collection, holder.location = "COLLECTION", group, (x, 0.0, 0.0)
            self.scene.collection.objects.link(holder)
        result = self.bake()
        nodes = [node for node in self.glb().json["nodes"] if "mesh" in node]
        self.assertEqual([node.get("translation", [0, 0, 0])[0] for node in nodes], [0, 5, 10])
        self.assertEqual(len({node["mesh"] for node in nodes}), 1)
        self.assertEqual(len(result["materials"]), 1)

    def test_geometry_nodes_make_instances(self) -> None:
        made, tree, emission = self.emitting(name="random")
        tree.links.new(tree.nodes.new("ShaderNodeObjectInfo").outputs["Random"], emission.inputs["Color"])
        nodes = bpy.data.node_groups.new("grid", "GeometryNodeTree")
        nodes.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        kinds = ("MeshGrid", "MeshCube", "SetMaterial", "InstanceOnPoints")
        grid, cube, paint, instances = (nodes.nodes.new(f"GeometryNode{kind}") for kind in kinds)
        end = nodes.nodes.new("NodeGroupOutput")
        grid.inputs["Vertices X"].default_value = grid.inputs["Vertices Y"].default_value = 2
        paint.inputs["Material"].default_value = made
        nodes.links.new(cube.outputs["Mesh"], paint.inputs["Geometry"])
        nodes.links.new(paint.outputs[0], instances.inputs["Instance"])
        nodes.links.new(grid.outputs["Mesh"], instances.inputs["Points"])
        nodes.links.new(instances.outputs[0], end.inputs[0])
        holder = bpy.data.objects.new("holder", bpy.data.meshes.new("holder"))
        self.scene.collection.objects.link(holder)
        holder.modifiers.new("nodes", "NODES").node_group = nodes
        result = self.bake()
        self.assertEqual(len(result["materials"]), 4)
        found = [node for node in self.glb().json["nodes"] if "mesh" in node]
        places = {tuple(round(value, 3) for value in node["translation"]) for node in found}
        self.assertEqual(places, {(x, 0, z) for x in (-0.5, 0.5) for z in (-0.5, 0.5)})
        light = {tuple(self.glb().material(name=node["name"])["emissiveFactor"]) for node in found}
        self.assertEqual(len(light), 4)

    def test_what_surrounds_an_object_darkens_its_corners(self) -> None:
        """Ambient occlusion sees the other objects."""
        made, tree, emission = self.emitting(name="occluded")
        node = tree.nodes.new("ShaderNodeAmbientOcclusion")
        tree.links.new(node.outputs["AO"], emission.inputs["Color"])
        self.plane(material=made)
        self.plane(material=made, name="wall", location=(1, 0, 1), rotation=(0, -math.pi / 2, 0))
        self.bake(samples=16)
        found = self.glb().texels(name="plane", info=self.glb().material(name="plane")["emissiveTexture"])
        near, far = (
            found.values[mask, 0].mean() for mask in (found.positions[:, 0] > 0.9, found.positions[:, 0] < -0.9)
        )
        self.assertLess(near + 0.1, far)

    def test_a_scene_is_read_as_it_is_rendered(self) -> None:
        made, _, _ = self.material(name="grey")
        cube = self.cube(material=made)
        array = cube.modifiers.new("array", "ARRAY")
        array.count, array.show_viewport = 3, False
        hidden = self.cube(material=made, name="hidden")
        hidden.hide_render = True
        bpy.ops.object.text_add(location=(0, 5, 0))
        bpy.ops.object.metaball_add(type="BALL", location=(0, 10, 0))
        bpy.ops.surface.primitive_nurbs_surface_sphere_add(location=(0, 15, 0))
        sheared = self.cube(material=made, name="sheared")
        holder = bpy.data.objects.new("holder", None)
        holder.scale = (1.0, 3.0, 1.0)
        self.scene.collection.objects.link(holder)
        sheared.parent, sheared.rotation_euler = holder, (0.0, 0.0, 0.5)
        bpy.context.view_layer.update()
        expected = np.array([sheared.matrix_world @ vertex.co for vertex in sheared.data.vertices])
        self.bake()
        names = {node["name"] for node in self.glb().json["nodes"]}
        self.assertEqual(names, {"cube", "sheared", "Text", "Mball", "SurfSphere"})
        self.assertEqual(
            self.glb().json["accessors"][self.glb().primitives(name="cube")[0]["indices"]]["count"], 3 * 36
        )
        positions = self.glb().numbers(accessor=self.glb().primitives(name="sheared")[0]["attributes"]["POSITION"])
        self.assertNotIn("scale", self.glb().node(name="sheared"))
        for low, high, axis, sign in ((0, 0, 0, 1), (2, 2, 1, -1), (1, 1, 2, 1)):
            self.assertAlmostEqual(positions[:, low].max(), (expected[:, axis] * sign).max(), places=5)
            self.assertAlmostEqual(positions[:, high].min(), (expected[:, axis] * sign).min(), places=5)

    def test_a_lamps_radiance_is_what_blender_shows(self) -> None:
        for shape, scale in (("RECTANGLE", (1.0, 1.0, 1.0)), ("ELLIPSE", (2.0, 0.5, 1.0))):
            with self.subTest(shape=shape):
                bpy.ops.wm.read_factory_settings(use_empty=True)
                self.scene = bpy.context.scene
                data = bpy.data.lights.new("lamp", "AREA")
                data.shape, data.size, data.size_y, data.energy, data.color = shape, 4.0, 3.0, 50.0, (1.0, 0.5, 0.25)
                lamp = bpy.data.objects.new("lamp", data)
                lamp.scale, lamp.visible_camera = scale, True
                # It faces the camera above.
                lamp.rotation_euler = (math.pi, 0.0, 0.0)
                self.scene.collection.objects.link(lamp)
                bpy.context.view_layer.update()
                expected = self.render(thing="lamp", edge=4)[2, 2, :3]
                self.bake()
                found = self.glb().material(name="lamp")
                strength = found["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"]
                np.testing.assert_allclose(np.array(found["emissiveFactor"]) * strength, expected, rtol=1e-4)
                self.assertFalse(found.get("doubleSided", False))
                positions = self.glb().numbers(accessor=self.glb().primitives(name="lamp")[0]["attributes"]["NORMAL"])
                # -Z of Blender, which is -Y of glTF.
                np.testing.assert_allclose(positions, np.tile([0.0, -1.0, 0.0], (len(positions), 1)), atol=1e-6)

    def test_lamps_and_camera_are_those_of_gltf(self) -> None:
        for kind, energy in (("POINT", 40.0), ("SUN", 3.0), ("SPOT", 80.0)):
            data = bpy.data.lights.new(kind, kind)
            data.energy, data.exposure = energy, 1.0
            self.scene.collection.objects.link(bpy.data.objects.new(kind, data))
        camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        self.scene.collection.objects.link(camera)
        self.scene.camera = camera
        result = self.bake()
        self.assertEqual(self.codes(result), set())
        lights = self.glb().json["extensions"]["KHR_lights_punctual"]["lights"]
        found = {light["type"]: light["intensity"] for light in lights}
        expected = {"point": 683 * 80 / (4 * math.pi), "directional": 6.0 * 683, "spot": 683 * 160 / (4 * math.pi)}
        for kind, value in expected.items():
            self.assertAlmostEqual(found[kind] / value, 1.0, places=3)
        self.assertEqual(self.glb().json["cameras"][0]["type"], "perspective")

    def test_the_worlds_map_follows_the_formats_lookup(self) -> None:
        world = bpy.data.worlds.new("world")
        self.scene.world = world
        world.use_nodes = True
        tree = world.node_tree
        shift = tree.nodes.new("ShaderNodeVectorMath")
        shift.inputs[1].default_value = (2.0, 2.0, 2.0)
        tree.links.new(self.coordinates(tree=tree, kind="Generated"), shift.inputs[0])
        tree.links.new(shift.outputs[0], tree.nodes["Background"].inputs["Color"])
        result = self.bake(samples=64)
        self.assertEqual(result["world"]["image"], "world.exr")
        image = bpy.data.images.load(str(self.root / "out" / "world.exr"))
        rows = LIMITS["world_rows"]
        found = np.array(image.pixels[:]).reshape(rows, 2 * rows, 4)[::-1, :, :3] - 2.0
        u, v = (np.arange(2 * rows) + 0.5) * math.pi / rows, ((np.arange(rows) + 0.5) * math.pi / rows)[:, None]
        # FORMAT.md: u = atan2(x, -z) / 2 pi and v = acos(y) / pi, in glTF's axes.
        x, y, z = np.sin(v) * np.sin(u), np.cos(v) + 0.0 * u, -np.sin(v) * np.cos(u)
        np.testing.assert_allclose(found, np.stack([x, -z, y], axis=-1), atol=0.01)

    def test_textures_are_as_fine_as_asked_within_the_limit(self) -> None:
        made, tree, shader = self.material(name="checks")
        tree.links.new(self.checks(tree=tree, scale=2.3, colors=((1, 1, 1), (0, 0, 0))), shader.inputs["Base Color"])
        self.plane(material=made)
        self.plane(material=made, name="small", location=(5, 0, 0)).scale = (0.1, 0.1, 0.1)
        result = self.bake(texel_m=2.0 / 128)
        self.assertEqual(sorted(entry["texels"] for entry in result["materials"]), [16, 128])
        result = self.bake(texel_m=2.0 / 128, most_baked_texels=64 * 64)
        self.assertEqual(sorted(entry["texels"] for entry in result["materials"]), [16, 32])
        self.assertIn("coarser_textures", self.codes(result))


class Untrusted(Bake):
    """Files of other people."""

    def test_no_python_of_the_file_is_run(self) -> None:
        marker = self.root / "marker"
        text = bpy.data.texts.new("register.py")
        text.from_string(f"import bpy\nopen({str(marker)!r}, 'w').write('text')\n")
        text.use_module = True
        made, _, _ = self.material(name="grey")
        cube = self.cube(material=made)
        driver = cube.driver_add("location", 0).driver
        driver.type, driver.expression = "SCRIPTED", f"[open({str(marker)!r}, 'w'), 5.0][1]"
        result = self.bake()
        self.assertFalse(marker.exists())
        self.assertIn("scripts_disabled", self.codes(result))
        # The twin: Blender does run both where scripts are allowed.
        bpy.ops.wm.open_mainfile(filepath=str(self.folder / "scene.blend"), use_scripts=True, load_ui=False)
        self.assertTrue(marker.exists())

    def test_a_handler_of_an_add_on_is_not_run(self) -> None:
        marker = self.root / "marker"
        made, _, _ = self.material(name="grey")
        self.cube(material=made)
        before = f"import bpy; bpy.app.handlers.load_post.append(lambda *_: open({str(marker)!r}, 'w'))"
        self.bake(before=before)
        self.assertFalse(marker.exists())

    def test_files_outside_and_missing_files_are_refused(self) -> None:
        made, tree, shader = self.material(name="pictures")
        for place in (self.root / "outside.png", self.folder / "missing.png"):
            image = bpy.data.images.new("picture", 4, 4)
            image.filepath_raw, image.file_format = str(place), "PNG"
            image.save()
            node = tree.nodes.new("ShaderNodeTexImage")
            node.image = bpy.data.images.load(str(place))
            tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        os.symlink(self.root / "outside.png", self.folder / "link.png")
        node.image = bpy.data.images.load(str(self.folder / "link.png"))
        tree.nodes.new("ShaderNodeTexImage").image = bpy.data.images.load(str(self.folder / "missing.png"))
        (self.folder / "missing.png").unlink()
        self.cube(material=made)
        unused = bpy.data.images.load(str(self.root / "outside.png"), check_existing=False)
        unused.filepath, unused.use_fake_user = "/nowhere/unused.png", True
        result = self.bake(is_good=False)
        found = {(fault["code"], Path(fault["place"]).name) for fault in result["faults"]}
        self.assertEqual(
            found, {("file_outside", "outside.png"), ("file_outside", "link.png"), ("file_missing", "missing.png")}
        )

    def test_a_linked_library_outside_is_refused_and_one_inside_is_read(self) -> None:
        made, _, _ = self.material(name="grey")
        self.cube(material=made, name="linked")
        for place, is_good in ((self.folder / "library.blend", True), (self.root / "library.blend", False)):
            with self.subTest(place=place):
                if is_good:
                    bpy.ops.wm.save_as_mainfile(filepath=str(place))
                else:
                    (self.folder / "library.blend").rename(place)
                bpy.ops.wm.read_factory_settings(use_empty=True)
                with bpy.data.libraries.load(str(place), link=True) as (_, target):
                    target.objects = ["linked"]
                bpy.context.scene.collection.objects.link(target.objects[0])
                (self.root / "out" / "scene.glb").unlink(missing_ok=True)
                result = self.bake(is_good=is_good)
                self.assertEqual([fault["code"] for fault in result["faults"]], [] if is_good else ["file_outside"])
                self.assertEqual(result["files"], ["library.blend"] if is_good else [])

    def test_osl_is_run_unless_it_writes_files(self) -> None:
        for body, is_good in (("", True), ('fprintf("{}", "x");', False)):
            with self.subTest(is_good=is_good):
                bpy.ops.wm.read_factory_settings(use_empty=True)
                marker = self.root / "marker"
                text = bpy.data.texts.new("shader.osl")
                text.from_string(
                    "shader ramp(point At = P, output color Out = 0) { %s Out = color(At[0], 0.25, 0.5); }"
                    % body.replace("{}", str(marker))
                )
                made, tree, shader = self.material(name="osl")
                node = tree.nodes.new("ShaderNodeScript")
                node.script = text
                if "Out" not in node.outputs:
                    node.inputs.new("NodeSocketVector", "At")
                    node.outputs.new("NodeSocketColor", "Out")
                tree.links.new(self.coordinates(tree=tree, kind="UV"), node.inputs["At"])
                tree.links.new(node.outputs["Out"], shader.inputs["Base Color"])
                self.plane(material=made)
                (self.root / "out" / "scene.glb").unlink(missing_ok=True)
                result = self.bake(is_good=is_good)
                self.assertFalse(marker.exists())
                self.assertEqual([fault["code"] for fault in result["faults"]], [] if is_good else ["osl"])
                if is_good:
                    info = self.glb().material(name="plane")["pbrMetallicRoughness"]["baseColorTexture"]
                    color = self.glb().texels(name="plane", info=info)
                    u = (color.positions[:, :1] + 1.0) / 2.0
                    expected = srgb_bytes(linear=u * [1, 0, 0] + [0, 0.25, 0.5])
                    self.close(color.values[:, :3], expected, tolerance=1.01 * ONE_BYTE)

    def test_too_many_instances_are_refused(self) -> None:
        made, _, _ = self.material(name="grey")
        for k in range(3):
            self.cube(material=made, location=(5.0 * k, 0.0, 0.0))
        self.bake(is_good=False, most_instances=2)
        result = self.bake(is_good=False, most_triangles=35)
        self.assertEqual([fault["code"] for fault in result["faults"]], ["too_much"])


class Charts(unittest.TestCase):
    """Whether a uv can hold a texture."""

    SQUARE = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], dtype=np.float32)

    def holds(self, uvs: np.ndarray) -> bool:
        return holds_texture(uvs=uvs, areas=np.ones(len(uvs)))

    def test_a_square_and_its_mirror_hold_one(self) -> None:
        self.assertTrue(self.holds(self.SQUARE))
        self.assertTrue(self.holds(self.SQUARE[:, ::-1]))
        self.assertFalse(self.holds(self.SQUARE * 1.01))
        self.assertFalse(self.holds(self.SQUARE - 0.01))

    def test_overlaps_and_collapsed_faces_hold_none(self) -> None:
        half = self.SQUARE * 0.5
        self.assertTrue(self.holds(np.concatenate([half, half + 0.5])))
        self.assertFalse(self.holds(np.concatenate([half, half + 0.25])))
        self.assertFalse(self.holds(np.concatenate([half, half[:1] * 0.0])))

    def test_each_texel_of_a_square_is_counted_once(self) -> None:
        """The diagonal belongs to none."""
        counts = coverage(uvs=self.SQUARE, side=64)
        self.assertEqual((int(counts.max()), int(counts.sum())), (1, 64 * 64 - 64))
        moved = coverage(uvs=self.SQUARE * [0.5, 0.25], side=64)
        self.assertEqual(np.argwhere(moved).max(axis=0).tolist(), [15, 31])


if __name__ == "__main__":
    finished = unittest.main(exit=False).result
    # bpy 4.5 may hang in an ordinary exit.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0 if finished.wasSuccessful() else 1)
