"""The views of a dataset, from its own files."""

import json
from pathlib import Path
from typing import Any, Iterator


def views(dataset: Path) -> Iterator[tuple[str, dict[str, Any], Path]]:
    """Scene, view and the picture's path, in the dataset's order."""
    description = json.loads((dataset / "dataset.json").read_text())
    for scene in description["scenes"]:
        folder = dataset / "scenes" / scene
        for view in json.loads((folder / "scene.json").read_text())["views"]:
            renders = folder / "ground_truth/renders" / description["photo_renderer"]
            yield scene, view, renders / view["id"] / "rgb.png"


def licences(dataset: Path) -> dict[str, str]:
    """The licence text of each scene that has one."""
    description = json.loads((dataset / "dataset.json").read_text())
    return {entry["scene"]: entry["text"] for entry in description["licences"]}
