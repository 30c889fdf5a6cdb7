#!/bin/sh
# Makes the files of a release: wheels for Linux on x86_64 and aarch64, and the source distribution.
#
#   tools/build_wheels.sh [--out FOLDER] [x86_64|aarch64|sdist ...]
#
# A wheel serves every Python from 3.9 and every glibc from 2.17: Zig, which PyPI has, links against the stubs of that
# glibc, for either processor, so neither a container nor a cross compiler is needed. Without names, all three files are
# made, except wheels for which Rust's standard library is not installed; for a named wheel that is an error. FOLDER is
# `dist` by default. auditwheel checks which system libraries a wheel needs, twine checks its description, and every file
# must hold the licences.
set -eu
cd "$(dirname "$0")/.."

fail() {
    echo "build_wheels: $1" >&2
    exit 2
}

out=dist named="" wanted=""
while [ $# -gt 0 ]; do
    case $1 in
        --out) [ $# -gt 1 ] || fail "--out needs a folder"; out=$2; shift ;;
        x86_64 | aarch64 | sdist) named="$named $1" ;;
        *) fail "'$1' is none of x86_64, aarch64, sdist and --out FOLDER" ;;
    esac
    shift
done

# Checked before anything is built: the wheels that can be made.
for part in ${named:-x86_64 aarch64 sdist}; do
    target=$part-unknown-linux-gnu
    if [ "$part" = sdist ] || [ -d "$(rustc --print target-libdir --target "$target")" ]; then
        wanted="$wanted $part"
    elif [ -n "$named" ]; then
        fail "Rust's standard library for $target is not installed; \`rustup target add $target\` installs it"
    else
        echo "build_wheels: skipped the wheel for $part, which \`rustup target add $target\` makes possible" >&2
    fi
done
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' Cargo.toml)
grep -qx "version: $version" CITATION.cff || fail "CITATION.cff states another version than Cargo.toml, $version"

target_folder="${CARGO_TARGET_DIR:-$PWD/target}"
tools/apt_install.sh python3-venv
tools/venv.sh python3 "$target_folder/wheel_tools" tools/requirements_wheels.txt
bin="$target_folder/wheel_tools/bin"

# Beside the licences of MatEval itself, where pyproject.toml's `license-files` finds it.
third_party=crates/python/LICENSE-THIRD-PARTY
trap 'rm -f "$third_party"' EXIT
python3 tools/third_party_licenses.py "$third_party" x86_64-unknown-linux-gnu aarch64-unknown-linux-gnu

mkdir -p "$out"
set --
for part in $wanted; do
    if [ "$part" = sdist ]; then
        "$bin/maturin" sdist --manifest-path crates/python/Cargo.toml --out "$out"
        file="$out/mateval-$version.tar.gz"
        listing=$(tar -tzf "$file")
        echo "$listing" | grep -qx "mateval-$version/Cargo.lock" || fail "'$file' lacks Cargo.lock"
    else
        # maturin finds Zig as a module of the Python that VIRTUAL_ENV and PATH name.
        VIRTUAL_ENV="$target_folder/wheel_tools" PATH="$bin:$PATH" "$bin/maturin" build --release --zig \
            --target "$part-unknown-linux-gnu" --compatibility manylinux_2_17 \
            --manifest-path crates/python/Cargo.toml --out "$out"
        file=$(ls "$out/mateval-$version-cp39-abi3-"*"manylinux_2_17_$part.whl")
        "$bin/auditwheel" show "$file" | tee "$target_folder/auditwheel.txt"
        grep -q "\"manylinux_2_17_$part\"" "$target_folder/auditwheel.txt" ||
            fail "'$file' needs a newer system than its name states"
        listing=$("$bin/python" -m zipfile --list "$file")
    fi
    for licence in MIT APACHE THIRD-PARTY; do
        echo "$listing" | grep -q "LICENSE-$licence" || fail "'$file' lacks LICENSE-$licence"
    done
    set -- "$@" "$file"
done
"$bin/twine" check --strict "$@"
ls -l "$@"
