# The form of the sources: clang-format may move line breaks and align otherwise, but would change no
# blank within a line; 120 columns at most (100 is the aim), no tabs, no blanks at the end of a line.
. tests/checks/lib.sh

# The text with one blank for each run of white space, none behind or before a bracket or comma.
level() {
    sed 's/\\$//' | tr '\n' ' ' | sed -e 's/ \+/ /g' -e 's/\([[({]\) /\1/g' \
        -e 's/ \([])},;]\)/\1/g' -e 's/" "//g' -e 's/ \(\* \)\+/ /g' | tr ';{}' '\n\n\n'
}
same_blanks() {
    level < "$1" > "$work/ours"
    clang-format --style=file "$1" | level > "$work/theirs"
    diff "$work/ours" "$work/theirs"
}
plain() { ! grep -nHP '\t|[ \t]$|\r' "$1" && [ -z "$(tail -c 1 "$1")" ]; }
not_wide() {
    LC_ALL=C.UTF-8 awk 'length > 120 { print FILENAME ":" FNR ": " length " columns"; bad = 1 }
        END { exit bad }' "$1"
}

files=$(find src include tests bench -name '*.[ch]')
each same_blanks $files
each not_wide $files
each plain $(find src include kernels -name '*.[ch]' -o -name '*.cl') $(find tests bench .ci -name '*.sh' \
    -o -name '*.[ch]' -o -name '*.py')
finish
