#!/bin/sh
# Make or update a virtual environment from a list of packages: build/pyenv from tests/requirements.txt. Of data.txt beside
# the list only the packages themselves are installed, not what they depend on. Quick when it is up to date; when two run
# at once, the second waits. Without PyPI the exit status is 75. Python: the PYTHON given, else python3.
# usage: sh tests/pyenv.sh [FOLDER LIST] && build/pyenv/bin/python ...
set -eu
cd "$(dirname "$0")/.."
folder=${1:-build/pyenv}
list=${2:-tests/requirements.txt}
data=$(dirname "$list")/data.txt
[ -e "$data" ] || data=/dev/null

mkdir -p build
exec 9> "$folder.lock"
flock 9
cat "$list" "$data" | cmp -s - "$folder/installed.txt" && exit 0
[ -x "$folder/bin/python" ] || "${PYTHON:-python3}" -m venv --clear "$folder"
# Exit 75: the packages cannot be had now, which says nothing of the project. Any other failure is one.
status=0
install() {
    "$folder/bin/python" -m pip install --quiet --disable-pip-version-check --prefer-binary "$@" 2>> "$folder.log"
}
: > "$folder.log"
{ install -r "$list" && { [ ! -s "$data" ] || install --no-deps -r "$data"; }; } || status=$?
cat "$folder.log" >&2
if [ $status -ne 0 ]; then
    unreachable='NewConnectionError|Temporary failure in name resolution|Network is unreachable|ProxyError'
    unreachable="$unreachable|ConnectTimeoutError|ReadTimeoutError|Connection reset|Remote end closed|50[0-9] Server Error|from versions: none"
    ! grep -qE "$unreachable" "$folder.log" || exit 75
    exit $status
fi
# Last, so that an install that was broken off is taken up again.
cat "$list" "$data" > "$folder/installed.txt"
