"""Datasets for PyTorch's data loaders. Tests of the loaders themselves are skipped without PyTorch;
`MATEVAL_TORCH=1 tools/test_python.sh` runs them."""

import doctest
import importlib
import os
import pathlib
import pickle
import re

import numpy as np
import pytest
from test_dataset import HEIGHT, WIDTH
from test_tutorial import README, run_example

import mateval
import mateval.torch


@pytest.fixture
def torch():
    """PyTorch, which must be there where its tests are asked for."""
    return importlib.import_module("torch") if os.environ.get("MATEVAL_TORCH") else pytest.importorskip("torch")


def test_views_are_a_map_style_dataset(dataset, scene):
    views = mateval.torch.Views(dataset)
    assert len(views) == 1
    item = views[0]
    assert (item["scene"], item["view"]) == ("room", "input") and set(item) == {"scene", "view", "rgb", "depth", "valid"}
    assert np.array_equal(item["rgb"], scene.input.rgb)
    all_views = mateval.torch.Views(dataset, fields=["truth.albedo"], views=scene.views)
    assert len(all_views) == 5 and all_views[4]["truth.albedo"].shape == (HEIGHT, WIDTH, 3)
    assert len(pickle.loads(pickle.dumps(views))) == 1
    with pytest.raises(IndexError):
        views[1]
    cameras = mateval.torch.Views(dataset, fields=["camera.K", "camera.world_from_camera"])
    assert cameras[0]["camera.K"].shape == (3, 3) and cameras[0]["camera.world_from_camera"].shape == (4, 4)
    ids = mateval.torch.Views(dataset, fields=["instance", "part", "exposure"])[0]
    assert ids["instance"].dtype == ids["part"].dtype == np.int64 and ids["exposure"] == scene.exposure
    assert np.array_equal(ids["instance"], scene.input.instance)
    # The camera itself is no array.
    for other in ("colour", "normals", "camera", "truth"):
        with pytest.raises(ValueError, match=f"fields: expected arrays of a view .*normal.*, found '{other}'"):
            mateval.torch.Views(dataset, fields=[other])
    with pytest.raises(TypeError, match=r"fields: expected a list such as \['rgb'\]"):
        mateval.torch.Views(dataset, fields="rgb")
    with pytest.raises(mateval.UnknownId, match="has no view 'left'"):
        mateval.torch.Views(dataset, views=["left"])


def test_scenes_for_loaders_hold_all_their_views(root, scene):
    item = mateval.torch.Scenes(root, fields=["rgb", "depth", "truth.albedo"])[0]
    assert item["scene"] == "room" and item["view"] == list(scene.views)
    assert item["rgb"].shape == (HEIGHT, WIDTH, 3)
    assert item["depth"].shape == (5, HEIGHT, WIDTH) and item["truth.albedo"].shape == (5, HEIGHT, WIDTH, 3)
    assert np.array_equal(item["depth"][2], list(scene.views.values())[2].depth)
    ids = mateval.torch.Scenes(root, fields=["instance", "exposure"])[0]
    assert ids["instance"].shape == (5, HEIGHT, WIDTH) and ids["exposure"] == scene.exposure
    assert mateval.torch.Scenes(root, fields=["valid"], views=["input"])[0]["valid"].shape == (1, HEIGHT, WIDTH)
    with pytest.raises(mateval.UnknownId, match="no view 'down'"):
        mateval.torch.Scenes(root, views=["down"])


@pytest.mark.parametrize("kind", [mateval.torch.Views, mateval.torch.Scenes])
def test_the_examples_of_docstrings_run(torch, eight_scenes, kind):
    source = "".join(example.source for example in doctest.DocTestParser().get_examples(kind.__doc__))
    names = run_example(source, eight_scenes, {"torch": torch})
    photo, other = names["photo"], names["albedo" if kind is mateval.torch.Views else "depth"]
    # The shapes that the last comment states, for pictures of 32x24 pixels and five views.
    batch = 8 if kind is mateval.torch.Views else 2
    assert photo.shape == (batch, 24, 32, 3) and photo.dtype == torch.float32
    assert other.shape == ((8, 24, 32, 3) if kind is mateval.torch.Views else (2, 5, 24, 32))
    first = mateval.open(eight_scenes)[-batch].input
    assert np.array_equal(photo[0].numpy(), first.rgb)


def test_the_training_of_the_readme_runs(torch, root, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, training, *_ = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    run_example(training, root, {"dataset": mateval.open(root)})
    assert pathlib.Path("OUT/submission.json").exists()


class Objects:
    """What a worker may return besides arrays."""

    def __init__(self, root):
        self.dataset = mateval.open(root)

    def __len__(self):
        return len(self.dataset)

    def __getitem__(self, index):
        scene = self.dataset[index]
        instance, maps = next(iter(mateval.lift(scene, base_color=scene.input.preview).items()))
        return scene, scene.input.camera, scene.instances[instance], maps


def test_workers_return_objects(torch, eight_scenes):
    objects = Objects(eight_scenes)
    # What cannot be pickled is lost without an exception, so that only the timeout ends the wait.
    loader = torch.utils.data.DataLoader(objects, batch_size=None, num_workers=2, timeout=60)
    places = [scene.id for scene, *_ in loader]
    assert places == list(objects.dataset)
    for (scene, camera, instance, maps), id in zip(loader, objects.dataset):
        expected = objects.dataset[id]
        assert np.array_equal(camera.K, expected.input.camera.K) and instance.id in expected.instances
        assert maps.base_color.dtype == np.uint8 and maps.roughness is None and maps.seen.dtype == np.bool_


def test_cameras_and_pictures_take_tensors(torch, scene):
    camera, depth = scene.input.camera, scene.input.depth
    tensor = torch.tensor(depth, requires_grad=True)
    assert np.array_equal(camera.unproject(tensor), camera.unproject(depth), equal_nan=True)
    points = torch.tensor([[0.0, 1.0, 0.0]], requires_grad=True)
    for ours, expected in zip(camera.project(points.bfloat16()), camera.project([[0, 1, 0]])):
        assert np.array_equal(ours, expected, equal_nan=True)
    photo = torch.tensor(scene.input.rgb, requires_grad=True)
    assert mateval.display.Pictures({"a": photo})._repr_html_() == mateval.display.Pictures({"a": scene.input.rgb})._repr_html_()
