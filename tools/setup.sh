#!/bin/sh
# Installs what MatEval needs beside Rust and Python, on Debian and its kin, and fetches the weights of LPIPS.
# Does nothing where everything is there.
set -eu
cd "$(dirname "$0")/.."

have_libclang() { ldconfig -p 2>/dev/null | grep -q 'libclang[-.0-9]*\.so' || ls /usr/lib/llvm-*/lib/libclang*.so* >/dev/null 2>&1; }

missing=""
command -v c++ >/dev/null 2>&1 || missing="$missing g++"
# xatlas' bindings are generated at build time.
have_libclang || missing="$missing libclang-dev"
python3 -m pip --version >/dev/null 2>&1 || missing="$missing python3-pip"

if [ -n "$missing" ]; then
    command -v apt-get >/dev/null 2>&1 || {
        echo "setup: install these with your system's own tool, then run this again:$missing" >&2
        exit 2
    }
    as_root=""
    [ "$(id -u)" = 0 ] || as_root=sudo
    echo "setup: installing$missing" >&2
    $as_root apt-get update -qq
    # The lists of names hold no spaces of their own.
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive $as_root apt-get install -y -qq --no-install-recommends $missing >/dev/null
fi

python3 tools/fetch_lpips_weights.py >&2
