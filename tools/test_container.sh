#!/bin/sh
# Builds the image with buildah and scores in it with podman, without a network and without capabilities, as an ordinary
# user and as Codabench does; every result must have the bytes of one made outside. Prints the size.
#
# MATEVAL names the command, which goes into the image; by default it is the release build. Needs root, and debootstrap
# where no registry can be reached: then the image's base is made from Debian's packages. BASE names another base.
# Images lie in target/test_container, apart from those of the machine.
set -eu
cd "$(dirname "$0")/.."
tools/apt_install.sh buildah podman debootstrap binutils zip
if [ -z "${MATEVAL:-}" ]; then
    cargo build --release --bin mateval
    MATEVAL="${CARGO_TARGET_DIR:-target}/release/mateval"
fi
MATEVAL=$(realpath "$MATEVAL")
export MATEVAL
work=$(realpath -m target/test_container)
storage="--root $work/images --runroot $work/run --storage-driver vfs"
fail() {
    echo "test_container: $1" >&2
    exit 1
}
# The options are a list of words here and below.
# shellcheck disable=SC2086
images() { buildah $storage "$@"; }
mkdir -p "$work"
chmod 755 "$work"

if [ -z "${BASE:-}" ]; then
    BASE=docker.io/library/debian:12-slim
    if ! images pull --quiet "$BASE" > /dev/null 2>&1; then
        BASE=localhost/debian:12-made-here
        if ! images inspect --type image "$BASE" > /dev/null 2>&1; then
            [ -d "$work/base/usr" ] || debootstrap --variant=minbase bookworm "$work/base" > "$work/debootstrap.log"
            # What debian:12-slim leaves out, too.
            (cd "$work/base" && rm -rf usr/share/doc usr/share/man usr/share/info usr/share/locale var/cache/apt var/lib/apt/lists)
            base=$(images from scratch)
            images add --quiet "$base" "$work/base" / > /dev/null
            images commit --quiet --rm "$base" "$BASE" > /dev/null
        fi
    fi
fi
echo "base: $BASE"
for target in mateval codabench; do
    BASE=$BASE BUILDER=buildah BUILD_FLAGS="$storage --quiet --isolation chroot" tools/container/build.sh "$target" "localhost/$target"
    # shellcheck disable=SC2086
    size=$(podman $storage image inspect --format '{{.Size}}' "localhost/$target")
    echo "$target: $((size / 1000000)) MB"
    [ "$size" -lt 250000000 ] || fail "the image '$target' is larger than 250 MB"
done

# A dataset, a submission and its result, made outside.
data=$work/data
rm -rf "$data"
mkdir -p "$data/out"
chmod 777 "$data/out"
cat > "$data/small.toml" <<'TOML'
name = "small"
resolution = [80, 60]
[[scene]]
id = "room"
bitterli = "room/scene.xml"
TOML
"$MATEVAL" sample "$data/sample" > /dev/null
"$MATEVAL" prep build "$data/small.toml" --source "$data/sample" --out "$data/dataset" > /dev/null
"$MATEVAL" prep render "$data/dataset" --renderer builtin > /dev/null
"$MATEVAL" baseline median --dataset "$data/dataset" --out "$data/median" > /dev/null
"$MATEVAL" eval lint "$data/median" --dataset "$data/dataset" > "$data/lint.txt"
"$MATEVAL" eval score "$data/median" --dataset "$data/dataset" --out "$data/result.json" > /dev/null

# crun starts nothing where both versions of cgroups are mounted, so the second is hidden from it; and podman's own limits
# are above those that a machine without CAP_SYS_RESOURCE may set.
container() {
    # shellcheck disable=SC2016,SC2086
    unshare --mount sh -c '! mountpoint -q /sys/fs/cgroup/unified || umount /sys/fs/cgroup/unified; exec podman "$@"' podman \
        $storage run --rm --network none --security-opt no-new-privileges --cgroups=disabled \
        --ulimit nofile=1024:1024 --ulimit nproc=4096:4096 "$@"
}
inside() { container --cap-drop all --read-only --tmpfs /tmp --volume "$data:/data" localhost/mateval "$@"; }
inside eval lint median --dataset dataset > "$data/out/lint.txt"
cmp "$data/lint.txt" "$data/out/lint.txt" || fail "lint reports something else inside"
inside eval score median --dataset dataset --out out/result.json > /dev/null
cmp "$data/result.json" "$data/out/result.json" || fail "the result has other bytes inside"
inside eval verify result.json --submission median --dataset dataset | grep '^confirmed' || fail "verify does not confirm"
# The twins: a changed number, a folder that the user must not write to, an address.
sed '/"summary"/,$s/psnr": 1/psnr": 2/' "$data/result.json" > "$data/out/changed.json"
! inside eval verify out/changed.json --submission median --dataset dataset 2> /dev/null || fail "verify confirms a changed result"
! inside baseline grey --dataset dataset --out grey > /dev/null 2>&1 || fail "the container writes as root"
links=$(container --entrypoint ls localhost/mateval /sys/class/net)
[ "$links" = lo ] || fail "the container has the network links $links"

# Codabench's layout and capabilities (compute_worker.py of codalab/codabench).
drop=""
for capability in AUDIT_WRITE CHOWN DAC_OVERRIDE FOWNER FSETID KILL MKNOD NET_BIND_SERVICE NET_RAW SETFCAP SETGID \
    SETPCAP SETUID SYS_CHROOT; do
    drop="$drop --cap-drop $capability"
done
"$MATEVAL" prep export "$data/dataset" --as codabench --out "$data/bundle" --image example/mateval:1
(cd "$data/median" && zip -qr ../median.zip .)
# Scores the archive as an answer to the first task; prints what the program prints.
codabench() {
    rm -rf "$data/app"
    mkdir -p "$data/app/input/res" "$data/app/output"
    cp -r "$data/bundle/data/scoring_program" "$data/app/program"
    cp -r "$data/bundle/data/reference_0" "$data/app/input/ref"
    python3 -m zipfile -e "$1" "$data/app/input/res"
    # shellcheck disable=SC2046,SC2086
    container $drop --volume "$data/app:/app" --workdir /app/program localhost/codabench \
        $(sed -n 's/^command: //p' "$data/app/program/metadata.yaml")
}
codabench "$data/median.zip"
python3 - "$data" <<'PY'
import json
import pathlib
import sys

data = pathlib.Path(sys.argv[1])
scores = json.loads((data / "app/output/scores.json").read_text())
summary = json.loads((data / "result.json").read_text())["protocols"]["mateval-3"]["summary"]
columns = (data / "app/program/columns.txt").read_text().split()
assert len(scores) == len(columns) == 8, scores
assert scores == {key.replace(".", "_"): round(summary[key], 6) for key in columns}, scores
page = (data / "app/output/detailed_results.html").read_text()
assert "data:image/png;base64," in page and "http" not in page and "Albedo, novel views" in page
PY
rm "$data/median/submission.json"
(cd "$data/median" && zip -qr ../broken.zip .)
! codabench "$data/broken.zip" 2> /dev/null || fail "a submission without submission.json is scored"
[ ! -e "$data/app/output/scores.json" ] || fail "a refused submission has scores"
echo "same bytes inside and outside; Codabench's layout is scored"
