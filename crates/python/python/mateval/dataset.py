"""A dataset as a mapping."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from . import _core


class Dataset(_core.Dataset, Mapping[str, _core.Scene]):
    """A dataset on disk: a mapping from the ids of its scenes to the scenes.

    Opening it checks its JSON files against its manifest; pictures are read when they are used. It can be pickled: the
    copy opens the same folder.
    """

    # A mapping compares its items, and a scene equals itself alone.
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (os.path.abspath(self.path),)


def open(path: str | os.PathLike[str]) -> Dataset:
    """Opens the dataset in the folder ``path``."""
    return Dataset(path)
