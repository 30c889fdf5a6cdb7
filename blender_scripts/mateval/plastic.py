"""Light under a smooth dielectric coat. Needs no bpy."""

import math

STEPS = 4096


def fresnel(*, cosine: float, eta: float) -> float:
    """Returns the share of unpolarised light that a boundary reflects; eta is the index behind it over that before it."""
    sine2 = (1.0 - cosine * cosine) / (eta * eta)
    if sine2 >= 1.0:
        return 1.0
    beyond = math.sqrt(1.0 - sine2)
    parallel = (eta * cosine - beyond) / (eta * cosine + beyond)
    across = (cosine - eta * beyond) / (cosine + eta * beyond)
    return 0.5 * (parallel * parallel + across * across)


def diffuse_reflectance(*, eta: float) -> float:
    """Returns the share of diffuse light that the boundary reflects: the cosine-weighted mean of `fresnel`."""
    places = ((k + 0.5) / STEPS for k in range(STEPS))
    return sum(2.0 * cosine * fresnel(cosine=cosine, eta=eta) for cosine in places) / STEPS


def base_under_coat(*, eta: float, nonlinear: bool) -> tuple[float, float]:
    """Returns (scale, inner): through the coat, a base of reflectance rho looks like rho * scale / (1 - rho * inner).

    As in Mitsuba's plastic, the light that enters, (1 - F outside) / eta^2, is multiplied by the light that leaves
    after any number of inner reflections. With `nonlinear` each of those is tinted by the base; without it none is.
    """
    outside, inside = diffuse_reflectance(eta=eta), diffuse_reflectance(eta=1.0 / eta)
    enters = (1.0 - outside) / (eta * eta)
    return (enters, inside) if nonlinear else (enters / (1.0 - inside), 0.0)
