"""Prints the scores of a picture of one colour on the scene `room` of a dataset, computed without MatEval's code.

Usage: `grey_scores.py DATASET`, with NumPy, OpenEXR, Pillow and scikit-image. The values of the built-in room at 160x120
pixels are pinned in tests/suite/scores.rs.
"""

import pathlib
import sys

import numpy as np
import OpenEXR
from PIL import Image
from skimage.color import deltaE_ciede2000, rgb2lab
from skimage.metrics import structural_similarity

GREY = ((188 / 255 + 0.055) / 1.055) ** 2.4
# A window of SSIM reaches this far.
REACH = 5


def picture(path):
    channels = OpenEXR.File(str(path)).channels()
    pixels = channels["RGB"].pixels if "RGB" in channels else np.stack([channels[c].pixels for c in "RGB"], -1)
    return pixels.astype(np.float64)


def encoded(linear):
    x = np.clip(linear, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def ssim(a, b):
    options = dict(gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1.0, channel_axis=-1)
    return structural_similarity(a, b, full=True, **options)


def whole_windows(mask):
    inside = np.zeros_like(mask)
    for y in range(REACH, mask.shape[0] - REACH):
        for x in range(REACH, mask.shape[1] - REACH):
            inside[y, x] = mask[y - REACH : y + REACH + 1, x - REACH : x + REACH + 1].all()
    return inside


def mateval(truth, prediction, mask):
    """Errors of linear values, SSIM of the windows wholly inside."""
    mse = ((truth - prediction) ** 2)[mask].mean()
    windows = whole_windows(mask)
    return mse, ssim(encoded(truth), encoded(prediction))[1].mean(-1)[windows].mean() if windows.any() else None


def paper(truth, prediction, mask):
    """Everything of sRGB-encoded values, SSIM of pictures that are black outside."""
    truth, prediction = encoded(truth), encoded(prediction)
    mse = ((truth - prediction) ** 2)[mask].mean()
    return mse, ssim(np.where(mask[..., None], truth, 0), np.where(mask[..., None], prediction, 0))[0]


def main(dataset):
    room = pathlib.Path(dataset) / "scenes/room"
    novel = sorted(view.name for view in (room / "views").iterdir() if view.name != "input")
    for rules in (mateval, paper):
        for views, names, region in (("input", ["input"], "valid"), ("novel", novel, "valid"), ("unobserved", novel, "unobserved")):
            for aligned in (False, True):
                found = []
                for name in names:
                    truth = picture(room / "ground_truth/views" / name / "albedo.exr")
                    mask = lambda kind: np.array(Image.open(room / "views" / name / f"{kind}.png")) > 127
                    prediction = np.full_like(truth, GREY)
                    if aligned:
                        valid = mask("valid")
                        p, t = prediction[valid], truth[valid]
                        prediction = prediction * ((t * p).sum(0) / (p * p).sum(0))
                    mse, similarity = rules(truth, prediction, mask(region))
                    valid = mask("valid")
                    lab = [rgb2lab(encoded(picture)) for picture in (truth, prediction)]
                    found.append((mse, 10 * np.log10(1 / mse), similarity, deltaE_ciede2000(*lab)[valid].mean()))
                key = f"albedo{'_aligned' if aligned else ''}.{views}"
                for metric, values in zip(("mse", "psnr", "ssim", "delta_e"), zip(*found)):
                    if views == "unobserved" and metric in ("ssim", "delta_e"):
                        continue
                    print(rules.__name__, f"{key}.{metric}", f"{np.mean([v for v in values if v is not None]):.9f}")


if __name__ == "__main__":
    main(sys.argv[1])
