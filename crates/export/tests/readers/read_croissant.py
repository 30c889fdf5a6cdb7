"""Validates a Croissant export with mlcroissant and compares its records with the dataset."""

import importlib.metadata
import logging
import sys
from pathlib import Path

import mlcroissant
import numpy as np
from dataset_views import licences, views
from PIL import Image

TOLERANCE = 1e-14
"""mlcroissant reads numbers with pandas.read_json, which errs in their last digit."""


class Warnings(logging.Handler):
    """Keeps what mlcroissant logs about the description."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.seen.append(record.getMessage())


def main(*, dataset: Path, out: Path) -> None:
    """Fails where a record differs, one is missing, or a warning is logged."""
    warnings = Warnings()
    logging.getLogger("absl").addHandler(warnings)
    description = mlcroissant.Dataset(jsonld=out / "croissant.json")
    records = {(found["views/scene"], found["views/view"]): found for found in description.records("views")}
    expected = list(views(dataset))
    assert len(records) == len(expected) == 10, (len(records), len(expected))
    for scene, view, picture in expected:
        found = records[scene.encode(), view["id"].encode()]
        matrix = np.array(found["views/world_from_camera"])
        assert matrix.shape == (4, 4)
        assert np.allclose(matrix, view["camera"]["world_from_camera"], rtol=0.0, atol=TOLERANCE)
        for key, value in view["camera"]["intrinsics"].items():
            assert abs(found[f"views/{key}"] - value) <= TOLERANCE * value, key
        assert np.array_equal(np.array(found["views/picture"]), np.array(Image.open(picture)))
        licence = licences(dataset).get(scene)
        stated = found["views/licence"]
        assert stated is None if licence is None else licence.strip() in stated.decode(), stated
    assert not warnings.seen, warnings.seen
    print(f"mlcroissant {importlib.metadata.version('mlcroissant')}: {len(records)} records of views, no warnings")


if __name__ == "__main__":
    main(dataset=Path(sys.argv[1]), out=Path(sys.argv[2]))
