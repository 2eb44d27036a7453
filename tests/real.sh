#!/bin/sh
# Meshes of the wild, of Debian's libcgal-demo, through every command: solved, or refused with a reason.
# usage: real.sh BUILD_FOLDER [FOLDER]    FOLDER: where the package's .off files are; else it is fetched
set -u
build=$1 folder=${2:-build/real}
tool=$PWD/$build/dmkcl
export ASAN_OPTIONS=use_sigaltstack=0
export LSAN_OPTIONS="suppressions=$PWD/tests/lsan.supp:print_suppressions=0"
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT

if [ ! -e "$folder/bunny00.off" ]; then
    mkdir -p "$folder/package" || exit 1
    (cd "$folder/package" && apt-get download libcgal-demo > "$work/said" 2>&1 &&
        dpkg-deb -x libcgal-demo_*.deb . && find . -name data.tar.gz -exec tar xzf {} \; &&
        find . -name '*.off' -exec cp {} .. \;) || { cat "$work/said"; exit 1; }
fi

tried=0 failed=0
try() { # NAME COMMAND...: exit code 0, or 4 with a reason; and sanitizers say nothing
    name=$1
    shift
    "$tool" "$@" > "$work/out" 2> "$work/err"
    status=$?
    tried=$((tried + 1))
    if [ $status -eq 0 ] && [ ! -s "$work/err" ]; then
        printf '%-18s %-6s %s\n' "$name" "$1" \
            "$(grep -hE '^(cost|cut open|path)' "$work/out" | head -n 1 | tr -s ' ')"
    elif [ $status -eq 4 ] && ! grep -qE 'Sanitizer|runtime error' "$work/err"; then
        printf '%-18s %-6s refused: %s\n' "$name" "$1" "$(sed 's/^dmkcl: //' "$work/err")"
    else
        failed=$((failed + 1))
        printf '%-18s %-6s FAILED: exit code %s\n' "$name" "$1" "$status"
        sed 's/^/    /' "$work/err"
    fi
}
for name in bunny00 armadillo refined_elephant ChineseDragon-10kv blade; do
    mesh=$folder/$name.off
    try $name info "$mesh"
    try $name solve "$mesh" --vertex 0 --out "$work/a.vtp" --locus "$work/b.obj" --tangent "$work/c.csv"
    try $name cut "$mesh" --vertex 0 --out "$work/d.off"
    try $name path "$mesh" --vertex 0 --to-vertex 100 --out "$work/e.obj"
done
"$tool" mesh sphere --triangles 4000 --refine 4 --out "$work/sphere.off" > "$work/out"
try 'sphere, 1,000,000' solve "$work/sphere.off" --vertex 0
echo "# tried $tried: failed $failed"
[ "$failed" -eq 0 ]
