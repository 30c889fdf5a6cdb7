"""Reading a dataset: mappings, arrays, cameras, meshes, ground truth."""

import collections.abc
import json
import pickle
import shutil

import numpy as np
import pytest

import mateval
import mateval.torch

HEIGHT, WIDTH = 72, 96


def test_a_dataset_is_a_mapping_of_scenes(root, dataset):
    assert isinstance(dataset, collections.abc.Mapping)
    assert list(dataset) == ["room"] and len(dataset) == 1 and "room" in dataset and "hall" not in dataset
    file = json.loads((root / "dataset.json").read_text())
    assert dataset.name == file["name"] and dataset.version == file["version"]
    assert dataset.manifest_sha256 == file["manifest_sha256"]
    assert dataset.photo_renderer == "builtin"
    copy = pickle.loads(pickle.dumps(dataset))
    assert copy.manifest_sha256 == dataset.manifest_sha256
    assert dataset == dataset and copy != dataset and len({dataset, copy}) == 2


def test_absent_scenes_are_not_in_the_mapping(root, tmp_path):
    whole = mateval.open(root)
    assert whole.absent == []
    copy = tmp_path / "part"
    shutil.copytree(root, copy, ignore=lambda folder, names: names if folder == str(root / "scenes") else [])
    part = mateval.open(copy)
    assert len(part) == 0 and list(part) == [] and "room" not in part and part.absent == ["room"]
    with pytest.raises(mateval.UnknownId, match="'room' is listed in .* folder is not there: unpack 'scenes/room.tar'"):
        part["room"]
    assert part.manifest_sha256 == whole.manifest_sha256
    (copy / "scenes/room").mkdir()
    with pytest.raises(mateval.Error, match="scenes/room/scene.json"):
        mateval.open(copy)


def test_a_scene_is_its_file(root, scene):
    file = json.loads((root / "scenes/room/scene.json").read_text())
    assert (scene.id, scene.house, scene.exposure) == ("room", "sample", file["exposure"])
    assert scene.photo is None
    assert list(scene.instances) == [instance["id"] for instance in file["instances"]]
    assert [part.index for part in scene.parts.values()] == [part["index"] for part in file["parts"]]
    assert list(scene.views) == [view["id"] for view in file["views"]]
    for instance, stated in zip(scene.instances.values(), file["instances"]):
        assert (instance.index, instance.name, instance.role) == (stated["index"], stated["name"], stated["role"]["type"])
        assert instance.atlas_size == (stated["atlas"] and stated["atlas"]["size"])


def test_pictures_have_their_shapes_and_dtypes(scene):
    expected = {
        "rgb": (np.float32, 3), "preview": (np.uint8, 3), "depth": (np.float32, 0), "normal": (np.float32, 3),
        "instance": (np.uint16, 0), "part": (np.uint16, 0), "valid": (np.bool_, 0), "unobserved": (np.bool_, 0),
    }
    truth = {
        "albedo": (np.float32, 3), "diffuse_albedo": (np.float32, 3), "rgb": (np.float32, 3),
        "roughness": (np.float32, 0), "metallic": (np.float32, 0), "specular_region": (np.bool_, 0),
    }
    seen = 0
    for view in scene.views.values():
        for holder, fields in ((view, expected), (view.truth, truth)):
            for field, (dtype, channels) in fields.items():
                if holder is view and field in ("rgb", "preview") and view.id != "input":
                    with pytest.raises(ValueError, match="use truth.rgb"):
                        getattr(view, field)
                    continue
                array = getattr(holder, field)
                shape = (HEIGHT, WIDTH, channels) if channels else (HEIGHT, WIDTH)
                assert array.shape == shape and array.dtype == dtype and array.flags.c_contiguous, (view.id, field)
                seen += 1
    assert seen == 5 * 14 - 4 * 2
    shown = scene.input.instance[scene.input.valid]
    assert set(np.unique(shown)) <= {instance.index for instance in scene.instances.values()}
    assert not scene.input.unobserved.any() and scene.views["up_left"].unobserved.any()


def test_the_preview_is_the_exposed_photo(scene):
    linear = np.clip(scene.input.rgb.astype(np.float64) * scene.exposure, 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    assert np.abs(encoded * 255 - scene.input.preview).max() < 0.51


def test_project_undoes_unproject(scene):
    for view in scene.views.values():
        camera, depth = view.camera, view.depth
        assert camera.size == (WIDTH, HEIGHT)
        points = camera.unproject(depth)
        pixels, depths = camera.project(points)
        hit = depth > 0
        y, x = np.nonzero(hit)
        assert np.abs(pixels[hit] - np.stack([x, y], -1) - 0.5).max() < 1e-9
        assert np.abs(depths[hit] - depth[hit]).max() < 1e-9
        assert np.isnan(points[~hit]).all()


def test_opencv_matrices_project_as_the_camera_does(scene):
    camera = scene.views["up_left"].camera
    points = camera.unproject(np.full((HEIGHT, WIDTH), 2.5))
    in_camera = np.linalg.inv(camera.opencv) @ np.concatenate([points.reshape(-1, 3).T, np.ones((1, HEIGHT * WIDTH))])
    homogeneous = camera.K @ in_camera[:3]
    assert np.allclose(homogeneous[2], 2.5)
    pixels, depths = camera.project(points.reshape(-1, 3))
    assert np.allclose((homogeneous[:2] / homogeneous[2]).T, pixels) and np.allclose(depths, 2.5)
    assert np.isnan(camera.project(camera.world_from_camera[:3, 3] + camera.world_from_camera[:3, 2])[1])


def test_meshes_have_the_uv_of_instances_glb(root, scene):
    trimesh = pytest.importorskip("trimesh")
    file = trimesh.load(root / "scenes/room/geometry/instances.glb", process=False)
    with_uv = 0
    for id, instance in scene.instances.items():
        mesh = instance.mesh
        assert mesh.faces.shape == (instance.triangles, 3) and mesh.faces.dtype == np.uint32
        assert mesh.vertices.dtype == np.float32
        assert np.array_equal(mesh.vertices, np.asarray(file.geometry[id].vertices, np.float32))
        assert (mesh.uv is None) == (instance.atlas_size is None)
        converted = mesh.to_trimesh()
        assert len(converted.faces) == instance.triangles
        if mesh.uv is not None:
            assert mesh.uv.shape == (len(mesh.vertices), 2)
            assert np.array_equal(np.asarray(converted.visual.uv, np.float32), mesh.uv)
            # trimesh drops the uv of what has no material; the file's v runs downwards, as trimesh turns it.
            loaded = np.asarray(file.geometry[id].visual.uv, np.float32)
            assert np.allclose(loaded, mesh.uv, atol=1e-6)
            with_uv += 1
    assert with_uv > 5


def test_withheld_truth_is_an_exception(withheld):
    dataset = mateval.open(withheld)
    view = dataset["room"].input
    assert view.depth.shape == (HEIGHT, WIDTH)
    with pytest.raises(mateval.Withheld, match="ground_truth/views/input' does not exist: .* withheld"):
        view.truth
    assert issubclass(mateval.Withheld, mateval.Error)


def test_a_dataset_that_was_moved_is_named(root, tmp_path):
    shutil.copytree(root, tmp_path / "before")
    view = mateval.open(tmp_path / "before")["room"].input
    (tmp_path / "before").rename(tmp_path / "after")
    with pytest.raises(FileNotFoundError, match="before' does not exist: the dataset was moved"):
        view.truth


def test_unknown_ids_name_the_known_ones(dataset, scene):
    with pytest.raises(mateval.UnknownId, match="has no scene 'hall'; it has 'room'") as caught:
        dataset["hall"]
    assert isinstance(caught.value, KeyError) and str(caught.value).startswith("'")
    with pytest.raises(mateval.UnknownId, match="scene 'room' has no view 'up'; it has 'input', 'up_left'"):
        scene.views["up"]
    with pytest.raises(mateval.UnknownId, match="has no instance 'sofa2'"):
        scene.instances["sofa2"]
    assert dataset.get("hall") is None


def test_a_missing_dataset_has_the_commands_text(tmp_path, command, nn):
    place = tmp_path / "none"
    with pytest.raises(mateval.Error) as caught:
        mateval.open(place)
    said = command("eval", "lint", nn, "--dataset", place, good=(2,)).stderr
    assert said == f"error: {caught.value}\n"


def test_wrong_camera_inputs_say_what_was_expected(scene):
    with pytest.raises(ValueError, match=r"depth: expected the shape \[72, 96\] .* found \[2, 2\]"):
        scene.input.camera.unproject(np.zeros((2, 2)))
    with pytest.raises(ValueError, match=r"xyz: expected the shape \(\.\.\., 3\), found \[2\]"):
        scene.input.camera.project(np.zeros(2))


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
    # The camera itself is no array.
    for other in ("colour", "normals", "camera", "truth"):
        with pytest.raises(ValueError, match=f"fields: expected arrays of a view .*normal.*, found '{other}'"):
            mateval.torch.Views(dataset, fields=[other])
    with pytest.raises(TypeError, match=r"fields: expected a list such as \['rgb'\]"):
        mateval.torch.Views(dataset, fields="rgb")
    with pytest.raises(mateval.UnknownId, match="has no view 'left'"):
        mateval.torch.Views(dataset, views=["left"])


def test_scenes_are_found_by_their_place(eight_scenes):
    eight = mateval.open(eight_scenes)
    assert eight[0].id == eight[-8].id == "room1" and [scene.id for scene in eight[2:4]] == ["room3", "room4"]
    with pytest.raises(IndexError, match="has 8 scenes, found the index 8"):
        eight[8]
    assert mateval.open(eight) is eight and 0 not in eight


def test_scenes_and_views_can_be_pickled(scene):
    copy, view = pickle.loads(pickle.dumps((scene, scene.views["up_left"])))
    assert copy.id == scene.id and view.id == "up_left"
    assert np.array_equal(view.depth, scene.views["up_left"].depth)


def test_scenes_for_loaders_hold_all_their_views(root, scene):
    item = mateval.torch.Scenes(root, fields=["rgb", "depth", "truth.albedo"])[0]
    assert item["scene"] == "room" and item["view"] == list(scene.views)
    assert item["rgb"].shape == (HEIGHT, WIDTH, 3)
    assert item["depth"].shape == (5, HEIGHT, WIDTH) and item["truth.albedo"].shape == (5, HEIGHT, WIDTH, 3)
    assert np.array_equal(item["depth"][2], list(scene.views.values())[2].depth)
    assert mateval.torch.Scenes(root, fields=["valid"], views=["input"])[0]["valid"].shape == (1, HEIGHT, WIDTH)
    with pytest.raises(mateval.UnknownId, match="no view 'down'"):
        mateval.torch.Scenes(root, views=["down"])


def test_notebooks_show_scenes_and_views(scene, withheld):
    assert scene._repr_html_().count("data:image/png;base64,") == 1 and "instances" in scene._repr_html_()
    assert "the true albedo" in scene.views["up_left"]._repr_html_()
    without = mateval.open(withheld)["room"].views["up_left"]._repr_html_()
    assert "withheld" in without and "<img" not in without
