#!/bin/sh
# Measures the cost of scoring a room, with MatEval and with other projects' software (Mitsuba, scikit-image, lpips).
# Installs the latter into target/peers_score (2.9 GB to download, 5.8 GB on disk), builds a dataset of two real rooms
# and a submission, and runs the bench. MATEVAL_DATA is the folder of the rooms; by default it is ../shared/data.
# Arguments are passed to the bench: `full` times every iteration of the fit.
set -eu
cd "$(dirname "$0")/.."
tools/setup.sh
# Mitsuba needs libatomic1, and LLVM 19 for its fast variant.
tools/apt_install.sh libatomic1 libllvm19 python3-venv

data="${MATEVAL_DATA:-$PWD/../shared/data}"
if ! [ -d "$data/3d-front" ]; then
    echo "SKIPPED: no 3d-front in '$data'; set MATEVAL_DATA" >&2
    exit 0
fi

venv=target/peers_score
tools/venv.sh python3.11 "$venv" tests/peers/requirements_score.txt

rooms=target/whole_room
recipe=crates/eval/benches/whole_room/recipe.toml
if ! cmp -s "$recipe" "$rooms/recipe.toml"; then
    rm -rf "$rooms"
    mkdir -p "$rooms"
    cargo run --quiet --release -- prep build "$recipe" --source "$data" --out "$rooms/dataset"
    cargo run --quiet --release -- prep render "$rooms/dataset" --renderer builtin
    cargo run --quiet --release -- baseline nn --dataset "$rooms/dataset" --out "$rooms/nn"
    cp "$recipe" "$rooms/recipe.toml"
fi

MATEVAL_CACHE="${MATEVAL_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/mateval}"
MATEVAL_PEERS_PYTHON="$PWD/$venv/bin/python"
export MATEVAL_CACHE MATEVAL_PEERS_PYTHON
for scene in living staircase2; do
    echo "== $scene"
    # Benches run in their crate's folder, so paths are absolute.
    cargo bench --quiet --workspace --bench whole_room -- "$PWD/$rooms/dataset" "$scene" "$PWD/$rooms/nn" "$@"
done
