"""Generates the OSL of the base colour of .mtlx files, with the place as inputs `place_u` and `place_v`.

    generate_osl.py FOLDER

Writes NAME.osl beside every NAME.mtlx of the folder, and the headers that they include.
"""

import shutil
import sys
from pathlib import Path

import MaterialX as mx
import MaterialX.PyMaterialXGenOsl as osl
import MaterialX.PyMaterialXGenShader as shader
from standard_library import with_library


def open_place(*, graph: mx.NodeGraph) -> None:
    """Replaces texture coordinates by inputs of the graph: the shader's own are not metres."""
    for axis in "uv":
        graph.addInput(f"place_{axis}", "float").setValueString("0.0")
    for node in graph.getNodes("texcoord"):
        node.setCategory("combine2")
        for axis, name in (("u", "in1"), ("v", "in2")):
            node.addInput(name, "float").setInterfaceName(f"place_{axis}")


def main() -> None:
    """Writes the shaders."""
    folder = Path(sys.argv[1])
    libraries = Path(mx.__file__).parent / "libraries"
    for header in (libraries / "stdlib/genosl/include").iterdir():
        shutil.copy(header, folder)
    for path in sorted(folder.glob("*.mtlx")):
        document = with_library(path=path)
        graph = next(graph for graph in document.getNodeGraphs() if graph.getName() == f"NG_{path.stem}")
        open_place(graph=graph)
        generator = osl.OslShaderGenerator.create()
        context = shader.GenContext(generator)
        context.registerSourceCodeSearchPath(mx.getDefaultDataSearchPath())
        generated = generator.generate("generated", graph.getOutput("base_color"), context)
        path.with_suffix(".osl").write_text(generated.getSourceCode("pixel"))


if __name__ == "__main__":
    main()
