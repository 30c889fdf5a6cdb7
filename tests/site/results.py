"""Synthetic results and pictures, from which a leaderboard can be made without a dataset. All of it is CC0."""

import hashlib
import json
import math
import random
import re
import struct
import subprocess
import zlib
from collections.abc import Sequence
from pathlib import Path

EXAMPLE = Path(__file__).parents[2] / "dataset_spec/examples/result.json"
VIEWS = ["input", "up_left", "up_right", "down_left", "down_right"]
WEIGHTS = "b24653d691930ef38ebb65d7139a65227e482b1abcf5709f4805fe743fecb6c1"
MANIFEST = "5" * 64
#: The metrics of each picture: in all views, and in all but `unobserved`.
PICTURES = {
    "albedo": (["mse", "psnr"], ["ssim", "lpips_alex", "delta_e"]),
    "albedo_aligned": (["mse", "psnr"], ["ssim", "lpips_alex", "delta_e"]),
    "rgb_true": (["mse", "psnr"], ["ssim", "lpips_alex", "flip"]),
    "rgb_relit": (["mse", "psnr"], ["ssim", "lpips_alex"]),
    "roughness": (["mae", "mse"], []),
    "metallic": (["mae", "mse"], []),
    "rgb_true_specular": ([], ["mse", "psnr"]),
    "roughness_specular": ([], ["mae"]),
    "metallic_specular": ([], ["mae"]),
}
#: The view and the region whose picture stands for those of each kind of views.
PLACES = {"input": ("input", "valid"), "novel": ("up_left", "valid"), "unobserved": ("up_left", "unobserved")}
#: The standard error, in dB, of one kind of light in every scene.
NOISE = {"rgb_true.input.psnr": 0.04}
CATEGORIES = [("Sofa", "Seat"), ("Dining Table", "Table"), ("WallInner", "Architecture")]


def pretty(value: object) -> str:
    """JSON as MatEval writes it: 0.000025 without an exponent, smaller numbers with one without a leading zero, as in 1e-6."""
    text = json.dumps(value, indent=2, ensure_ascii=False) + "\n"
    text = re.sub(r"(?<=[ -])(\d)(?:\.(\d+))?e-05\b", r"0.0000\1\2", text)
    return re.sub(r"(?<=\de)([+-])0+(?=\d)", r"\1", text)


def sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def scene_names(count: int) -> list[str]:
    return [f"room-{number:03}" for number in range(count)]


def scene_pictures(*, scene: str, psnr: float, chance: random.Random, is_truth: bool) -> list[dict]:
    """One picture for each kind of views. Renders of the truth are equal to the reference."""
    pictures = []
    for picture, (everywhere, where_whole) in PICTURES.items():
        for views, (view, region) in PLACES.items():
            level = psnr + chance.gauss(0, 0.8) + (2 if views == "input" else 0)
            known = {
                "mse": 10 ** (-level / 10), "mae": 10 ** (-level / 20), "psnr": level, "ssim": 1 - 0.9 * math.exp(-level / 20),
                "lpips_alex": 0.9 * math.exp(-level / 15), "flip": 0.8 * math.exp(-level / 15), "delta_e": 60 * math.exp(-level / 15),
            }
            if is_truth and picture.startswith("rgb"):
                known |= {"mse": 0.0, "psnr": 100.0}
            metrics = everywhere + (where_whole if views != "unobserved" else [])
            if metrics:
                pictures.append({
                    "scene": scene, "view": view, "picture": picture, "region": region, "pixels": 1000,
                    "values": {metric: known[metric] for metric in metrics},
                })
    return pictures


def scene_means(pictures: list[dict]) -> dict[str, float]:
    """The values themselves, since each mean is that of one picture."""
    views = {place: views for views, place in PLACES.items()}
    return {
        f"{one['picture']}.{views[one['view'], one['region']]}.{metric}": value
        for one in pictures
        for metric, value in one["values"].items()
    }


def summary(scenes: list[dict[str, float]]) -> dict[str, float]:
    """Means over scenes. The sums are in plain order, as MatEval's are: `sum` corrects roundings, and a reader would refuse the result."""
    totals = dict.fromkeys(scenes[0], 0.0)
    for values in scenes:
        for key, value in values.items():
            totals[key] += value
    return {key: total / len(scenes) for key, total in totals.items()}


def summary_noise(count: int) -> dict[str, float]:
    """The standard errors of means over this number of scenes, whose noise is independent."""
    errors = {}
    for key, error in NOISE.items():
        squares = 0.0
        for _ in range(count):
            squares += error * error
        errors[key] = math.sqrt(squares) / count
    return errors


def instances(*, scenes: list[str], psnr: float) -> list[dict]:
    found = []
    for scene in scenes:
        for at, (category, super_category) in enumerate(CATEGORIES):
            for views in ["input", "novel"]:
                found.append({
                    "scene": scene, "instance": f"piece-{at}", "category": category, "super_category": super_category,
                    "picture": "albedo", "views": views, "pixels": 1000 * (at + 1), "mse": 10 ** (-psnr / 10) * (1 + at),
                })
    return found


def result(
    *, method: str, psnr: float, scenes: list[str], seed: int, not_predicted: Sequence[str] = (), manifest: str = MANIFEST,
    **said: object,
) -> dict:
    """A whole RESULT.json; two scenes share a house. Maps that are not predicted have no values."""
    example = json.loads(EXAMPLE.read_text())
    protocol = example["protocols"]["mateval-3"]["protocol"]
    chance = random.Random(seed)
    pictures = {}
    for at, scene in enumerate(scenes):
        # A scene is equally hard or easy for all methods.
        ease = random.Random(f"scene {at}").gauss(0, 2)
        of_scene = scene_pictures(scene=scene, psnr=psnr + ease, chance=chance, is_truth=method == "gt")
        pictures[scene] = [one for one in of_scene if not one["picture"].startswith(tuple(not_predicted))]
    values = {scene: scene_means(of_scene) for scene, of_scene in pictures.items()}
    scores = {
        "protocol": protocol,
        "fingerprint": sha256(pretty([protocol, manifest, scenes, WEIGHTS])),
        "summary": summary([values[scene] for scene in sorted(scenes)]),
        "scenes": values, "summary_noise": summary_noise(len(scenes)), "noise": {scene: dict(NOISE) for scene in scenes},
        "fits": {}, "pictures": [one for of_scene in pictures.values() for one in of_scene], "texels": [],
        "instances": instances(scenes=scenes, psnr=psnr),
    }
    return {
        "format": "mateval-result/6", "tool": "mateval 0.1.0", "method": method,
        "submission": {"sha256": sha256(method + str(seed)), "description": said.pop("description", ""), **said},
        "dataset": {
            "name": "synthetic", "version": "1.0", "manifest_sha256": manifest, "scenes": scenes,
            "total_scenes": len(scenes), "photo_renderer": "builtin",
            "houses": {scene: f"house-{at // 2 if len(scenes) > 12 else at}" for at, scene in enumerate(scenes)},
        },
        "lpips_weights": {"alex": WEIGHTS}, "protocols": {"mateval-3": scores},
        "not_predicted": list(not_predicted), "tracer_check": {"informative": 65, "agree": 65}, "missing": [], "findings": [],
    }


def add_wide_views(found: dict, *, psnr: float) -> None:
    """Adds a picture of albedo from two other places to each scene, the farther one worse, and the means of both."""
    views = {"wide_1": {"distance_m": 0.5, "unseen_share": 0.1}, "wide_2": {"distance_m": 1.5, "unseen_share": 0.5}}
    scores, scenes = found["protocols"]["mateval-3"], found["dataset"]["scenes"]
    found["dataset"]["wide_views"] = {scene: views for scene in scenes}
    levels = [psnr - 2 * views[view]["distance_m"] for view in views]
    for scene in scenes:
        for view, level in zip(views, levels):
            values = {"mse": 10 ** (-level / 10), "psnr": level}
            scores["pictures"].append({
                "scene": scene, "view": view, "picture": "albedo", "region": "valid", "pixels": 1000, "values": values,
            })
        scores["scenes"][scene]["albedo.wide.mse"] = sum(10 ** (-level / 10) for level in levels) / len(levels)
        scores["scenes"][scene]["albedo.wide.psnr"] = sum(levels) / len(levels)
    scores["summary"] = summary([scores["scenes"][scene] for scene in sorted(scenes)])


def add_constancy(found: dict, *, ratio: float) -> None:
    """Adds how far a method's answers to each scene and its twin lie apart, as a share of the contrast."""
    part = {"deviation": 0.25 * ratio, "contrast": 0.25}
    spread = {"linear": 0.1 * ratio, "delta_e": 10 * ratio, "luminance": part, "chroma": part, "relative": ratio}
    found["constancy"] = [
        {"scene": scene, "lightings": ["alone_1"], "area_m2": 9.0, "raw": spread, "aligned": spread, "mean_mse": 0.01,
         "mean_delta_e": 12.0}
        for scene in found["dataset"]["scenes"]
    ]


def write_verification(path: Path, *, confirmed: bool, key: Path) -> None:
    """Writes the file that `eval verify` writes beside a result, and signs it with the program minisign."""
    found = json.loads(path.read_text())
    verification = path.with_suffix(".verified.json")
    verification.write_text(pretty({
        "format": "mateval-verification/1", "tool": "mateval 0.1.0", "result_sha256": sha256(path.read_text()),
        "submission_sha256": found["submission"]["sha256"],
        "dataset_manifest_sha256": MANIFEST, "confirmed": confirmed, "differences": 0, "findings": [],
    }))
    subprocess.run(["minisign", "-S", "-s", key, "-m", verification], check=True, stdout=subprocess.DEVNULL)


def write_png(path: Path, *, width: int, height: int, color) -> None:
    """Writes an 8-bit RGB PNG; `color` returns the bytes of a pixel."""
    rows = b"".join(b"\0" + bytes(v for x in range(width) for v in color(x, y)) for y in range(height))
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def write_pictures(folder: Path, *, methods: dict[str, float], scenes: list[str], width: int = 96, height: int = 54) -> None:
    """Draws a floor and a wall for each scene. `methods` holds, by id, the share by which a method's colours are wrong."""
    def room(scene: int, view: int, miss: float):
        base = [60 + 40 * ((scene + c) % 4) for c in range(3)]
        horizon = height * (0.45 + 0.05 * view)
        def color(x: int, y: int) -> list[int]:
            check = 25 if y > horizon and (x // 8 + y // 6) % 2 else 0
            level = [v + check + (30 if y < horizon else 0) for v in base]
            return [min(255, max(0, round(v * (1 - miss) + miss * 200 * x / width))) for v in level]
        return color

    for s, scene in enumerate(scenes):
        for v, view in enumerate(VIEWS):
            place = lambda method, kind: folder / method / scene / view / f"{kind}.png"
            for kind in ["albedo", "rgb_true"]:
                write_png(place("_truth", kind), width=width, height=height, color=room(s, v, 0.0))
                for method, miss in methods.items():
                    write_png(place(method, kind), width=width, height=height, color=room(s, v, miss))
            for method, miss in methods.items():
                heat = lambda x, y, miss=miss: [min(255, round(700 * miss * x / width)), min(255, round(300 * miss * x / width)), 0]
                write_png(place(method, "albedo-error"), width=width, height=height, color=heat)
