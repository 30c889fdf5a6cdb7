"""Fresnel's equations for metals. Needs no bpy."""

import math

EDGE_COSINE = 1.0 / 7.0
"""Cosine at Blender's edge tint, about 82 degrees, where Schlick's curve deviates most (Kutz et al. 2021)."""


def reflectance(*, cosine: float, eta: float, k: float) -> float:
    """Returns the share of unpolarised light that a conductor with complex index eta + i k reflects at this cosine."""
    if eta == 0.0 and k == 0.0:
        return 1.0  # the limit of k towards 0, where both sides of the fraction below vanish
    sine2 = 1.0 - cosine * cosine
    t = eta * eta - k * k - sine2
    a2b2 = math.sqrt(t * t + 4.0 * eta * eta * k * k)
    a = math.sqrt(max(0.0, 0.5 * (a2b2 + t)))
    s = (a2b2 + cosine * cosine - 2.0 * a * cosine) / (a2b2 + cosine * cosine + 2.0 * a * cosine)
    tail = (a2b2 * cosine * cosine + sine2 * sine2 - 2.0 * a * cosine * sine2) / (
        a2b2 * cosine * cosine + sine2 * sine2 + 2.0 * a * cosine * sine2
    )
    return 0.5 * (s + s * tail)


def edge_tint(*, eta: float, k: float) -> float:
    """Returns the factor of Schlick's curve at 82 degrees in Blender's F82 model of the same metal."""
    normal = reflectance(cosine=1.0, eta=eta, k=k)
    schlick = normal + (1.0 - normal) * (1.0 - EDGE_COSINE) ** 5
    return min(1.0, reflectance(cosine=EDGE_COSINE, eta=eta, k=k) / schlick)
