"""Loads a Hugging Face export with datasets and huggingface_hub and compares it with the dataset."""

import importlib.metadata
import io
import sys
from pathlib import Path

import datasets
import numpy as np
import yaml
from dataset_views import licences, views
from huggingface_hub import DatasetCard
from PIL import Image


def main(*, dataset: Path, out: Path) -> None:
    """Fails where the card cannot be parsed or a row differs from its view."""
    card = DatasetCard.load(out / "README.md")
    assert card.data.license == "other" and card.data.pretty_name == "sample", card.data
    assert card.data.configs == [
        {
            "config_name": "default",
            "data_files": [{"split": "test", "path": "data/test-00000-of-00001.parquet"}],
        }
    ]
    benchmark = yaml.safe_load((out / "eval.yaml").read_text())
    assert set(benchmark) == {"name", "description", "evaluation_framework", "tasks"}, benchmark
    assert benchmark["tasks"] == [{"id": "albedo_novel_psnr", "config": "default", "split": "test"}], benchmark
    splits = datasets.load_dataset(str(out))
    assert list(splits) == ["test"], splits
    rows = splits["test"]
    assert isinstance(rows.features["picture"], datasets.Image), rows.features
    expected = list(views(dataset))
    assert len(rows) == len(expected) == 10
    raw = rows.cast_column("picture", datasets.Image(decode=False))
    for at, (scene, view, picture) in enumerate(expected):
        row = rows[at]
        assert (row["scene"], row["view"]) == (scene, view["id"])
        assert row["intrinsics"] == view["camera"]["intrinsics"]
        assert row["world_from_camera"] == view["camera"]["world_from_camera"]
        assert raw[at]["picture"]["bytes"] == picture.read_bytes()
        assert np.array_equal(np.array(row["picture"]), np.array(Image.open(io.BytesIO(picture.read_bytes()))))
        licence = licences(dataset).get(scene)
        assert row["licence"] is None if licence is None else licence.strip() in row["licence"]
    names = ("datasets", "huggingface_hub", "pyarrow")
    print(", ".join(f"{name} {importlib.metadata.version(name)}" for name in names))
    print(rows)
    print(rows.features)


if __name__ == "__main__":
    main(dataset=Path(sys.argv[1]), out=Path(sys.argv[2]))
