"""The reports of ``lint`` and ``score``."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from . import _core
from .errors import UnknownId


class LintReport:
    """What is wrong with a submission."""

    def __init__(self, json_text: str, text: str) -> None:
        #: The report as ``mateval eval lint --format json`` prints it.
        self.json = json_text
        self._text = text
        self._file: dict[str, Any] = json.loads(json_text)

    @property
    def good(self) -> bool:
        """Whether no error was found."""
        return bool(self._file["good"])

    @property
    def findings(self) -> list[dict[str, Any]]:
        """Findings by severity and code: ``severity``, ``code``, ``count``, and ``examples``."""
        return list(self._file["findings"])

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        return f"<mateval.LintReport {'good' if self.good else 'not good'}, {len(self.findings)} kinds of findings>"


class Result(Mapping[str, float]):
    """The scores of a submission under one protocol: means over scenes, by keys such as ``albedo.novel.psnr``."""

    def __init__(self, json_text: str) -> None:
        #: The result as ``mateval eval score`` writes it.
        self.json = json_text
        self._file: dict[str, Any] = json.loads(json_text)
        (self._protocol,) = self._file["protocols"].values()
        self._summary: dict[str, float] = self._protocol["summary"]

    @property
    def method(self) -> str:
        """The method's name."""
        return str(self._file["method"])

    @property
    def fingerprint(self) -> str:
        """Numbers of different fingerprints must not be compared."""
        return str(self._protocol["fingerprint"])

    @property
    def scenes(self) -> dict[str, dict[str, float]]:
        """Means over the pictures of each scene, by the same keys."""
        return dict(self._protocol["scenes"])

    @property
    def findings(self) -> list[dict[str, Any]]:
        """Faults of the submission and what was scored instead."""
        return list(self._file["findings"])

    @property
    def not_predicted(self) -> list[str]:
        """Maps that the submission never contains, such as ``roughness``: they have no scores."""
        return list(self._file["not_predicted"])

    @property
    def missing(self) -> list[dict[str, Any]]:
        """Metrics that could not be computed: ``metric``, ``reason``, and the command to ``fix`` it."""
        return list(self._file["missing"])

    def to_records(self) -> list[dict[str, Any]]:
        """Every single value, as rows of a table: ``scene``, ``view``, ``picture``, ``region``, ``metric``, ``value``..."""
        return [
            {**{key: stated for key, stated in picture.items() if key != "values"}, "metric": metric, "value": value}
            for picture in self._protocol["pictures"]
            for metric, value in picture["values"].items()
        ]

    def __getitem__(self, key: str) -> float:
        try:
            return self._summary[key]
        except KeyError:
            import difflib  # Only mistakes pay for it.

            nearest = ", ".join(f"'{near}'" for near in difflib.get_close_matches(key, self._summary, cutoff=0.3))
            raise UnknownId(f"the result has no mean '{key}'; expected a key such as {nearest}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._summary)

    def __len__(self) -> int:
        return len(self._summary)

    def __repr__(self) -> str:
        return f"<mateval.Result of '{self.method}', {len(self)} means over {len(self.scenes)} scenes>"


def lint(submission: str | os.PathLike[str], dataset: _core.Dataset) -> LintReport:
    """Checks a submission, a folder or an archive, before it is scored. Ground truth is not needed."""
    return LintReport(*_core.lint(submission, dataset))


def score(
    submission: str | os.PathLike[str],
    dataset: _core.Dataset,
    *,
    scenes: Iterable[str] | None = None,
    protocol: str = "mateval-3",
    cache: str | os.PathLike[str] | None = None,
) -> Result:
    """Scores a submission, a folder or an archive. Takes minutes, and needs the dataset's ground truth.

    ``scenes`` are the ids of the scenes that are scored; all by default. In the folder ``cache`` the scores of scenes are
    kept for later calls.
    """
    if isinstance(scenes, str):
        raise TypeError(f"scenes: expected ids of scenes such as ['{scenes}'], found the text '{scenes}'")
    chosen = [] if scenes is None else list(scenes)
    if scenes is not None and not chosen:
        raise ValueError("scenes: expected at least one id, found none; None scores all scenes")
    return Result(_core.score(submission, dataset, scenes=chosen, protocol=protocol, cache=cache))
