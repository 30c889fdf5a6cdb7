#!/usr/bin/env python3
"""Writes vectors.json: the values that scikit-image and lpips compute for the pictures of mod.rs.

Run it where these are installed, on the CPU:

    pip install numpy scikit-image torch torchvision lpips safetensors
    python3 make_vectors.py

The pictures are generated here again from the same integers as in mod.rs; their SHA-256 in vectors.json ties the two
together. The networks of lpips get the weights that `mateval fetch lpips` writes, which hold its linear layers
too, so that nothing is downloaded. vectors.json changes only together with mod.rs or with a version below.
"""

from __future__ import annotations

import hashlib
import json
import os
from importlib.metadata import version
from pathlib import Path

import lpips
import numpy as np
import torch
from safetensors.numpy import load_file
from skimage.metrics import mean_squared_error, peak_signal_noise_ratio, structural_similarity

HERE = Path(__file__).resolve().parent
RADIUS = 5  # of SSIM's window
ROUNDED = 12  # digits kept: more than any tolerance needs


# --- The pictures of mod.rs ---------------------------------------------------------------------------------

MASK_64 = (1 << 64) - 1


def number(seed: int, index: int) -> int:
    """The number at `index` of the sequence of SplitMix64 from `seed`."""
    z = (seed + (index + 1) * 0x9E3779B97F4A7C15) & MASK_64
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK_64
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK_64
    return z ^ (z >> 31)


def triangle_wave(at: int, period: int) -> int:
    """0 to 255 and back over `period`."""
    within = at % period
    return min(within, period - within) * 510 // period


def tiles(x: int, y: int, c: int) -> int:
    """Flat tiles with a gradient and a fine grain."""
    tile = (y // 9) * 16 + x // 10
    return number(7, 3 * tile + c) % 200 + (3 * x + 2 * y) % 40 + number(8, (y * 128 + x) * 3 + c) % 16


def waves(x: int, y: int, c: int) -> int:
    """Slanted waves, slightly shifted in each channel."""
    return (2 * triangle_wave(3 * x + 2 * y, 64 + 8 * c) + triangle_wave(5 * y + 2 * x, 37)) // 3


REFERENCES = {"tiles": (80, 72, tiles), "waves": (64, 67, waves)}
PREDICTIONS = ("noise", "shift", "blur", "darker", "grey")


def picture(width: int, height: int, value: object) -> np.ndarray:
    """[height, width, 3] bytes."""
    values = [[[value(x, y, c) for c in range(3)] for x in range(width)] for y in range(height)]
    return np.array(values, dtype=np.int64).astype(np.uint8)


def predicted(reference: np.ndarray, kind: str) -> np.ndarray:
    """The reference with errors as a method might make them."""
    height, width, _ = reference.shape
    at = lambda x, y, c: int(reference[min(max(y, 0), height - 1), min(max(x, 0), width - 1), c])
    kinds = {
        "noise": lambda x, y, c: min(max(at(x, y, c) + number(9, (y * 128 + x) * 3 + c) % 81 - 40, 0), 255),
        "shift": lambda x, y, c: at(x - 3, y + 2, c),
        "blur": lambda x, y, c: sum(at(x + dx, y + dy, c) for dy in (-1, 0, 1) for dx in (-1, 0, 1)) // 9,
        "darker": lambda x, y, c: at(x, y, c) * (2 + c) // 5,
        "grey": lambda x, y, c: 128,
    }
    return picture(width, height, kinds[kind])


def mask_of(width: int, height: int) -> np.ndarray:
    """A disc and a bar."""
    inside = lambda x, y: (x - width // 2) ** 2 + (y - height // 2) ** 2 < 30**2 or 3 <= x < 17
    return np.array([[inside(x, y) for x in range(width)] for y in range(height)])


# --- The values --------------------------------------------------------------------------------------------------


def ssim_map(p: np.ndarray, r: np.ndarray) -> np.ndarray:
    """The mean over channels of the index of every window, by the position of its centre."""
    _, full = structural_similarity(
        p, r, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1.0, channel_axis=2, full=True
    )
    return full.mean(axis=2)


def windows_inside(mask: np.ndarray) -> np.ndarray:
    """The centres of the windows that lie wholly inside the picture and the mask."""
    height, width = mask.shape
    found = np.zeros_like(mask)
    for y in range(RADIUS, height - RADIUS):
        for x in range(RADIUS, width - RADIUS):
            found[y, x] = mask[y - RADIUS : y + RADIUS + 1, x - RADIUS : x + RADIUS + 1].all()
    return found


def network(net: str) -> lpips.LPIPS:
    """LPIPS v0.1 with our weights."""
    cache = os.environ.get("MATEVAL_CACHE") or Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "mateval"
    weights = load_file(Path(cache) / f"lpips-{net}-v0.1.safetensors")
    model = lpips.LPIPS(net=net, pretrained=False, pnet_rand=True, spatial=True, verbose=False)
    convolutions = [module for module in model.net.modules() if isinstance(module, torch.nn.Conv2d)]
    with torch.no_grad():
        for index, module in enumerate(convolutions, 1):
            module.weight.copy_(torch.from_numpy(weights[f"conv{index}.weight"]))
            module.bias.copy_(torch.from_numpy(weights[f"conv{index}.bias"]))
        for index, linear in enumerate(model.lins, 1):
            linear.model[-1].weight.copy_(torch.from_numpy(weights[f"lin{index}.weight"]).reshape(1, -1, 1, 1))
    assert len(weights) == 2 * len(convolutions) + len(model.lins)
    return model.eval()


def lpips_of(model: lpips.LPIPS, p: np.ndarray, r: np.ndarray) -> tuple[float, np.ndarray]:
    """The distance over whole pictures, and the map of distances at their pixels."""
    tensors = [torch.from_numpy((2 * v - 1).transpose(2, 0, 1)[None].astype(np.float32)) for v in (p, r)]
    with torch.no_grad():
        model.spatial = False
        whole = float(model(*tensors))
        model.spatial = True
        return whole, model(*tensors)[0, 0].double().numpy()


def values(models: dict[str, lpips.LPIPS], p: np.ndarray, r: np.ndarray, mask: np.ndarray) -> dict[str, float | int]:
    """All values that are compared; `p` and `r` are bytes."""
    p, r = p / 255.0, r / 255.0
    black_p, black_r = p * mask[..., None], r * mask[..., None]
    inside = windows_inside(mask)
    crop = np.s_[RADIUS:-RADIUS, RADIUS:-RADIUS]
    masked_mse = mean_squared_error(r[mask], p[mask])
    found = {
        "mse": mean_squared_error(r, p),
        "psnr": peak_signal_noise_ratio(r, p, data_range=1.0),
        "ssim": ssim_map(p, r)[crop].mean(),
        "masked_mse": masked_mse,
        "masked_psnr": peak_signal_noise_ratio(r[mask], p[mask], data_range=1.0),
        "masked_ssim_valid_windows": ssim_map(p, r)[inside].mean(),
        "blackfill_ssim": ssim_map(black_p, black_r)[crop].mean(),
    }
    filled = np.where(mask[..., None], p, r)
    for net, model in models.items():
        found[f"lpips_{net}"] = lpips_of(model, p, r)[0]
        found[f"blackfill_lpips_{net}"] = lpips_of(model, black_p, black_r)[0]
        found[f"masked_lpips_{net}"] = lpips_of(model, filled, r)[1].sum() / mask.sum()
    return {"valid_windows": int(inside.sum())} | {key: float(f"{value:.{ROUNDED}g}") for key, value in found.items()}


def sha256(picture: np.ndarray) -> str:
    """The SHA-256 of the bytes, row by row."""
    return hashlib.sha256(np.ascontiguousarray(picture).tobytes()).hexdigest()


def main() -> None:
    """Writes vectors.json beside this script."""
    torch.set_num_threads(1)
    models = {net: network(net) for net in ("alex", "vgg")}
    cases = []
    for name, (width, height, value) in REFERENCES.items():
        reference, mask = picture(width, height, value), mask_of(width, height)
        for kind in PREDICTIONS:
            prediction = predicted(reference, kind)
            hashes = [sha256(prediction), sha256(reference), sha256(mask.astype(np.uint8))]
            names = {"reference": name, "prediction": kind, "sha256": hashes}
            cases.append(names | values(models, prediction, reference, mask))
            print(name, kind)
    versions = {package: version(package) for package in ("scikit-image", "lpips", "torch", "numpy")}
    text = json.dumps({"made_with": versions, "cases": cases}, indent=1)
    (HERE / "vectors.json").write_text(text + "\n")


if __name__ == "__main__":
    main()
