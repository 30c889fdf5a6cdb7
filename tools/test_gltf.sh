#!/bin/sh
# Reads glTF files that trimesh and three.js write; installs both. Arguments are passed to the test runner.
set -eu
cd "$(dirname "$0")/.."
tools/apt_install.sh python3-venv nodejs
# Installs three.js, too.
tools/build_viewer.sh --check

target="${CARGO_TARGET_DIR:-$PWD/target}"
venv=$target/gltf
tools/venv.sh python3 "$venv" crates/sources/tests/writers/requirements.txt

MATEVAL_GLTF_PYTHON="$venv/bin/python" MATEVAL_GLTF_NODE_MODULES="$target/viewer/node_modules" \
    cargo test -p mateval-sources --test writers -- --show-output "$@"
