#!/usr/bin/env python3
"""Runs Marigold IID on a dataset's input pictures; `mateval baseline --adapter marigold` reads the result.

Input: a dataset's folder, whose `scenes/<scene>/views/input/rgb.png` are the pictures, and the model: a folder, or an
id that diffusers downloads from Hugging Face (once, 5 GB). Output: `OUT/<scene>/albedo.png` and
`OUT/<scene>/material.png` (red: roughness, green: metallic, blue: 0), 8-bit, of the picture's size, and `OUT/run.json`,
which records how they were made. Finished scenes are skipped, so that a run that was killed resumes.

The model is IID appearance, or IID lighting (--model prs-eth/marigold-iid-lighting-v1-1), which predicts neither
roughness nor metallic: of the latter only `albedo.png` is written, and not its shading and residual.

The files hold the model's own numbers, times 255 and rounded; the adapter states their encoding. There is one
exception: an albedo that the model's configuration calls linear is encoded by the power 1/2.2, as diffusers does to
show it. The configuration's encoding of roughness and metallic is ignored. It calls them linear, but the authors encode
them by the power 1/2.2 for training and decode predictions by 2.2 for scoring (github.com/prs-eth/Marigold,
src/dataset/interiorverse_dataset.py and script/iid/eval.py).

The noise of a scene depends on `--seed` and the scene's id only.

Licences: Marigold's code Apache-2.0, its weights CreativeML Open RAIL++-M.

Needs Python 3.11 and tools/requirements_marigold.txt. Exit code 0: the files exist; 2: they could not be made.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.metadata
import json
import os
import re
import shutil
import sys
from pathlib import Path
from typing import Any, NamedTuple

MODEL = "prs-eth/marigold-iid-appearance-v1-1"
NEEDED = ("diffusers", "transformers", "torch", "numpy", "pillow")
SCENE_ID = re.compile(r"[a-z0-9][a-z0-9_-]{0,63}")
HUB_ID = re.compile(r"[\w-][\w.-]*/[\w.-]+")


class RunError(Exception):
    """An error with a message for the user."""


class Places(NamedTuple):
    """The targets and channels of albedo, roughness and metallic in a prediction."""

    albedo: int  # target
    albedo_is_linear: bool
    material: int | None  # target; None where the model predicts no material, then roughness and metallic too
    roughness: int | None  # its channel
    metallic: int | None  # its channel


# --- The run's input --------------------------------------------------------------------------------------------


def first_line(problem: Exception) -> str:
    """Returns an error's message as one line."""
    return (str(problem) or type(problem).__name__).splitlines()[0]


def read_json(*, path: Path, what: str) -> dict[str, Any]:
    """Returns the object in a JSON file."""
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as problem:
        raise RunError(f"cannot read '{path}', {what}: {problem}") from problem
    if not isinstance(value, dict):
        raise RunError(f"'{path}' should hold a JSON object, {what}; found {type(value).__name__}")
    return value


def input_pictures(*, dataset: Path, wanted: list[str] | None) -> dict[str, Path]:
    """Returns the input pictures of the wanted scenes (all by default) by id, in the dataset's order."""
    scenes = read_json(path=dataset / "dataset.json", what="which every dataset has").get("scenes")
    if not (isinstance(scenes, list) and all(isinstance(s, str) and SCENE_ID.fullmatch(s) for s in scenes)):
        raise RunError(f"`scenes` in '{dataset / 'dataset.json'}' should be a list of ids; found {scenes!r}")
    unknown = sorted(set(wanted or ()) - set(scenes))
    if unknown:
        raise RunError(f"the dataset '{dataset}' has no scene '{unknown[0]}'; it has {', '.join(scenes)}")
    found = {s: dataset / "scenes" / s / "views/input/rgb.png" for s in scenes if not wanted or s in wanted}
    missing = [path for path in found.values() if not path.is_file()]
    if missing:
        raise RunError(f"'{missing[0]}' does not exist ({len(missing)} missing); run mateval prep render")
    return found


def model_folder(*, model: str, half: bool) -> tuple[Path, str | None]:
    """Returns the model's local folder, and its revision where that is known. Downloads the model where necessary."""
    if Path(model).is_dir():
        return Path(model), None
    if not HUB_ID.fullmatch(model):
        raise RunError(f"no model '{model}' found; expected a folder with a model_index.json, or an id such as {MODEL}")
    from diffusers import MarigoldIntrinsicsPipeline

    try:
        folder = Path(MarigoldIntrinsicsPipeline.download(model, variant="fp16" if half else None))
    except Exception as problem:  # the hub's client raises unrelated kinds of errors
        hint = "fetch it elsewhere and name its folder"
        raise RunError(f"cannot fetch the model '{model}': {first_line(problem)}; {hint}") from problem
    return folder, folder.name if folder.parent.name == "snapshots" else None


def places(*, properties: Any) -> Places:
    """Finds albedo, and roughness and metallic if the model predicts them, in the model's `target_properties`."""
    properties = properties if isinstance(properties, dict) else {}
    names = properties.get("target_names") or []
    if "albedo" not in names:
        raise RunError(f"the model predicts {names}; expected albedo, as {MODEL} does")
    space = properties.get("albedo", {}).get("prediction_space", "srgb")
    if space not in ("srgb", "linear"):
        raise RunError(f"the model's albedo is in the space '{space}'; expected srgb or linear")
    if "material" not in names:
        return Places(names.index("albedo"), space == "linear", None, None, None)
    channels = properties.get("material", {}).get("sub_target_names") or []
    if len(channels) != 3 or not {"roughness", "metallicity"} <= set(channels):
        raise RunError(f"the model's material holds {channels}; expected roughness and metallicity among three")
    spots = names.index("albedo"), space == "linear", names.index("material")
    return Places(*spots, channels.index("roughness"), channels.index("metallicity"))


def weights_sha256(*, folder: Path) -> str:
    """Returns a hash of the weights of the model's network, in hexadecimal digits."""
    digest = hashlib.sha256()
    for path in sorted(p for p in (folder / "unet").glob("*") if p.suffix in (".safetensors", ".bin")):
        with path.open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()


def settings(
    *, words: argparse.Namespace, folder: Path, config: dict[str, Any], revision: str | None
) -> dict[str, Any]:
    """Returns everything that the pictures depend on, as `run.json` records it."""
    dataset = read_json(path=words.dataset / "dataset.json", what="which every dataset has")
    asked = {
        "dataset_manifest_sha256": dataset.get("manifest_sha256"),
        "model": Path(words.model).resolve().name if Path(words.model).is_dir() else words.model,
        "revision": revision,
        "weights_sha256": weights_sha256(folder=folder),
        "target_properties": config.get("target_properties"),
        "steps": words.steps or config.get("default_denoising_steps"),
        "ensemble": words.ensemble,
        "resolution": config.get("default_processing_resolution") if words.resolution is None else words.resolution,
        "seed": words.seed,
        "device": words.device,
        "half": words.half,
    }
    return asked | {name: importlib.metadata.version(name) for name in NEEDED}


def check_out(*, out: Path, asked: dict[str, Any], scenes: list[str], force: bool) -> None:
    """Refuses a folder that holds other files, or pictures that were made with other settings and would be kept."""
    there = sorted(p.name for p in out.iterdir() if not p.name.startswith(".")) if out.exists() else []
    if not there:
        return
    if "run.json" not in there:
        raise RunError(f"'{out}' holds '{there[0]}' but no run.json, so it is not this tool's; choose another folder")
    made = read_json(path=out / "run.json", what="which says how the pictures beside it were made")
    other = [key for key in {**asked, **made} if made.get(key) != asked.get(key)]
    stay = sorted(set(there) - {"run.json"} - set(scenes))
    if other and (stay or not force):
        hint = f"'{stay[0]}' would stay so; choose another one" if force else "give --force, or choose another folder"
        key = other[0]
        raise RunError(f"'{out}' was made with {key} {made.get(key)!r}, not {asked.get(key)!r}; {hint}")


# --- Pictures -----------------------------------------------------------------------------------------------------


def scene_seed(*, seed: int, scene: str) -> int:
    """Returns a seed of 63 bits that depends on the given seed and this scene only."""
    return int.from_bytes(hashlib.sha256(f"{seed} {scene}".encode("ascii")).digest()[:8], "big") >> 1


def pictures(*, prediction: Any, where: Places) -> tuple[Any, Any]:
    """Returns albedo and material as 8-bit pictures; the pipeline gives [target, row, column, channel] from 0 to 1.

    The material is None for a model without one.
    """
    import numpy as np

    if not np.isfinite(prediction).all():
        raise RunError("the prediction has numbers that are not finite; run without --half")
    both = np.zeros((2, *prediction.shape[1:]))
    both[0] = prediction[where.albedo] ** (1 / 2.2 if where.albedo_is_linear else 1)
    if where.material is not None:
        both[1, ..., 0] = prediction[where.material, ..., where.roughness]
        both[1, ..., 1] = prediction[where.material, ..., where.metallic]
    albedo, material = np.rint(255 * np.clip(both, 0, 1)).astype(np.uint8)
    return albedo, None if where.material is None else material


def load(*, folder: Path, device: str, half: bool) -> Any:
    """Returns the pipeline on its device."""
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # makes CUDA deterministic
    import torch
    from diffusers import MarigoldIntrinsicsPipeline
    from diffusers.utils.logging import disable_progress_bar

    if not sys.stderr.isatty():
        disable_progress_bar()
    if device == "cuda" and not torch.cuda.is_available():
        raise RunError("torch finds no CUDA device; expected one for --device cuda; run with --device cpu")
    torch.use_deterministic_algorithms(True, warn_only=True)
    words: dict[str, Any] = {"torch_dtype": torch.float32, "low_cpu_mem_usage": False}
    if half:
        words |= {"torch_dtype": torch.float16, "variant": "fp16" if any(folder.rglob("*.fp16.*")) else None}
    try:
        pipe = MarigoldIntrinsicsPipeline.from_pretrained(folder, **words).to(device)
    except (OSError, ValueError) as problem:
        raise RunError(f"cannot load the model in '{folder}': {first_line(problem)}; download it again") from problem
    pipe.set_progress_bar_config(disable=True)
    return pipe


def predict(*, pipe: Any, picture: Path, seed: int, asked: dict[str, Any]) -> Any:
    """Returns the pipeline's prediction for one picture, at the picture's size."""
    import torch
    from PIL import Image

    with Image.open(picture) as image:
        rgb = image.convert("RGB")
    # The noise is drawn on the CPU, so that it is the same for every device.
    generator = torch.Generator("cpu").manual_seed(seed)
    numbers = {"num_inference_steps": asked["steps"], "ensemble_size": asked["ensemble"]}
    return pipe(rgb, processing_resolution=asked["resolution"], generator=generator, **numbers).prediction


def write_scene(*, folder: Path, albedo: Any, material: Any) -> None:
    """Writes a scene's pictures so that its folder is complete or absent."""
    from PIL import Image

    beside = folder.parent / f".{folder.name}.partial"
    shutil.rmtree(beside, ignore_errors=True)
    beside.mkdir()
    Image.fromarray(albedo).save(beside / "albedo.png")
    if material is not None:
        Image.fromarray(material).save(beside / "material.png")
    beside.rename(folder)


def write_run(*, path: Path, asked: dict[str, Any]) -> None:
    """Writes `run.json` under a temporary name and renames it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(".run.json.partial")
    beside.write_text(json.dumps(asked, indent=2) + "\n", encoding="utf-8")
    beside.replace(path)


# --- The run ----------------------------------------------------------------------------------------------


def run(*, words: argparse.Namespace) -> None:
    """Checks the input, then makes the pictures scene by scene."""
    if words.half and words.device == "cpu":
        raise RunError("--half is for graphics cards; add --device cuda, or leave it out")
    found = input_pictures(dataset=words.dataset, wanted=words.scene)
    folder, revision = model_folder(model=words.model, half=words.half)
    config = read_json(path=folder / "model_index.json", what="which every model of diffusers has")
    where = places(properties=config.get("target_properties"))
    asked = settings(words=words, folder=folder, config=config, revision=revision)
    check_out(out=words.out, asked=asked, scenes=list(found), force=words.force)
    todo = {scene: path for scene, path in found.items() if words.force or not (words.out / scene).is_dir()}
    print(f"{len(found) - len(todo)} of {len(found)} scenes are finished already and skipped", file=sys.stderr)
    pipe = load(folder=folder, device=words.device, half=words.half) if todo else None
    # Written first, so that pictures with other settings do not look finished if this run is killed.
    for scene in todo:
        shutil.rmtree(words.out / scene, ignore_errors=True)
    write_run(path=words.out / "run.json", asked=asked)
    for number, (scene, path) in enumerate(todo.items(), start=1):
        print(f"scene '{scene}' ({number} of {len(todo)})", file=sys.stderr)
        try:
            seed = scene_seed(seed=words.seed, scene=scene)
            prediction = predict(pipe=pipe, picture=path, seed=seed, asked=asked)
        except (OSError, ValueError, RuntimeError) as problem:  # torch raises RuntimeError if memory is short
            raise RunError(f"cannot run the model on '{path}': {first_line(problem)}") from problem
        albedo, material = pictures(prediction=prediction, where=where)
        write_scene(folder=words.out / scene, albedo=albedo, material=material)
        print(words.out / scene)


def at_least(smallest: int) -> Any:
    """Returns a parser of integers that are at least `smallest`."""

    def whole_number(text: str) -> int:
        if int(text) < smallest:
            raise argparse.ArgumentTypeError(f"'{text}' is smaller than {smallest}")
        return int(text)

    return whole_number


def main(arguments: list[str] | None = None) -> int:
    """Runs the tool with command-line arguments and returns the exit code."""
    parser = argparse.ArgumentParser(description="run Marigold IID on a dataset's input pictures")
    parser.add_argument("dataset", type=Path, metavar="DATASET", help="folder of the dataset, which must be rendered")
    parser.add_argument("out", type=Path, metavar="OUT", help="folder for the pictures")
    parser.add_argument("--model", default=MODEL, metavar="ID_OR_FOLDER", help="the model (default: %(default)s)")
    parser.add_argument("--scene", action="append", metavar="ID", help="run this scene only; may be repeated")
    parser.add_argument("--steps", type=at_least(1), metavar="N", help="denoising steps (default: the model's)")
    about = "predictions to take the median of (default: 1)"
    parser.add_argument("--ensemble", type=at_least(1), default=1, metavar="N", help=about)
    about = "longer side in pixels, 0 for the picture's own (default: the model's)"
    parser.add_argument("--resolution", type=at_least(0), metavar="N", help=about)
    parser.add_argument("--seed", type=at_least(0), default=0, metavar="N", help="seed of the noise (default: 0)")
    about = "where the model runs (default: %(default)s)"
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help=about)
    about = "16-bit floats, which need less memory and change the numbers"
    parser.add_argument("--half", action="store_true", help=about)
    parser.add_argument("--force", action="store_true", help="make pictures again that exist")
    words = parser.parse_args(arguments)
    try:
        run(words=words)
    except (ImportError, importlib.metadata.PackageNotFoundError) as problem:
        print(f"error: {problem}; install tools/requirements_marigold.txt as its first lines describe", file=sys.stderr)
        return 2
    except RunError as problem:
        print(f"error: {problem}", file=sys.stderr)
        return 2
    except OSError as problem:
        print(f"error: cannot write to '{words.out}': {problem}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
