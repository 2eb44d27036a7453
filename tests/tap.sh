# For test scripts: TAP results. Source it, call `check`, `fails` or `skip` for each test, end with
# `tap_end`.
export LC_ALL=C.UTF-8 # in others awk's numbers have commas
tap_n=0
: "${DMKCL_BUILD:=build/release}"
tool=$DMKCL_BUILD/dmkcl
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT

tap_result() { # ok|"not ok" NAME
    tap_n=$((tap_n + 1))
    printf '%s %d - %s\n' "$1" "$tap_n" "$2"
}

# check NAME COMMAND...: the command succeeds. What it prints is shown when it does not.
check() {
    local name=$1 status
    shift
    "$@" > "$work/said" 2>&1
    status=$?
    if [ "$status" -eq 0 ]; then
        tap_result ok "$name"
    else
        tap_result 'not ok' "$name"
        echo "# status $status of: $*"
        sed 's/^/# /' "$work/said"
    fi
}

# fails NAME CODE PATTERN COMMAND...: the exit status is CODE, the standard output is empty and the
# standard error matches PATTERN.
fails() {
    local name=$1 code=$2 pattern=$3 status
    shift 3
    "$@" > "$work/out" 2> "$work/err"
    status=$?
    if [ "$status" -eq "$code" ] && [ ! -s "$work/out" ] && grep -qE -e "$pattern" "$work/err"; then
        tap_result ok "$name"
    else
        tap_result 'not ok' "$name"
        echo "# status $status instead of $code, expected '$pattern', of: $*"
        sed 's/^/# /' "$work/out" "$work/err"
    fi
}

# skip NAME REASON
skip() {
    echo "$2"
    tap_n=$((tap_n + 1))
    printf 'ok %d # SKIP %s\n' "$tap_n" "$1"
}

# The packages of tests/requirements.txt and data.txt; without PyPI the rest is skipped, and that is counted.
need_packages() { # WHAT IS SKIPPED
    sh tests/pyenv.sh > "$work/pyenv" 2>&1
    [ $? -ne 75 ] || { skip "$1" "PyPI cannot be reached: $(tail -n 1 "$work/pyenv")"; tap_end; exit 0; }
    check 'the packages of tests/requirements.txt' sh tests/pyenv.sh
}

tap_end() { echo "1..$tap_n"; }

# The OFF file twice in one, the second time 10 further along x, its vertices numbered behind the first's.
two_meshes() { # FILE
    awk 'NR == 1 { print; next }
        NR == 2 { n = $1; print 2 * n, 2 * $2, 0; next }
        NR <= n + 2 { print; x[NR] = $1 + 10 " " $2 " " $3; next }
        { t[NR] = $0; u[NR] = 3 " " $2 + n " " $3 + n " " $4 + n }
        END { for (i = 3; i <= n + 2; i++) print x[i]
            for (i = n + 3; i <= NR; i++) print t[i]
            for (i = n + 3; i <= NR; i++) print u[i] }' "$1"
}

# A JSON object and nothing else. Perl is part of every Debian.
is_json() { # FILE
    perl -0777 -e '
        $_ = <STDIN> // "";
        exit !/\A\s*(?&object)\s*\z
            (?(DEFINE)
                (?<string> "(?:[^"\\\x00-\x1f]|\\(?:["\\\/bfnrt]|u[0-9a-fA-F]{4}))*")
                (?<number> -?(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][-+]?[0-9]+)?)
                (?<value> \s*(?:(?&string)|(?&number)|true|false|null|(?&object)|(?&list))\s*)
                (?<object> \{(?:\s*(?&string)\s*:(?&value)(?:,\s*(?&string)\s*:(?&value))*|\s*)\})
                (?<list> \[(?:(?&value)(?:,(?&value))*|\s*)\]))/x' < "$1"
}
