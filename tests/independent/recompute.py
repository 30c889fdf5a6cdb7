"""Computes every number of a result again from pictures, without MatEval's code.

Usage: `recompute.py DATASET PICTURES RESULT [WEIGHTS]`, where PICTURES was written by `mateval eval score --pictures` for
the one submission of RESULT. Needs what requirements.txt lists; LPIPS is compared where WEIGHTS names the file of weights,
which needs lpips, torch and safetensors too. Prints the largest differences and ends with 1 if one is above its bound.
PROTOCOL.md describes each step.
"""

import collections
import json
import pathlib
import sys

import flip_evaluator
import numpy as np
import OpenEXR
from PIL import Image
from scipy.ndimage import minimum_filter
from skimage.color import deltaE_ciede2000
from skimage.metrics import structural_similarity

BOUND = 1e-5
NETWORK_BOUND = 1e-4
SIDE_OF_BLOCKS = 16
# A window of SSIM has 11 pixels a side.
WINDOW = 11


def exr(path):
    channels = OpenEXR.File(str(path)).channels()
    if "RGB" in channels:
        return channels["RGB"].pixels.astype(np.float64)
    if {"R", "G", "B"} <= set(channels):
        return np.stack([channels[c].pixels for c in "RGB"], -1).astype(np.float64)
    return next(iter(channels.values())).pixels.astype(np.float64)


def mask_of(path):
    return np.array(Image.open(path)) > 127


def encoded(linear):
    """sRGB; values above 1 are clipped, the straight part continues below 0."""
    x = np.minimum(linear, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055)


# Seven digits; scikit-image's rgb2lab has six, and greys that are not quite neutral.
XYZ = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]])


def lab(linear):
    """CIE Lab under D65, which is the white of Rec. 709."""
    x = linear @ XYZ.T / XYZ.sum(1)
    f = np.where(x > 216 / 24389, np.cbrt(x), (24389 / 27 * x + 16) / 116)
    return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], -1)


def slope(x):
    return np.where(x <= 0.0031308, 12.92, 1.055 / 2.4 * np.maximum(x, 0.0031308) ** (1 / 2.4 - 1))


def psnr(mse):
    return min(-10 * np.log10(mse), 100.0) if mse > 0 else 100.0


def ssim_map(prediction, reference):
    """The mean of SSIM and its map, of encoded pictures."""
    options = dict(gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1.0, channel_axis=-1)
    return structural_similarity(prediction, reference, full=True, **options)


def whole_windows(mask):
    """The pixels whose window lies inside the mask."""
    return minimum_filter(mask.astype(np.uint8), WINDOW, mode="constant") > 0


def colour_difference(prediction, truth, mask):
    """The mean CIEDE2000 of linear pictures."""
    return deltaE_ciede2000(*(lab(np.clip(picture, 0, 1)) for picture in (prediction, truth)))[mask].mean()


#: The metrics of linear pictures of base colour, over the valid pixels of a view.
LINEAR_METRICS = {"delta_e": colour_difference}


def flip(prediction, reference, mask):
    """The mean FLIP; pixels outside the mask are the reference's."""
    filled = np.where(mask[..., None], prediction, reference)
    pair = [np.ascontiguousarray(picture, dtype=np.float32) for picture in (reference, filled)]
    return float(np.asarray(flip_evaluator.evaluate(*pair, "LDR", applyMagma=False)[0]).squeeze()[mask].mean())


#: Further metrics of encoded pictures, over the valid pixels of a view, and the kinds of pictures that have them.
ENCODED_METRICS = {"flip": (("rgb_true",), flip)}


class Similarity:
    """The metrics of two encoded pictures over a mask."""

    def __init__(self, weights):
        self.lpips = None
        if weights is None:
            print("LPIPS is not compared, since no weights were named")
            return
        import lpips
        import torch
        from safetensors.torch import load_file

        self.torch, self.lpips = torch, lpips.LPIPS(net="alex", spatial=True, pretrained=False, pnet_rand=True, verbose=False)
        self.load(dict(load_file(weights).items()))

    def load(self, state):
        own = self.lpips.state_dict()
        for k, layer in enumerate(("slice1.0", "slice2.3", "slice3.6", "slice4.8", "slice5.10"), 1):
            for part in ("weight", "bias"):
                own[f"net.{layer}.{part}"] = state[f"conv{k}.{part}"]
            # Both names are of one layer.
            for name in (f"lin{k - 1}.model.1.weight", f"lins.{k - 1}.model.1.weight"):
                own[name] = state[f"lin{k}.weight"].reshape(own[name].shape)
        self.lpips.load_state_dict(own)

    def values(self, kind, prediction, reference, mask):
        found = {}
        whole = whole_windows(mask)
        if whole.any():
            found["ssim"] = ssim_map(prediction, reference)[1].mean(-1)[whole].mean()
        filled = np.where(mask[..., None], prediction, reference)
        if self.lpips is not None and min(mask.shape) >= 32:
            tensor = lambda picture: self.torch.tensor(picture.transpose(2, 0, 1)[None] * 2 - 1, dtype=self.torch.float32)
            with self.torch.no_grad():
                found["lpips_alex"] = float(self.lpips(tensor(filled), tensor(reference))[0, 0].numpy()[mask].mean())
        of_kind = {name: value for name, (kinds, value) in ENCODED_METRICS.items() if kind in kinds}
        return found | {name: value(prediction, reference, mask) for name, value in of_kind.items()}


def blocks(camera, first, shape):
    """The block of each pixel: a square of the first camera's picture, continued beyond its frame."""
    k, rotation = camera["intrinsics"], np.array(camera["world_from_camera"])[:3, :3]
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    local = np.stack([(x - k["cx"]) / k["fx"], (k["cy"] - y) / k["fy"], -np.ones(shape)], -1)
    k, own = first["intrinsics"], np.array(first["world_from_camera"])[:3, :3]
    local = local @ rotation.T @ own
    column = np.floor((k["cx"] - k["fx"] * local[..., 0] / local[..., 2]) / SIDE_OF_BLOCKS)
    row = np.floor((k["cy"] + k["fy"] * local[..., 1] / local[..., 2]) / SIDE_OF_BLOCKS)
    return (row * 65536 + column).astype(np.int64)


def light(folder, valid):
    """X and u of both halves, and the pair that SSIM compares."""
    reference, ratio = exr(folder / "reference.exr"), exr(folder / "ratio.exr")
    quarters = [exr(folder / f"quarter_{at}.exr") for at in range(4)]
    halves = [(quarters[0] + quarters[1]) / 2, (quarters[2] + quarters[3]) / 2]
    x, u = [], []
    for half in range(2):
        other = 1 - half
        expected = np.clip(ratio * reference, 0, 1)[valid].sum()
        k = np.clip(np.clip(halves[other], 0, 1)[valid].sum() / expected, 0.1, 10) if expected > 0 else 1.0
        scaled = k * ratio * reference
        p = np.clip(exr(folder / f"guided_{other}.exr"), scaled / 2, 2 * scaled)
        s = np.where(p >= 1, 0, slope(np.minimum(p, 1)))
        p = np.clip(p, 0, 1)
        x.append(encoded(p) + s * (halves[half] - p) - encoded(reference))
        u.append(s * (quarters[2 * half] - quarters[2 * half + 1]) / 2)
    return x, u, encoded(np.clip(exr(folder / "shown.exr"), 0, 1)), encoded(np.clip(reference, 0, 1))


def sums_by_block(ids, values):
    order, index = np.unique(ids, return_inverse=True)
    return dict(zip(order.tolist(), np.bincount(index, weights=values)))


class LightError:
    """The error of one picture over a mask, with its noise by block."""

    def __init__(self, x, u, mask, ids):
        count = mask.sum() * 3
        self.mse = (x[0] * x[1])[mask].sum() / count
        by = lambda product: sums_by_block(ids[mask], product[mask].sum(-1) / count)
        self.sums = [by(x[1] * u[0]), by(x[0] * u[1]), by(u[0] * u[1])]

    @staticmethod
    def deviation(sums):
        squares = sum(v**2 for part in sums[:2] for v in part.values())
        return max(squares - sum(v**2 for v in sums[2].values()), squares / 2) ** 0.5

    def bounded(self):
        return max(self.mse, 1.645 * self.deviation(self.sums))


def mean_psnr_error(errors):
    total = [collections.Counter(), collections.Counter(), collections.Counter()]
    for error in errors:
        if error.bounded() > 0:
            factor = -10 / np.log(10) / error.bounded() / len(errors)
            for sums, own in zip(total, error.sums):
                for block, value in own.items():
                    sums[block] += factor * value
    return LightError.deviation(total)


def scene_means(dataset, pictures, scene, similarity):
    root = dataset / "scenes" / scene
    description = json.loads((root / "scene.json").read_text())
    values, noise = collections.defaultdict(list), collections.defaultdict(list)
    first = description["views"][0]["camera"]
    for view in description["views"]:
        name = view["id"]
        if name.startswith("wide_"):
            continue
        shown, hidden, made = root / "views" / name, root / "ground_truth/views" / name, pictures / scene / name
        valid = mask_of(shown / "valid.png")
        whole = "input" if name == "input" else "novel"
        regions = [(whole, valid)] + ([] if name == "input" else [("unobserved", mask_of(shown / "unobserved.png"))])
        specular = mask_of(hidden / "specular_region.png") & valid
        truth, prediction = exr(hidden / "albedo.exr"), exr(made / "albedo.exr")
        p, t = prediction[valid], truth[valid]
        squares = (p * p).sum(0)
        scale = np.where(squares > 0, (t * p).sum(0) / np.where(squares > 0, squares, 1), 1)
        for kind, picture in (("albedo", prediction), ("albedo_aligned", (prediction * scale).astype(np.float32).astype(np.float64))):
            for views, mask in regions:
                if not mask.any():
                    continue
                mse = ((picture - truth) ** 2)[mask].mean()
                values[kind, views, "mse"].append(mse)
                values[kind, views, "psnr"].append(psnr(mse))
            clipped = [np.clip(a, 0, 1) for a in (picture, truth)]
            for metric, value in similarity.values(kind, *map(encoded, clipped), valid).items():
                values[kind, whole, metric].append(value)
            for metric, value in LINEAR_METRICS.items():
                values[kind, whole, metric].append(value(picture, truth, valid))
        for kind in ("roughness", "metallic"):
            if not description["source"][f"states_{kind}"]:
                continue
            off = exr(made / f"{kind}.exr") - exr(hidden / f"{kind}.exr")
            off = np.where(np.abs(off) <= 0.505 / 255, 0, off)
            for views, mask in regions:
                if mask.any():
                    values[kind, views, "mae"].append(np.abs(off)[mask].mean())
                    values[kind, views, "mse"].append((off[mask] ** 2).mean())
            if specular.any():
                values[f"{kind}_specular", whole, "mae"].append(np.abs(off)[specular].mean())
        ids = blocks(view["camera"], first, valid.shape)
        for folder in sorted(path for path in made.iterdir() if path.is_dir()):
            kind = folder.name.partition("-")[0]
            x, u, prediction, reference = light(folder, valid)
            for views, mask in regions + ([(whole, specular)] if kind == "rgb_true" else []):
                if not mask.any():
                    continue
                picture = f"{kind}_specular" if mask is specular else kind
                error = LightError(x, u, mask, ids)
                values[picture, views, "mse"].append(error.mse)
                values[picture, views, "psnr"].append(psnr(error.bounded()))
                noise[f"{picture}.{views}.psnr"].append(error)
            for metric, value in similarity.values(kind, prediction, reference, valid).items():
                values[kind, whole, metric].append(value)
    texels = collections.defaultdict(lambda: [0.0, 0.0])
    for path in sorted((pictures / scene / "texels").glob("*.exr")):
        channels = {name: channel.pixels.astype(np.float64) for name, channel in OpenEXR.File(str(path), separate_channels=True).channels().items()}
        off = sum((channels[f"prediction.{c}"] - channels[f"truth.{c}"]) ** 2 for c in "RGB") / 3
        for views, part in (("observed", channels["observed"] > 0.5), ("unobserved", channels["observed"] <= 0.5)):
            texels[views][0] += (channels["area"] * off)[part].sum()
            texels[views][1] += channels["area"][part].sum()
    for views, (error, area) in texels.items():
        if area > 0:
            values["texture_base_color", views, "mse"].append(error / area)
            values["texture_base_color", views, "psnr"].append(psnr(error / area))
    means = {".".join(key): float(np.mean(found)) for key, found in values.items()}
    return means, {key: mean_psnr_error(errors) for key, errors in noise.items()}


def main(dataset, pictures, result, weights=None):
    dataset, pictures = pathlib.Path(dataset), pathlib.Path(pictures)
    result = json.loads(pathlib.Path(result).read_text())
    scores, similarity = result["protocols"]["mateval-3"], Similarity(weights)
    skipped = ["lpips_alex"] if similarity.lpips is None else []
    wrong, compared, worst = [], 0, {}

    def compare(place, stated, found):
        nonlocal compared
        metric = place.rsplit(".", 1)[-1]
        if metric in skipped:
            return
        compared += 1
        bound = NETWORK_BOUND if metric in ("lpips_alex", "flip") else BOUND
        # Decibels are relative: 1e-5 of an error of light is 4e-5 dB.
        bound *= max(1, abs(stated)) if metric == "psnr" else 1
        off = abs(stated - found) if found is not None else float("inf")
        worst[metric] = max(worst.get(metric, 0), off)
        if not off <= bound:
            wrong.append(f"{place}: stated {stated}, recomputed {found}")

    every = {}
    for scene, stated in scores["scenes"].items():
        means, noise = scene_means(dataset, pictures, scene, similarity)
        every[scene] = means
        for key, value in stated.items():
            if not key.split(".")[1].startswith("wide"):
                compare(f"{scene}: {key}", value, means.get(key))
        for key in means.keys() - stated.keys():
            if key.rsplit(".", 1)[-1] not in skipped and not any(m in key for m in result["not_predicted"]):
                wrong.append(f"{scene}: {key}: recomputed {means[key]}, not stated")
        for key, value in scores["noise"].get(scene, {}).items():
            if not key.split(".")[1].startswith("wide"):
                compare(f"{scene}: error of {key}", value, noise.get(key))
    for key, value in scores["summary"].items():
        found = [means[key] for means in every.values() if key in means]
        if not key.split(".")[1].startswith("wide"):
            compare(f"summary: {key}", value, float(np.mean(found)) if found else None)
    for metric, off in sorted(worst.items()):
        print(f"{metric}: largest difference {off:.1e}")
    print(f"{compared} numbers compared, {len(wrong)} wrong")
    print("\n".join(wrong[:40]))
    return 1 if wrong or not compared else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
