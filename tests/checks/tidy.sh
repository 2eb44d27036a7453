# clang-tidy on every C file with the checks of .clang-tidy; tests/checks/tidy.known lists the
# findings that are wrong.
. tests/checks/lib.sh

known() { sed 's/ *#.*//; /^$/d' tests/checks/tidy.known; }
clean() { # FILE
    local define=-DDMK_ANALYZER
    [ "$1" = src/base/base.c ] && define=
    clang-tidy --quiet "$1" -- $flags -Itests -I"$build" $define > "$work/tidy" 2> "$work/tidy2"
    # "FILE:LINE:COLUMN: error: TEXT [CHECK,...]" as "FILE CHECK".
    grep -E '^[^ ]+:[0-9]+:[0-9]+: (error|warning):' "$work/tidy" |
        sed -e "s,^$PWD/,," -e 's/^\([^:]*\):.*\[\([^],]*\).*/\1 \2/' > "$work/found"
    known > "$work/known"
    cut -d' ' -f1,2 "$work/found" | grep -vxFf "$work/known" > "$work/new"
    cat "$work/found" >> "$all"
    [ ! -s "$work/new" ] || { cat "$work/tidy" "$work/tidy2"; return 1; }
    ! grep -E 'error: .*(file not found|unknown)|^Error' "$work/tidy" "$work/tidy2"
}
all=$work/all
: > "$all"
each clean $(find src tests bench -name '*.c')
known | while read -r line; do grep -qxF "$line" "$all" || echo "$line"; done > "$work/gone"
try 'what tidy.known lists is still found' says_nothing cat "$work/gone"
finish
