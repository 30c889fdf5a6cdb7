#!/usr/bin/env python3
"""Bakes MatEval's procedural graphs, as OSL in Blender, and compares them with `mateval graph render`.

    test_graphs.py MATEVAL FOLDER

MATEVAL is the program. FOLDER holds copies of `crates/procedural/library/*.mtlx` and what
`crates/procedural/tests/peers/generate_osl.py FOLDER` has made of them. Run it with a Python that has the bpy module.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
from case import ONE_BYTE, Bake, run
from mateval.uv_charts import srgb_bytes

EDGE = 256
"""Edge of the textures, which show a square metre."""

SHIFT = (0.001 / EDGE, 0.002 / EDGE)
"""How far from a texel's centre Blender bakes, in metres (`render/intern/bake.cc`, RE_bake_pixels_populate)."""

MOST_APART = 4
"""Texels of 65,536 that may differ: Cycles computes in single precision, so cells differ at their borders."""


class Graphs(Bake):
    """All built-in graphs."""

    program, shaders = "", Path()

    def graph_material(self, *, name: str) -> bpy.types.Material:
        """A material whose base colour is a shader's, at the object's x and y in metres."""
        shutil.copy(self.shaders / f"{name}.osl", self.folder)
        made, tree, shader = self.material(name=name)
        script = tree.nodes.new("ShaderNodeScript")
        script.mode, script.filepath = "EXTERNAL", str(self.folder / f"{name}.osl")
        # The module of PyPI cannot read a shader's sockets.
        text = (self.shaders / f"{name}.osl").read_text()
        output = re.search(r"output color (\w+)", text[text.index("shader generated") :]).group(1)
        for socket in ("place_u", "place_v", "footprint"):
            if socket not in script.inputs:
                script.inputs.new("NodeSocketFloat", socket)
        if output not in script.outputs:
            script.outputs.new("NodeSocketColor", output)
        script.inputs["footprint"].default_value = 1.0 / EDGE
        place = tree.nodes.new("ShaderNodeSeparateXYZ")
        tree.links.new(self.coordinates(tree=tree), place.inputs[0])
        tree.links.new(place.outputs["X"], script.inputs["place_u"])
        tree.links.new(place.outputs["Y"], script.inputs["place_v"])
        tree.links.new(script.outputs[output], shader.inputs["Base Color"])
        return made

    def rendered(self, *, name: str) -> np.ndarray:
        """MatEval's picture of a graph where Blender bakes it, as stored."""
        path = self.root / f"{name}.png"
        shift = [f"--set=t_{axis}={-by:.12f}" for axis, by in zip("uv", SHIFT, strict=True)]
        # A colour alone has no place.
        shift = [] if name == "paint" else shift
        command = [self.program, "graph", "render", name, "--out", path, "--resolution", str(EDGE), *shift]
        subprocess.run(command, check=True, capture_output=True)
        image = bpy.data.images.load(str(path))
        image.colorspace_settings.name = "Non-Color"
        return np.array(image.pixels[:]).reshape(EDGE, EDGE, 4)[::-1, :, :3]

    def test_baked_graphs_are_those_of_mateval(self) -> None:
        names = sorted(path.stem for path in self.shaders.glob("*.osl"))
        self.assertEqual(len(names), 28)
        for header in self.shaders.glob("*.h"):
            shutil.copy(header, self.folder)
        for number, name in enumerate(names):
            mesh = bpy.data.meshes.new(name)
            mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
            mesh.uv_layers.new(name="uv").uv.foreach_set("vector", [0, 0, 1, 0, 1, 1, 0, 1])
            mesh.materials.append(self.graph_material(name=name))
            thing = bpy.data.objects.new(name, mesh)
            thing.location = (2.0 * number, 0.0, 0.0)
            self.scene.collection.objects.link(thing)
        self.bake(texels=EDGE)
        textured = 0
        for name in names:
            with self.subTest(graph=name):
                expected = self.rendered(name=name)
                pbr = self.glb().material(name=name)["pbrMetallicRoughness"]
                if "baseColorTexture" in pbr:
                    found = self.glb().picture(info=pbr["baseColorTexture"])[..., :3]
                else:
                    found = srgb_bytes(linear=np.array(pbr["baseColorFactor"][:3]))
                apart = np.abs(found - expected).max(axis=-1)
                beyond = int((apart > 1.01 * ONE_BYTE).sum())
                print(f"{name}: {beyond} texels beyond 1/255, mean {apart.mean() * 255:.3f}/255", file=sys.stderr)
                self.assertLessEqual(beyond, MOST_APART)
                # The twin: the picture of the neighbouring texel.
                other = np.abs(found - np.roll(expected, (1, 1), axis=(0, 1))).max(axis=-1)
                textured += int((other > 1.01 * ONE_BYTE).sum() > 10 * MOST_APART)
        self.assertEqual(textured, 27, "all but paint")


if __name__ == "__main__":
    Graphs.program, Graphs.shaders = sys.argv[1], Path(sys.argv[2])
    del sys.argv[1:3]
    run()
