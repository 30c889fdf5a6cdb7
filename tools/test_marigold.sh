#!/bin/sh
# Tests tools/run_marigold.py on a tiny model. Installs Debian's torch (0.7 GB) and, into target/marigold, the other
# requirements (0.3 GB). If all of tools/requirements_marigold.txt is installed, run tools/test_run_marigold.py
# instead.
set -eu
cd "$(dirname "$0")/.."
tools/apt_install.sh python3-torch python3-venv

venv=target/marigold
requirements=tools/requirements_marigold.txt
if ! cmp -s "$requirements" "$venv/requirements.txt"; then
    rm -rf "$venv"
    # Debian's torch is for Debian's own Python only.
    /usr/bin/python3 -m venv --system-site-packages "$venv"
    grep -v '^torch==' "$requirements" >"$venv/without_torch.txt"
    "$venv/bin/pip" install --quiet --disable-pip-version-check -r "$venv/without_torch.txt"
    cp "$requirements" "$venv/requirements.txt"
fi
"$venv/bin/python" tools/test_run_marigold.py
