#!/bin/sh
# Installs what MatEval needs besides Rust and Python on Debian-like systems: a C++ compiler, libclang, the LPIPS
# weights and Blender. Does nothing if all of them are installed.
set -eu
cd "$(dirname "$0")/.."

# libclang-cpp, which graphics drivers install, is a different library.
have_libclang() { ldconfig -p 2>/dev/null | grep -q 'libclang[-.0-9]*\.so' || ls /usr/lib/llvm-*/lib/libclang.so* /usr/lib/llvm-*/lib/libclang-[0-9]*.so* 2>/dev/null | grep -q .; }

missing=""
command -v c++ >/dev/null 2>&1 || missing="$missing g++"
# The bindings of xatlas are generated at build time, which needs libclang.
have_libclang || missing="$missing libclang-dev"
python3 -m pip --version >/dev/null 2>&1 || missing="$missing python3-pip"
# Package names contain no spaces.
# shellcheck disable=SC2086
[ -z "$missing" ] || tools/apt_install.sh $missing

fetch=crates/cli/src/fetch
# The X and GL libraries that Blender's module is linked to. Systems other than Debian have other names for them.
libraries=$(sed -n 's/^LIBRARIES = "\(.*\)"$/\1/p' "$fetch/blender_module.py")
if command -v dpkg >/dev/null 2>&1; then
    # shellcheck disable=SC2086
    tools/apt_install.sh $libraries python3-venv
fi

# The same as `mateval fetch`, which has not been built yet.
cache="${MATEVAL_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/mateval}"
python3 "$fetch/lpips_weights.py" --out "$cache" >&2
python3 "$fetch/blender_module.py" --cache "$cache" --requirements "$(cat "$fetch/blender_requirements.txt")" >&2
