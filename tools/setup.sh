#!/bin/sh
# Installs what MatEval needs besides Rust and Python on Debian-like systems: a linker, pip, the LPIPS weights and
# Blender. Does nothing if all of them are installed, and needs root only if a package is missing.
set -eu
cd "$(dirname "$0")/.."
fetch=crates/cli/src/fetch

missing=""
# Rust links with it.
command -v cc >/dev/null 2>&1 || missing="$missing gcc libc6-dev"
python3 -m pip --version >/dev/null 2>&1 || missing="$missing python3-pip"
# The X and GL libraries that Blender's module is linked to. Systems other than Debian have other names for them.
! command -v dpkg >/dev/null 2>&1 || missing="$missing $(sed -n 's/^    "lib.*": "\(.*\)",$/\1/p' "$fetch/blender_module.py")"
# Package names contain no spaces.
# shellcheck disable=SC2086
[ -z "$missing" ] || tools/apt_install.sh $missing

# The same as `mateval fetch`, which has not been built yet. One that fails does not stop the other.
cache="${MATEVAL_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/mateval}"
failed=0
python3 "$fetch/lpips_weights.py" --out "$cache" >&2 || failed=$?
python3 "$fetch/blender_module.py" --cache "$cache" --requirements "$(cat "$fetch/blender_requirements.txt")" >&2 || failed=$?
exit "$failed"
