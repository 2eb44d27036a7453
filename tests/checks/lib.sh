# For the checks of this folder, run from the repository root: source it, call `try` for each thing
# tried and `finish` at the end. Prints what failed, and at last "# tried N: failed M".
# CHECK_SHORT=1 asks for a form that continuous integration has time for.
set -u
export LC_ALL=C.UTF-8 # in others awk's numbers have commas
build=${DMKCL_BUILD:-build/release}
short=${CHECK_SHORT:-}
tried=0 failed=0
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT

# What the sources are compiled with, apart from warnings and optimisation.
flags='-std=c11 -D_GNU_SOURCE -DCL_TARGET_OPENCL_VERSION=120 -Iinclude -Isrc -Ikernels'
libs=${DMKCL_LIBS:-$(make -np 2> /dev/null | sed -n 's/^LDLIBS := //p')}
warnings='-Wall -Wextra -Wpedantic -Wshadow -Wstrict-prototypes -Wmissing-prototypes -Wpointer-arith
    -Wvla -Werror'

try() { # NAME COMMAND...: the command succeeds
    local name=$1 status=0
    shift
    tried=$((tried + 1))
    "$@" > "$work/said" 2>&1 || status=$?
    [ $status -eq 0 ] && return
    failed=$((failed + 1))
    echo "FAILED: $name"
    sed 's/^/    /' "$work/said" | head -n 60
    [ $status -ne 124 ] || echo "    (it ran past its time limit)"
}

# each COMMAND ITEM...: `COMMAND ITEM` succeeds for every item; as many at once as there are
# processors, each with a folder $work of its own.
each() {
    local command=$1 each_work=$work item
    shift
    for item; do
        while [ "$(jobs -rp | wc -l)" -ge "$(nproc)" ]; do wait -n; done
        (
            work=$(mktemp -d "$each_work/each.XXXXXX")
            "$command" "$item" > "$each_work/${item//\//:}.said" 2>&1
            echo $? > "$each_work/${item//\//:}.status"
            rm -rf "$work"
        ) &
    done
    wait
    for item; do try "$item: $command" ended "$each_work/${item//\//:}"; done
}
ended() { cat "$1.said" && return "$(cat "$1.status")"; }

says_nothing() { # COMMAND...: prints nothing; its status does not matter
    "$@" > "$work/words" 2>&1
    cat "$work/words"
    [ ! -s "$work/words" ]
}

# tested NAME COMMAND...: a run of tests whose last line counts them; its figures are added.
tested() {
    local name=$1 line
    shift
    "$@" > "$work/said" 2>&1
    line=$(grep -vE '^make(\[[0-9]+\])?: ' "$work/said" | tail -n 1)
    case $line in
    *' passed, '*' failed'*)
        set -- $line
        tried=$((tried + $1 + $3)) failed=$((failed + $3))
        [ "$3" -eq 0 ] || { echo "FAILED: $name"; grep -A 30 FAILED "$work/said" | head -n 100; } ;;
    *)
        tried=$((tried + 1)) failed=$((failed + 1))
        echo "FAILED: $name did not come to its end"
        tail -n 30 "$work/said" ;;
    esac
}

finish() {
    echo "# tried $tried: failed $failed"
    [ "$failed" -eq 0 ] && [ "$tried" -gt 0 ]
    exit
}
