#!/bin/sh
# Computes every number of two results again with NumPy, SciPy, scikit-image and flip-evaluator, from the pictures that
# `eval score --pictures` writes: tools/test_independent.sh [WEIGHTS]. With the file of LPIPS' weights, LPIPS too; that needs
# lpips, torch and safetensors in target/independent. Uses the dataset of tools/test_demo.sh, which must have run.
set -eu
cd "$(dirname "$0")/.."
tools/apt_install.sh python3-venv
target="${CARGO_TARGET_DIR:-$PWD/target}" venv="${CARGO_TARGET_DIR:-$PWD/target}/independent"
tools/venv.sh python3.11 "$venv" tests/independent/requirements.txt
demo="$target/test-demo" work="$target/independent_work"
rm -rf "$work"
mkdir -p "$work"
for method in nn grey; do
    "$target/debug/mateval" eval score "$demo/submissions/$method" --dataset "$demo/dataset" --scene room \
        --out "$work/$method.json" --pictures "$work/$method"
    "$venv/bin/python" tests/independent/recompute.py "$demo/dataset" "$work/$method" "$work/$method.json" "$@"
done
