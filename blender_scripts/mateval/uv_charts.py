"""Whether a mesh's uv can hold a baked texture. Needs numpy, which Blender brings, and no bpy."""

import numpy as np

SIDE = 512
"""Edge of the raster in which overlaps are counted."""

MOST_OVERLAP = 0.002
"""Largest share of the covered raster that may be covered twice: triangles of one chart meet in single texels."""

LEAST_COVERED = 0.05
"""Share of the square that a uv must cover; below, most of a texture would be empty."""

EDGE = 1e-4
"""How far a uv may lie outside of 0 to 1, by rounding."""

CHUNK = 1 << 22
"""Candidates that are rasterised at once, which bounds memory."""


def twice_areas(*, uvs: np.ndarray) -> np.ndarray:
    """Returns twice the signed area of each triangle of uvs, shape (n, 3, 2)."""
    first, second = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    return first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]


def covered_share(*, uvs: np.ndarray) -> float:
    """Returns the summed area of the triangles: the share of the square that they cover, unless they overlap."""
    return float(np.abs(twice_areas(uvs=uvs)).sum() / 2.0)


def holds_texture(*, uvs: np.ndarray, areas: np.ndarray) -> bool:
    """Returns whether the triangles lie within 0 to 1, apart from each other, and all have an area.

    `uvs` has the shape (n, 3, 2); `areas` are those of the surface, shape (n,).
    """
    if not np.isfinite(uvs).all() or uvs.min() < -EDGE or uvs.max() > 1.0 + EDGE:
        return False
    share = covered_share(uvs=uvs)
    if not LEAST_COVERED <= share <= 1.0 + MOST_OVERLAP:
        return False
    # A triangle whose uvs are a point or a line would be baked from one place.
    flat = np.abs(twice_areas(uvs=uvs)) < 1e-9 * share
    if areas[flat].sum() > 1e-3 * areas.sum():
        return False
    counts = coverage(uvs=uvs, side=SIDE)
    return bool((counts > 1).sum() <= MOST_OVERLAP * max((counts > 0).sum(), 1))


def coverage(*, uvs: np.ndarray, side: int) -> np.ndarray:
    """Counts for each texel centre the triangles that strictly contain it. The first row is that of v near 0."""
    corners = uvs.astype(np.float64) * side - 0.5
    areas = twice_areas(uvs=corners)
    # Counter-clockwise, so that the inside is where all three edge functions are positive.
    corners[areas < 0] = corners[areas < 0][:, ::-1]
    low = np.clip(np.ceil(corners.min(axis=1)).astype(np.int64), 0, side)
    high = np.clip(np.floor(corners.max(axis=1)).astype(np.int64) + 1, 0, side)
    extent = np.maximum(high - low, 0)
    sizes = extent[:, 0] * extent[:, 1]
    counts = np.zeros(side * side, dtype=np.int64)
    owners = np.flatnonzero(sizes)
    ends = np.cumsum(sizes[owners])
    start = 0
    while start < len(owners):
        before = ends[start - 1] if start else 0
        stop = max(int(np.searchsorted(ends, before + CHUNK, side="right")), start + 1)
        chunk = owners[start:stop]
        owner = np.repeat(chunk, sizes[chunk])
        rank = np.arange(len(owner)) - np.repeat(ends[start:stop] - sizes[chunk] - before, sizes[chunk])
        place = low[owner] + np.stack([rank % extent[owner, 0], rank // extent[owner, 0]], axis=1)
        inside = np.ones(len(owner), dtype=bool)
        for k in range(3):
            origin, target = corners[owner, k], corners[owner, (k + 1) % 3]
            along, to = target - origin, place - origin
            inside &= along[:, 0] * to[:, 1] - along[:, 1] * to[:, 0] > 1e-9
        counts += np.bincount(place[inside, 1] * side + place[inside, 0], minlength=side * side)
        start = stop
    return counts.reshape(side, side)


def srgb_bytes(*, linear: np.ndarray) -> np.ndarray:
    """Returns linear values as the sRGB bytes that a texture stores, over 255 (IEC 61966-2-1)."""
    bounded = np.clip(linear, 0.0, 1.0)
    encoded = np.where(bounded <= 0.0031308, 12.92 * bounded, 1.055 * np.maximum(bounded, 1e-9) ** (1 / 2.4) - 0.055)
    return np.round(encoded * 255.0) / 255.0
