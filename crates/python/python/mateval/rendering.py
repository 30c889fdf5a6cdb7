"""``Scene.render``."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _core
from .progress import Progress

MAPS = ("base_color", "roughness", "metallic")


def render(
    scene: _core.Scene,
    maps: Union[Mapping[str, Any], str, "os.PathLike[str]"],
    light: str,
    samples: int,
    progress: Progress,
) -> dict[str, npt.NDArray[np.uint8]]:
    """Renders maps as a submission that holds nothing else is rendered."""
    if isinstance(maps, (str, os.PathLike)):
        return _core.render(scene, maps, light, samples, progress)
    if not isinstance(maps, Mapping):
        raise TypeError(f"maps: expected a dictionary by instance or a submission's folder, found {type(maps).__name__}")
    root, _ = scene.__reduce__()[1]
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "maps")
        with _core.Submission(out, root, method="maps") as submission:
            for instance, found in maps.items():
                is_mapping = isinstance(found, Mapping)
                if not is_mapping and not isinstance(found, _core.Maps):
                    expected = f"Maps or a dictionary of {', '.join(MAPS)}"
                    raise TypeError(f"maps: {instance}: expected {expected}, found {type(found).__name__}")
                unknown = [name for name in found if name not in MAPS] if is_mapping else []
                if unknown:
                    raise ValueError(f"maps: {instance}: expected {', '.join(MAPS)}, found {', '.join(map(repr, unknown))}")
                get = found.get if is_mapping else lambda name: getattr(found, name)
                given = {name: get(name) for name in MAPS if get(name) is not None}
                if given:
                    submission.write(scene.id, instance, **given)
        return _core.render(scene, out, light, samples, progress)
