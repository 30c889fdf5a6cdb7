"""The views of a dataset as PyTorch's data loaders take them. PyTorch is not imported."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from . import _core
from .dataset import Dataset


class Views:
    """A map-style dataset for ``torch.utils.data.DataLoader``: one item a view, a dictionary of arrays.

    ``fields`` are names of ``View``'s arrays, or of ``Truth``'s as in ``truth.albedo``. ``views`` are the ids of the views
    that are taken from every scene; by default the input view alone, since methods see no other photo. An item also holds
    the ids ``scene`` and ``view``. Pictures of different scenes may differ in size: such batches need a ``collate_fn``.
    """

    def __init__(
        self,
        dataset: Dataset,
        fields: Iterable[str] = ("rgb", "depth", "valid"),
        views: Iterable[str] = ("input",),
    ) -> None:
        for name, given in (("fields", fields), ("views", views)):
            if isinstance(given, str):
                raise TypeError(f"{name}: expected a list such as ['{given}'], found the text '{given}'")
        self.dataset = dataset
        self.fields = tuple(fields)
        for field in self.fields:
            _check_field(field)
        views = tuple(views)
        # An unknown id fails here, not in a worker.
        self._places = [(scene, dataset[scene].views[view].id) for scene in dataset for view in views]

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, index: int) -> dict[str, Any]:
        scene, id = self._places[index]
        view = self.dataset[scene].views[id]
        return {"scene": scene, "view": id, **{field: _field(view, field) for field in self.fields}}


def _check_field(field: str) -> None:
    holder, name = (_core.Truth, field[len("truth.") :]) if field.startswith("truth.") else (_core.View, field)
    if name.startswith("_") or not hasattr(holder, name):
        raise ValueError(f"fields: expected arrays of View, or of Truth as in 'truth.albedo', found '{field}'")


def _field(view: Any, field: str) -> Any:
    for name in field.split("."):
        view = getattr(view, name)
    return view
