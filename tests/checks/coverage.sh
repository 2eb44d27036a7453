# The share of lines of src/ that the tests run: FLOOR percent of all, and FLOOR_FILE of each file.
# In short, scripts that add nothing, or build for themselves, are left out.
. tests/checks/lib.sh
floor=${FLOOR:-97} floor_file=${FLOOR_FILE:-62} scripts=
if [ "$short" ]; then
    floor=${FLOOR:-96} floor_file=${FLOOR_FILE:-54}
    scripts='tests/test_batch.sh tests/test_cli.sh tests/test_geometry.sh'
fi

make -s coverage ${scripts:+TEST_SCRIPTS="$scripts"} > "$work/coverage" 2>&1 ||
    { tail -n 30 "$work/coverage"; exit 1; }
# "91.67% of 12 src/x.c"
grep -E '^[0-9.]+% of [0-9]+ src/' "$work/coverage" > "$work/files"
head -n 20 "$work/files"
for file in $(find src -name '*.c' ! -path 'src/python/*'); do
    try "$file: $floor_file % at least" awk -v file="$file" -v floor="$floor_file" '
        $4 == file { there = 1; print $1; exit ($1 + 0 < floor) } END { if (!there) exit 1 }' \
        "$work/files"
done
try "all of src/: $floor % at least" awk -v floor="$floor" '
    { n += $3; covered += $3 * $1 / 100 }
    END { printf "%.2f %% of %d lines\n", 100 * covered / n, n; exit !(100 * covered / n >= floor) }' \
    "$work/files"
awk '{ n += $3; covered += $3 * $1 / 100 } END { printf "lines run: %.2f %% of %d\n", 100 * covered / n, n }' \
    "$work/files"
finish
