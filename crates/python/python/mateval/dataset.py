"""A dataset as a mapping."""

from __future__ import annotations

import functools
import os
from collections.abc import Mapping
from typing import Any, Union, overload

from . import _core


class Dataset(_core.Dataset, Mapping[str, _core.Scene]):
    """A dataset on disk: a mapping from the ids of its scenes to the scenes.

    ``dataset[0]`` is the first scene and ``dataset[2:5]`` a list of scenes. Opening it checks its JSON files against its
    manifest; pictures are read when they are used. It can be pickled, and so can its scenes and views: the copy opens the
    same folder.
    """

    # A mapping compares its items, and a scene equals itself alone.
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    @overload
    def __getitem__(self, key: str | int) -> _core.Scene: ...

    @overload
    def __getitem__(self, key: slice) -> list[_core.Scene]: ...

    def __getitem__(self, key: str | int | slice) -> _core.Scene | list[_core.Scene]:
        if isinstance(key, slice):
            return [self[id] for id in list(self)[key]]
        if isinstance(key, int):
            try:
                key = list(self)[key]
            except IndexError:
                raise IndexError(f"'{self.path}' has {len(self)} scenes, found the index {key}") from None
        return super().__getitem__(key)

    def __contains__(self, key: object) -> bool:
        return key in list(self)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (os.path.abspath(self.path),)

    def _repr_html_(self) -> str:
        from . import display  # Only notebooks need it.

        return display.dataset(self)


#: A dataset, or the path of its folder.
DatasetOrPath = Union[_core.Dataset, str, "os.PathLike[str]"]


def open(path: DatasetOrPath) -> Dataset:
    """Opens the dataset in the folder ``path``. A dataset that is open is returned as it is."""
    return path if isinstance(path, Dataset) else Dataset(path)


def reopened_scene(path: str, scene: str) -> _core.Scene:
    """The copy of a pickled scene."""
    return _reopened(path)[scene]


def reopened_view(path: str, scene: str, view: str) -> _core.View:
    """The copy of a pickled view."""
    return _reopened(path)[scene].views[view]


def reopened_instance(path: str, scene: str, instance: str) -> _core.Instance:
    """The copy of a pickled instance."""
    return _reopened(path)[scene].instances[instance]


def _reopened(path: str) -> Dataset:
    # A batch holds many copies from one dataset. It is opened for the first of them, and again once it has changed.
    try:
        changed = os.stat(os.path.join(path, "dataset.json")).st_mtime_ns
    except OSError:
        return Dataset(path)  # Its error names the folder.
    return _opened_once(path, changed)


@functools.lru_cache(maxsize=1)
def _opened_once(path: str, changed: int) -> Dataset:
    return Dataset(path)
