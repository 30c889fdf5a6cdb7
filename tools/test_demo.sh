#!/bin/sh
# Runs the demo of the tests' build, with few samples, and compares the
# README's table with its results. Albedo scores do not depend on samples.
set -eu
cd "$(dirname "$0")/.."
# Built with the tests' profile, so that nothing is compiled twice.
cargo test --workspace --no-run --quiet
out="${CARGO_TARGET_DIR:-target}/test-demo"
rm -rf "$out"
"${CARGO_TARGET_DIR:-target}/debug/mateval" demo --out "$out" --samples 4
python3 tests/readme_table.py "$out/results"
