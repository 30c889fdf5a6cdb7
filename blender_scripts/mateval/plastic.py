"""Light under a smooth dielectric coat. Needs no bpy."""

import math

STEPS = 4096


def fresnel(*, cosine: float, eta: float) -> float:
    """Share of unpolarised light that a boundary of relative index eta (beyond over before) reflects."""
    sine2 = (1.0 - cosine * cosine) / (eta * eta)
    if sine2 >= 1.0:
        return 1.0
    beyond = math.sqrt(1.0 - sine2)
    parallel = (eta * cosine - beyond) / (eta * cosine + beyond)
    across = (cosine - eta * beyond) / (cosine + eta * beyond)
    return 0.5 * (parallel * parallel + across * across)


def diffuse_reflectance(*, eta: float) -> float:
    """Share of light from all around that the boundary reflects: the cosine-weighted mean of `fresnel`."""
    places = ((k + 0.5) / STEPS for k in range(STEPS))
    return sum(2.0 * cosine * fresnel(cosine=cosine, eta=eta) for cosine in places) / STEPS


def base_under_coat(*, eta: float, nonlinear: bool) -> tuple[float, float]:
    """(scale, inner): a base of reflectance rho looks like rho * scale / (1 - rho * inner) through the coat.

    Mitsuba's plastic: what enters, (1 - F outside) / eta^2, times what leaves after any number of reflections inside.
    With `nonlinear` the base's colour takes part in each of them, without it none of them takes anything.
    """
    outside, inside = diffuse_reflectance(eta=eta), diffuse_reflectance(eta=1.0 / eta)
    enters = (1.0 - outside) / (eta * eta)
    return (enters, inside) if nonlinear else (enters / (1.0 - inside), 0.0)
