"""The reports of ``lint`` and ``score``, and results side by side: ``tables`` and ``rank``."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from . import _core
from .dataset import DatasetOrPath, open as open_dataset
from .errors import UnknownId
from .progress import Progress

#: The protocol whose numbers are shown unless another is named.
PROTOCOL = "mateval-3"


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

    def __init__(self, json_text: str, protocol: str | None = None) -> None:
        """``json_text`` is a result as the command writes it, which ``load`` checks."""
        #: The result as ``mateval eval score`` writes it.
        self.json = json_text
        self._file: dict[str, Any] = json.loads(json_text)
        protocols = self._file["protocols"]
        if protocol is None:
            protocol = PROTOCOL if PROTOCOL in protocols else next(iter(protocols), PROTOCOL)
        if protocol not in protocols:
            known = ", ".join(f"'{name}'" for name in protocols)
            raise UnknownId(f"the result of '{self.method}' has no protocol '{protocol}'; it has {known}")
        #: The protocol of these numbers.
        self.protocol = protocol
        self._protocol: dict[str, Any] = protocols[protocol]
        self._summary: dict[str, float] = self._protocol["summary"]

    @classmethod
    def load(cls, path: str | os.PathLike[str], protocol: str | None = None) -> Result:
        """Reads ``RESULT.json``, as ``save`` and ``mateval eval score`` write it. A result of several protocols has the
        numbers of ``mateval-3`` unless another is named."""
        return cls(_core.read_result(path), protocol)

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Writes ``RESULT.json``, which every command of ``mateval eval`` takes. ``force`` replaces a file."""
        try:
            with open(path, "w" if force else "x", encoding="utf-8") as file:
                file.write(self.json)
        except FileExistsError:
            text = f"'{os.fspath(path)}' already exists; choose another path, or replace it with force=True"
            raise FileExistsError(text) from None

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
    def constancy(self) -> dict[str, dict[str, Any]]:
        """By scene whose twins the submission answers, how far its answers lie apart: ``raw``, ``aligned``, ``mean_mse``..."""
        return {family["scene"]: family for family in self._file.get("constancy", [])}

    @property
    def measured(self) -> list[dict[str, Any]]:
        """The regions of captured rooms whose colour was measured, as rows of a table: ``scene``, ``region``,
        ``predicted``, ``measured``, ``delta_e``... Only ``capture-1`` has them."""
        return list(self._protocol.get("measured", []))

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
            raise UnknownId(_nearest(f"the result has no mean '{key}'", key, self._summary)) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._summary)

    def __len__(self) -> int:
        return len(self._summary)

    def _repr_html_(self) -> str:
        from . import display  # Only notebooks need it.

        return display.result(self)

    def __repr__(self) -> str:
        return f"<mateval.Result of '{self.method}', {len(self)} means over {len(self.scenes)} scenes>"


def lint(
    submission: str | os.PathLike[str], dataset: DatasetOrPath, *, progress: Progress = None
) -> LintReport:
    """Checks a submission, a folder or an archive, before it is scored. Ground truth is not needed."""
    return LintReport(*_core.lint(submission, open_dataset(dataset), progress=progress))


def score(
    submission: str | os.PathLike[str],
    dataset: DatasetOrPath,
    *,
    scenes: Iterable[str] | None = None,
    protocol: str = PROTOCOL,
    cache: str | os.PathLike[str] | None = None,
    progress: Progress = None,
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
    dataset = open_dataset(dataset)
    text = _core.score(submission, dataset, scenes=chosen, protocol=protocol, cache=cache, progress=progress)
    return Result(text)


def tables(
    results: Iterable[Result],
    *,
    ceiling: Result | None = None,
    by: str = "dataset",
    format: str = "frames",
) -> Any:
    """Puts results side by side, as ``mateval eval tables`` does: one table for each kind of picture.

    ``by`` is ``dataset`` for means over scenes, ``scene``, ``category`` or ``super_category``. ``ceiling`` is the result of
    the truth itself, in the last row. Results of other datasets, protocols or versions of the scorer are refused.

    ``frames`` returns a dictionary by the tables' titles, of ``pandas.DataFrame`` with the methods as index if pandas is
    installed, else of lists of dictionaries. The other formats, ``csv``, ``markdown``, ``latex`` and ``text``, return text.
    """
    results = _results(results)
    protocol = results[0].protocol
    texts = [result.json for result in results]
    top = None if ceiling is None else ceiling.json
    if format != "frames":
        return _core.tables(texts, top, protocol, by, format)
    found = {}
    for table in _core.tables(texts, top, protocol, by, "csv").strip().split("\n\n"):
        head, *lines = csv.reader(table.splitlines())
        names = 1 if by == "dataset" else 2
        title, head = head[names - 1], [*head[: names - 1], "method", *head[names:]]
        rows = [dict(zip(head, line[:names] + [_number(cell) for cell in line[names:]])) for line in lines]
        found[title] = _frame(rows, head[:names])
    return found


def rank(results: Iterable[Result], key: str = "albedo.novel.psnr") -> Any:
    """Ranks results by one mean, best first: rows of ``method``, ``value``, ``low`` and ``high`` (the 95 % interval; None with
    fewer than five houses), ``place``, and ``best_rank`` and ``worst_rank``, between which the data leaves the rank open.

    Returns a ``pandas.DataFrame`` if pandas is installed, else a list of dictionaries.
    """
    results = _results(results)
    ranking = json.loads(_core.rank([result.json for result in results], results[0].protocol))
    if key not in ranking["keys"]:
        text = f"no result has a mean '{key}' (Result.missing says what was not computed)"
        raise UnknownId(_nearest(text, key, ranking["keys"]))
    names = {method["id"]: method["method"] for method in ranking["methods"]}
    best_first = ranking["keys"][key]["better"] == "higher"
    standings = sorted(
        ranking["keys"][key]["standings"], key=lambda standing: standing["value"], reverse=best_first
    )
    rows = []
    for place, standing in enumerate(standings, start=1):
        interval = standing["interval"] or {"low": None, "high": None}
        rows.append(
            {
                "method": names[standing["method"]],
                "value": standing["value"],
                "low": interval["low"],
                "high": interval["high"],
                "place": place,
                "best_rank": standing["rank"]["best"],
                "worst_rank": standing["rank"]["worst"],
            }
        )
    return _frame(rows, [])


def _results(given: Iterable[Result]) -> list[Result]:
    results = [given] if isinstance(given, Result) else list(given)
    for result in results:
        if not isinstance(result, Result):
            raise TypeError(f"results: expected mateval.Result, found {type(result).__name__}; Result.load reads a file")
    if not results:
        raise ValueError("results: expected at least one, found none")
    return results


def _nearest(text: str, key: str, known: Iterable[str]) -> str:
    import difflib  # Only mistakes pay for it.

    nearest = ", ".join(f"'{near}'" for near in difflib.get_close_matches(key, list(known), cutoff=0.3))
    return f"{text}; expected a key such as {nearest}"


def _number(cell: str) -> float | None:
    return float(cell) if cell else None


def _frame(rows: list[dict[str, Any]], index: list[str]) -> Any:
    try:
        import pandas
    except ImportError:
        return rows
    frame = pandas.DataFrame(rows)
    return frame.set_index(index) if index else frame
