#!/bin/sh
# The tracer against Mitsuba 3 and Blender: installs both into target/peers (1.2 GB), then renders the same scenes with each.
# Arguments go to the test runner: tools/test_peers.sh mitsuba
set -eu
cd "$(dirname "$0")/.."
tools/setup.sh

# mitsuba: libatomic1, and LLVM 19 for its fast variant. bpy: the libraries of X and GL that it is linked to.
packages="libatomic1 libllvm19 libxrender1 libxfixes3 libxi6 libxkbcommon0 libsm6 libgl1 python3-venv"
missing=""
for package in $packages; do
    dpkg -s "$package" >/dev/null 2>&1 || missing="$missing $package"
done
if [ -n "$missing" ]; then
    as_root=""
    [ "$(id -u)" = 0 ] || as_root=sudo
    echo "test_peers: installing$missing" >&2
    $as_root apt-get update -qq
    # The list of names holds no spaces of its own.
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive $as_root apt-get install -y -qq --no-install-recommends $missing >/dev/null
fi

venv=target/peers
requirements=tests/peers/requirements.txt
if ! cmp -s "$requirements" "$venv/requirements.txt"; then
    rm -rf "$venv"
    python3.11 -m venv "$venv"
    "$venv/bin/pip" install --quiet --disable-pip-version-check -r "$requirements"
    cp "$requirements" "$venv/requirements.txt"
fi

MATEVAL_PEERS_PYTHON="$PWD/$venv/bin/python" cargo test --test peers -- --show-output "$@"
