"""The device that renders: the processor, or one graphics card that Cycles knows of.

Cycles lists devices in the preferences of its add-on. This file reads and sets these preferences and imports no `bpy`,
so that tests can pass others in their place.
"""

import platform
import re
from pathlib import Path
from typing import Any

from mateval.job import JobError

KINDS = ("OPTIX", "CUDA", "HIP", "ONEAPI", "METAL")
"""Kinds of devices in the order in which `auto` takes them: ray-tracing cores first."""

DRIVER_FILE = Path("/proc/driver/nvidia/version")
"""Where Linux's driver of NVIDIA's cards states its version. Blender states none."""


def found(*, preferences: Any) -> dict[str, list]:
    """Returns the devices of each kind. Cycles lists the processor under every kind; it is left out."""
    devices = {}
    for kind in KINDS:
        try:
            listed = preferences.get_devices_for_type(kind)
        except (TypeError, ValueError):
            # This build of Blender does not know the kind.
            listed = []
        devices[kind] = [device for device in listed if device.type == kind]
    return devices


def choose(*, preferences: Any, wanted: str, required: str | None, turn: int) -> tuple[dict | None, str | None]:
    """Sets up the device of a job.

    `wanted` is `cpu`, `auto` or a kind. `required` is the device that has rendered other views of the scene, `cpu` or a
    kind: views of one scene never come from devices of two kinds, whose pictures differ by more than noise. Processes
    that run at once have different turns and take different cards.

    Returns the device, or None for the processor, and what the user should know about the choice.
    """
    if wanted == "cpu":
        return None, None
    devices = found(preferences=preferences)
    summary = ", ".join(f"{kind.lower()} {len(devices[kind])}" for kind in KINDS)
    kind = wanted.upper()
    if wanted == "auto":
        kind = next((kind for kind in KINDS if devices[kind]), "CPU") if required is None else required.upper()
    elif kind not in KINDS:
        raise JobError(f"'{wanted}' is no device; expected cpu, auto or one of {', '.join(KINDS).lower()}")
    if kind == "CPU":
        why = f"Cycles found no graphics card (devices found: {summary})"
        return None, f"--device auto rendered on the processor: {why if required is None else 'as it did before'}"
    if not devices[kind]:
        reason = "" if required is None else "; other views of this scene were rendered by it, and --force renders all"
        raise JobError(
            f"Cycles found no device of the kind {kind.lower()} (devices found: {summary}){reason}. Check the driver, "
            "and CUDA_VISIBLE_DEVICES and its like, or choose another --device"
        )
    chosen = devices[kind][turn % len(devices[kind])]
    preferences.compute_device_type = kind
    for listed in preferences.devices:
        # A processor beside the card would make pictures depend on which of both was faster.
        listed.use = listed.type == kind and listed.id == chosen.id
    return {"kind": kind.lower(), "name": chosen.name, "driver": driver(kind=kind)}, None


def driver(*, kind: str, file: Path = DRIVER_FILE) -> str | None:
    """Returns the version of the card's driver, or None if the system does not state it."""
    if kind == "METAL":
        return f"macOS {platform.mac_ver()[0]}"
    if kind not in ("OPTIX", "CUDA"):
        return None
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None
    version = re.search(r"\b\d+\.\d+(\.\d+)?\b", text)
    return version.group(0) if version else None
