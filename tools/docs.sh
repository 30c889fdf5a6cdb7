#!/bin/sh
# Builds the site of the documentation, target/docs_site, which opens from the disk. Unknown links and places in a page
# are errors. MATEVAL and MATEVAL_EXTENSION name the command and the Python package's compiled module; by default they are
# the tests' build.
set -eu
cd "$(dirname "$0")/.."
tools/apt_install.sh python3-venv
target="${CARGO_TARGET_DIR:-$PWD/target}"
if [ -z "${MATEVAL:-}" ] || [ -z "${MATEVAL_EXTENSION:-}" ]; then
    # Named together, so that both use the libraries with the same features.
    cargo build --quiet --package mateval --package mateval-python
    MATEVAL="${MATEVAL:-$target/debug/mateval}" MATEVAL_EXTENSION="${MATEVAL_EXTENSION:-$target/debug/lib_core.so}"
fi
MATEVAL=$(realpath "$MATEVAL")
export MATEVAL
tools/venv.sh python3.11 "$target/docs_venv" tools/requirements_docs.txt
# tools/docs/mkdocs.yml names both folders.
"$target/docs_venv/bin/python" tools/docs/api.py "$MATEVAL_EXTENSION" target/docs_python
# The variable silences an advertisement. Signatures are formatted by ruff, which is looked for in PATH. With `--quiet`,
# MkDocs would not count the warnings that `--strict` makes errors.
NO_MKDOCS_2_WARNING=1 PATH="$target/docs_venv/bin:$PATH" PYTHONDONTWRITEBYTECODE=1 mkdocs build --strict --config-file tools/docs/mkdocs.yml
echo "file://$PWD/target/docs_site/index.html"
