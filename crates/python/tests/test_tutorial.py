"""The tutorial runs as it is, and prints what the score says."""

import pathlib
import re
import subprocess
import sys

import mateval

TUTORIAL = pathlib.Path(__file__).parent.parent / "tutorial.py"


def test_the_tutorial_ends_with_the_scores_of_its_submission(root, dataset, command, tmp_path):
    out = tmp_path / "first"
    done = subprocess.run([sys.executable, TUTORIAL, root, out], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "within the photo's frame" in done.stdout
    novel = re.search(r"novel: (\S+)", done.stdout)
    assert novel and novel[1] == f"{mateval.score(out, dataset)['albedo.novel.psnr']:.2f}"
    explained = re.search(r"mateval (eval explain .*)", done.stdout)
    assert explained and "squared error" in command(*explained[1].split()).stdout
    # A second run replaces the submission.
    assert mateval.lint(out, dataset).good


def test_a_dataset_that_does_not_exist_ends_it(tmp_path):
    done = subprocess.run([sys.executable, TUTORIAL, tmp_path / "none", tmp_path / "out"], capture_output=True, text=True)
    assert done.returncode != 0 and "none" in done.stderr
    assert not (tmp_path / "out").exists()


def test_without_the_truth_it_ends_after_the_check(withheld, tmp_path):
    done = subprocess.run([sys.executable, TUTORIAL, withheld, tmp_path / "out"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "the truth is withheld" in done.stdout and "PSNR" not in done.stdout
