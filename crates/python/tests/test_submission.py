"""Lifting, writing, checking and scoring: the same bytes as the command's."""

import json
import os
import pathlib
import pickle
import subprocess
import sys
import textwrap

import numpy as np
import pytest

import mateval


def files_of(folder):
    """The bytes of all files by their paths."""
    return {
        str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()
    }


def written(out, dataset, scene, maps):
    with mateval.Submission(out, dataset, method="mine") as submission:
        for instance, found in maps.items():
            given = {map: getattr(found, map) for map in ("base_color", "roughness", "metallic")}
            submission.write(scene.id, instance, **{map: array for map, array in given.items() if array is not None})
    return out


def compare_maps(ours, commands):
    ours, commands = files_of(ours), files_of(commands)
    ours.pop("submission.json"), commands.pop("submission.json")
    assert list(ours) == list(commands) and len(ours) > 10
    assert [path for path in ours if ours[path] != commands[path]] == []


def test_lift_equals_the_baseline_byte_for_byte(dataset, scene, nn, tmp_path):
    truth = scene.input.truth
    maps = mateval.lift(scene, base_color=truth.albedo, roughness=truth.roughness, metallic=truth.metallic)
    compare_maps(written(tmp_path / "out", dataset, scene, maps), nn)
    assert any(found.seen.any() for found in maps.values())
    for found in maps.values():
        assert found.seen.shape == found.roughness.shape and found.seen.dtype == np.bool_


def test_maps_can_be_pickled(scene):
    for given in ({"base_color": scene.input.preview}, {"roughness": scene.input.truth.roughness}):
        maps = next(iter(mateval.lift(scene, **given).values()))
        copy = pickle.loads(pickle.dumps(maps))
        for name in ("base_color", "roughness", "metallic", "seen"):
            before, after = getattr(maps, name), getattr(copy, name)
            assert (before is None) == (after is None) == (name not in (*given, "seen"))
            assert before is None or np.array_equal(before, after)


def test_lift_equals_the_baseline_with_other_options(root, dataset, scene, command, tmp_path):
    out = tmp_path / "command"
    command("baseline", "nn", "--dataset", root, "--out", out, "--estimate", "input", "--neighbours", 3,
            "--normal-weight", 0.5, "--any-instance", "--atlas-size", 64)
    photo = np.clip(scene.input.rgb * np.float32(scene.exposure), 0, 1)
    maps = mateval.lift(scene, base_color=photo, neighbours=3, normal_weight=0.5, any_instance=True, atlas_size=64)
    assert all(found.roughness is None for found in maps.values())
    compare_maps(written(tmp_path / "ours", dataset, scene, maps), out)


def test_lift_decodes_integers_as_the_plain_adapter_does(root, dataset, scene, command, tmp_path):
    photo = scene.input.preview
    folder = tmp_path / "estimate"
    folder.mkdir()
    # The plain adapter reads the preview, which is a PNG of the same bytes.
    adapter = tmp_path / "plain.toml"
    adapter.write_text('name = "x"\n[base_color]\nfiles = ["{scene}.png"]\nencoding = "srgb"\n')
    (folder / "room.png").write_bytes((root / "scenes/room/views/input/rgb.png").read_bytes())
    out = tmp_path / "command"
    command("baseline", "nn", "--dataset", root, "--out", out, "--estimate", folder, "--adapter", adapter)
    compare_maps(written(tmp_path / "ours", dataset, scene, mateval.lift(scene, base_color=photo)), out)


def test_delight_is_the_commands(root, dataset, scene, command, tmp_path):
    delit = mateval.delight(scene)
    pictures = tmp_path / "pictures"
    command("baseline", "delight", "--dataset", root, "--out", pictures)
    lights = json.loads((pictures / "room/lights.json").read_text())["lights"]
    assert delit.radiances == {light["name"]: tuple(light["radiance"]) for light in lights}
    out = tmp_path / "command"
    command("baseline", "nn", "--dataset", root, "--out", out, "--estimate", "delight")
    maps = mateval.lift(scene, base_color=delit.base_color, roughness=delit.roughness, metallic=delit.metallic)
    compare_maps(written(tmp_path / "ours", dataset, scene, maps), out)
    # The photo is made again where the base colour is well known, but for colours that would exceed 1.
    known = scene.input.valid & (delit.confidence > 0.9)
    made = delit.base_color * delit.shading + delit.gloss
    assert known.any() and np.median(np.abs(made[known] / scene.input.rgb[known] - 1)) < 0.05
    assert set(mateval.delight(scene, lights="stage").radiances) < set(delit.radiances)
    with pytest.raises(ValueError, match="'room' or 'stage', found 'sun'"):
        mateval.delight(scene, lights="sun")


def test_procedural_is_the_commands(root, dataset, scene, command, tmp_path):
    truth = scene.input.truth
    estimate = {"base_color": truth.albedo, "roughness": truth.roughness, "metallic": truth.metallic}
    for keep_seen in (False, True):
        maps = mateval.procedural(scene, keep_seen=keep_seen, detail=0.5, **estimate)
        assert all((found.seen is not None) == keep_seen for found in maps.values())
        out = tmp_path / f"command{keep_seen}"
        words = ["--keep-seen"] if keep_seen else []
        command("baseline", "procedural", "--dataset", root, "--out", out, "--estimate", "gt", "--detail", "0.5", *words)
        compare_maps(written(tmp_path / f"ours{keep_seen}", dataset, scene, maps), out)
    with pytest.raises(ValueError, match="the detail is 2; expected 0 to 1"):
        mateval.procedural(scene, detail=2, **estimate)
    with pytest.raises(ValueError, match="expected base_color, roughness or metallic"):
        mateval.procedural(scene)
    with pytest.raises(mateval.Error, match="base_color"):
        mateval.procedural(scene, roughness=truth.roughness)
    with pytest.raises(mateval.Error, match="no part set 'none'"):
        mateval.procedural(scene, part_set="none", **estimate)


def test_lint_is_the_commands(root, dataset, nn, command):
    report = mateval.lint(nn, dataset)
    assert report.json == command("eval", "lint", nn, "--dataset", root, "--format", "json").stdout
    assert str(report) == command("eval", "lint", nn, "--dataset", root).stdout
    assert report.good and isinstance(report.findings, list)


def test_lint_finds_faults(dataset, tmp_path):
    out = tmp_path / "empty"
    with mateval.Submission(out, dataset, method="empty"):
        pass
    report = mateval.lint(out, dataset)
    assert not report.good and [finding["code"] for finding in report.findings] == ["no_scenes_folder"]


def test_score_is_the_commands(root, dataset, nn, command, tmp_path):
    command("eval", "score", nn, "--dataset", root, "--out", tmp_path / "result.json")
    result = mateval.score(nn, dataset, cache=tmp_path / "cache")
    assert result.json == (tmp_path / "result.json").read_text()
    assert result["albedo.input.psnr"] == result.scenes["room"]["albedo.input.psnr"] > 20
    assert len(result.fingerprint) == 64 and len(result) > 20 and result.method == "nn-gt"
    with pytest.raises(mateval.UnknownId, match="no mean 'albedo.input.pnsr'; expected a key such as 'albedo.input.psnr'"):
        result["albedo.input.pnsr"]
    records = result.to_records()
    assert len(records) > 50 and {"scene", "view", "picture", "region", "pixels", "metric", "value"} <= set(records[0])
    assert "values" not in records[0] and not result.not_predicted
    (record,) = [r for r in records if (r["picture"], r["view"], r["metric"]) == ("albedo", "input", "psnr")]
    assert record["value"] == result["albedo.input.psnr"]
    assert mateval.score(nn, dataset, scenes=["room"], cache=tmp_path / "cache").json == result.json


def test_score_refuses_what_it_does_not_know(dataset, nn, tmp_path):
    with pytest.raises(mateval.Error, match="there is no protocol 'best'; use one of: .*mateval-3"):
        mateval.score(nn, dataset, protocol="best")
    with pytest.raises(mateval.UnknownId, match="has no scene 'hall'; it has 'room'"):
        mateval.score(nn, dataset, scenes=["hall"])
    with pytest.raises(TypeError, match="found the text 'room'"):
        mateval.score(nn, dataset, scenes="room")
    with pytest.raises(mateval.Error, match="cannot read '.*no-such"):
        mateval.score(tmp_path / "no-such", dataset)


def test_the_dtype_decides_the_encoding(dataset, scene, tmp_path):
    ids = [id for id, instance in scene.instances.items() if instance.atlas_size]
    flat = np.full((64, 64, 3), 0.5)
    arrays = {
        np.uint8: (flat * 255).astype(np.uint8), np.uint16: (flat * 65535).astype(np.uint16),
        np.float16: flat.astype(np.float16), np.float32: flat.astype(np.float32), np.float64: flat,
    }
    out = tmp_path / "out"
    with mateval.Submission(out, dataset, method="m", cost={"seconds_a_scene": 3, "hardware": "a CPU"}) as submission:
        for id, array in zip(ids, arrays.values()):
            # Not contiguous, which must not matter.
            submission.write("room", id, base_color=array[::-1, ::-1], roughness=array[..., 0].T)
    endings = [sorted(path.name for path in (out / "scenes/room" / id).iterdir()) for id in ids[:5]]
    assert endings == 2 * [["base_color.png", "roughness.png"]] + 3 * [["base_color.exr", "roughness.exr"]]
    assert json.loads((out / "submission.json").read_text())["cost"] == {"seconds_a_scene": 3.0, "hardware": "a CPU"}
    report = mateval.lint(out, dataset)
    # Of the other instances nothing was written.
    assert {finding["code"] for finding in report.findings if finding["severity"] == "error"} == {"missing_object"}


FLAT = np.full((64, 64, 3), 0.5, np.float32)


def with_value(value):
    array = FLAT.copy()
    array[3, 5, 1] = value
    return array


@pytest.mark.parametrize(
    "error, match, arguments",
    [
        (TypeError, "base_color: expected a NumPy array or a tensor, found list", {"base_color": [[0.5]]}),
        (TypeError, "base_color: expected uint8, .* found int64", {"base_color": FLAT.astype(np.int64)}),
        (TypeError, "base_color: expected uint8, .* found bool", {"base_color": FLAT > 0}),
        (ValueError, r"base_color: expected the shape \(side, side, 3\) .*64 to 4096.*found \[64, 64\]", {"base_color": FLAT[..., 0]}),
        (ValueError, r"base_color: .*found \[32, 64, 3\]", {"base_color": FLAT[:32]}),
        (ValueError, r"base_color: .*found \[32, 32, 3\]", {"base_color": FLAT[:32, :32]}),
        (ValueError, r"roughness: expected the shape \(side, side\) .*found \[64, 64, 3\]", {"roughness": FLAT}),
        (ValueError, r"base_color: expected values from -1 to 16, found NaN at \[3, 5, 1\]", {"base_color": with_value(np.nan)}),
        (ValueError, r"base_color: .*found 16.5 at \[3, 5, 1\]", {"base_color": with_value(16.5)}),
        (ValueError, r"metallic: expected values from 0 to 1, found 2 at \[3, 5\]", {"metallic": with_value(2)[..., 1]}),
        (ValueError, "expected base_color, roughness or metallic, found none", {}),
    ],
)
def test_wrong_maps_are_refused(dataset, scene, tmp_path, error, match, arguments):
    id = next(id for id, instance in scene.instances.items() if instance.atlas_size)
    with mateval.Submission(tmp_path / "out", dataset, method="m") as submission:
        with pytest.raises(error, match=match):
            submission.write("room", id, **arguments)
        submission.write("room", id, base_color=FLAT)
        with pytest.raises(ValueError, match="base_color: expected a map that was not written yet"):
            submission.write("room", id, base_color=FLAT)
        with pytest.raises(mateval.UnknownId, match="has no scene 'hall'; it has 'room'"):
            submission.write("hall", id, base_color=FLAT)
        with pytest.raises(mateval.UnknownId, match="scene 'room' has no instance 'x'; it has '"):
            submission.write("room", "x", base_color=FLAT)
    with pytest.raises(ValueError, match="is closed; expected an open one"):
        submission.write("room", id, roughness=FLAT[..., 0])


@pytest.mark.parametrize(
    "error, match, arguments",
    [
        (ValueError, "found none of them", {}),
        (ValueError, "base_color: expected values from -1 to 16, found NaN", {"base_color": with_value(np.nan)}),
        (ValueError, "base_color: expected values from -1 to 16, found 128", {"base_color": with_value(128)}),
        (ValueError, "base_color: expected at most 67108864 pixels", {"base_color": np.broadcast_to(np.uint8(3), (100000, 100000, 3))}),
        (ValueError, r"roughness: expected the height and width of base_color, \[64, 64\], found", {"base_color": FLAT, "roughness": FLAT[:9, :, 0]}),
        (ValueError, "neighbours: expected 1 to 255, found 0", {"base_color": FLAT, "neighbours": 0}),
        (ValueError, "normal_weight: expected 0 to 100 m, found -1", {"base_color": FLAT, "normal_weight": -1}),
        (ValueError, "atlas_size: expected 64 to 4096 texels, found 5", {"base_color": FLAT, "atlas_size": 5}),
        (mateval.WrongShape, "has 64x64 pixels, the input view 96x72; expected the same proportions.*scale it back", {"base_color": FLAT}),
    ],
)
def test_wrong_estimates_are_refused(scene, error, match, arguments):
    with pytest.raises(error, match=match):
        mateval.lift(scene, **arguments)


def test_a_relative_place_stays_the_same_folder(dataset, scene, tmp_path, monkeypatch):
    id = next(id for id, instance in scene.instances.items() if instance.atlas_size)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path)
    with mateval.Submission("out", dataset, method="m") as submission:
        monkeypatch.chdir(tmp_path / "elsewhere")
        submission.write("room", id, base_color=FLAT)
    assert (tmp_path / "out" / "submission.json").is_file()
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_a_submission_replaces_nothing_unasked(root, dataset, scene, tmp_path, command, nn):
    out = tmp_path / "out"
    mateval.Submission(out, dataset, method="first").close()
    with pytest.raises(mateval.Error, match="already exists") as caught:
        mateval.Submission(out, dataset, method="second")
    said = command("baseline", "grey", "--dataset", root, "--out", out, good=(2,)).stderr
    assert said.replace("--out", "out").replace("--force", "force=True") == f"error: {caught.value}\n"
    mateval.Submission(out, dataset, method="third", force=True).close()
    assert json.loads((out / "submission.json").read_text())["method"] == "third"
    with pytest.raises(mateval.Error, match="would lie in the dataset"):
        mateval.Submission(root / "out", dataset, method="m")
    with pytest.raises(ValueError, match="cost: expected 'seconds_a_scene', found no such key"):
        mateval.Submission(tmp_path / "other", dataset, method="m", cost={})
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_an_exception_leaves_nothing(dataset, tmp_path):
    with pytest.raises(RuntimeError):
        with mateval.Submission(tmp_path / "out", dataset, method="m"):
            raise RuntimeError
    submission = mateval.Submission(tmp_path / "out", dataset, method="m")
    submission.discard()
    submission.close()
    mateval.Submission(tmp_path / "out", dataset, method="m")
    assert list(tmp_path.iterdir()) == []


def test_a_killed_program_leaves_no_half_submission(root, dataset, scene, tmp_path):
    first, second = [id for id, instance in scene.instances.items() if instance.atlas_size][:2]
    program = textwrap.dedent(f"""
        import os, numpy as np, mateval
        submission = mateval.Submission({str(tmp_path / "out")!r}, mateval.open({str(root)!r}), method="m")
        submission.write("room", {first!r}, base_color=np.zeros((64, 64, 3), np.uint8))
        os._exit(7)
    """)
    assert subprocess.run([sys.executable, "-c", program]).returncode == 7
    assert not (tmp_path / "out").exists()
    left = [path.name for path in tmp_path.iterdir()]
    assert len(left) == 1 and left[0].startswith(".out.") and left[0].endswith(".partial")
    # What the killed program left is removed by the next one.
    with mateval.Submission(tmp_path / "out", dataset, method="m") as submission:
        submission.write("room", second, base_color=np.zeros((64, 64, 3), np.uint8))
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert [path.name for path in (tmp_path / "out/scenes/room").iterdir()] == [second]


def test_metrics_are_the_scorers(scene):
    rng = np.random.default_rng(1)
    a, b = rng.random((2, 40, 50, 3), np.float32)
    mask = rng.random((40, 50)) > 0.001
    error = np.mean((a - b).astype(np.float64) ** 2)
    assert mateval.metrics.psnr(a, b) == pytest.approx(-10 * np.log10(error), abs=1e-9)
    error = np.mean((a - b)[mask].astype(np.float64) ** 2)
    assert mateval.metrics.psnr(a, b, mask) == pytest.approx(-10 * np.log10(error), abs=1e-9)
    assert mateval.metrics.psnr(a[..., 0], a[..., 0]) == 100
    assert mateval.metrics.psnr(a, b, np.zeros((40, 50), bool)) is None
    assert mateval.metrics.ssim(a, a) == pytest.approx(1)
    assert 0 < mateval.metrics.ssim(a, b, mask) < 0.5
    assert mateval.metrics.ssim(np.zeros((11, 11), np.uint8), np.zeros((11, 11), np.uint8)) == 1
    for wrong, text in (
        ((a, b[1:]), r"reference: expected the height and width of prediction, \[40, 50\], found \[39, 50\]; scale"),
        ((a, b[..., 0]), r"reference: expected the shape \(height, width, 3\) of the prediction, found \[40, 50\]"),
        ((a[..., 0], b), r"reference: expected the shape \(height, width\) of the prediction, found \[40, 50, 3\]"),
        ((a, b, mask[:, 1:]), r"mask: expected the height and width of prediction, \[40, 50\], found \[40, 49\]"),
        ((a, b, mask[0]), r"mask: expected the shape \(height, width\), found \[50\]"),
    ):
        with pytest.raises(mateval.WrongShape, match=text) as raised:
            mateval.metrics.psnr(*wrong)
        assert isinstance(raised.value, ValueError) and isinstance(raised.value, mateval.Error)
    with pytest.raises(mateval.WrongShape, match="at least 11x11 pixels; found 5x5; compare larger ones"):
        mateval.metrics.ssim(a[:5, :5], b[:5, :5])
    with pytest.raises(TypeError, match="reference: expected floats like the prediction, found integers"):
        mateval.metrics.psnr(a, (b * 255).astype(np.uint8))
    with pytest.raises(ValueError, match="reference: expected values from -1 to 16, found .*divide values of 0 to 255"):
        mateval.metrics.psnr(a, b * 255)
    with pytest.raises(TypeError, match="mask: expected bool, found uint8"):
        mateval.metrics.psnr(a, b, mask.astype(np.uint8))
    with pytest.raises(ValueError, match=r"prediction: expected values from -1 to 16, found NaN at \[0, 0\]"):
        mateval.metrics.ssim(np.full((20, 20), np.nan), np.zeros((20, 20)))


def test_lpips_is_computed_or_says_how_to_get_its_weights(tmp_path):
    a = np.random.default_rng(1).random((64, 64, 3), np.float32)
    program = "import mateval, numpy as np\nmateval.metrics.lpips(*np.zeros((2, 64, 64, 3)))"
    environment = {**os.environ, "MATEVAL_CACHE": str(tmp_path)}
    ended = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
    assert "mateval.errors.Error: lpips_alex is missing: cannot read" in ended.stderr and "run: " in ended.stderr
    try:
        assert mateval.metrics.lpips(a, a) == 0
    except mateval.Error as error:
        pytest.skip(str(error))
    assert mateval.metrics.lpips(a, 1 - a) > 0.1


def test_of_two_submissions_at_one_place_one_stays_whole(dataset, scene, tmp_path):
    ids = [id for id, instance in scene.instances.items() if instance.atlas_size][:2]
    first, second = [mateval.Submission(tmp_path / "out", dataset, method=id) for id in ids]
    for submission, id in zip((first, second), ids):
        submission.write("room", id, metallic=np.zeros((64, 64)))
    first.close()
    with pytest.raises(Exception, match="was made by another process meanwhile"):
        second.close()
    assert json.loads((tmp_path / "out/submission.json").read_text())["method"] == ids[0]
    assert [path.name for path in (tmp_path / "out/scenes/room").iterdir()] == ids[:1]


class Tensor:
    """As PyTorch's: on another device, with a gradient."""

    def __init__(self, array, place="cuda"):
        self.array, self.place, self.dtype = array, place, f"torch.{array.dtype}"

    def detach(self):
        return Tensor(self.array, self.place)

    def cpu(self):
        return Tensor(self.array, "cpu")

    def numpy(self):
        assert self.place == "cpu"
        return self.array


def test_what_method_authors_pass_is_taken_or_explained(scene):
    photo = np.clip(scene.input.rgb * np.float32(scene.exposure), 0, 1)
    plain = mateval.lift(scene, base_color=photo)
    name = next(iter(plain))
    read_only = photo.copy()
    read_only.flags.writeable = False
    backwards = photo[::-1, ::-1].copy()[::-1, ::-1]
    for same in (Tensor(photo), read_only, backwards, photo.astype(np.float64)):
        assert np.array_equal(mateval.lift(scene, base_color=same)[name].base_color, plain[name].base_color)
    srgb = np.where(photo <= 0.0031308, 12.92 * photo, 1.055 * photo ** (1 / 2.4) - 0.055)
    encoded = mateval.lift(scene, base_color=srgb, encoding="srgb")[name].base_color
    assert np.abs(encoded.astype(int) - plain[name].base_color).max() <= 1
    for wrong, text in (
        ({"base_color": photo.transpose(2, 0, 1)}, r"found \[3, 72, 96\]; `numpy.moveaxis\(array, 0, -1\)`"),
        ({"base_color": photo[None]}, r"found \[1, 72, 96, 3\]; `array\[0\]` drops the first axis"),
        ({"base_color": photo * 200}, "divide values of 0 to 255 by 255, or pass them as uint8"),
        ({"base_color": photo, "roughness": photo[..., :1]}, r"drops the last axis"),
        ({"base_color": photo, "encoding": "gamma"}, "encoding: expected 'linear' or 'srgb', found 'gamma'"),
    ):
        with pytest.raises(ValueError, match=text):
            mateval.lift(scene, **wrong)
    with pytest.raises(TypeError, match="base_color: expected a NumPy array or a tensor, found list"):
        mateval.lift(scene, base_color=[[1.0]])


def test_progress_is_reported_and_ends_the_work(scene, capsys):
    photo, heard = scene.input.preview, []
    mateval.lift(scene, base_color=photo, progress=lambda *report: heard.append(report))
    assert heard and all(0 <= done <= total for _, done, total in heard), heard

    def fails(name, done, total):
        raise KeyError(name)

    with pytest.raises(KeyError):
        mateval.procedural(scene, base_color=photo, progress=fails)
    assert capsys.readouterr().err == ""
    mateval.lift(scene, base_color=photo, progress=True)
    assert "[####" in capsys.readouterr().err
    with pytest.raises(TypeError, match="progress: expected None, True, False or a callable, found 3"):
        mateval.lift(scene, base_color=photo, progress=3)


@pytest.fixture(scope="module")
def scores(root, nn, command, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scores")
    command("baseline", "grey", "--dataset", root, "--out", folder / "grey")
    return [mateval.score(folder / "grey", root), mateval.score(nn, root)], folder


def test_results_are_saved_loaded_and_compared(root, scores, command, tmp_path, monkeypatch):
    (grey, nn), _ = scores
    nn.save(tmp_path / "nn.json")
    with pytest.raises(FileExistsError, match="nn.json' already exists; .* force=True"):
        nn.save(tmp_path / "nn.json")
    nn.save(tmp_path / "nn.json", force=True)
    assert dict(mateval.Result.load(tmp_path / "nn.json")) == dict(nn)
    (tmp_path / "nn.json").write_text(nn.json.replace('"albedo.novel.psnr": ', '"albedo.novel.psnr": 1', 1))
    with pytest.raises(mateval.Error):
        mateval.Result.load(tmp_path / "nn.json")
    assert "Albedo PSNR" in nn._repr_html_()
    with pytest.raises(mateval.UnknownId, match="no protocol 'paper'; it has 'mateval-3'"):
        mateval.Result(nn.json, "paper")

    pandas = pytest.importorskip("pandas")
    ranked = mateval.rank([grey, nn])
    assert list(ranked["method"]) == [nn.method, "grey"] and list(ranked["place"]) == [1, 2]
    assert ranked["value"][0] == nn["albedo.novel.psnr"] and pandas.isna(ranked["low"][0])
    table = mateval.tables([grey, nn])["Albedo, novel views"]
    assert table.loc["grey", "Albedo PSNR \u2191"] == grey["albedo.novel.psnr"]
    assert "| grey |" in mateval.tables([grey, nn], format="markdown")
    monkeypatch.setitem(sys.modules, "pandas", None)
    assert mateval.rank([grey, nn])[0]["method"] == nn.method
    with pytest.raises(mateval.Error, match="the ceiling 'nn-gt' is not the truth"):
        mateval.tables([grey], ceiling=nn)
    command("baseline", "gt", "--dataset", root, "--out", tmp_path / "gt")
    truth = mateval.score(tmp_path / "gt", root)
    rows = mateval.tables([grey, nn], ceiling=truth, by="scene")["Albedo, novel views"]
    assert [(row["Scene"], row["method"]) for row in rows] == [("room", "grey"), ("room", "nn-gt"), ("room", "gt (ceiling)")], rows
    with pytest.raises(mateval.UnknownId, match="expected a key such as 'albedo.novel.psnr'"):
        mateval.rank([nn], key="albedo.novel.psn")
    with pytest.raises(TypeError, match="Result.load reads a file"):
        mateval.tables(["nn.json"])


def test_a_scene_is_rendered_with_any_maps(scene, nn, scores):
    truth = scene.input.truth
    maps = mateval.lift(scene, base_color=truth.albedo, roughness=truth.roughness, metallic=truth.metallic)
    ours = scene.render(maps, samples=1, progress=False)
    assert list(ours) == list(scene.views) and ours["input"].dtype == np.uint8
    given = scene.render(nn, samples=1)
    assert all(np.array_equal(ours[view], given[view]) for view in ours)
    black = scene.render({next(iter(maps)): {"base_color": np.zeros((64, 64, 3), np.uint8)}}, samples=1)
    assert not np.array_equal(black["input"], ours["input"])
    assert not np.array_equal(scene.render(nn, light="warm_cool", samples=1)["input"], ours["input"])
    with pytest.raises(ValueError, match="light: expected a name of `Scene.lightings`, such as 'true'"):
        scene.render(nn, light="sun")
    with pytest.raises(ValueError, match="expected base_color, roughness, metallic, found 'albedo'"):
        scene.render({next(iter(maps)): {"albedo": np.zeros((64, 64, 3), np.uint8)}})
    with pytest.raises(TypeError, match="maps: .*: expected Maps or a dictionary of base_color, .*, found ndarray"):
        scene.render({next(iter(maps)): np.zeros((64, 64, 3), np.uint8)})
    with pytest.raises(ValueError, match="light: scene 'room' has no lighting 'alone_9'; `Scene.lightings` lists"):
        scene.render(nn, light="alone_9", samples=1)
    # The scorer's own lightings.
    (_, result), _ = scores
    scored = {record["lighting"] for record in result.to_records() if record["picture"] == "rgb_relit"}
    assert scene.lightings[:2] == ["true", "warm_cool"] and set(scene.lightings[1:]) == scored
    for light in scene.lightings:
        assert list(scene.render(nn, light=light, samples=1)) == list(scene.views)


def test_exceptions_speak_python(dataset, nn):
    with pytest.raises(mateval.Error, match="force=True") as raised:
        mateval.Submission(nn, dataset, method="x")
    assert "--" not in str(raised.value)
