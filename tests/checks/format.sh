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

for file in $(find src include tests bench -name '*.[ch]'); do
    try "$file: clang-format" same_blanks "$file"
    try "$file: width" not_wide "$file"
done
for file in $(find src include kernels -name '*.[ch]' -o -name '*.cl') $(find tests bench .ci -name '*.sh' \
    -o -name '*.[ch]' -o -name '*.py'); do
    try "$file: tabs, ends of lines" plain "$file"
done
finish
