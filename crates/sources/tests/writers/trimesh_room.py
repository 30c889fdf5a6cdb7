"""Writes the sample's room with trimesh: every OBJ as a node, textures, and a mirrored copy.

Usage: trimesh_room.py ROOM OUT, where ROOM is the folder with `models` and `textures`.
"""

import sys
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image


def main() -> None:
    """Writes the scene as .glb, or as .gltf with files, by the ending of OUT."""
    room, out = Path(sys.argv[1]), Path(sys.argv[2])
    scene = trimesh.Scene()
    picture = Image.open(room / "textures" / "wood.png")
    for number, path in enumerate(sorted((room / "models").glob("*.obj"))):
        mesh = trimesh.load(path, force="mesh", process=False)
        material = trimesh.visual.material.PBRMaterial(
            name=f"paint {number}",
            baseColorFactor=[255, 128, 64, 255],
            baseColorTexture=picture if number % 2 else None,
            metallicFactor=0.0,
            roughnessFactor=0.5,
        )
        uv = getattr(mesh.visual, "uv", None)
        mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
        scene.add_geometry(mesh, node_name=path.stem, geom_name=path.stem)
    scene.graph.update(frame_from="world", frame_to="mirrored", geometry="table", matrix=np.diag([-1.0, 1.0, 1.0, 1.0]))
    scene.camera = trimesh.scene.Camera(resolution=(320, 240), fov=(60, 45))
    scene.camera_transform = trimesh.transformations.translation_matrix([2.0, 1.5, 3.0])
    written = scene.export(file_type=out.suffix[1:])
    if isinstance(written, dict):
        for name, content in written.items():
            (out.parent / (out.name if name == "model.gltf" else name)).write_bytes(content)
    else:
        out.write_bytes(written)


if __name__ == "__main__":
    main()
