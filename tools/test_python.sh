#!/bin/sh
# Builds the wheel of the Python package and tests it in fresh environments of those of Python 3.9, 3.11 and 3.13 that are
# found. Arguments are passed to pytest. PYTHONS="python3.11 ..." chooses interpreters; those that pyenv keeps are found
# too. MATEVAL_PROFILE=dev builds with the tests' profile, which shares its libraries with tools/test.sh, and tests the
# oldest and the newest of those found alone, unless PYTHONS is given; what takes minutes and is the same under every
# Python, comparing with the command's own files, is then tested under the newest alone.
# MATEVAL_WHEELS=FOLDER builds nothing: it tests the wheel for this processor in FOLDER, whose own command then makes the
# dataset. MATEVAL_TORCH=1 also tests mateval.torch with Debian's PyTorch, which it installs: 150 MB of downloads, 650 MB
# on disk. (PyPI's wheels for Linux on x86_64 hold CUDA: gigabytes.)
set -eu
cd "$(dirname "$0")/.."
tools/apt_install.sh python3-venv
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

if [ -n "${MATEVAL_WHEELS:-}" ]; then
    dist=$(realpath "$MATEVAL_WHEELS")
    python3 -m venv "$work/wheel"
    "$work/wheel/bin/pip" install --quiet "$dist"/*_"$(uname -m)".whl
    mateval="$work/wheel/bin/mateval"
else
    dist="$work/dist"
    profile="${MATEVAL_PROFILE:-release}"
    # The folder of the profile `dev` has another name.
    folder="$(echo "$profile" | sed 's/^dev$/debug/')"
    # Named together with the extension module, so that both use the libraries with the same features.
    cargo build --profile "$profile" --package mateval --package mateval-python --bin mateval
    mateval="${CARGO_TARGET_DIR:-$PWD/target}/$folder/mateval"

    python3 -m venv "$work/maturin"
    "$work/maturin/bin/pip" install --quiet 'maturin>=1.9.4,<2'
    "$work/maturin/bin/maturin" build --profile "$profile" --manifest-path crates/python/Cargo.toml --out "$dist"
fi
ls -l "$dist"

# One scene of the built-in sample, small enough to be rendered in seconds.
"$mateval" sample "$work/source"
printf '%s\n' 'name = "sample"' 'resolution = [96, 72]' 'atlas_size = 128' \
    '[[scene]]' 'id = "room"' 'bitterli = "room/scene.xml"' 'house = "sample"' > "$work/source/recipe.toml"
"$mateval" prep build "$work/source/recipe.toml" --out "$work/dataset"
"$mateval" prep render "$work/dataset" --renderer builtin --samples 1 --scorer-samples 16

{
    printf '%s\n' 'name = "eight"' 'resolution = [32, 24]' 'atlas_size = 64'
    for number in 1 2 3 4 5 6 7 8; do
        printf '%s\n' '[[scene]]' "id = \"room$number\"" 'bitterli = "room/scene.xml"' 'house = "sample"'
    done
} > "$work/source/eight.toml"
"$mateval" prep build "$work/source/eight.toml" --out "$work/eight"
"$mateval" prep render "$work/eight" --renderer builtin --samples 1 --scorer-samples 16

# pyenv's commands of other versions than the chosen one are in no folder of PATH.
PATH="$PATH:$(echo "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.*/bin | tr ' ' ':')"
found=""
for name in ${PYTHONS:-python3.9 python3.11 python3.13}; do
    # `command -v` would find pyenv's shim, which fails for versions that are not chosen.
    python=$(which -a "$name" | while read -r path; do "$path" -c 'import venv' 2> /dev/null && echo "$path" && break; done)
    [ -n "$python" ] || { echo "$name was not found, and is not tested"; continue; }
    found="$found $python"
done
[ -n "$found" ] || { echo "none of these Pythons was found" >&2; exit 1; }
if [ "${MATEVAL_PROFILE:-}" = dev ] && [ -z "${PYTHONS:-}" ]; then
    found=$(printf '%s\n' $found | sed -n '1p; 1!{$p}')
    newest=$(printf '%s\n' $found | tail -n 1)
fi
export MATEVAL_COMMAND="$mateval" MATEVAL_DATASET="$work/dataset" MATEVAL_EIGHT_SCENES="$work/eight" MATEVAL_WHEELS="$dist"
tested=0
for python in $found; do
    "$python" --version
    fewer=""
    [ "${newest:-$python}" = "$python" ] || fewer="not is_the_commands"
    "$python" -m venv "$work/env$tested"
    "$work/env$tested/bin/pip" install --quiet "$dist"/*_"$(uname -m)".whl pytest mypy trimesh pandas nbclient ipykernel
    "$work/env$tested/bin/python" -m pytest -q -p no:cacheprovider crates/python/tests ${fewer:+-k "$fewer"} "$@"
    tested=$((tested + 1))
done

if [ -n "${MATEVAL_TORCH:-}" ]; then
    tools/apt_install.sh python3-torch
    # Debian's torch is for Debian's own Python only.
    /usr/bin/python3 -m venv --system-site-packages "$work/torch"
    "$work/torch/bin/pip" install --quiet "$dist"/*_"$(uname -m)".whl pytest
    # Without it the tests would be skipped.
    "$work/torch/bin/python" -c 'import torch; print("PyTorch", torch.__version__)'
    "$work/torch/bin/python" -m pytest -q -p no:cacheprovider crates/python/tests/test_torch.py
else
    echo "mateval.torch was not tested with PyTorch; MATEVAL_TORCH=1 does"
fi
