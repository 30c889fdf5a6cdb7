#!/bin/sh
# Installs the named Debian packages that are missing, and waits while another program uses apt. Where it cannot install
# them, it prints them and ends with exit code 2.
set -eu
missing=""
for package in "$@"; do
    state=$(dpkg-query --show --showformat '${db:Status-Status}' "$package" 2>/dev/null) || true
    [ "$state" = installed ] || missing="$missing $package"
done
[ -n "$missing" ] || exit 0

command -v apt-get >/dev/null 2>&1 || {
    echo "setup: this system has no apt-get; install what these Debian packages contain, then run this again:$missing" >&2
    exit 2
}
give_up() {
    echo "setup: $1; have root run this, then try again: apt-get install$missing" >&2
    exit 2
}

as_root=""
if [ "$(id -u)" != 0 ]; then
    # sudo can ask for a password on a terminal only.
    { command -v sudo && { [ -t 0 ] || sudo -n true; }; } >/dev/null 2>&1 ||
        give_up "packages are missing, and you are not root and cannot use sudo"
    as_root=sudo
fi

# Waits up to ten minutes for apt's lists and archives; apt-get itself waits for dpkg's lock.
seconds=600
apt() {
    until output=$(
        $as_root env LC_ALL=C DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=600 "$@" 2>&1
    ); do
        case $output in
        *"Could not get lock"*) [ "$seconds" -gt 0 ] || give_up "another program has used apt for ten minutes" ;;
        *) give_up "apt-get $1 failed ($({ echo "$output" | grep '^E:' || echo "$output"; } | tail -n 1))" ;;
        esac
        [ "$seconds" -lt 600 ] || echo "setup: waiting for another program that uses apt" >&2
        sleep 5
        seconds=$((seconds - 5))
    done
}

echo "setup: installing$missing" >&2
apt update
# Package names contain no spaces.
# shellcheck disable=SC2086
apt install -y --no-install-recommends $missing
