#!/bin/sh
# Compares the nodes and graphs of crates/procedural with MaterialX' own: its checks of files, its code generators, and
# the OSL that it generates, evaluated in Blender's Cycles. Installs MaterialX into target/materialx. Arguments are
# passed to the test runner.
set -eu
cd "$(dirname "$0")/.."
# Installs Blender.
tools/setup.sh
tools/apt_install.sh python3-venv

venv=target/materialx
tools/venv.sh python3.11 "$venv" crates/procedural/tests/peers/requirements.txt

cache="${MATEVAL_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/mateval}"
MATEVAL_PEERS_BLENDER="$cache/blender/bin/python" MATEVAL_MATERIALX_PYTHON="$PWD/$venv/bin/python" cargo test -p mateval-procedural --test peers -- --show-output "$@"
