"""A pinhole camera in Blender's terms. Needs no bpy."""

import math
from typing import Any, NamedTuple


class Lens(NamedTuple):
    """What Blender calls a camera with sensor fit HORIZONTAL."""

    angle_x: float
    """Horizontal field of view in radians, as of a lens that looks through the picture's middle."""
    shift_x: float
    """How far the picture lies to the right of the axis, in widths."""
    shift_y: float
    """How far it lies above the axis, in widths."""
    pixel_aspect_y: float
    """Height of a pixel over its width."""


def lens(*, intrinsics: dict[str, Any]) -> Lens:
    """Blender's lens for focal lengths and a principal point in pixels, from the top left."""
    width, height = intrinsics["width"], intrinsics["height"]
    fx, fy, cx, cy = (intrinsics[key] for key in ("fx", "fy", "cx", "cy"))
    aspect = fx / fy
    return Lens(
        angle_x=2.0 * math.atan(0.5 * width / fx),
        shift_x=(0.5 * width - cx) / width,
        shift_y=(cy - 0.5 * height) * aspect / width,
        pixel_aspect_y=aspect,
    )
