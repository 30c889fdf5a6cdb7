"""The tutorial and the examples of the documentation run as they are."""

import doctest
import json
import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest

import mateval

TUTORIAL = pathlib.Path(__file__).parent.parent / "tutorial.ipynb"
README = TUTORIAL.with_name("README.md")


def test_the_tutorial_ends_with_scores_and_pictures(root, command, tmp_path, monkeypatch):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    notebook = nbformat.read(TUTORIAL, as_version=4)
    monkeypatch.setenv("MATEVAL_DATASET", str(root))
    client = nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}})
    client.execute()
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    outputs = [output for cell in cells for output in cell.outputs]
    assert not [output for output in outputs if output.output_type == "stream" and output.name == "stderr"]
    pictures = [output.data["text/html"].count("<img") for output in outputs if "text/html" in output.get("data", {})]
    assert sum(pictures) >= 7, pictures
    result = mateval.Result.load(tmp_path / "first.json")
    shown = "".join(output.text for output in outputs if output.output_type == "stream")
    assert f"albedo, novel: {result['albedo.novel.psnr']:.2f} dB" in shown
    explain = next(line for line in shown.splitlines() if line.startswith("mateval eval explain"))
    monkeypatch.chdir(tmp_path)
    assert "squared error" in command(*explain.split()[1:]).stdout


def test_the_tutorial_is_typed(tmp_path):
    pytest.importorskip("mypy")
    cells = json.loads(TUTORIAL.read_text())["cells"]
    program = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    (tmp_path / "tutorial.py").write_text(program)
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "tutorial.py"], capture_output=True, text=True, cwd=tmp_path
    )
    assert checked.returncode == 0, checked.stdout


def run_example(source, root, extra):
    """Runs an example of the documentation, on the tests' dataset and its room, and returns its names."""
    namespace = {"mateval": mateval, **extra}
    exec(source.replace('"DATASET"', repr(str(root))).replace('["living"]', '["room"]'), namespace)
    return namespace


def test_the_examples_of_the_package_run(root, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    examples = doctest.DocTestParser().get_examples(mateval.__doc__)
    assert len(examples) >= 5
    grey = {"my_estimate": lambda photo: np.full(photo.shape, 0.5, np.float32)}
    run_example("".join(example.source for example in examples), root, grey)
    assert pathlib.Path("OUT/submission.json").exists()


def test_the_examples_of_the_readme_run(root, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    first, *_ = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    run_example(first, root, {"estimate": lambda photo: np.full(photo.shape, 0.5, np.float32)})
    assert pathlib.Path("OUT/submission.json").exists()
