#!/bin/sh
# Installs Blender 4.5 LTS as a Python module (800 MB) where `mateval` searches for it: $MATEVAL_CACHE/blender, else
# $XDG_CACHE_HOME/mateval/blender, else ~/.cache/mateval/blender. Does nothing if it is installed. Its wheels are for
# Python 3.11 only.
set -eu
cd "$(dirname "$0")/.."
cache="${MATEVAL_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/mateval}"
requirements=blender_scripts/requirements.txt

# The X and GL libraries that the module is linked to. Systems other than Debian have other names for them.
if command -v dpkg >/dev/null 2>&1; then
    tools/apt_install.sh libxrender1 libxfixes3 libxi6 libxkbcommon0 libsm6 libgl1
fi
if cmp -s "$requirements" "$cache/blender/requirements.txt"; then exit 0; fi
command -v python3.11 >/dev/null 2>&1 || {
    echo "setup: Blender's module needs Python 3.11; install python3.11, or set MATEVAL_BLENDER to a Blender 4.5" >&2
    exit 2
}
if command -v dpkg >/dev/null 2>&1; then tools/apt_install.sh python3-venv; fi
echo "setup: installing Blender into '$cache/blender'" >&2
rm -rf "$cache/blender"
mkdir -p "$cache"
python3.11 -m venv "$cache/blender"
"$cache/blender/bin/pip" install --quiet --disable-pip-version-check -r "$requirements"
# Copied last: this file marks a complete installation.
cp "$requirements" "$cache/blender/requirements.txt"
