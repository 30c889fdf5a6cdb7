#!/bin/sh
# Opens the exports of `prep export` with the packages that they are made for: mlcroissant, datasets, huggingface_hub and
# pycolmap, which it installs into target/exports. Arguments are passed to the test runner.
set -eu
cd "$(dirname "$0")/.."
tools/apt_install.sh python3-venv

venv=target/exports
requirements=crates/export/tests/readers/requirements.txt
if ! cmp -s "$requirements" "$venv/requirements.txt"; then
    rm -rf "$venv"
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet --disable-pip-version-check -r "$requirements"
    cp "$requirements" "$venv/requirements.txt"
fi

MATEVAL_EXPORT_PYTHON="$PWD/$venv/bin/python" cargo test -p mateval-export --test readers -- --show-output "$@"
