#!/bin/sh
# Makes a virtual environment of these packages, unless it exists: tools/venv.sh PYTHON FOLDER REQUIREMENTS
set -eu
python=$1 venv=$2 requirements=$3
cmp -s "$requirements" "$venv/requirements.txt" && exit 0
give_up() {
    echo "venv: $1, then run this again" >&2
    exit 2
}
"$python" -c "" >/dev/null 2>&1 || give_up "'$python' cannot be run; install it"
rm -rf "$venv"
# Debian keeps pip's installer apart, in python3-venv; then a pip outside installs into the environment.
if "$python" -c "import ensurepip" 2>/dev/null; then
    "$python" -m venv "$venv"
    set -- "$venv/bin/python" -m pip
else
    "$python" -m pip --version >/dev/null 2>&1 || give_up "'$python' has no pip; install python3-venv or python3-pip"
    "$python" -m venv --without-pip "$venv"
    set -- "$python" -m pip --python "$venv/bin/python"
fi
"$@" install --quiet --disable-pip-version-check -r "$requirements"
cp "$requirements" "$venv/requirements.txt"
