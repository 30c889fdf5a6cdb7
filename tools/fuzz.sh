#!/bin/sh
# Runs every fuzz target of tests/fuzz for SECONDS (default 60), or only the targets that are named:
#   tools/fuzz.sh [SECONDS [TARGET...]]
# Needs cargo-fuzz (cargo install cargo-fuzz) and a stable Rust. Inputs that crash are kept in
# tests/fuzz/artifacts/TARGET/.
set -eu
cd "$(dirname "$0")/.."
seconds="${1:-60}"
[ "$#" -eq 0 ] || shift
# libFuzzer's counters need compiler flags that are not stable.
export RUSTC_BOOTSTRAP=1
# The fuzz targets are built with the same versions as everything else.
cp Cargo.lock tests/fuzz/Cargo.lock
[ "$#" -gt 0 ] || set -- $(ls tests/fuzz/src/bin | sed -n '/^seeds\.rs$/d; s/\.rs$//p')
cargo fuzz build --fuzz-dir tests/fuzz
"tests/fuzz/target/$(rustc -vV | sed -n 's/^host: //p')/release/seeds" tests/fuzz/corpus
failed=""
# Threads that outlive a run make libFuzzer search for leaks after every run, which would take nearly all of the time,
# so leak detection is off.
for target in "$@"; do
  mkdir -p "tests/fuzz/corpus/$target"
  echo "== $target for $seconds s"
  cargo fuzz run --fuzz-dir tests/fuzz "$target" -- \
    -max_total_time="$seconds" -rss_limit_mb=2048 -timeout=10 -max_len=131072 -print_final_stats=1 -detect_leaks=0 || failed="$failed $target"
done
[ -z "$failed" ] || { echo "crashed:$failed" >&2; exit 1; }
