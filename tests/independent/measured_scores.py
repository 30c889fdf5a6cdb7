"""Prints the numbers that crates/metrics/src/measured.rs pins, computed without MatEval's code.

Usage: `measured_scores.py`. Needs NumPy, Pillow and colour-science. MAW's two numbers follow `numerical_albedo.py` of
MeasuredAlbedo/code.
"""

import colour
import numpy as np
from PIL import Image


class Draws:
    """Numbers of 0 to 1 from a linear congruence."""

    def __init__(self, seed):
        self.state = seed

    def next(self):
        self.state = (self.state * 1664525 + 1013904223) % 2**32
        return (self.state >> 8) / 2**24

    def color(self):
        return [self.next(), self.next(), self.next()]


def region_set(seed):
    draws = Draws(seed)
    regions = [(1 + int(draws.next() * 500), draws.color(), draws.color()) for _ in range(2 + seed % 7)]
    return [np.array(column, float) for column in zip(*regions)]


def encoded(linear):
    curve = np.where(linear > 0.0031308, 1.055 * np.power(linear, 1 / 2.4) - 0.055, 12.92 * linear)
    return np.minimum(curve, 1.0)


def lab(linear):
    return colour.XYZ_to_Lab(colour.sRGB_to_XYZ(encoded(linear)))


def factor(weights, x, y):
    return np.sum(weights * x * y) / max(np.sum(weights * x * x), 1e-6)


def scores(seed):
    pixels, predicted, measured = region_set(seed)
    grey = [colors.mean(-1) for colors in (predicted, measured)]
    intensity = np.square(factor(pixels, *grey) * grey[0] - grey[1])
    own = np.array([factor(1.0, p, m) for p, m in zip(*grey)])
    chromaticity = colour.delta_E(lab(measured), lab(own[:, None] * predicted))
    absolute = colour.delta_E(lab(measured), lab(predicted))
    weighted = [np.average(values, weights=pixels) for values in (intensity, chromaticity)]
    return [*weighted, absolute.mean()]


def checksum(values):
    total = 0
    for value in np.asarray(values).reshape(-1).tolist():
        total = (total * 31 + value) % 2**32
    return total


def main():
    for seed in range(1, 21):
        print("[" + ", ".join(f"{value:.9f}" for value in scores(seed)) + "],")
    for width, height in ((50, 37), (640, 400), (321, 240)):
        y, x = np.mgrid[:height, :width]
        levels = np.stack([(7 * x + 3 * y) % 256, (x * y) % 256, (x // 5 * 40 + y) % 256], -1).astype(np.uint8)
        picture = np.asarray(Image.fromarray(levels).resize((320, 240), resample=Image.BILINEAR))
        mask = np.asarray(Image.fromarray(levels[..., 1]).resize((320, 240), resample=Image.NEAREST))
        print(f"(({width}, {height}), {checksum(picture)}, {checksum(mask)}),")
    print("adobe", colour.RGB_to_RGB([0.5, 0.0, 0.25], "Adobe RGB (1998)", "sRGB", chromatic_adaptation_transform=None))


if __name__ == "__main__":
    main()
