#!/bin/sh
# Tests the leaderboard's site in headless Chromium, which this installs. Arguments are passed to the test:
# tools/test_site.sh TestBoard
set -eu
cd "$(dirname "$0")/.."
tools/apt_install.sh chromium fonts-dejavu-core
# Built with the tests' profile, so that nothing is compiled twice.
cargo test --workspace --no-run --quiet
python3 tests/site/test_site.py "$@"
