"""A pinhole camera as Blender's lens. Needs no bpy."""

import math
from typing import Any, NamedTuple


class Lens(NamedTuple):
    """Blender's settings of a camera with sensor fit HORIZONTAL."""

    angle_x: float
    """Horizontal field of view in radians, for a principal point in the picture's centre."""
    shift_x: float
    """Shift of the picture to the right of the axis, in picture widths."""
    shift_y: float
    """Shift of the picture above the axis, in picture widths."""
    pixel_aspect_y: float
    """Height of a pixel divided by its width."""


def lens(*, intrinsics: dict[str, Any]) -> Lens:
    """Returns Blender's lens for focal lengths and a principal point in pixels, measured from the top left."""
    width, height = intrinsics["width"], intrinsics["height"]
    fx, fy, cx, cy = (intrinsics[key] for key in ("fx", "fy", "cx", "cy"))
    aspect = fx / fy
    return Lens(
        angle_x=2.0 * math.atan(0.5 * width / fx),
        shift_x=(0.5 * width - cx) / width,
        shift_y=(cy - 0.5 * height) * aspect / width,
        pixel_aspect_y=aspect,
    )
