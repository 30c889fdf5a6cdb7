"""Hooks of MkDocs: pages that are made at build time, and links that work both in the repository and on the site.

The site holds the folder `dataset_spec`, made pages (`keys/`, `commands/`, `tutorial.md`), and `repository/`: the other
files of the repository that its pages link to.
"""

import json
import os
import posixpath
import re
import sys
from pathlib import Path

from mkdocs.structure.files import File, Files

sys.path.insert(0, str(Path(__file__).parent))
import commands  # noqa: E402
import keys  # noqa: E402

DOCS = "dataset_spec"
TUTORIAL = "crates/python/tutorial.ipynb"
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s]+)\)")
LIST = re.compile(r"^((?!- |\d+\. |[|#\s]).+\n)(?=- |1\. )", re.MULTILINE)
FENCE = re.compile(r"^(```.*?^```$)", re.MULTILINE | re.DOTALL)

#: The file of the repository that a page of the site shows; pages that are made are not listed.
shown: dict[str, str] = {}


def on_config(config):
    """Fills the menu's lists of made pages."""
    groups = [{group: [{name: f"keys/{name}.md"} for name in names]} for group, names in keys.GROUPS.items()]
    lists = {
        "Keys": ["keys/index.md", *groups, "keys/shared.md"],
        "Commands": ["commands/index.md", *(f"commands/{name}.md" for name in commands.subcommands(commands.help_of([])))],
    }
    config.nav = [{title: lists.get(title, value) for title, value in entry.items()} for entry in config.nav]
    return config


def on_files(files: Files, config) -> Files:
    made = {f"keys/{name}": text for name, text in keys.Keys().pages().items()}
    made |= {f"commands/{name}": text for name, text in commands.pages().items()}
    made["tutorial.md"] = notebook(TUTORIAL)
    made["python.md"] = PYTHON
    made |= {f"assets/{name}": (Path(__file__).parent / name).read_text() for name in ("site.css", "iframe-worker.js")}
    for place, text in made.items():
        files.append(File.generated(config, place, content=text))
    shown.update({file.src_uri: f"{DOCS}/{file.src_uri}" for file in files.documentation_pages() if not file.generated_by})
    # What pages link to is copied, and so is what the copies link to.
    left = list(shown.values())
    while left:
        page = left.pop()
        for _, _, link in LINK.findall(FENCE.sub("", Path(page).read_text())):
            path = target(page, link)
            place = path and site_place(path)
            if not place or files.get_file_from_path(place) or not os.path.isfile(path):
                continue
            files.append(File.generated(config, place, content=Path(path).read_bytes()))
            if place.endswith(".md"):
                shown[place] = path
                left.append(path)
    return files


def on_page_markdown(markdown: str, page, config, files: Files) -> str:
    source = shown.get(page.file.src_uri)
    if source is None:
        return markdown
    # Chapters come before tables of keys in a search.
    page.meta.setdefault("search", {"boost": 2})

    def moved(found: re.Match) -> str:
        picture, text, link = found.groups()
        path = target(source, link)
        if path is None:
            return found[0]
        if os.path.isdir(path) and path != str(keys.SCHEMAS):
            return text
        place = posixpath.relpath(site_place(path), posixpath.dirname(page.file.src_uri) or ".")
        fragment = link.partition("#")[2]
        return f"{picture}[{text}]({place}{'#' + fragment if fragment else ''})"

    parts = FENCE.split(markdown)
    # Without an empty line before it, MkDocs sees no list.
    return "".join(part if part.startswith("```") else LIST.sub(r"\1\n", LINK.sub(moved, part)) for part in parts)


def target(page: str, link: str) -> str | None:
    """The path in the repository that a link of a file names; none for addresses and places of the same page."""
    path = link.partition("#")[0]
    if not path or "://" in path or path.startswith("mailto:"):
        return None
    return posixpath.normpath(posixpath.join(posixpath.dirname(page), path))


def site_place(path: str) -> str:
    """Where the site shows a file of the repository. A schema is shown as its table of keys."""
    if path == str(keys.SCHEMAS):
        return "keys/index.md"
    if path.startswith(f"{keys.SCHEMAS}/"):
        return f"keys/{Path(path).name.split('.')[0]}.md"
    if path == TUTORIAL:
        return "tutorial.md"
    if path.startswith(f"{DOCS}/"):
        return path.removeprefix(f"{DOCS}/")
    # MkDocs leaves out names that begin with a dot.
    return "repository/" + re.sub(r"(^|/)\.", r"\1", path)


def notebook(path: str) -> str:
    """The cells of a notebook as a page."""
    cells = json.loads(Path(path).read_text())["cells"]
    texts = [("".join(cell["source"]), cell["cell_type"]) for cell in cells]
    return "\n\n".join(text if kind == "markdown" else f"```python\n{text}\n```" for text, kind in texts)


#: The names of the package's many members are headings, which would come first in every search.
PYTHON = """---
search: { boost: 0.001 }
---

# Python API

::: mateval

## mateval.metrics

::: mateval.metrics
    options: { heading_level: 3 }

## mateval.torch

::: mateval.torch
    options: { heading_level: 3 }

## mateval.display

::: mateval.display
    options: { heading_level: 3, members: [Pictures] }

## mateval.progress

::: mateval.progress
    options: { heading_level: 3, members: [] }
"""
