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

python3 tools/fetch_lpips_weights.py >&2
tools/setup_blender.sh
