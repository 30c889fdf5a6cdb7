"""Writes a page for each group of commands, from `--help` of the command that MATEVAL names."""

import os
import re
import subprocess


def help_of(words: list[str]) -> str:
    """The help of a command, which names itself `mateval`."""
    done = subprocess.run(["mateval", *words, "--help"], executable=os.environ["MATEVAL"], capture_output=True, text=True,
                          check=True, env={**os.environ, "COLUMNS": "100"})
    return done.stdout


def subcommands(text: str) -> list[str]:
    listed = text.partition("\nCommands:\n")[2].partition("\n\n")[0]
    return [name for name in re.findall(r"^  (\S+)", listed, re.MULTILINE) if name != "help"]


def sections(words: list[str]) -> str:
    """The section of a command, followed by those of its subcommands."""
    text = help_of(words)
    body = f"{'#' * min(len(words), 2)} mateval {' '.join(words)}\n\n```text\n{text.rstrip()}\n```\n\n"
    return body + "".join(sections([*words, name]) for name in subcommands(text))


def pages() -> dict[str, str]:
    """The text of each page, by its file's name."""
    top = help_of([])
    found = {f"{name}.md": sections([name]) for name in subcommands(top)}
    found["index.md"] = f"# Commands\n\n```text\n{top.rstrip()}\n```\n"
    return found
