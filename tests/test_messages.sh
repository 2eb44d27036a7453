# All messages of errors, as they stand in the sources: advice names options that exist where it is given, what
# the library says holds for every language, and the words are those of the manual.
. tests/tap.sh

# One message a line, "FILE:LINE: TEXT": the literals of each call of dmk_fail, cli_error and their like.
messages() { # FILES
    awk '
        function finish() {
            text = ""
            rest = call
            while (match(rest, /"([^"\\]|\\.)*"/)) {
                text = text substr(rest, RSTART + 1, RLENGTH - 2)
                rest = substr(rest, RSTART + RLENGTH)
            }
            if (text != "") print file ":" line ": " text
            call = ""
        }
        /^#define|^ \*|^\/\*/ { next }
        !call && match($0, /(dmk_fail|cli_error|dmk_text_fail|dmk_text_fail_word|complain|bad_value|usage_error)\(/) {
            file = FILENAME
            line = FNR
            call = substr($0, RSTART)
            if ($0 ~ /;[ \t]*(\/\*.*\*\/)?$/) finish()
            next
        }
        call { call = call $0; if ($0 ~ /;[ \t]*(\/\*.*\*\/)?$/) finish() }' "$@"
}
messages $(find src -name '*.c' ! -path 'src/cli/*' ! -path 'src/python/*') > "$work/library"
messages src/cli/*.c > "$work/tool"
check 'there are messages to look at' test "$(cat "$work/library" "$work/tool" | wc -l)" -ge 150

nothing() { # PATTERN FILE
    ! grep -nE -e "$1" "$2"
}
check 'the library names no options of the tool' nothing '(^|[^-a-z])--[a-z]' "$work/library"
check 'the library names fields and functions of its header' sh -c '
    grep -v "^src/io/" "$1" | cut -d: -f3- | grep -oE "\b[a-z]+(_[a-z]+)+\b" | sort -u | while read -r name; do
        grep -qw -e "$name" include/dmkcl.h || echo "$name"
    done > "$2"; cat "$2"; test ! -s "$2"' - "$work/library" "$work/odd"

"$tool" --help | sed -n 's/^  \([a-z]*\) .*/\1/p' > "$work/commands"
for command in $(cat "$work/commands"); do
    "$tool" "$command" --help > "$work/help-$command" || echo "$command" >> "$work/broken"
done
check 'each command has its help' test ! -e "$work/broken"
# "COMMAND: ... --option": of that command; without one: of any.
options_exist() {
    local bad=0 file text command option helps
    while IFS= read -r text; do
        command=$(printf '%s\n' "$text" | sed -n 's/^[^ ]*: \([a-z]*\): .*/\1/p')
        helps=$work/help-$command
        [ -n "$command" ] && [ -e "$helps" ] || helps=$(echo "$work"/help-*)
        for option in $(printf '%s\n' "$text" | grep -oE -e '--[a-z][a-z-]*'); do
            grep -qE -e "^  $option( |\$)" $helps || { echo "$option: $text"; bad=1; }
        done
    done < "$work/tool"
    return $bad
}
check 'options that the tool names exist' options_exist
# Whatever prints them: the table in exit.c, too, which has the tool's names for what the library says.
grep -ohE '`dmkcl [a-z]+' src/cli/*.c | sed 's/.* //' | grep -vx help > "$work/named"
check 'the tool names commands' test -s "$work/named"
check 'and they exist' test -z "$(grep -vxFf "$work/commands" "$work/named")"
# What a message says is to be done is done in the same breath: the commonest slips of style.
check 'no message ends with a full stop, an exclamation or a blank' nothing '[.! ]$' "$work/library"
check 'nor does one of the tool' nothing '[^.][.! ]$' "$work/tool"

# ---- the advice of a divergence fits the method -----------------------------------------------

diverges() { # PATTERN OPTION...
    local pattern=$1
    shift
    "$tool" solve meshes/torus.off --vertex 0 --single "$@" > "$work/said_out" 2>&1
    test $? -eq 6 && grep -E "$pattern" "$work/said_out" && ! grep -E -e '--dt|--start' "$work/said_out"
}
check 'inertial: the inertia' diverges 'try a smaller --inertia, or improve .* smallest angle is [0-9.]+ degrees' \
    --method inertial --inertia 0.9999
# Rounding lets no change be so small: the mesh is not to blame.
fails 'a tolerance out of reach' 7 '^dmkcl: 60 steps did not reach the tolerance: .* wanted 1e-15; raise --max-steps or' \
    "$tool" solve meshes/torus.off --vertex 0 --quiet --tolerance 1e-15
tap_end
