#!/bin/sh
# Runs all tests: those of the Python tools, then those of every crate. A failing crate does not stop the others.
set -eu
cd "$(dirname "$0")/.."
python3 tools/test_lpips_weights.py
python3 tools/test_blender_module.py
python3 tools/test_run_marigold.py
python3 blender_scripts/tests/test_pure.py
cargo test --workspace --no-fail-fast
