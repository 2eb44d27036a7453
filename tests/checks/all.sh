# All checks, one after another, and a table of them: what was tried, how often, how much of it failed,
# in how many seconds. Logs: build/checks/NAME.log. ONLY='NAME ...' takes these alone.
set -u
build=${DMKCL_BUILD:-build/release}
logs=build/checks
mkdir -p "$logs"
bad=0 total=0
table=$logs/table
printf '%-11s %-58s %10s %8s %6s\n' check 'what is tried' tried failed s > "$table"

row() { # NAME WHAT COMMAND...
    local name=$1 what=$2 log=$logs/$1.log begin=$SECONDS tried failed status
    shift 2
    case " ${ONLY:-$name} " in *" $name "*) ;; *) return ;; esac
    "$@" > "$log" 2>&1 < /dev/null
    status=$?
    set -- $(awk '/^# tried [0-9]+: failed [0-9]+$/ { t += $3; f += $5 }
        /^[0-9]+ passed, [0-9]+ failed/ { t += $1 + $3; f += $3 }
        END { print t + 0, f + 0 }' "$log")
    tried=$1 failed=$2
    # Tried nothing, or ended badly without a word of failures: that is a failure too.
    [ "$tried" -gt 0 ] && { [ $status -eq 0 ] || [ "$failed" -gt 0 ]; } || failed=$((failed + 1))
    total=$((total + tried)) bad=$((bad + failed))
    printf '%-11s %-58s %10d %8d %6d\n' "$name" "$what" "$tried" "$failed" \
        $((SECONDS - begin)) | tee -a "$table"
    [ "$failed" -eq 0 ] || grep -A 12 FAILED "$log" | head -n 60
}
script() { row "$1" "$2" env DMKCL_BUILD="$build" bash "tests/checks/$1.sh"; }

head -n 1 "$table"
script headers 'headers alone, in C99, C11, C17, C++98 to C++20'
script layers 'which folder knows which'
script symbols 'exported symbols, globals, calls that must not be'
script format 'form of the sources, by clang-format and rules'
script compilers 'C files by gcc and clang, warnings are errors'
script cppcheck 'C files by cppcheck'
script tidy 'C files by clang-tidy'
row tests 'all tests' make -s test
script sanitize 'all tests under ASan and UBSan'
script coverage 'share of lines that tests run, above a floor'
script thread 'own threads under ThreadSanitizer'
script kernels 'kernels as native code under ASan and UBSan'
script oclgrind 'kernels under Oclgrind: races, bounds, wrong calls'
script valgrind 'the tool under memcheck'
row fuzz 'executions of fuzzing drivers, all readers' make -s fuzz FUZZ_SECONDS="${FUZZ_SECONDS:-15}"
row faults 'memory, files, OpenCL calls that fail, signals' \
    make -s faults FAULT_STRIDE="${FAULT_STRIDE:-7}" FAULT_RUNS="${FAULT_RUNS:-5}"
script hostile 'bad meshes: refused with the reason, or solved'
script same 'the same answer: threads, devices, precisions, numbers'
script long 'solves in one process, memory flat; 8 threads at once'
script soak 'short runs one after another, by chance, some interrupted'
echo
cat "$table"
echo "# tried $total: failed $bad"
[ $bad -eq 0 ]
