"""Twins and captured rooms: what Python shows of them, and what it refuses."""

import json
import shutil
import struct
import zlib

import numpy as np
import pytest

import mateval

REGIONS = ["floor", "sofa"]


def grey_png(values):
    """An 8-bit grey PNG, by https://www.w3.org/TR/png-3/."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width = values.shape
    rows = b"".join(b"\0" + row.tobytes() for row in values.astype(np.uint8))
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    parts = [chunk(b"IHDR", head), chunk(b"IDAT", zlib.compress(rows)), chunk(b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


@pytest.fixture(scope="module")
def captured(root, dataset, command, tmp_path_factory):
    """The sample's room passed off as a capture: its export to nerfstudio, its mesh and two regions."""
    folder = tmp_path_factory.mktemp("captured")
    command("prep", "export", "--as", "nerfstudio", "--with-ground-truth", "--out", folder / "export", root)
    source = folder / "export" / "room"
    shutil.copy(root / "scenes/room/geometry/instances.glb", source / "mesh.glb")
    scene = dataset["room"]
    (source / "regions.png").write_bytes(grey_png(np.asarray(scene.input.instance)))
    shared = {"photo": "input", "mask": "regions.png", "color": [0.25] * 3}
    regions = [{**shared, "name": name, "value": scene.instances[name].index} for name in REGIONS]
    measurements = {"format": "mateval-measurements/1", "regions": regions}
    (source / "measured.json").write_text(json.dumps(measurements))
    recipe = source / "recipe.toml"
    recipe.write_text(
        'name = "captured"\natlas_size = 64\n[[scene]]\nid = "room"\n[scene.capture]\nmesh = "mesh.glb"\n'
        'cameras = "transforms.json"\nphotos = "images"\ninput = "input"\nmeasured = "measured.json"\n'
    )
    command("prep", "build", recipe, "--out", folder / "dataset")
    return folder / "dataset"


@pytest.fixture(scope="module")
def twins(root, command, tmp_path_factory):
    """The dataset with two twins, for which nothing has to be rendered."""
    copy = tmp_path_factory.mktemp("twins") / "dataset"
    shutil.copytree(root, copy)
    recipe = copy / ".build/recipe.toml"
    recipe.write_text(recipe.read_text().replace("[[scene]]", '[[scene]]\ntwins = ["warm_cool", "alone_1"]'))
    command("prep", "finish", copy)
    return mateval.open(copy)


def grey(folder, command, tmp_path):
    out = tmp_path / "grey"
    command("baseline", "grey", "--dataset", folder, "--out", out)
    return out


def test_a_captured_room_has_measured_colours_and_no_truth(captured, command, tmp_path):
    dataset = mateval.open(captured)
    assert dataset["room"].photo == "images/input.png" and dataset["room"].input.rgb.max() > 0
    with pytest.raises(mateval.Error, match="is captured"):
        dataset["room"].input.truth
    submission = grey(captured, command, tmp_path)
    assert mateval.lint(submission, dataset).good
    with pytest.raises(mateval.Error, match="is captured"):
        dataset["room"].render(submission)
    result = mateval.score(submission, dataset, protocol="capture-1")
    assert [region["region"] for region in result.measured] == REGIONS
    for region in result.measured:
        # Byte 188 of sRGB, the nearest to 0.5.
        assert region["predicted"] == pytest.approx([0.503] * 3, abs=1e-3) and region["measured"] == [0.25] * 3
        assert region["scene"] == "room" and region["pixels"] > 0 and "measurement_delta_e" not in region
    mean = np.mean([region["delta_e"] for region in result.measured])
    assert result["measured.input.region_delta_e"] == pytest.approx(mean, abs=1e-12)
    # Under another protocol the room has no number, and a warning says so.
    other = mateval.score(submission, dataset)
    assert len(other) == 0 and other.measured == []
    assert [(f["code"], f["severity"]) for f in other.findings if f["code"] == "other_protocol"] == [
        ("other_protocol", "warning")
    ]


def test_twins_are_scenes_of_their_own_photo(twins, command, tmp_path):
    ids = ["room--alone_1", "room--warm_cool"]
    assert twins.twins == {"room--alone_1": ("room", "alone_1"), "room--warm_cool": ("room", "warm_cool")}
    assert sorted(twins) == ["room", *ids]
    room = twins["room"].input
    for twin in (twins[id].input for id in ids):
        assert np.array_equal(twin.depth, room.depth) and not np.array_equal(twin.rgb, room.rgb)
        assert np.array_equal(twin.truth.albedo, room.truth.albedo)
    # Grey is the same in any light, and has no contrast to compare with.
    result = mateval.score(grey(twins.path, command, tmp_path), twins)
    family = result.constancy["room"]
    assert sorted(family["lightings"]) == ["alone_1", "warm_cool"]
    assert family["raw"]["linear"] == 0 and family["raw"]["relative"] is None
    assert set(result.scenes) == {"room"}
