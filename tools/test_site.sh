#!/bin/sh
# Tests the leaderboard's site in headless Chromium, which this installs. Arguments name tests:
# tools/test_site.sh test_site.TestBoard. `test_docs` tests the site of the documentation, which tools/docs.sh builds.
set -eu
cd "$(dirname "$0")/.."
tools/apt_install.sh chromium fonts-dejavu-core minisign
# Installs three.js and axe-core, too, which the tests use.
tools/build_viewer.sh --check
# Built with the tests' profile, so that nothing is compiled twice.
cargo test --workspace --no-run --quiet
target="${CARGO_TARGET_DIR:-$PWD/target}"
export MATEVAL="$target/debug/mateval" MATEVAL_NODE_MODULES="$target/viewer/node_modules"
[ $# -gt 0 ] || set -- test_site test_access test_room
cd tests/site && python3 -m unittest "$@"
