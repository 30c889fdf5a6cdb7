#!/bin/sh
# Builds, renders and verifies every scene file below a folder, and writes a page of what happened:
# tools/test_corpus.sh FOLDER [OUT]. corpus/test_corpus.py, which does it, states what is found, tried and counted as a
# failure.
# `--self-test` instead of FOLDER checks the outcomes of files that it makes.
#
# MATEVAL names the command; by default it is the tests' build.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
target="${CARGO_TARGET_DIR:-$root/target}"
if [ -z "${MATEVAL:-}" ]; then
    # Built with the tests' profile, so that nothing is compiled twice.
    (cd "$root" && cargo test --workspace --no-run --quiet)
    MATEVAL="$target/debug/mateval"
fi
exec python3 "$root/tools/corpus/test_corpus.py" --mateval "$MATEVAL" --default-out "$target/corpus" "$@"
