"""The coordinates at which Blender looks up an environment map. Needs no bpy.

The format (format/truth.md, "Environment lookup") turns a direction into the map's frame, d = Rt w, and looks up
u = atan2(d.x, -d.z) / 2 pi, v = acos(d.y) / pi from the top. Blender looks b up at u = 1/2 - atan2(b.y, b.x) / 2 pi,
v = 1/2 + asin(b.z) / pi from the bottom. Both are the same for b = (d.z, d.x, d.y).
"""

Row = tuple[float, float, float]


def blender_from_world(*, world_from_environment: list[list[float]]) -> tuple[Row, Row, Row]:
    """Returns the rows of the matrix that takes a world direction to Blender's lookup direction."""

    def row_of(axis: int) -> Row:
        # A row of the transposed rotation is a column of the rotation.
        x, y, z = (world_from_environment[k][axis] for k in range(3))
        return (x, y, z)

    return (row_of(2), row_of(0), row_of(1))
