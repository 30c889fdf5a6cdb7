#!/bin/sh
# Makes a virtual environment of these packages, unless it exists: tools/venv.sh PYTHON FOLDER REQUIREMENTS
set -eu
python=$1 venv=$2 requirements=$3
cmp -s "$requirements" "$venv/requirements.txt" && exit 0
rm -rf "$venv"
"$python" -m venv "$venv"
"$venv/bin/pip" install --quiet --disable-pip-version-check -r "$requirements"
cp "$requirements" "$venv/requirements.txt"
