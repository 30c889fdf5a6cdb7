"""Parts of a scene by their ids."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeVar

from .errors import UnknownId

T = TypeVar("T")


class ById(Mapping[str, T]):
    """A mapping from ids to instances, parts or views, in the order of ``scene.json``."""

    __slots__ = ("_owner", "_kind", "_items")

    def __init__(self, owner: str, kind: str, items: dict[str, T]) -> None:
        """``owner`` and ``kind`` are for the text of errors, as in ``scene 'living'`` and ``view``."""
        self._owner = owner
        self._kind = kind
        self._items = items

    def __getitem__(self, key: str) -> T:
        try:
            return self._items[key]
        except KeyError:
            known = ", ".join(f"'{id}'" for id in self._items)
            raise UnknownId(f"{self._owner} has no {self._kind} '{key}'; it has {known}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __repr__(self) -> str:
        return f"<mateval.ById: {len(self)} of kind {self._kind} of {self._owner}>"
