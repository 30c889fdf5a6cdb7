"""MSE, PSNR and SSIM by scikit-image, LPIPS by the `lpips` package, for `score_room_mitsuba.py`.

Follows the rules of protocol `mateval-2` as far as these packages allow: light and colours for SSIM and LPIPS clipped
and sRGB-encoded, albedo's MSE and PSNR linear; SSIM over the windows that lie inside the mask; LPIPS of the prediction
with the truth's pixels outside the mask, the sum of the map over the mask's pixels. Noise is not removed from the
pictures.
"""

from __future__ import annotations

import warnings

import lpips
import numpy as np
import torch
from safetensors.numpy import load_file
from scipy.ndimage import minimum_filter
from skimage.metrics import mean_squared_error, peak_signal_noise_ratio, structural_similarity

WINDOW = 11


def network(weights: str | None) -> lpips.LPIPS:
    """AlexNet with the weights of `mateval fetch lpips`; without a file random ones, as fast."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        net = lpips.LPIPS(net="alex", version="0.1", pretrained=False, pnet_rand=True, spatial=True, verbose=False)
    if weights is not None:
        values = {name: torch.from_numpy(array) for name, array in load_file(weights).items()}
        convolutions = [layer for layer in net.net.modules() if isinstance(layer, torch.nn.Conv2d)]
        for k, layer in enumerate(convolutions, start=1):
            layer.weight.data, layer.bias.data = values[f"conv{k}.weight"], values[f"conv{k}.bias"]
        for k, layer in enumerate(net.lins, start=1):
            layer.model[-1].weight.data = values[f"lin{k}.weight"].reshape(1, -1, 1, 1)
    return net.eval()


def srgb(linear: np.ndarray) -> np.ndarray:
    """Returns the picture clipped to 0..1 and sRGB-encoded."""
    held = np.clip(linear, 0.0, 1.0)
    return np.where(held <= 0.0031308, 12.92 * held, 1.055 * held ** (1.0 / 2.4) - 0.055).astype(np.float32)


class Scores:
    """Compares views; adds the time of each metric to `stages`."""

    def __init__(self, *, network: lpips.LPIPS, exposure: float, stages: list[dict], timed) -> None:
        """`timed` is a context manager that adds a stage."""
        self.network, self.exposure, self.stages, self.timed = network, exposure, stages, timed

    def view(self, *, truth: dict, pictures: dict, view: int) -> list[dict]:
        """All values of a view by region: of both tracks, and of albedo unaligned and aligned."""
        light = srgb(self.exposure * truth["rgb"])
        values = []
        for track in ("true", "fitted"):
            shown = srgb(self.exposure * pictures[track])
            values += self.picture(name=f"rgb_{track}", pair=(shown, light), encoded=(shown, light), truth=truth)
        valid = truth["masks"]["valid"]
        aligned = pictures["albedo"] * scales(prediction=pictures["albedo"], truth=truth["albedo"], mask=valid)
        for name, picture in (("albedo", pictures["albedo"]), ("albedo_aligned", aligned)):
            encoded = (srgb(picture), srgb(truth["albedo"]))
            values += self.picture(name=name, pair=(picture, truth["albedo"]), encoded=encoded, truth=truth)
        return [{"view": view, **value} for value in values]

    def picture(self, *, name: str, pair: tuple, encoded: tuple, truth: dict) -> list[dict]:
        """One picture in every region: `pair` for MSE and PSNR, `encoded` for SSIM and LPIPS; prediction first."""
        with self.timed(self.stages, name="SSIM", samples=0):
            similarity = ssim_map(*encoded)
        values = []
        for region, mask in truth["masks"].items():
            if not mask.any():
                continue
            with self.timed(self.stages, name="MSE, PSNR", samples=0):
                predicted, true = (picture[mask] for picture in pair)
                mse = float(mean_squared_error(true, predicted))
                psnr = float(peak_signal_noise_ratio(true, predicted, data_range=1.0)) if mse > 0.0 else 100.0
            with self.timed(self.stages, name="SSIM", samples=0):
                inside = minimum_filter(mask, size=WINDOW, mode="constant", cval=False)
                ssim = float(similarity[inside].mean()) if inside.any() else None
            with self.timed(self.stages, name="LPIPS", samples=0):
                filled = np.where(mask[:, :, None], encoded[0], encoded[1])
                distance = float(self.lpips_map(filled, encoded[1]).sum() / mask.sum())
            values.append({"picture": name, "region": region, "mse": mse, "psnr": psnr, "ssim": ssim, "lpips": distance})
        return values

    def lpips_map(self, prediction: np.ndarray, truth: np.ndarray) -> np.ndarray:
        """The distance at every pixel of two encoded pictures."""
        tensors = [torch.from_numpy(picture.transpose(2, 0, 1)[None]) for picture in (prediction, truth)]
        with torch.inference_mode():
            return self.network(*tensors, normalize=True)[0, 0].numpy()

    def whole_lpips(self, *, prediction: np.ndarray, truth: np.ndarray) -> float:
        """LPIPS as published, over whole pictures of linear light: the sum of the means of the stages' own maps."""
        tensors = [torch.from_numpy(srgb(picture).transpose(2, 0, 1)[None]) for picture in (prediction, truth)]
        self.network.spatial = False
        with torch.inference_mode():
            distance = float(self.network(*tensors, normalize=True))
        self.network.spatial = True
        return distance


def scales(*, prediction: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The scale for each channel that brings the prediction nearest to the truth over the mask; 1 if it is black."""
    squares = (prediction[mask] ** 2).sum(axis=0)
    return np.where(squares > 0.0, (truth[mask] * prediction[mask]).sum(axis=0) / np.maximum(squares, 1e-30), 1.0)


def ssim_map(prediction: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """SSIM around every pixel, as the mean over the channels."""
    _, full = structural_similarity(
        truth,
        prediction,
        data_range=1.0,
        channel_axis=2,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        full=True,
    )
    return full.mean(axis=2)
