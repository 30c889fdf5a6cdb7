"""Writes the Python package as mkdocstrings reads it, to the folder that is given.

The compiled module knows the docstrings, its stub the types. This joins both to one file of Python, `_core.py`, and copies
the other files: python api.py EXTENSION FOLDER
"""

import ast
import importlib
import re
import shutil
import sys
from pathlib import Path

PACKAGE = Path("crates/python/python/mateval")
EXAMPLE = re.compile(r"^( *)>>> .*\n(?:\1(?:>>>|\.\.\.) .*\n)*", re.MULTILINE)


def fenced(text: str) -> str:
    """A text with its examples in blocks of code."""
    return EXAMPLE.sub(r"\1```python\n\g<0>\1```\n", text)


def document(node: ast.AST, thing: object) -> None:
    """Puts the docstrings of a class and its members, or of a function, into its stub."""
    if text := getattr(thing, "__doc__", None):
        node.body.insert(0, ast.Expr(ast.Constant(fenced(text + "\n"))))
    for member in node.body if isinstance(node, ast.ClassDef) else []:
        if isinstance(member, ast.FunctionDef) and member.name == "__new__":
            # mkdocstrings shows the arguments of this name with the class.
            member.name, member.returns = "__init__", None
        elif isinstance(member, ast.FunctionDef) and not member.name.startswith("__"):
            document(member, getattr(thing, member.name))


def main(extension: str, folder: str) -> None:
    package = Path(folder) / "mateval"
    shutil.rmtree(package, ignore_errors=True)
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    compiled = package / "_core.abi3.so"
    shutil.copyfile(extension, compiled)
    sys.dont_write_bytecode = True
    sys.path.insert(0, folder)
    core = importlib.import_module("mateval._core")
    stub = ast.parse((package / "_core.pyi").read_text())
    for node in stub.body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            document(node, getattr(core, node.name))
    for file in package.glob("*.py"):
        file.write_text(fenced(file.read_text()))
    (package / "_core.py").write_text(ast.unparse(stub))
    (package / "_core.pyi").unlink()
    compiled.unlink()


main(*sys.argv[1:])
