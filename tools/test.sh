#!/bin/sh
# All tests: the Python tools', then every crate's, all of them even where one fails.
set -eu
cd "$(dirname "$0")/.."
python3 tools/test_fetch_lpips_weights.py
python3 tools/test_run_marigold.py
python3 blender_scripts/tests/test_pure.py
cargo test --workspace --no-fail-fast
