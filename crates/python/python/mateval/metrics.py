"""The scorer's own metrics of two arrays."""

from ._core import lpips, psnr, ssim

__all__ = ["lpips", "psnr", "ssim"]
