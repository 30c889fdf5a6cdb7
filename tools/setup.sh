#!/bin/sh
# Installs what MatEval needs beside Rust and Python, on Debian and its kin: a C++ compiler, libclang, the weights of LPIPS
# and Blender. Does nothing where everything is there.
set -eu
cd "$(dirname "$0")/.."

# libclang-cpp, which graphics drivers bring along, is another library.
have_libclang() { ldconfig -p 2>/dev/null | grep -q 'libclang[-.0-9]*\.so' || ls /usr/lib/llvm-*/lib/libclang.so* /usr/lib/llvm-*/lib/libclang-[0-9]*.so* 2>/dev/null | grep -q .; }

missing=""
command -v c++ >/dev/null 2>&1 || missing="$missing g++"
# xatlas' bindings are generated at build time.
have_libclang || missing="$missing libclang-dev"
python3 -m pip --version >/dev/null 2>&1 || missing="$missing python3-pip"
# The list of names holds no spaces of its own.
# shellcheck disable=SC2086
[ -z "$missing" ] || tools/apt_install.sh $missing

python3 tools/fetch_lpips_weights.py >&2
tools/setup_blender.sh
