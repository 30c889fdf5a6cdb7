"""The views and scenes of a dataset as PyTorch's data loaders take them. PyTorch is not imported."""

from __future__ import annotations

import operator
from collections.abc import Iterable
from typing import Any

from .dataset import Dataset, DatasetOrPath, open

#: Every array of a view, of its camera and of its truth, and the exposure of its scene.
_FIELDS = (
    *("rgb", "preview", "depth", "normal", "instance", "part", "valid", "unobserved"),
    *("camera.K", "camera.world_from_camera", "camera.opencv", "exposure"),
    *("truth.albedo", "truth.diffuse_albedo", "truth.roughness", "truth.metallic", "truth.specular_region", "truth.rgb"),
)


class Views:
    """A map-style dataset for ``torch.utils.data.DataLoader``: one item a view, a dictionary of arrays.

    ``dataset`` is a dataset or its folder. ``fields`` are ``rgb``, ``preview``, ``depth``, ``normal``, ``instance``,
    ``part``, ``valid`` and ``unobserved`` of ``View``, with ids as int64; ``K``, ``world_from_camera`` and ``opencv`` of
    its camera, as in ``camera.K``; ``albedo``, ``diffuse_albedo``, ``roughness``, ``metallic``, ``specular_region`` and
    ``rgb`` of its truth, as in ``truth.albedo``; and ``exposure`` of its scene, by which ``rgb`` is multiplied to be what
    ``preview`` shows. Colours are RGB. ``views`` are the ids of the views that are taken from every scene; by default the
    input view alone, since methods see no other photo. An item also holds the ids ``scene`` and ``view``. Pictures of
    different scenes may differ in size: such batches need a ``collate_fn``.

    >>> views = mateval.torch.Views("DATASET", fields=["rgb", "depth", "normal", "valid", "truth.albedo"])
    >>> for batch in torch.utils.data.DataLoader(views, batch_size=8, num_workers=4):
    ...     photo, albedo = batch["rgb"], batch["truth.albedo"]  # (8, height, width, 3), float32, linear
    """

    def __init__(
        self,
        dataset: DatasetOrPath,
        fields: Iterable[str] = ("rgb", "depth", "valid"),
        views: Iterable[str] = ("input",),
    ) -> None:
        self.dataset: Dataset = open(dataset)
        self.fields = _fields(fields)
        views = _list("views", views)
        # An unknown id fails here, not in a worker.
        self._places = [(id, scene.views[view].id) for id, scene in self.dataset.items() for view in views]

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, index: int) -> dict[str, Any]:
        scene, id = self._places[operator.index(index)]
        view = self.dataset[scene].views[id]
        values = {field: _value(self.dataset[scene], view, field) for field in self.fields}
        return {"scene": scene, "view": id, **values}


class Scenes:
    """The same with one item a scene: each field is an array of all its views, or of those named, in the order of their
    ids in ``view``, which PyTorch collates to one list a view. The photo, ``rgb`` and ``preview``, exists for the input
    view alone, and ``exposure`` is one for all views: these have no such axis.

    >>> scenes = mateval.torch.Scenes("DATASET", fields=["rgb", "depth"])
    >>> for batch in torch.utils.data.DataLoader(scenes, batch_size=2):
    ...     photo, depth = batch["rgb"], batch["depth"]  # (2, height, width, 3), (2, views, height, width)
    """

    def __init__(
        self,
        dataset: DatasetOrPath,
        fields: Iterable[str] = ("rgb", "depth", "valid"),
        views: Iterable[str] | None = None,
    ) -> None:
        self.dataset: Dataset = open(dataset)
        self.fields = _fields(fields)
        self.views = None if views is None else _list("views", views)
        self._ids = list(self.dataset)
        for scene in self.dataset.values():
            for view in self.views or ():
                _ = scene.views[view]

    def __len__(self) -> int:
        return len(self._ids)

    def __getitem__(self, index: int) -> dict[str, Any]:
        import numpy as np  # `import mateval` does without.

        scene = self.dataset[self._ids[operator.index(index)]]
        ids = list(scene.views) if self.views is None else list(self.views)
        item: dict[str, Any] = {"scene": scene.id, "view": ids}
        for field in self.fields:
            is_of_scene = field in ("rgb", "preview", "exposure")
            values = [_value(scene, scene.views[id], field) for id in ids if not is_of_scene]
            item[field] = _value(scene, scene.input, field) if is_of_scene else np.stack(values)
        return item


def _value(scene: Any, view: Any, field: str) -> Any:
    if field == "exposure":
        return scene.exposure
    value = operator.attrgetter(field)(view)
    # PyTorch converts no uint16 before version 2.3, and few of its functions take one.
    return value.astype("int64") if field in ("instance", "part") else value


def _fields(given: Iterable[str]) -> tuple[str, ...]:
    fields = _list("fields", given)
    for field in fields:
        if field not in _FIELDS:
            raise ValueError(f"fields: expected arrays of a view ({', '.join(_FIELDS)}), found '{field}'")
    return fields


def _list(name: str, given: Iterable[str]) -> tuple[str, ...]:
    if isinstance(given, str):
        raise TypeError(f"{name}: expected a list such as ['{given}'], found the text '{given}'")
    return tuple(given)
