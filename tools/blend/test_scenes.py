#!/usr/bin/env python3
"""Bakes whole `.blend` scenes that it builds: what is read of them, and what is refused.

Run it with a Python that has the bpy module: `~/.cache/mateval/blender/bin/python tools/blend/test_scenes.py`.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

import bpy
import numpy as np
from case import LIMITS, ONE_BYTE, Bake, run
from mateval.bake import make_bench
from mateval.uv_charts import srgb_bytes


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
        random = tree.nodes.new("ShaderNodeObjectInfo").outputs["Random"]
        tree.links.new(random, emission.inputs["Color"])
        first = self.plane(material=made, name="first")
        second = bpy.data.objects.new("zweites Ding ä", first.data)
        second.location = (5.0, 0.0, 0.0)
        self.scene.collection.objects.link(second)
        expected = [float(self.render(thing=each.name, edge=4)[2, 2, 0]) for each in (first, second)]
        shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
        tree.links.new(random, shader.inputs["Roughness"])
        tree.links.new(shader.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        self.bake()
        for name, value in zip(("first", "zweites Ding ä"), expected, strict=True):
            found = self.glb().material(name=name)["pbrMetallicRoughness"]["roughnessFactor"]
            self.assertAlmostEqual(found, value, places=4)

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
                self.assertEqual(self.bake()["lamps"], [{"node": "lamp", "visible": True}])
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
        self.scene.unit_settings.scale_length = 0.01
        result = self.bake()
        self.assertEqual(self.codes(result), {"unit"})
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
        # format/truth.md: u = atan2(x, -z) / 2 pi and v = acos(y) / pi, in glTF's axes.
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
        unused.filepath, unused.use_fake_user = str(self.root / "nowhere" / "unused.png"), True
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
                writing = body.replace("{}", str(marker))
                text.from_string(
                    f"shader ramp(point At = P, output color Out = 0) {{ {writing} Out = color(At[0], 0.25, 0.5); }}"
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


if __name__ == "__main__":
    run()
