#!/bin/sh
# Installs the named Debian packages that are missing. On a system without apt-get it prints them and fails.
set -eu
missing=""
for package in "$@"; do
    dpkg -s "$package" >/dev/null 2>&1 || missing="$missing $package"
done
[ -n "$missing" ] || exit 0
command -v apt-get >/dev/null 2>&1 || {
    echo "setup: install these packages with your system's package manager, then run this again:$missing" >&2
    exit 2
}
as_root=""
[ "$(id -u)" = 0 ] || as_root=sudo
echo "setup: installing$missing" >&2
$as_root apt-get update -qq
# Package names contain no spaces.
# shellcheck disable=SC2086
DEBIAN_FRONTEND=noninteractive $as_root apt-get install -y -qq --no-install-recommends $missing >/dev/null
