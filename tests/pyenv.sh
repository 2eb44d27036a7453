#!/bin/sh
# Make or update the virtual environment build/pyenv from tests/requirements.txt. Quick when it is up
# to date; when two run at once, the second waits. Python: the PYTHON given, else python3.
# usage: sh tests/pyenv.sh && build/pyenv/bin/python ...
set -eu
cd "$(dirname "$0")/.."
folder=build/pyenv
list=tests/requirements.txt

mkdir -p build
exec 9> build/pyenv.lock
flock 9
cmp -s "$list" "$folder/installed.txt" && exit 0
[ -x "$folder/bin/python" ] || "${PYTHON:-python3}" -m venv --clear "$folder"
"$folder/bin/python" -m pip install --quiet --disable-pip-version-check --prefer-binary -r "$list"
# Last, so that an install that was broken off is taken up again.
cp "$list" "$folder/installed.txt"
