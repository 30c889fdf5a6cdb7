#!/bin/sh
# Compares the tracer with Mitsuba 3 and Blender: installs Mitsuba into target/peers, then renders the same scenes with
# each. Arguments are passed to the test runner: tools/test_peers.sh mitsuba
set -eu
cd "$(dirname "$0")/.."
tools/setup.sh

# Mitsuba needs libatomic1, and LLVM 19 for its fast variant. setup.sh has installed Blender.
tools/apt_install.sh libatomic1 libllvm19 python3-venv

venv=target/peers
tools/venv.sh python3.11 "$venv" tests/peers/requirements.txt

cache="${MATEVAL_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/mateval}"
MATEVAL_PEERS_BLENDER="$cache/blender/bin/python" MATEVAL_PEERS_PYTHON="$PWD/$venv/bin/python" cargo test --workspace --test peers -- --show-output "$@"
