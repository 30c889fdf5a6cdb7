"""Tests of `blender_module.py`: no network; a Python without Blender stands in for its environment."""

from __future__ import annotations

import contextlib
import io
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "crates/cli/src/fetch"))

import blender_module as tool  # noqa: E402

WANTED = "bpy==4.5.15\n"


class WholeRun(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.cache = Path(folder.name)
        self.folder = self.cache / "blender"

    def run_tool(self) -> tuple[int, str, str]:
        with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
            code = tool.main(["--cache", str(self.cache), "--requirements", WANTED.strip()])
        return code, out.getvalue(), err.getvalue()

    def environment(self, *, script: str, mark: str | None) -> None:
        """Writes an environment whose Python is a shell script."""
        python = self.folder / "bin" / "python"
        python.parent.mkdir(parents=True)
        python.write_text(f"#!/bin/sh\n{script}\n", encoding="ascii")
        python.chmod(0o755)
        if mark is not None:
            (self.folder / "requirements.txt").write_text(mark, encoding="ascii")

    def test_an_installed_module_is_kept(self) -> None:
        self.environment(script="exit 0", mark=WANTED)
        with mock.patch.object(tool, "install") as install:
            self.assertEqual(self.run_tool(), (0, f"{self.folder / 'bin/python'}\n", ""))
        install.assert_not_called()

    def test_an_incomplete_and_another_installation_are_made_anew(self) -> None:
        for mark in (None, "bpy==4.2.0\n"):
            with self.subTest(mark=mark):
                if self.folder.exists():
                    tool.shutil.rmtree(self.folder)
                self.environment(script="exit 0", mark=mark)
                with mock.patch.object(tool, "install") as install:
                    self.run_tool()
                install.assert_called_once_with(folder=self.folder, requirements=WANTED)

    def test_a_missing_library_is_named(self) -> None:
        self.environment(script="echo 'ImportError: libSM.so.6: no such file' >&2; exit 1", mark=WANTED)
        code, out, err = self.run_tool()
        self.assertEqual((code, out), (2, ""))
        self.assertRegex(err, "libSM.so.6.*apt-get install.*libsm6.*MATEVAL_BLENDER")

    def test_a_pip_that_fails_leaves_no_mark(self) -> None:
        def stand_in(*, command: list[str], problem: str) -> None:
            if "venv" in command:
                self.folder.mkdir()
            else:
                raise tool.FetchError(problem)

        with mock.patch.object(tool, "run", stand_in), mock.patch.object(tool, "python_3_11", return_value="python"):
            code, _, err = self.run_tool()
        self.assertEqual(code, 2)
        self.assertIn("pip could not install Blender", err)
        self.assertFalse((self.folder / "requirements.txt").exists())

    def test_without_python_3_11_nothing_is_removed(self) -> None:
        self.environment(script="exit 0", mark="bpy==4.2.0\n")
        with mock.patch.object(tool.sys, "version_info", (3, 9, 2)), mock.patch.object(tool.shutil, "which", return_value=None):
            code, _, err = self.run_tool()
        self.assertEqual(code, 2)
        self.assertRegex(err, "needs Python 3.11; this is 3.9.*MATEVAL_BLENDER")
        self.assertTrue((self.folder / "bin" / "python").exists())


if __name__ == "__main__":
    unittest.main()
