#!/bin/sh
# Builds crates/report/viewer/room.min.js.gz, the leaderboard's 3D view, from room.js and three.js as package-lock.json
# fixes it; npm checks the hashes there. With --check it compares what is compressed, and writes nothing; exit code 1 if
# they differ.
set -eu
cd "$(dirname "$0")/.."
command -v npm >/dev/null 2>&1 || tools/apt_install.sh nodejs npm
viewer=$PWD/crates/report/viewer
work="${CARGO_TARGET_DIR:-$PWD/target}/viewer"
mkdir -p "$work"
if ! cmp -s "$viewer/package-lock.json" "$work/package-lock.json"; then
    cp "$viewer/package.json" "$work/"
    # Copied last: this file marks a complete installation.
    cp "$viewer/package-lock.json" "$work/new-lock.json"
    (cd "$work" && cp new-lock.json npm-shrinkwrap.json && npm ci --ignore-scripts --no-audit --no-fund --silent)
    mv "$work/new-lock.json" "$work/package-lock.json"
fi
cp "$viewer/room.js" "$work/"
version=$(node -p "require('$work/node_modules/three/package.json').version")
banner=$(printf '/*!\nthree.js %s, bundled with room.js of MatEval\n\n%s\n*/' "$version" "$(cat "$work/node_modules/three/LICENSE")")
(cd "$work" && node_modules/.bin/esbuild room.js --bundle --minify --format=iife --target=es2020 --legal-comments=none \
    --banner:js="$banner" --log-level=warning --outfile=room.min.js)
if [ "${1:-}" != --check ]; then
    gzip -9nc "$work/room.min.js" > "$viewer/room.min.js.gz"
elif ! gzip -dc "$viewer/room.min.js.gz" | cmp "$work/room.min.js" -; then
    echo "build_viewer: room.min.js.gz is not what room.js gives; run tools/build_viewer.sh" >&2
    exit 1
fi
