#!/bin/sh
# Installs the Python package in a Debian 12 that holds Python and nothing else of MatEval's, and runs the demo there,
# as a new user would: `tools/test_bare_debian.sh WHEEL [FOLDER]`. Needs root, debootstrap and a network. The system is
# made in FOLDER (default: target/bare_debian; 0.5 GB, and 1 GB with Blender) and kept for the next run.
set -eu
wheel=$(realpath "$1")
cd "$(dirname "$0")/.."
root=${2:-target/bare_debian}
[ -d "$root/usr" ] || debootstrap --variant=minbase --include=ca-certificates,python3-venv bookworm "$root"

# The network of this machine.
cp /etc/resolv.conf "$root/etc/resolv.conf"
cp /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/ca-certificates.crt"
mkdir -p "$root/wheels"
rm -rf "$root"/wheels/* "$root/demo" "$root/venv"
cp "$wheel" "$root/wheels/"
mountpoint -q "$root/proc" || mount -t proc proc "$root/proc"
trap 'umount "$root/proc"' EXIT

in_system() { chroot "$root" /usr/bin/env HOME=/home LC_ALL=C.UTF-8 PATH=/venv/bin:/usr/sbin:/usr/bin:/sbin:/bin sh -euc "$1"; }
seconds() {
    before=$(date +%s)
    in_system "$2"
    echo "$1: $(($(date +%s) - before)) s"
}

in_system 'for tool in cargo cc git; do if command -v $tool; then exit 1; fi; done'
seconds "pip install" 'python3 -m venv /venv && pip install --quiet --disable-pip-version-check /wheels/*.whl'
seconds "mateval fetch lpips" 'mateval fetch lpips'
# The first answer names the libraries that Blender lacks; with them it works.
seconds "mateval fetch blender" '
    mateval fetch blender 2> /tmp/refused || {
        cat /tmp/refused >&2
        libraries=$(sed -n "s/.*apt-get install \([a-z0-9 -]*\), then.*/\1/p" /tmp/refused)
        apt-get update -qq && apt-get install -y -qq --no-install-recommends $libraries > /dev/null
        mateval fetch blender
    }'
seconds "mateval demo" 'mateval demo --out /demo'
test -s "$root/demo/leaderboard/index.html"
