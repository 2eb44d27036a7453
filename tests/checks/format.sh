# The form of the sources: as clang-format leaves them; 120 columns at most (comments; code has 100), no
# tabs, no blanks at the end of a line.
. tests/checks/lib.sh

formatted() { clang-format --style=file --dry-run -Werror "$1"; }
plain() { ! grep -nHP '\t|[ \t]$|\r' "$1" && [ -z "$(tail -c 1 "$1")" ]; }
not_wide() {
    LC_ALL=C.UTF-8 awk 'length > 120 { print FILENAME ":" FNR ": " length " columns"; bad = 1 }
        END { exit bad }' "$1"
}

files=$(find src include kernels tests bench -name '*.[ch]')
each formatted $files
each not_wide $files
each plain $(find src include kernels -name '*.[ch]' -o -name '*.cl') $(find tests bench .ci -name '*.sh' \
    -o -name '*.[ch]' -o -name '*.py')
finish
