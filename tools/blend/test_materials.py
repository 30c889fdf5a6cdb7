#!/usr/bin/env python3
"""Bakes the materials of `.blend` scenes that it builds, and compares them with closed forms.

Run it with a Python that has the bpy module: `~/.cache/mateval/blender/bin/python tools/blend/test_materials.py`.
"""

from __future__ import annotations

import math
import unittest

import bpy
import numpy as np
from case import ONE_BYTE, Bake, checker, run
from mateval.uv_charts import coverage, holds_texture, srgb_bytes


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

    def test_a_spiral_is_unwrapped_face_by_face(self) -> None:
        """Seen from above its turns overlap, and they are one chart. It has no uv, which its picture's place shows."""
        made, tree, shader = self.material(name="spiral")
        split = tree.nodes.new("ShaderNodeSeparateXYZ")
        tree.links.new(self.coordinates(tree=tree), split.inputs[0])
        tree.links.new(split.outputs["Z"], shader.inputs["Roughness"])
        tree.links.new(self.coordinates(tree=tree, kind="UV"), shader.inputs["Emission Color"])
        shader.inputs["Emission Strength"].default_value = 1.0
        angles = np.linspace(0.0, 6.0 * math.pi, 97)
        rings = [(r * math.cos(a), r * math.sin(a), a / (6.0 * math.pi)) for a in angles for r in (0.5, 1.0)]
        faces = [(2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2) for k in range(96)]
        mesh = bpy.data.meshes.new("spiral")
        mesh.from_pydata(rings, [], faces)
        mesh.materials.append(made)
        self.scene.collection.objects.link(bpy.data.objects.new("spiral", mesh))
        result = self.bake(texels=256)
        self.assertEqual((result["materials"][0]["uv"], self.codes(result)), ("mateval", {"camera"}))
        found = self.glb().material(name="spiral")
        self.assertNotIn("emissiveTexture", found)
        self.assertEqual(found.get("emissiveFactor", [0, 0, 0]), [0, 0, 0])
        self.assertNotIn("TEXCOORD_1", self.glb().primitives(name="spiral")[0]["attributes"])
        data = self.glb().texels(name="spiral", info=found["pbrMetallicRoughness"]["metallicRoughnessTexture"])
        self.close(data.values[:, 1], data.positions[:, 2], tolerance=1.01 * ONE_BYTE)

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

    def test_generated_coordinates_stay_when_a_mesh_is_deformed(self) -> None:
        """By a shape key and a modifier; the undeformed neighbour has its own."""
        made, tree, shader = self.material(name="generated")
        split = tree.nodes.new("ShaderNodeSeparateXYZ")
        tree.links.new(self.coordinates(tree=tree, kind="Generated"), split.inputs[0])
        tree.links.new(split.outputs["X"], shader.inputs["Roughness"])
        tree.links.new(self.coordinates(tree=tree, kind="Generated"), shader.inputs["Base Color"])
        gradient = tree.nodes.new("ShaderNodeTexGradient")
        tree.links.new(gradient.outputs["Fac"], shader.inputs["Metallic"])
        for name, is_deformed in (("bent", True), ("flat", False)):
            bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8, size=2.0)
            grid = bpy.context.object
            grid.name = name
            grid.data.materials.append(made)
            if is_deformed:
                grid.shape_key_add(name="Basis")
                key = grid.shape_key_add(name="moved")
                key.value = 1.0
                for point in key.data:
                    point.co.x += 0.3 * (1.0 - point.co.x**2)
                cast = grid.modifiers.new("cast", "CAST")
                cast.factor = 0.5
        self.assertNotIn("generated_coordinates", self.codes(self.bake()))
        for name in ("bent", "flat"):
            pbr = self.glb().material(name=name)["pbrMetallicRoughness"]
            data = self.glb().picture(info=pbr["metallicRoughnessTexture"])
            color = self.glb().picture(info=pbr["baseColorTexture"])
            u = np.tile((np.arange(64) + 0.5) / 64, (64, 1))
            self.close(data[..., 1].ravel(), u.ravel(), tolerance=ONE_BYTE)
            self.close(data[..., 2].ravel(), u.ravel(), tolerance=ONE_BYTE)
            self.close(color[..., 0].ravel(), srgb_bytes(linear=u).ravel(), tolerance=1.01 * ONE_BYTE)
        bent = self.glb().numbers(accessor=self.glb().primitives(name="bent")[0]["attributes"]["POSITION"])
        flat = self.glb().numbers(accessor=self.glb().primitives(name="flat")[0]["attributes"]["POSITION"])
        self.assertGreater(np.abs(bent - flat).max(), 0.2)


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

    def test_a_picture_with_holes_is_kept_only_with_its_opacity(self) -> None:
        stored = np.ones((8, 8, 4), dtype=np.float32)
        stored[:4, :, 3] = 0.0
        image = bpy.data.images.new("holes", 8, 8, alpha=True)
        image.pixels.foreach_set(stored.ravel())
        image.filepath_raw, image.file_format = str(self.folder / "holes.png"), "PNG"
        image.save()
        for name in ("whole", "open"):
            made, tree, shader = self.material(name=name)
            node = tree.nodes.new("ShaderNodeTexImage")
            node.image = bpy.data.images.load(str(self.folder / "holes.png"), check_existing=True)
            node.interpolation = "Closest"
            tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
            if name == "open":
                tree.links.new(node.outputs["Alpha"], shader.inputs["Alpha"])
            self.plane(material=made, name=name)
        result = self.bake()
        kinds = {entry["source"]: entry["base_color"] for entry in result["materials"]}
        self.assertEqual(kinds, {"whole": "baked", "open": "picture"})
        for name, rgb in (("whole", 0.0), ("open", 1.0)):
            found = self.glb().material(name=name)
            self.assertEqual(found.get("alphaMode", "OPAQUE"), "OPAQUE" if name == "whole" else "BLEND")
            lower = self.glb().picture(info=found["pbrMetallicRoughness"]["baseColorTexture"])[-1, 0]
            self.assertEqual((lower[0], lower[3]), (rgb, 1.0 - rgb))


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
    run()
