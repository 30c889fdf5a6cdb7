#!/usr/bin/env python3
"""Tests of run_marigold.py. Tests of the pipeline build a tiny one with random weights; nothing is downloaded.

tools/test.sh runs what needs nothing but Python, tools/test_marigold.sh everything.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import tomllib
import types
import unittest
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

import run_marigold as tool  # noqa: E402

# As the released model's model_index.json has it (config/train_marigold_iid_appearance.yaml of prs-eth/Marigold).
APPEARANCE = {
    "target_names": ["albedo", "material"],
    "albedo": {"prediction_space": "srgb"},
    "material": {"prediction_space": "stack", "sub_target_names": ["roughness", "metallicity", None]},
    "roughness": {"prediction_space": "linear", "up_to_scale": False},
    "metallicity": {"prediction_space": "linear", "up_to_scale": False},
}
# As that of the lighting model (config/train_marigold_iid_lighting.yaml).
LIGHTING = {"target_names": ["albedo", "shading", "residual"], "albedo": {"prediction_space": "linear"}}
SIZES = {"attic": (40, 24), "cellar": (24, 33)}  # width, height; neither is a multiple of eight both ways


def attention(query: Any, key: Any, value: Any, **_words: Any) -> Any:
    """Attention without masks, as in torch 2.0 and later (Vaswani and others 2017, equation 1)."""
    weights = (query @ key.transpose(-2, -1) / query.shape[-1] ** 0.5).softmax(-1)
    return weights @ value


def complete_torch() -> None:
    """Adds to torch before 2.1 (Debian 12 has such a version) the names that diffusers needs to load the pipeline."""
    import torch

    if not hasattr(torch, "compiler"):
        torch.float8_e4m3fn = torch.float8_e5m2 = None
        torch.compiler = types.SimpleNamespace(disable=lambda f=None: f or (lambda g: g), is_compiling=lambda: False)
        # The replacement in diffusers, `baddbmm` with beta = 0, passes on NaN from uninitialised memory.
        torch.nn.functional.scaled_dot_product_attention = attention


def missing(*names: str) -> Any:
    """Skips a test that needs these packages if one is missing."""
    absent = [name for name in names if importlib.util.find_spec(name) is None]
    return unittest.skipIf(absent, f"SKIPPED: this Python has no {', '.join(absent)}; run tools/test_marigold.sh")


def write_json(*, path: Path, value: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value), encoding="utf-8")


class Plan(unittest.TestCase):
    def setUp(self) -> None:
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = Path(scratch.name)
        write_json(path=self.folder / "dataset.json", value={"scenes": ["b", "a"]})
        for scene in "ab":
            (self.folder / "scenes" / scene / "views/input").mkdir(parents=True)
            (self.folder / "scenes" / scene / "views/input/rgb.png").touch()

    def refused(self, expected: str, function: Any, **words: Any) -> None:
        with self.assertRaisesRegex(tool.RunError, expected):
            function(**words)

    def test_scenes_come_in_the_datasets_order(self) -> None:
        for wanted, expected in ((None, ["b", "a"]), (["a", "b"], ["b", "a"]), (["a"], ["a"])):
            found = tool.input_pictures(dataset=self.folder, wanted=wanted)
            self.assertEqual(list(found), expected)
        self.assertEqual(found["a"], self.folder / "scenes/a/views/input/rgb.png")

    def test_a_folder_that_is_no_dataset_is_refused(self) -> None:
        self.refused("no scene 'c'; it has b, a", tool.input_pictures, dataset=self.folder, wanted=["c"])
        (self.folder / "scenes/a/views/input/rgb.png").unlink()
        self.refused(r"a/views/input/rgb.png' does not exist \(1 ", tool.input_pictures, dataset=self.folder, wanted=None)
        self.assertEqual(list(tool.input_pictures(dataset=self.folder, wanted=["b"])), ["b"])
        for value in ({"scenes": ["../x"]}, {"scenes": "ab"}, {}, ["a"]):
            write_json(path=self.folder / "dataset.json", value=value)
            self.refused("should", tool.input_pictures, dataset=self.folder, wanted=None)
        (self.folder / "dataset.json").unlink()
        self.refused("cannot read '.*dataset.json'", tool.input_pictures, dataset=self.folder, wanted=None)

    def test_the_places_follow_the_models_names(self) -> None:
        self.assertEqual(tool.places(properties=APPEARANCE), (0, False, 1, 0, 1))
        turned = {
            "target_names": ["material", "shading", "albedo"],
            "albedo": {"prediction_space": "linear"},
            "material": {"sub_target_names": ["metallicity", None, "roughness"]},
        }
        self.assertEqual(tool.places(properties=turned), (2, True, 0, 2, 0))
        self.assertEqual(tool.places(properties=LIGHTING), (0, True, None, None, None))

    def test_a_model_of_another_kind_is_refused(self) -> None:
        for properties in (None, {}, {"target_names": ["depth"]}):
            self.refused("expected albedo, as", tool.places, properties=properties)
        space = APPEARANCE | {"albedo": {"prediction_space": "stack"}}
        self.refused("space 'stack'", tool.places, properties=space)
        for names in (None, ["roughness", "metallicity"], ["roughness", None, None]):
            material = APPEARANCE | {"material": {"sub_target_names": names}}
            self.refused("expected roughness and metallicity", tool.places, properties=material)

    def test_seeds_differ_by_seed_and_scene(self) -> None:
        seeds = [tool.scene_seed(seed=seed, scene=scene) for seed in (0, 1, 10) for scene in ("a", "b", "0a")]
        self.assertEqual(len(set(seeds)), 9)
        self.assertTrue(all(0 <= seed < 2**63 for seed in seeds))
        # sha256sum of "0 a", its first 16 digits, halved.
        self.assertEqual(seeds[0], 7473381847846152037)

    def test_the_adapter_reads_what_is_written(self) -> None:
        path = Path(tool.__file__).parents[1] / "crates/baselines/adapters/marigold.toml"
        adapter = tomllib.loads(path.read_text(encoding="utf-8"))
        found = {key: (value["files"][0], value.get("channel")) for key, value in adapter.items() if "files" in value}
        expected = {"base_color": ("{scene}/albedo.png", None)}
        expected |= {"roughness": ("{scene}/material.png", "r"), "metallic": ("{scene}/material.png", "g")}
        self.assertEqual(found, expected)
        # The power by which the model's authors encode its targets, and `pictures` a linear albedo.
        self.assertEqual({adapter[key]["encoding"] for key in expected}, {"gamma22"})
        # The lighting model has no material.
        self.assertEqual([adapter[key].get("optional", False) for key in expected], [False, True, True])

    def test_a_folder_of_other_pictures_is_refused(self) -> None:
        out, asked = self.folder / "out", {"seed": 1}
        for force in (False, True):
            tool.check_out(out=out, asked=asked, scenes=["a"], force=force)
        write_json(path=out / "notes.txt", value="mine")
        self.refused("no run.json", tool.check_out, out=out, asked=asked, scenes=["a"], force=True)
        (out / "notes.txt").unlink()
        write_json(path=out / "run.json", value={"seed": 1})
        (out / "a").mkdir()
        tool.check_out(out=out, asked=asked, scenes=["b"], force=False)
        other = {"seed": 2}
        self.refused("seed 1, not 2; give --force", tool.check_out, out=out, asked=other, scenes=["a"], force=False)
        tool.check_out(out=out, asked=other, scenes=["a"], force=True)
        self.refused("'a' would stay", tool.check_out, out=out, asked=other, scenes=["b"], force=True)


@missing("numpy")
class Mapping(unittest.TestCase):
    def pictures(self, *, properties: dict[str, Any]) -> tuple[Any, Any]:
        """Pictures of a prediction whose values identify target and channel: 0.1, 0.2, 0.3 and 0.4, 0.5, 0.6."""
        import numpy as np

        prediction = np.broadcast_to(np.arange(1, 7, dtype=np.float32).reshape(2, 1, 1, 3) / 10, (2, 4, 5, 3))
        return tool.pictures(prediction=prediction, where=tool.places(properties=properties))

    def check(self, *, picture: Any, expected: list[int]) -> None:
        self.assertEqual((picture.shape, str(picture.dtype)), ((4, 5, 3), "uint8"))
        self.assertEqual(picture.reshape(-1, 3).tolist(), [expected] * 20)

    def test_the_released_model(self) -> None:
        albedo, material = self.pictures(properties=APPEARANCE)
        self.check(picture=albedo, expected=[26, 51, 77])  # 255 times 0.1, 0.2, 0.3: as predicted
        self.check(picture=material, expected=[102, 128, 0])  # roughness 0.4, metallic 0.5

    def test_names_decide_and_not_positions(self) -> None:
        stacked = {"sub_target_names": [None, "metallicity", "roughness"]}
        turned = APPEARANCE | {"target_names": ["material", "albedo"], "material": stacked}
        albedo, material = self.pictures(properties=turned)
        self.check(picture=albedo, expected=[102, 128, 153])
        self.check(picture=material, expected=[77, 51, 0])

    def test_a_linear_albedo_is_encoded(self) -> None:
        albedo, material = self.pictures(properties=APPEARANCE | {"albedo": {"prediction_space": "linear"}})
        # Computed with bc: 255*e(l(0.1)/2.2) = 89.5, then 122.7 and 147.5.
        self.check(picture=albedo, expected=[90, 123, 148])
        self.check(picture=material, expected=[102, 128, 0])

    def test_the_lighting_model_has_no_material(self) -> None:
        albedo, material = self.pictures(properties=LIGHTING)
        self.check(picture=albedo, expected=[90, 123, 148])
        self.assertIsNone(material)

    def test_values_that_are_not_finite_are_refused(self) -> None:
        import numpy as np

        for bad in (np.nan, np.inf):
            prediction = np.full((2, 1, 1, 3), 0.5)
            prediction[1, 0, 0, 2] = bad
            with self.assertRaisesRegex(tool.RunError, "not finite"):
                tool.pictures(prediction=prediction, where=tool.places(properties=APPEARANCE))


def tiny_tokenizer(*, folder: Path) -> Any:
    """A tokenizer with only the marks for begin and end of a text, which suffice for an empty text."""
    from transformers import CLIPTokenizer

    write_json(path=folder / "vocab.json", value={"<|startoftext|>": 0, "<|endoftext|>": 1, "a</w>": 2})
    (folder / "merges.txt").write_text("#version: 0.2\n", encoding="ascii")
    return CLIPTokenizer(str(folder / "vocab.json"), str(folder / "merges.txt"), model_max_length=8)


def tiny_networks() -> dict[str, Any]:
    """Networks of a few thousand random weights, with the same interfaces as the real ones."""
    import torch
    from diffusers import AutoencoderKL, UNet2DConditionModel
    from transformers import CLIPTextConfig, CLIPTextModel

    torch.manual_seed(7)
    width = 8
    unet = UNet2DConditionModel(
        in_channels=12,  # the latents of the picture and of two targets, with four channels each
        out_channels=8,
        block_out_channels=(width, 2 * width),
        down_block_types=("CrossAttnDownBlock2D", "DownBlock2D"),
        up_block_types=("UpBlock2D", "CrossAttnUpBlock2D"),
        layers_per_block=1,
        norm_num_groups=4,
        cross_attention_dim=width,
        attention_head_dim=4,
    )
    vae = AutoencoderKL(
        block_out_channels=(width,) * 4,
        down_block_types=("DownEncoderBlock2D",) * 4,
        up_block_types=("UpDecoderBlock2D",) * 4,
        latent_channels=4,
        norm_num_groups=4,
    )
    layers = {"num_hidden_layers": 1, "num_attention_heads": 2, "max_position_embeddings": 8}
    tokens = {"vocab_size": 3, "bos_token_id": 0, "eos_token_id": 1, "pad_token_id": 1}
    text_encoder = CLIPTextModel(CLIPTextConfig(hidden_size=width, intermediate_size=width, **layers, **tokens))
    return {"unet": unet, "vae": vae, "text_encoder": text_encoder}


def write_tiny_model(*, folder: Path, properties: dict[str, Any] = APPEARANCE) -> None:
    """Saves a pipeline of the real class."""
    from diffusers import DDIMScheduler, MarigoldIntrinsicsPipeline

    MarigoldIntrinsicsPipeline(
        **tiny_networks(),
        tokenizer=tiny_tokenizer(folder=folder / "words"),
        scheduler=DDIMScheduler(prediction_type="v_prediction", timestep_spacing="trailing", clip_sample=False),
        prediction_type="intrinsics",
        target_properties=properties,
        default_denoising_steps=2,
        default_processing_resolution=32,
    ).save_pretrained(folder)


def write_tiny_dataset(*, folder: Path) -> None:
    """The parts of a dataset that the tool reads: a list of scenes, and a picture of each."""
    from PIL import Image

    value = {"format": "mateval/3", "scenes": list(SIZES), "manifest_sha256": "d" * 64}
    write_json(path=folder / "dataset.json", value=value)
    for scene, (width, height) in SIZES.items():
        path = folder / "scenes" / scene / "views/input/rgb.png"
        path.parent.mkdir(parents=True)
        places = [(x, y, channel) for y in range(height) for x in range(width) for channel in range(3)]
        ramp = bytes((5 * x + 3 * y * (channel + 1)) % 256 for x, y, channel in places)
        Image.frombytes("RGB", (width, height), ramp).save(path)


@missing("diffusers", "transformers", "torch", "numpy", "PIL")
class Pipeline(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        complete_torch()
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.root = Path(scratch.name)
        write_tiny_model(folder=cls.root / "model")
        write_tiny_dataset(folder=cls.root / "dataset")
        cls.first = cls.root / "first"
        cls.first_run = cls.run_tool(out=cls.first)

    @classmethod
    def run_tool(cls, *words: str, out: Path, dataset: str = "dataset") -> subprocess.CompletedProcess:
        """Runs the tool in its own process, which must not access the network."""
        # This file calls the tool after it has completed torch.
        command = [sys.executable, __file__, "--as-tool", str(cls.root / dataset), str(out)]
        command += [*([] if "--model" in words else ["--model", str(cls.root / "model")]), *words]
        environment = os.environ | {"HF_HUB_OFFLINE": "1", "HF_HOME": str(cls.root / "hub")}
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)

    def fresh(self, name: str) -> Path:
        return self.root / f"{self.id().rsplit('.', 1)[1]}_{name}"

    def check_done(self, done: subprocess.CompletedProcess) -> None:
        self.assertEqual(done.returncode, 0, done.stderr)

    def check_refused(self, *words: str, expected: str, **more: Any) -> None:
        out = more.pop("out", self.fresh("out"))
        before = content(folder=out)
        done = self.run_tool(*words, out=out, **more)
        self.assertEqual((done.returncode, done.stdout), (2, ""), done.stderr)
        self.assertRegex(done.stderr.splitlines()[-1], f"^error: .*{expected}")
        self.assertEqual(content(folder=out), before)

    def test_every_scene_has_both_pictures_of_its_size(self) -> None:
        from PIL import Image

        self.check_done(self.first_run)
        self.assertEqual(self.first_run.stdout, "".join(f"{self.first / scene}\n" for scene in SIZES))
        names = [f"{scene}/{file}" for scene in SIZES for file in ("albedo.png", "material.png")]
        self.assertEqual(sorted(content(folder=self.first)), sorted([*names, "run.json"]))
        for scene, size in SIZES.items():
            for name in ("albedo.png", "material.png"):
                with Image.open(self.first / scene / name) as picture:
                    self.assertEqual((picture.mode, picture.size), ("RGB", size))
                    bands = [band.getextrema() for band in picture.split()]
                self.assertEqual([low == high for low, high in bands], [False, False, name == "material.png"])
            self.assertEqual(bands[2], (0, 0))

    def test_the_files_are_what_the_pipeline_predicts(self) -> None:
        import torch
        from PIL import Image

        pipe = tool.load(folder=self.root / "model", device="cpu", half=False)
        with Image.open(self.root / "dataset/scenes/attic/views/input/rgb.png") as picture:
            generator = torch.Generator().manual_seed(tool.scene_seed(seed=0, scene="attic"))
            albedo, material = 255 * pipe(picture, num_inference_steps=2, generator=generator).prediction
        expected = {"albedo.png": albedo, "material.png": material * [1, 1, 0]}
        for name, values in expected.items():
            with Image.open(self.first / "attic" / name) as picture:
                # A number near a half may be rounded either way.
                self.assertLess(abs(values.reshape(-1) - list(picture.tobytes())).max(), 0.51, name)

    def test_run_json_records_the_settings(self) -> None:
        run = json.loads((self.first / "run.json").read_text(encoding="utf-8"))
        expected = {"model": "model", "revision": None, "target_properties": APPEARANCE, "seed": 0, "steps": 2}
        expected |= {"ensemble": 1, "resolution": 32, "device": "cpu", "half": False}
        self.assertEqual({key: run[key] for key in expected}, expected)
        self.assertEqual(run["dataset_manifest_sha256"], "d" * 64)
        # Two networks with the same name have different hashes.
        self.assertEqual(run["weights_sha256"], tool.weights_sha256(folder=self.root / "model"))
        self.assertNotEqual(run["weights_sha256"], tool.weights_sha256(folder=self.root / "dataset"))
        hashes = {"dataset_manifest_sha256", "weights_sha256"}
        self.assertEqual(set(run) - set(expected), set(tool.NEEDED) | hashes)

    def test_the_same_seed_gives_the_same_bytes_for_a_single_scene_too(self) -> None:
        whole, out = content(folder=self.first), self.fresh("alone")
        self.check_done(self.run_tool("--scene", "cellar", out=out))
        alone = content(folder=out)
        self.assertEqual(sorted(alone), ["cellar/albedo.png", "cellar/material.png", "run.json"])
        self.assertEqual(alone, {name: whole[name] for name in alone})

    def test_other_settings_give_other_bytes(self) -> None:
        whole = content(folder=self.first)
        for words in (("--seed", "1"), ("--steps", "1"), ("--ensemble", "3"), ("--resolution", "16")):
            with self.subTest(words):
                out = self.fresh(words[0])
                self.check_done(self.run_tool("--scene", "attic", *words, out=out))
                other = content(folder=out)
                for name in ("attic/albedo.png", "attic/material.png", "run.json"):
                    self.assertNotEqual(other[name], whole[name])

    def test_a_run_resumes_and_force_starts_over(self) -> None:
        out, whole = self.fresh("out"), content(folder=self.first)
        self.check_done(self.run_tool("--scene", "attic", out=out))
        # The state after a kill during the second scene.
        (out / ".cellar.partial").mkdir()
        (out / ".cellar.partial/albedo.png").touch()
        (out / "attic/albedo.png").write_bytes(b"seen")
        done = self.run_tool(out=out)
        self.check_done(done)
        self.assertIn("1 of 2 scenes are finished already and skipped", done.stderr)
        self.assertEqual(content(folder=out), whole | {"attic/albedo.png": b"seen"})
        done = self.run_tool(out=out)
        self.check_done(done)
        self.assertEqual((done.stdout, "2 of 2 scenes" in done.stderr), ("", True))
        self.check_refused("--seed", "1", expected="made with seed 0, not 1; give --force", out=out)
        # A forced run that fails leaves no pictures made with seed 0.
        spoilt = self.fresh("spoilt")
        write_tiny_dataset(folder=spoilt)
        (spoilt / "scenes/attic/views/input/rgb.png").write_bytes(b"no picture")
        done = self.run_tool("--force", "--seed", "1", out=out, dataset=spoilt.name)
        self.assertEqual((done.returncode, list(content(folder=out))), (2, ["run.json"]))
        self.check_done(self.run_tool("--force", out=out))
        self.assertEqual(content(folder=out), whole)
        self.check_refused("--force", "--seed", "1", "--scene", "attic", expected="'cellar' would stay so", out=out)

    def test_missing_inputs_are_reported(self) -> None:
        self.check_refused("--scene", "garret", expected="no scene 'garret'; it has attic, cellar")
        self.check_refused(dataset="nowhere", expected="cannot read '.*nowhere/dataset.json'")
        self.check_refused("--model", "./nowhere", expected="no model './nowhere'")
        self.check_refused("--model", "nobody/nothing", expected="cannot fetch the model 'nobody/nothing': ")
        self.check_refused("--model", str(self.root / "dataset"), expected="cannot read '.*/model_index.json'")
        self.check_refused("--half", expected="--half is for graphics cards")

    def test_a_damaged_model_or_picture_is_reported(self) -> None:
        spoilt = self.fresh("model")
        write_tiny_model(folder=spoilt, properties=APPEARANCE | {"target_names": ["depth", "shading"]})
        self.check_refused("--model", str(spoilt), expected="expected albedo, as")
        (spoilt / "model_index.json").write_bytes((self.root / "model/model_index.json").read_bytes())
        (spoilt / "unet/diffusion_pytorch_model.safetensors").unlink()
        self.check_refused("--model", str(spoilt), expected="cannot load the model in")
        dataset = self.fresh("dataset")
        write_tiny_dataset(folder=dataset)
        (dataset / "scenes/cellar/views/input/rgb.png").write_bytes(b"no picture")
        out = self.fresh("half")
        done = self.run_tool(out=out, dataset=dataset.name)
        self.assertEqual((done.returncode, done.stdout), (2, f"{out / 'attic'}\n"))
        self.assertRegex(done.stderr, "error: cannot run the model on '.*cellar/views/input/rgb.png'")
        self.assertFalse((out / "cellar").exists())
        (dataset / "scenes/cellar/views/input/rgb.png").unlink()
        self.check_refused(dataset=dataset.name, expected="cellar/views/input/rgb.png' does not exist")


def content(*, folder: Path) -> dict[str, bytes]:
    """All files below a folder, by relative path."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


if __name__ == "__main__":
    if sys.argv[1:2] == ["--as-tool"]:
        complete_torch()
        sys.exit(tool.main(sys.argv[2:]))
    unittest.main()
