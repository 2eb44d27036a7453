#!/bin/sh
# See that the Debian packages of a list are there.
# usage: deps.sh check|install LIST
# check names the missing ones and fails; install gets them, as root or through sudo where that asks
# no password, and otherwise fails like check. Elsewhere than on Debian it only prints the list.
set -eu
mode=$1
list=$(sed 's/#.*//' "$2" | tr -s ' \n' ' ')

if ! command -v dpkg-query > /dev/null; then
    echo "No dpkg here: taking for granted what Debian calls$list" >&2
    exit 0
fi

missing=
for package in $list; do
    state=$(dpkg-query -W -f='${Status}' "$package" 2> /dev/null || true)
    case $state in *'ok installed'*) ;; *) missing="$missing $package" ;; esac
done
[ -n "$missing" ] || exit 0

root=
if [ "$mode" = check ]; then
    echo "Missing Debian packages:$missing" >&2
    echo "Install them with \`make deps\` or: apt-get install$missing" >&2
    exit 1
elif [ "$(id -u)" -ne 0 ]; then
    if ! command -v sudo > /dev/null || ! sudo -n true 2> /dev/null; then
        echo "Missing Debian packages:$missing" >&2
        echo "They need root: apt-get install$missing" >&2
        exit 1
    fi
    root='sudo -n'
fi

echo "Installing Debian packages:$missing"
apt='env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=600'
# The package lists of a fresh machine are empty or old.
$root $apt update
$root $apt install -y --no-install-recommends $missing < /dev/null > /dev/null
