# All checks, in two rows side by side, and a table of them: what was tried, how often, how much of it failed,
# in how many seconds. Logs: build/checks/NAME.log. ONLY='NAME ...' takes these alone.
# CHECK_SHORT=1: what continuous integration has time for, the tests beside the tools; the last line
# counts it all.
set -u
build=${DMKCL_BUILD:-build/release}
short=${CHECK_SHORT:-}
logs=build/checks
mkdir -p "$logs/cache"
export XDG_CACHE_HOME=$PWD/$logs/cache # kernels compiled by one row serve the next
table=$logs/table counts=$logs/counts
printf '%-11s %-58s %10s %8s %6s\n' check 'what is tried' tried failed s > "$table"
: > "$counts"
: > "$logs/skips"

wanted() { case " ${ONLY:-$1} " in *" $1 "*) ;; *) return 1 ;; esac }
row() { # NAME WHAT COMMAND...
    local name=$1 what=$2 log=$logs/$1.log begin=$SECONDS tried failed bad status
    shift 2
    wanted "$name" || return 0
    "$@" > "$log" 2>&1 < /dev/null
    status=$?
    set -- $(awk '/^# tried [0-9]+: failed [0-9]+$/ { t += $3; f += $5 }
        /^[0-9]+ passed, [0-9]+ failed/ { t += $1 + $3; f += $3 }
        /^[0-9]+ passed, [0-9]+ failed, [0-9]+ skipped/ { s += $5 }
        END { print t + 0, f + 0, s + 0 }' "$log")
    tried=$1 failed=$2 bad=$2
    # Tried nothing, or ended badly without a word of failures: that is a failure too.
    [ "$tried" -gt 0 ] && { [ $status -eq 0 ] || [ "$failed" -gt 0 ]; } || bad=$((failed + 1))
    echo "$tried $failed $bad $3" >> "$counts"
    grep -E '^ +skipped: ' "$log" | sed "s/^ */$name /" >> "$logs/skips"
    printf '%-11s %-58s %10d %8d %6d\n' "$name" "$what" "$tried" "$bad" \
        $((SECONDS - begin)) | tee -a "$table"
    [ "$bad" -eq 0 ] || { grep -q FAILED "$log" && grep -A 12 FAILED "$log" || tail -n 30 "$log"; } |
        head -n 100
}
script() { row "$1" "$2" env DMKCL_BUILD="$build" bash "tests/checks/$1.sh"; }
# What the tests themselves do in short.
long() { [ "$short" ] || "$@"; }
# Rows that run beside the others.
beside() {
    row tests 'all tests' make -s test
    script thread 'own threads under ThreadSanitizer'
    script valgrind 'the tool under memcheck'
    long script sanitize 'tests under ASan and UBSan'
    long script coverage 'share of lines that tests run, above a floor'
}

head -n 1 "$table"
if [ "$short" ]; then
    # The tests replay fuzzing drivers with this build, which `sanitize` uses too.
    ! wanted tests || make -s -j"$(nproc)" CONFIG=sanitize tests replayers > "$logs/sanitize.log" 2>&1
fi
beside &
script headers 'headers alone, in C99, C11, C17, C++98 to C++20'
long script layers 'which folder knows which'
script mutate 'small wrong changes of the sources that a test notices'
script symbols 'exported symbols, globals, calls that must not be'
script format 'form of the sources, by clang-format and rules'
script compilers 'C files by gcc and clang, warnings are errors'
script cppcheck 'C files by cppcheck'
long script tidy 'C files by clang-tidy'
[ -z "$short" ] || script sanitize 'C tests under ASan and UBSan'
script kernels 'kernels as native code under ASan and UBSan'
script oclgrind 'kernels under Oclgrind: races, bounds, wrong calls'
long row fuzz 'executions of fuzzing drivers, all readers' make -s fuzz FUZZ_SECONDS="${FUZZ_SECONDS:-60}"
long row faults 'memory, files, OpenCL calls that fail, signals' \
    make -s faults FAULT_STRIDE="${FAULT_STRIDE:-7}" FAULT_RUNS="${FAULT_RUNS:-5}"
long script hostile 'bad meshes: refused with the reason, or solved'
long script same 'the same answer: threads, devices, precisions, numbers'
long script long 'solves in one process, memory flat; 8 threads at once'
long script soak 'short runs one after another, by chance, some interrupted'
wait
echo
cat "$logs/skips" # what was not tried, and counts as such below
[ "$short" ] || cat "$table"
awk -v short="$short" '{ tried += $1; passed += $1 - $2; bad += $3; skipped += $4 }
    END { if (short) printf "%d passed, %d failed%s\n", passed, bad, skipped ? ", " skipped " skipped" : ""
        else printf "# tried %d: failed %d%s\n", tried, bad, skipped ? ", skipped " skipped : ""
        exit bad > 0 || passed == 0 }' "$counts"
