# The form of the sources: as clang-format leaves them; 120 columns at most (comments; code has 100), no
# tabs, no blanks at the end of a line. And that pages with figures of bench.csv have those that are in it.
. tests/checks/lib.sh

formatted() { clang-format --style=file --dry-run -Werror "$1"; }
plain() { ! grep -nHP '\t|[ \t]$|\r' "$1" && [ -z "$(tail -c 1 "$1")" ]; }
not_wide() {
    awk 'length > 120 { print FILENAME ":" FNR ": " length " columns"; bad = 1 }
        END { exit bad }' "$1"
}

# The commit, and a row for each size with the seconds of distance, solve and the heat method to two digits.
as_measured() {
    python3 - "$1" << 'EOF'
import csv, re, sys
text, rows = open(sys.argv[1]).read(), {(r["mesh"], r["program"]): r for r in csv.DictReader(open("bench/results/bench.csv"))}
for size in "70k", "270k", "1.08M":
    runs = [rows[f"quartic_{size}", program] for program in ("distance", "dmkcl", "heat_robust")]
    row = f"{int(runs[0]['triangles']):,}[^|]* \\| " + " \\| ".join(f"{float(r['seconds']):.2g}" for r in runs) + " \\|"
    if not re.search(row, text) or runs[0]["commit"] not in text:
        sys.exit(f"{sys.argv[1]} has not {row} of {runs[0]['commit']}")
EOF
}

files=$(find src include kernels tests bench -name '*.[ch]')
each formatted $files
each not_wide $files
each as_measured README.md bench/FIGURES.md
each plain $(find src include kernels -name '*.[ch]' -o -name '*.cl') $(find tests bench .ci -name '*.sh' \
    -o -name '*.[ch]' -o -name '*.py')
finish
