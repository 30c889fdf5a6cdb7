"""Modules of `render.py`. They are a package because Blender has modules with the same names."""
