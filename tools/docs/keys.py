"""Writes a table of keys for each JSON and TOML format, from the schemas in `dataset_spec/schema`.

A type that is used in one place is expanded there, under its path (`views[].camera.fx`). One that several places use has a
table of its own: on the page of the format where all of its uses are, else on the page `shared.md`.
"""

import html
import json
import re
from collections import defaultdict
from pathlib import Path

SCHEMAS = Path("dataset_spec/schema")

#: The pages, by group, in the order of the menu.
GROUPS = {
    "Dataset": ["recipe", "dataset", "targets", "scene", "compare_verdict"],
    "Ground truth": ["reference", "source_materials", "lights", "material_classes", "render", "scorer", "measured", "measurements"],
    "Submissions and results": ["submission", "lint", "result", "rounded", "verification", "explain", "leaderboard", "errata", "votes",
                                "preferences"],
    "Reports of a dataset": ["survey_rules", "survey", "stats", "findings", "compare", "release"],
    "Baselines": ["adapter", "encoding", "fitted_lights", "import", "import_materials"],
    "Between MatEval and Blender": ["blender_job", "blender_result"],
}
#: What the end of a key states about a number or a text.
UNITS = {"_m": "metres", "_m2": "square metres", "_deg": "degrees", "_db": "dB", "seconds": "seconds", "_ms": "ms",
         "sha256": "64 hexadecimal digits", "_bytes": "bytes"}
ID = "^[a-z0-9][a-z0-9_-]{0,63}$"


class Keys:
    """All schemas, and where each of their types has its table."""

    def __init__(self) -> None:
        self.roots = {path.name.split(".")[0]: json.loads(path.read_text()) for path in sorted(SCHEMAS.glob("*.json"))}
        if sorted(self.roots) != sorted(name for names in GROUPS.values() for name in names):
            raise ValueError("GROUPS and dataset_spec/schema list different schemas")
        self.types: dict[str, dict] = {}
        #: By type, the places that use it, and the formats that have it.
        uses, self.formats = defaultdict(set), defaultdict(set)
        for page, root in self.roots.items():
            for name, node in {root["title"]: root, **root.get("$defs", {})}.items():
                node = {key: value for key, value in node.items() if key not in ("$schema", "$defs")}
                # A format's schema may contain another's, without its title.
                if {**self.types.setdefault(name, node), "title": 0} != {**node, "title": 0}:
                    raise ValueError(f"schemas differ in the type {name}")
                self.formats[name].add(page)
                for number, used in enumerate(references(node)):
                    uses[used].add((name, number))
        titles = {root["title"]: page for page, root in self.roots.items()}
        #: The page and heading of each table.
        self.place: dict[str, tuple[str, str]] = {}
        for name, node in self.types.items():
            if name in titles:
                self.place[name] = (titles[name], "")
            elif variants(node) and len(uses[name]) != 1:
                pages = self.formats[name]
                self.place[name] = (next(iter(pages)) if len(pages) == 1 else "shared", name)
        self.written: list[tuple] = []

    def pages(self) -> dict[str, str]:
        """The text of each page, by its file's name."""
        texts = {f"{page}.md": self.page(page) for page in self.roots}
        texts["shared.md"] = "# Shared types\n\nTypes that several formats use.\n" + self.tables("shared")
        texts["index.md"] = self.index()
        # Every key of every type has exactly one row; keys of variants that are alike share it.
        expected = {(name, key) for name, node in self.types.items() for one in variants(node) for key in one["properties"]}
        rows = [entry for entry in self.written if entry[0] in self.types]
        if {entry[:2] for entry in rows} != expected or len(set(rows)) != len(rows):
            raise ValueError(f"keys without a row, or with several: {expected ^ {entry[:2] for entry in rows}}")
        return texts

    def index(self) -> str:
        lines = ["# Keys", "", "The keys of every JSON and TOML file that MatEval reads or writes, from their "
                 "schemas. [The chapters](../format/index.md) describe the files.", "",
                 "`list[].key` is a key of each object of a list, `map.<name>.key` one of each object that is found by a name. An "
                 "*optional* key may be absent, and so may one with a *default*, which it then has. A number of numbers, as in "
                 "3 × number, is a list of that length. In TOML an object is a table, and a list of objects an array of tables, "
                 "as in `[[scene]]`.", ""]
        for group, names in GROUPS.items():
            lines += [f"## {group}", "", "| Format | Content |", "|---|---|"]
            lines += [f"| [{name}]({name}.md) | {self.content(name)} |" for name in names] + [""]
        return "\n".join(lines)

    def page(self, page: str) -> str:
        root = self.roots[page]
        head = f"# Keys of {page}\n\n{self.content(page)} [Schema](../schema/{page}.schema.json)\n\n"
        return head + (self.table(root["title"]) if variants(root) else "") + self.tables(page)

    def content(self, page: str) -> str:
        """What a format holds."""
        root = self.roots[page]
        return clean(root["description"]) if "description" in root else f"An object; {self.kind(root, page)[0]}."

    def tables(self, page: str) -> str:
        names = sorted(name for name, (at, heading) in self.place.items() if at == page and heading)
        texts = [f"\n## {name}\n\n{clean(self.types[name].get('description', ''))}\n\n{self.table(name)}" for name in names]
        return "".join(texts)

    def table(self, name: str) -> str:
        page = self.place[name][0]
        lines = ["| Key | Type | Meaning |", "|---|---|---|"]
        for path, kind, meaning in self.rows(name, "", page):
            # Long paths may be broken between their keys.
            broken = html.escape(path).replace(".", ".<wbr>")
            lines.append(f"| <code>{broken}</code> | {kind} | {cell(meaning)} |")
        return "\n".join(lines) + "\n"

    def rows(self, name: str, prefix: str, page: str, node: dict | None = None):
        """Yields path, type and meaning of each key of a type, and of those that are expanded below them."""
        alike: dict[str, list[tuple[dict, dict, bool]]] = {}
        options = variants(self.types[name] if node is None else node)
        for one in options:
            for key, value in one["properties"].items():
                alike.setdefault(key, []).append((one, value, key in one.get("required", [])))
        tag = next((key for key, found in alike.items() if all("const" in value for _, value, _ in found)), None)
        for key, found in sorted(alike.items(), key=lambda item: item[0] not in ("format", tag)):
            path = prefix + key
            if key == tag:
                self.written.append((name, key, path))
                words = [f"`{value['const']}`" + (f": {one['description']}" if "description" in one else "")
                         for one, value, _ in found]
                yield path, "word", "<br>".join(words)
                continue
            for content in {json.dumps(value): value for _, value, _ in found}.values():
                those = [(one, required) for one, value, required in found if value == content]
                self.written.append((name, key, path, json.dumps(content)))
                kind, inside = self.kind(content, page)
                unit = next((unit for end, unit in UNITS.items() if key.endswith(end)), None)
                if unit and re.search("number|integer|text", kind):
                    kind += f", {unit}"
                if not all(required for _, required in those):
                    # An empty default is that of an absent key.
                    default = content.get("default") not in (None, "", [], {})
                    kind += f"<br>*default* `{json.dumps(content['default'])}`" if default else "<br>*optional*"
                meaning = [content.get("description") or self.below(content)]
                if not content.get("description") and len(options) > 1 and "description" in those[0][0] and not tag:
                    meaning = [those[0][0]["description"]]
                if tag and len(options) > 1 and len(those) < len(options):
                    meaning.append("Only with " + ", ".join(f"`{one['properties'][tag]['const']}`" for one, _ in those) + ".")
                meaning += self.words(content)
                yield path, kind, "<br>".join(part for part in meaning if part)
                if inside:
                    suffix, inner, body = inside
                    yield from self.rows(inner or f"{name}.{key}", f"{path}{suffix}.", page, body)

    def kind(self, node: dict, page: str) -> tuple[str, tuple | None]:
        """The words of a type, and what is expanded below its key: the path's suffix, the type's name and its body."""
        if "anyOf" in node or "$ref" not in node and isinstance(node.get("type"), list):
            options = node.get("anyOf") or [{**node, "type": kind} for kind in node["type"]]
            kinds = [self.kind(option, page) for option in options if option.get("type") != "null"]
            return " or ".join([kind for kind, _ in kinds] + ["null"]), next((inside for _, inside in kinds if inside), None)
        if name := reference(node):
            target = self.types[name]
            if name in self.place:
                at, heading = self.place[name]
                return f"[{name}]({at}.md{'#' + heading.lower() if heading else ''})", None
            if variants(target):
                words = [f"`{one['const']}`" for one in target.get("oneOf", []) if "const" in one]
                return " or ".join(["object", *words]), ("", name, None)
            return self.kind(target, page)
        if words := node.get("enum"):
            return " or ".join(f"`{word}`" for word in words), None
        if node.get("oneOf"):
            return "word", None
        kind = node.get("type")
        if kind == "array":
            inner, inside = self.kind(node["items"], page)
            fixed = f"{node['maxItems']} × " if node.get("maxItems") and node.get("maxItems") == node.get("minItems") else "list of "
            return fixed + inner, inside and ("[]" + inside[0], *inside[1:])
        if kind == "object" and "properties" not in node:
            values = node.get("additionalProperties") or next(iter(node["patternProperties"].values()))
            inner, inside = self.kind(values, page)
            return f"by name: {inner}", inside and (".<name>" + inside[0], *inside[1:])
        if kind == "object":
            return "object", ("", None, node)
        if kind == "string" and node.get("pattern"):
            return ("[id](../format/index.md#conventions)" if node["pattern"] == ID else f"text `{node['pattern']}`"), None
        if "minimum" in node and "maximum" in node:
            least, most = (json.dumps(node[end]).removesuffix(".0") for end in ("minimum", "maximum"))
            return f"{kind}, {least} to {most}", None
        return {"string": "text", "boolean": "true or false"}.get(kind, kind), None

    def below(self, node: dict) -> str:
        """The description of the type that a key has no words of its own for."""
        name = reference(node)
        return self.types[name].get("description", "") if name else ""

    def words(self, node: dict) -> list[str]:
        """A line for each word that a key may have."""
        for part in (node, node.get("items", {}), *node.get("anyOf", [])):
            options = self.types[name].get("oneOf", []) if (name := reference(part)) and name not in self.place else []
            lines = []
            for option in options:
                for word in option.get("enum", [option["const"]] if "const" in option else []):
                    lines.append(f"`{word}`" + (f": {option['description']}" if "description" in option else ""))
            if lines:
                return lines
        return []


def reference(node: dict) -> str | None:
    return node["$ref"].split("/")[-1] if "$ref" in node else None


def references(node: object):
    """Yields the types that a schema uses, once for each use."""
    if isinstance(node, dict):
        if name := reference(node):
            yield name
        for value in node.values():
            yield from references(value)
    elif isinstance(node, list):
        for value in node:
            yield from references(value)


def variants(node: dict) -> list[dict]:
    """The objects that a type may be; none if it is a number, a text or a word."""
    return [one for one in [node, *node.get("oneOf", [])] if "properties" in one]


def clean(text: str) -> str:
    """A doc comment without line breaks, and with this site's links in place of rustdoc's."""
    text = re.sub(r"\[`(?:\w+::)*(\w+)`\](?!\()", r"`\1`", " ".join(text.split()))
    return re.sub(r"\bformat/(\w+)\.md", r"[format/\1.md](../format/\1.md)", text)


def cell(text: str) -> str:
    return clean(text).replace("|", "\\|")
