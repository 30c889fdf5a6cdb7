"""Tests of `blender_module.py`: no network; a Python without Blender stands in for its environment."""

from __future__ import annotations

import contextlib
import io
import os
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
            note = f"already present: Blender 4.5 in '{self.folder}'\n"
            self.assertEqual(self.run_tool(), (0, f"{self.folder / 'bin/python'}\n", note))
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

    def test_a_module_whose_python_was_removed_is_installed_again(self) -> None:
        self.environment(script="exit 0", mark=WANTED)
        (self.folder / "bin" / "python").unlink()
        (self.folder / "bin" / "python").symlink_to(self.cache / "removed")
        with mock.patch.object(tool, "install") as install:
            self.run_tool()
        install.assert_called_once_with(folder=self.folder, requirements=WANTED)

    def program(self, *, name: str, script: str) -> Path:
        """Writes a shell script into the folder that stands in for the PATH."""
        path = self.cache / "path" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"#!/bin/sh\n{script}\n", encoding="ascii")
        path.chmod(0o755)
        return path

    def lacking(self) -> tuple[int, str, str]:
        """Runs the tool on an environment whose Python finds no libXi, with what is in the stand-in for the PATH."""
        problem = "ImportError: libXi.so.6: cannot open shared object file: No such file or directory"
        self.environment(script=f"echo /bpy/__init__.so; echo '{problem}'; exit 1", mark=WANTED)
        (self.cache / "path").mkdir(exist_ok=True)
        with mock.patch.dict(os.environ, {"PATH": str(self.cache / "path")}):
            return self.run_tool()

    def test_all_missing_libraries_and_their_packages_are_named(self) -> None:
        found = "libm.so.6 => /lib/libm.so.6 (0x1)"
        missing = [f"{name} => not found" for name in ("libXi.so.6", "libSM.so.6", "libXi.so.6", "libodd.so")]
        self.program(name="ldd", script="".join(f"echo '\t{line}';" for line in (found, *missing)))
        code, out, err = self.lacking()
        self.assertEqual((code, out, err.count("\n")), (2, "", 1))
        named = "Blender lacks these libraries: libSM.so.6, libXi.so.6, libodd.so;"
        self.assertRegex(err, f"^error: downloaded into '.*', but {named}")
        self.assertIn("apt-get install libsm6 libxi6, then run this again), or use --renderer builtin", err)

    def test_without_ldd_the_library_is_named_that_python_names(self) -> None:
        code, out, err = self.lacking()
        self.assertEqual((code, out), (2, ""))
        self.assertRegex(err, "lacks these libraries: libXi.so.6; .*apt-get install libxi6, then")

    def test_a_library_of_no_known_package_is_named(self) -> None:
        self.program(name="ldd", script="echo 'libodd.so => not found'")
        _, _, err = self.lacking()
        self.assertRegex(err, "libodd.so; install them and run this again, or use --renderer builtin")

    def test_a_module_that_fails_otherwise_is_not_said_to_lack_a_library(self) -> None:
        odd = "echo /m; echo 'ValueError: odd'; exit 1"
        for script, words in ((odd, "ValueError: odd"), ("kill -4 $$", "signal 4")):
            with self.subTest(words):
                if self.folder.exists():
                    tool.shutil.rmtree(self.folder)
                self.environment(script=script, mark=WANTED)
                code, _, err = self.run_tool()
                self.assertEqual(code, 2)
                self.assertRegex(err, f"downloaded into .*cannot be imported by .*python': {words}; .*builtin")

    def test_check_refuses_a_python_without_the_module(self) -> None:
        with contextlib.redirect_stderr(io.StringIO()) as err:
            self.assertEqual(tool.main(["--check"]), 2)
        self.assertIn(f"'{sys.executable}' has no module bpy", err.getvalue())

    def install_by(self, *, ensurepip: int, pip: int) -> tuple[int, str, str]:
        """Runs the tool with a Python 3.11 that has or lacks ensurepip and pip, and records its commands."""
        script = f"""echo "$@" >> '{self.cache}/commands'
        case "$*" in
        *ensurepip*) exit {ensurepip};;
        *"pip --version") exit {pip};;
        *"-m venv "*) mkdir -p '{self.folder}/bin'; cp "$0" '{self.folder}/bin/python';; esac"""
        python = self.program(name="python3.11", script=script)
        with mock.patch.object(tool, "python_3_11", return_value=str(python)):
            return self.run_tool()

    def test_where_debian_keeps_ensurepip_apart_a_pip_outside_installs(self) -> None:
        code, out, _ = self.install_by(ensurepip=1, pip=0)
        self.assertEqual((code, out), (0, f"{self.folder / 'bin/python'}\n"))
        commands = (self.cache / "commands").read_text()
        self.assertIn(f"-m venv {self.folder} --without-pip\n", commands)
        self.assertIn(f"-m pip --python {self.folder}/bin/python install", commands)

    def test_with_ensurepip_the_pip_inside_installs(self) -> None:
        self.assertEqual(self.install_by(ensurepip=0, pip=1)[0], 0)
        commands = (self.cache / "commands").read_text()
        self.assertNotIn("--without-pip", commands)
        self.assertIn("\n-m pip install", commands)

    def test_without_any_pip_it_says_what_to_install(self) -> None:
        self.environment(script="exit 0", mark="bpy==4.2.0\n")
        code, _, err = self.install_by(ensurepip=1, pip=1)
        self.assertEqual(code, 2)
        self.assertTrue((self.folder / "bin" / "python").exists())
        self.assertRegex(err, "has no pip.*apt-get install python3.11-venv.*--renderer builtin")

    def test_a_pip_that_fails_leaves_nothing_and_is_run_again(self) -> None:
        script = f"""case "$*" in *"-m venv "*) mkdir -p '{self.folder}/bin'; cp "$0" '{self.folder}/bin/python';;
        *" install "*) echo 'connection broken'; exit 1;; esac"""
        python = self.program(name="python3.11", script=script)
        for _ in range(2):
            with mock.patch.object(tool, "python_3_11", return_value=str(python)):
                code, _, err = self.run_tool()
            self.assertEqual(code, 2)
            self.assertRegex(err, "\nerror: pip could not fetch Blender: the package index was not .* builtin, which")
            self.assertFalse(self.folder.exists())

    def test_a_virtual_environment_that_cannot_be_made_is_reported(self) -> None:
        script = "case \"$*\" in *'-m venv '*) echo \"Error: [Errno 13] Permission denied: '/x'\"; exit 1;; esac"
        python = self.program(name="python3.11", script=script)
        with mock.patch.object(tool, "python_3_11", return_value=str(python)):
            code, _, err = self.run_tool()
        self.assertEqual(code, 2)
        self.assertRegex(err, "^error: cannot make a virtual environment in .*Permission denied: '/x'; or use")

    def test_without_python_3_11_nothing_is_removed(self) -> None:
        self.environment(script="exit 0", mark="bpy==4.2.0\n")
        version = mock.patch.object(tool.sys, "version_info", (3, 9, 2))
        with version, mock.patch.object(tool.shutil, "which", return_value=None):
            code, _, err = self.run_tool()
        self.assertEqual(code, 2)
        self.assertRegex(err, "needs Python 3.11; this is 3.9.*MATEVAL_BLENDER.*--renderer builtin")
        self.assertTrue((self.folder / "bin" / "python").exists())

    def test_a_python_3_11_that_does_not_run_counts_as_missing(self) -> None:
        shim = self.program(name="python3.11", script="echo 'no such version is chosen' >&2; exit 127")
        path = mock.patch.dict(os.environ, {"PATH": str(shim.parent)})
        with path, mock.patch.object(tool.sys, "version_info", (3, 13, 2)):
            code, _, err = self.run_tool()
        self.assertEqual(code, 2)
        self.assertRegex(err, "this is 3.13.*--renderer builtin")


if __name__ == "__main__":
    unittest.main()
