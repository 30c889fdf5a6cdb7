"""Validates .mtlx files with MaterialX and generates the code of their outputs for OSL, GLSL and MDL.

    check_files.py FILE.mtlx...

Prints a JSON list with one object for each file: its path, what MaterialX finds wrong with it, and the number of
characters of each generated shader.
"""

import json
import sys
from pathlib import Path

import MaterialX as mx
import MaterialX.PyMaterialXGenGlsl as glsl
import MaterialX.PyMaterialXGenMdl as mdl
import MaterialX.PyMaterialXGenOsl as osl
import MaterialX.PyMaterialXGenShader as shader
from standard_library import with_library

GENERATORS = {
    "osl": osl.OslShaderGenerator.create,
    "glsl": glsl.GlslShaderGenerator.create,
    "mdl": mdl.MdlShaderGenerator.create,
}


def shader_lengths(*, document: mx.Document) -> dict[str, list[int]]:
    """The length of the code of each output of each graph of the file, and of each material."""
    elements = [element for graph in own(document.getNodeGraphs()) for element in graph.getOutputs()]
    elements += own(document.getMaterialNodes())
    lengths = {}
    for target, create in GENERATORS.items():
        generator = create()
        context = shader.GenContext(generator)
        context.registerSourceCodeSearchPath(mx.getDefaultDataSearchPath())
        generated = [generator.generate(element.getName(), element, context) for element in elements]
        lengths[target] = [len(each.getSourceCode("pixel")) for each in generated]
    return lengths


def own(elements: list[mx.Element]) -> list[mx.Element]:
    """The elements that are not the standard library's."""
    return [element for element in elements if not element.getActiveSourceUri().endswith(("_ng.mtlx", "_defs.mtlx"))
            and "libraries" not in Path(element.getActiveSourceUri()).parts]


def check(*, path: Path) -> dict:
    """What MaterialX says about a file."""
    document = with_library(path=path)
    is_valid, message = document.validate()
    return {
        "path": str(path),
        "faults": "" if is_valid else message,
        "shaders": shader_lengths(document=document) if is_valid else {},
    }


def main() -> None:
    """Prints the reports."""
    print(json.dumps([check(path=Path(path)) for path in sys.argv[1:]]))


if __name__ == "__main__":
    main()
