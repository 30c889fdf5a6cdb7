"""Writes grey_scores.json: the scores of a picture of one colour, computed without MatEval's code.

Usage: `grey_scores.py DATASET`, where DATASET is the built-in room at 160x120 pixels (`SCORED` in tests/suite/scores.rs pins
the numbers). Needs what requirements.txt lists.
"""

import json
import pathlib
import sys

import numpy as np
from recompute import LINEAR_METRICS, encoded, exr, mask_of, psnr, ssim_map, whole_windows

GREY = ((188 / 255 + 0.055) / 1.055) ** 2.4


def ssim_inside(prediction, reference, mask):
    return ssim_map(prediction, reference)[1].mean(-1)[whole_windows(mask)].mean()


def ssim_black_fill(prediction, reference, mask):
    return ssim_map(*(np.where(mask[..., None], picture, 0) for picture in (prediction, reference)))[0]


def srgb(linear):
    return encoded(np.clip(linear, 0, 1))


#: The space of the errors under both protocols.
SPACES = (lambda linear: linear, srgb)
SSIM = (ssim_inside, ssim_black_fill)


def scores(room, names, region, aligned, protocol):
    found = {}
    for name in names:
        truth = exr(room / "ground_truth/views" / name / "albedo.exr")
        valid, mask = (mask_of(room / "views" / name / f"{kind}.png") for kind in ("valid", region))
        prediction = np.full_like(truth, GREY)
        if aligned:
            p, t = prediction[valid], truth[valid]
            prediction = prediction * ((t * p).sum(0) / (p * p).sum(0))
        mse = ((SPACES[protocol](truth) - SPACES[protocol](prediction)) ** 2)[mask].mean()
        values = {"mse": mse, "psnr": psnr(mse)}
        if region == "valid":
            values["ssim"] = SSIM[protocol](srgb(prediction), srgb(truth), valid)
            values |= {metric: value(prediction, truth, valid) for metric, value in LINEAR_METRICS.items()}
        for metric, value in values.items():
            found.setdefault(metric, []).append(value)
    return {metric: float(np.mean(values)) for metric, values in found.items()}


def main(dataset):
    room = pathlib.Path(dataset) / "scenes/room"
    novel = sorted(view.name for view in (room / "views").iterdir() if view.name != "input")
    found = {}
    for views, names, region in (("input", ["input"], "valid"), ("novel", novel, "valid"), ("unobserved", novel, "unobserved")):
        for aligned in (False, True):
            both = [scores(room, names, region, aligned, protocol) for protocol in (0, 1)]
            for metric in both[0]:
                key = f"albedo{'_aligned' if aligned else ''}.{views}.{metric}"
                found[key] = [float(f"{values[metric]:.9f}") for values in both]
    rows = [f"  {json.dumps(key)}: {json.dumps(found[key])}" for key in sorted(found)]
    pathlib.Path(__file__).with_suffix(".json").write_text("{\n" + ",\n".join(rows) + "\n}\n")


if __name__ == "__main__":
    main(sys.argv[1])
