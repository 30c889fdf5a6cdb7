"""Compares variants of nodes with the definitions of MaterialX' standard library.

    check_definitions.py VARIANTS.json

The file is a list of objects with `node`, `inputs` (a list of name, type and default, which is `place` for the first
texture coordinates) and `outputs` (a list of name and type). Prints a JSON list of the variants that no definition has.
"""

import json
import sys
from pathlib import Path

import MaterialX as mx
from standard_library import with_library

IGNORED = {"space", "note"}
"""Inputs that are accepted without a meaning here."""


def default_of(*, definition: mx.Input) -> list[float] | str:
    """The default of an input as numbers, or `place`."""
    if definition.getAttribute("defaultgeomprop") == "UV0":
        return "place"
    return [float(number) for number in definition.getValueString().split(",")]


def described(*, definition: mx.NodeDef) -> tuple[dict, list]:
    """Inputs and outputs of a definition, as in the file."""
    inputs = {
        each.getName(): [each.getType(), default_of(definition=each)]
        for each in definition.getActiveInputs()
        if each.getName() not in IGNORED
    }
    return inputs, [[each.getName(), each.getType()] for each in definition.getActiveOutputs()]


def main() -> None:
    """Prints the variants that differ."""
    library = with_library()
    unknown = []
    for variant in json.loads(Path(sys.argv[1]).read_text()):
        wanted = ({name: [kind, default] for name, kind, default in variant["inputs"]}, variant["outputs"])
        supported = {"float", "integer", "vector2", "vector3", "color3"}
        definitions = [each for each in library.getMatchingNodeDefs(variant["node"])
                       if all(i.getType() in supported for i in each.getActiveInputs() if i.getName() not in IGNORED)]
        if wanted not in [described(definition=each) for each in definitions]:
            unknown.append(variant)
    print(json.dumps(unknown))


if __name__ == "__main__":
    main()
