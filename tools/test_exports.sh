#!/bin/sh
# Opens the exports of `prep export` with the packages that they are made for: mlcroissant, datasets, huggingface_hub and
# pycolmap, which it installs into target/exports. Arguments are passed to the test runner.
set -eu
cd "$(dirname "$0")/.."
tools/apt_install.sh python3-venv

venv=target/exports
tools/venv.sh python3 "$venv" crates/export/tests/readers/requirements.txt

MATEVAL_EXPORT_PYTHON="$PWD/$venv/bin/python" cargo test -p mateval-export --test readers -- --show-output "$@"
