"""Writes the page of outcomes: failures first, then refusals by cause, then what was built."""

from __future__ import annotations

import base64
import html
import re
from collections import Counter
from pathlib import Path

from run import RESOLUTION, Outcome, Result

STYLE = Path(__file__).resolve().parents[2] / "crates/pages/src/style.css"
LOG_CHARACTERS = 20_000
"""How much of a log is shown, from its start and from its end."""


def shortened(*, text: str) -> str:
    """The start and the end of a long text."""
    if len(text) <= 2 * LOG_CHARACTERS:
        return text
    return f"{text[:LOG_CHARACTERS]}\n[...]\n{text[-LOG_CHARACTERS:]}"


def kind_of_cause(*, cause: str) -> str:
    """The first part of a refusal, without the names, places and numbers that differ from file to file."""
    text = re.sub(r"^error: (cannot build the dataset: )?", "", cause)
    text = re.sub(r"^('[^']*'|scene '[^']*'): ", "", text)
    text = re.sub(r"(?<!\w)'[^']*'", "'…'", text)
    text = re.sub(r"(?<![\w/…])(/[\w.\[\]-]+)+", "/…", text)
    text = re.sub(r"(?<!\w)-?\d+(\.\d+)?(e-?\d+)?", "#", text)
    return re.sub(r"^(.{40,}?)[:;] .*", r"\1", text)


def write_page(*, results: list[Result], tried: int, folder: Path, out: Path) -> None:
    """Writes `index.html` beside and renames it, so that a page can be read at any time."""
    counts = Counter(result.outcome for result in results)
    causes = Counter(kind_of_cause(cause=result.cause) for result in results if result.outcome is Outcome.REFUSED)
    order = list(Outcome)
    shown = sorted(results, key=lambda result: (order.index(result.outcome), kind_of_cause(cause=result.cause)))
    state = "" if len(results) == tried else f"<p class=notice>{len(results)} of {tried} scenes were tried so far.</p>"
    refusals = "".join(f"<tr><td>{count}<td class=word>{html.escape(cause)}" for cause, count in causes.most_common())
    text = PAGE.format(
        style=STYLE.read_text(encoding="utf-8"),
        folder=html.escape(str(folder)),
        state=state,
        counts="".join(f"<li><b>{counts[outcome]}</b> {outcome.value}" for outcome in Outcome),
        refusals=f"<h2>Refused because</h2><div class=wide><table>{refusals}</table></div>" if causes else "",
        rows="".join(row(result=result) for result in shown),
    )
    new = out / "index.html.new"
    new.write_text(text, encoding="utf-8")
    new.replace(out / "index.html")


def row(*, result: Result) -> str:
    """A scene's row, which narrow windows show as a card."""
    case, picture, found = result.case, "", "none"
    if result.picture is not None:
        data = base64.b64encode(result.picture).decode()
        picture = f'<img src="data:image/png;base64,{data}" width={RESOLUTION[0]} height={RESOLUTION[1]} alt="">'
    if result.findings:
        lines = "".join(f"<li>{html.escape(code)}: {count}" for code, count in sorted(result.findings.items()))
        found = f"<details><summary>{result.findings.total()}</summary><ul>{lines}</ul></details>"
    log = html.escape(shortened(text=(result.folder / "log.txt").read_text(encoding="utf-8")))
    size = case.file.stat().st_size / 1024
    # A command that was not run has a dash.
    codes = [str(step.code) for step in result.steps] + ["-"] * (3 - len(result.steps))
    seconds = [f"{step.seconds:.1f}" for step in result.steps] + ["-"] * (3 - len(result.steps))
    return (
        f"<tr class={result.outcome.value}><th>{html.escape(case.name)}<td class=picture>{picture}"
        f'<td class=word data-name="outcome"><b>{result.outcome.value}</b> {html.escape(result.cause)}'
        f"<details><summary>log</summary><pre>{log}</pre></details>"
        f'<td data-name="kind">{case.kind}<td data-name="KiB">{size:,.0f}<td data-name="exit codes">{" ".join(codes)}'
        f'<td data-name="seconds">{" ".join(seconds)}<td data-name="findings">{found}'
    )


PAGE = """<!doctype html>
<html lang=en><meta charset=utf-8><meta name=viewport content="width=device-width"><title>Corpus</title>
<style>
{style}
.cases {{ width: 100%; }}
.cases td, .cases thead th {{ min-width: 0; text-align: left; }}
.cases td.word {{ width: 45%; }}
.cases img {{ border: 1px solid var(--line); }}
.cases ul {{ margin: 0; padding-left: 1.2rem; }}
.cases pre {{ white-space: pre-wrap; overflow-wrap: anywhere; }}
.failed b {{ color: var(--bad); }}
.built b {{ color: var(--good); }}
@media (max-width: 60rem) {{
  .cases, .cases tbody {{ display: block; }}
  .cases thead {{ display: none; }}
  .cases tr {{ display: block; border-bottom: 1px solid var(--line); padding: .6rem 0; }}
  .cases tbody th, .cases td {{ display: block; border: 0; width: auto; max-width: none; padding: .1rem 0; }}
  .cases td.word {{ width: auto; }}
  .cases td[data-name]::before {{ content: attr(data-name) ": "; color: var(--dim); }}
}}
</style>
<h1>Scenes below {folder}</h1>
{state}<ul class=headlines>{counts}</ul>
{refusals}
<h2>Scenes</h2>
<p>Exit codes and seconds are those of build, render and verify.</p>
<table class=cases><thead><tr><th>file<th>picture<th>outcome<th>kind<th>KiB<th>exit codes<th>seconds<th>findings</thead>
<tbody>{rows}</tbody></table>
"""
