"""What `render.py` is made of. A package, as Blender itself has modules of such names."""
