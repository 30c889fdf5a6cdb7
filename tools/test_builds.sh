#!/bin/sh
# Checks that the optimised build and the tests' build write the same bytes for the sample: dataset, pictures,
# submission and score.
set -eu
cd "$(dirname "$0")/.."
# Builds the command with the tests' profile; nothing is compiled that the tests have not compiled.
cargo test --workspace --no-run --quiet
cargo build --release --quiet

target="${CARGO_TARGET_DIR:-target}"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for build in debug release; do
    mateval="$target/$build/mateval"
    out="$folder/$build"
    "$mateval" sample "$out/source"
    sed -i 's/^resolution = .*/resolution = [96, 72]\natlas_size = 128/' "$out/source/recipe.toml"
    "$mateval" prep build "$out/source/recipe.toml" --out "$out/dataset"
    "$mateval" prep render --renderer builtin --samples 2 --scorer-samples 16 "$out/dataset"
    "$mateval" baseline nn --dataset "$out/dataset" --out "$out/nn"
    "$mateval" eval score "$out/nn" --dataset "$out/dataset" --out "$out/RESULT.json"
done
for file in dataset/MANIFEST.sha256 RESULT.json; do
    cmp "$folder/debug/$file" "$folder/release/$file" || {
        echo "test_builds: $file of the optimised build differs from that of the tests' build" >&2
        exit 1
    }
done
echo "test_builds: both builds write the same dataset and the same score"
