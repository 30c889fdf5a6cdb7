"""Fixtures: the small sample dataset that tools/test_python.sh builds, and the command that built it."""

import os
import pathlib
import shutil
import subprocess

import pytest

import mateval


@pytest.fixture(scope="session")
def root():
    """The dataset's folder; tests must not write to it."""
    return pathlib.Path(os.environ["MATEVAL_DATASET"])


@pytest.fixture(scope="session")
def eight_scenes():
    """A dataset of eight tiny scenes, which are one room under eight names."""
    return pathlib.Path(os.environ["MATEVAL_EIGHT_SCENES"])


@pytest.fixture(scope="session")
def dataset(root):
    return mateval.open(root)


@pytest.fixture(scope="session")
def scene(dataset):
    return dataset["room"]


@pytest.fixture(scope="session")
def command():
    """Runs `mateval` with these words."""

    def run(*words, good=(0,)):
        done = subprocess.run([os.environ["MATEVAL_COMMAND"], *map(str, words)], capture_output=True, text=True)
        assert done.returncode in good, done.stderr
        return done

    return run


@pytest.fixture(scope="session")
def eight_greys(eight_scenes, command, tmp_path_factory):
    """The submission of `mateval baseline grey` for the eight scenes."""
    out = tmp_path_factory.mktemp("grey") / "grey"
    command("baseline", "grey", "--dataset", eight_scenes, "--out", out)
    return out


@pytest.fixture(scope="session")
def withheld(root, tmp_path_factory):
    """A copy of the dataset without its ground truth."""
    copy = tmp_path_factory.mktemp("withheld") / "dataset"
    shutil.copytree(root, copy, ignore=shutil.ignore_patterns("ground_truth"))
    return copy


@pytest.fixture(scope="session")
def nn(root, command, tmp_path_factory):
    """The submission of `mateval baseline nn`."""
    out = tmp_path_factory.mktemp("nn") / "nn"
    command("baseline", "nn", "--dataset", root, "--out", out)
    return out
