#!/bin/sh
# Builds and renders a dataset with one process for each scene, all at once: tools/test_apart.sh [SCENES] [ROUNDS] [FOLDER].
# Each round must give the files that one process gives. tests/suite/apart.rs does the same with four scenes.
set -eu
cd "$(dirname "$0")/.."
scenes=${1:-8}
rounds=${2:-10}
work=${3:-$(mktemp -d)}
mkdir -p "$work"
work=$(realpath "$work")
cargo build --release --package mateval --bin mateval
mateval="${CARGO_TARGET_DIR:-$PWD/target}/release/mateval"

"$mateval" sample "$work/source" --houses "$scenes" --force
recipe="$work/source/recipe.toml"
sed -i 's/^resolution = .*/resolution = [32, 24]\natlas_size = 64\nsamples = 1/' "$recipe"
ids=$(sed -n 's/^id = "\(.*\)"$/\1/p' "$recipe")

# Runs `mateval prep STEP` for every scene at once.
at_once() {
    jobs=""
    for id in $ids; do
        "$mateval" prep "$@" --scene "$id" > "$work/$id.log" 2>&1 &
        jobs="$jobs $!"
    done
    for job in $jobs; do
        wait "$job"
    done
}

"$mateval" prep build "$recipe" --out "$work/serial" > /dev/null
"$mateval" prep render --scorer-samples 16 "$work/serial" > /dev/null
round=0
while [ "$round" -lt "$rounds" ]; do
    rm -rf "$work/apart"
    at_once build "$recipe" --out "$work/apart"
    "$mateval" prep finish "$work/apart" > /dev/null
    at_once render --scorer-samples 16 "$work/apart"
    "$mateval" prep finish "$work/apart" > /dev/null
    cmp "$work/serial/MANIFEST.sha256" "$work/apart/MANIFEST.sha256"
    cmp "$work/serial/dataset.json" "$work/apart/dataset.json"
    "$mateval" prep verify "$work/apart" > /dev/null
    round=$((round + 1))
done
echo "$rounds rounds of $scenes processes at once: the same files as by one process"
