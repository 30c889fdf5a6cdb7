"""Reading a dataset: mappings, arrays, cameras, meshes, ground truth."""

import collections.abc
import json
import pickle
import shutil

import numpy as np
import pytest

import mateval
from mateval import display

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
    assert scene.photo is None and not scene.redressed
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
    with pytest.raises(mateval.WrongShape, match=r"depth: expected the shape \[72, 96\] .* found \[2, 2\]; pass the depth"):
        scene.input.camera.unproject(np.zeros((2, 2)))
    with pytest.raises(mateval.WrongShape, match=r"xyz: expected the shape \(\.\.\., 3\), found \[2\]"):
        scene.input.camera.project(np.zeros(2))


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


def test_cameras_and_instances_can_be_pickled(scene):
    camera = scene.views["up_left"].camera
    copy = pickle.loads(pickle.dumps(camera))
    assert copy.size == camera.size and np.array_equal(copy.K, camera.K)
    assert np.array_equal(copy.world_from_camera, camera.world_from_camera)
    # The twin: another view's camera.
    assert not np.array_equal(copy.world_from_camera, scene.input.camera.world_from_camera)
    copies = pickle.loads(pickle.dumps(dict(scene.instances)))
    assert list(copies) == list(scene.instances)
    for id, copy in copies.items():
        instance = scene.instances[id]
        assert (copy.id, copy.index, copy.role) == (instance.id, instance.index, instance.role)
    assert np.array_equal(copy.mesh.vertices, instance.mesh.vertices)


def test_a_copy_opens_a_dataset_that_changed_anew(root, tmp_path):
    copy = tmp_path / "dataset"
    shutil.copytree(root, copy)
    pickled = pickle.dumps(mateval.open(copy)["room"].input)
    assert pickle.loads(pickled).id == "input"
    (copy / "dataset.json").write_text("{")
    with pytest.raises(mateval.Error, match="dataset.json"):
        pickle.loads(pickled)


def test_notebooks_show_scenes_and_views(scene, withheld):
    assert scene._repr_html_().count("data:image/png;base64,") == 1 and "instances" in scene._repr_html_()
    assert "the true albedo" in scene.views["up_left"]._repr_html_()
    without = mateval.open(withheld)["room"].views["up_left"]._repr_html_()
    assert "withheld" in without and "<img" not in without


def test_notebooks_show_datasets(root, eight_scenes, withheld, tmp_path, monkeypatch):
    table = mateval.open(root)._repr_html_()
    assert "<td>room</td><td>sample</td><td>5</td><td>96x72</td><td></td>" in table and "not shown" not in table
    assert "<td>truth withheld</td>" in mateval.open(withheld)._repr_html_()
    eight = mateval.open(eight_scenes)
    assert eight._repr_html_().count("<tr>") == 1 + 8 and "8 scenes" in eight._repr_html_()
    monkeypatch.setattr(display, "MOST_SCENES", 3)
    assert eight._repr_html_().count("<tr>") == 1 + 3 and "5 of the scenes" in eight._repr_html_()
    shutil.copytree(root, tmp_path / "part", ignore=lambda folder, names: names if folder == str(root / "scenes") else [])
    assert "1 that was not downloaded" in mateval.open(tmp_path / "part")._repr_html_()


def test_lightings_need_the_truth(withheld):
    with pytest.raises(mateval.Withheld, match="ground_truth' does not exist"):
        mateval.open(withheld)["room"].lightings


def test_pictures_are_bytes_floats_or_booleans(scene):
    view = scene.input
    shown = mateval.display.Pictures({"photo": view.rgb, "depth": view.depth / view.depth.max(), "valid": view.valid})
    assert shown._repr_html_().count("<img") == 3
    with pytest.raises(ValueError, match="ids: expected uint8, floats or booleans, found uint16; scale it"):
        mateval.display.Pictures({"ids": view.instance})._repr_html_()
    with pytest.raises(TypeError, match="pictures: expected a dictionary by captions, found list"):
        mateval.display.Pictures([view.rgb])
