"""Arrays of other libraries as NumPy's. No such library is imported."""

from __future__ import annotations

from typing import Any

import numpy as np


def as_array(name: str, given: Any) -> np.ndarray[Any, Any]:
    """The array of ``given``, for an argument of this name: of a tensor of PyTorch on any device, with or without
    gradients, and of whatever states NumPy's ``__array__``."""
    if hasattr(given, "detach") and hasattr(given, "cpu"):
        given = given.detach().cpu()
        # NumPy has no bfloat16.
        given = given.float() if str(given.dtype) == "torch.bfloat16" else given
        return np.asarray(given.numpy())
    if hasattr(given, "__array__"):
        return np.asarray(given)
    found = f"{type(given).__module__}.{type(given).__qualname__}".replace("builtins.", "")
    raise TypeError(f"{name}: expected a NumPy array or a tensor, found {found}")
