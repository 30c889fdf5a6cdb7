#!/bin/sh
# Builds the image of MatEval: `tools/container/build.sh [TARGET [NAME]]`
#
# TARGET is mateval (by default) or codabench, see Containerfile. The release build of the command (or the one that
# MATEVAL names) and LPIPS' weights are put into target/container, then $BUILDER (docker, podman or buildah; by default
# docker) builds there. BASE names another Debian 12 to build on, BUILD_FLAGS has further words for the builder.
set -eu
cd "$(dirname "$0")/../.."
target=${1:-mateval} name=${2:-mateval}
context=target/container
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' Cargo.toml)
cache=${MATEVAL_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/mateval}

if [ -z "${MATEVAL:-}" ]; then
    cargo build --release --bin mateval
    MATEVAL="${CARGO_TARGET_DIR:-target}/release/mateval"
fi
rm -rf "$context"
mkdir -p "$context/cache" "$context/licences"
for net in alex vgg; do
    cp "$cache/lpips-$net-v0.1.safetensors" "$context/cache/" || {
        echo "build: the weights of LPIPS are missing; run \`mateval fetch lpips\`" >&2
        exit 2
    }
done
# The Python package links the same crates as the command.
python3 tools/third_party_licenses.py "$context/licences/LICENSE-THIRD-PARTY" x86_64-unknown-linux-gnu
cp LICENSE-MIT LICENSE-APACHE "$context/licences/"
strip -o "$context/mateval" "$MATEVAL"
chmod 755 "$context/mateval"
cp tools/container/Containerfile "$context/"

# A list of words, as a user of docker writes them.
# shellcheck disable=SC2086
"${BUILDER:-docker}" build ${BUILD_FLAGS:-} --target "$target" --build-arg BASE="${BASE:-docker.io/library/debian:12-slim}" \
    --build-arg VERSION="$version" --build-arg REVISION="$(git rev-parse --short HEAD 2>/dev/null || echo unknown)" \
    --tag "$name" --file "$context/Containerfile" "$context"
