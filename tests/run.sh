#!/bin/sh
# Run test programs (cmocka) and test scripts from the repository root, print what failed, count.
# usage: run.sh BUILD_FOLDER TEST...
# Every test speaks TAP: a plan "1..N", then "ok K - name" or "not ok K - name" for each. A program
# that ends badly, ends before its plan is fulfilled, or plans nothing counts as one failure more.
set -u
build=$1
shift

# Nothing outside the build folder is touched: kernel caches live here while tests run, and longer with
# KEEP_SCRATCH=1.
scratch=$PWD/$build/scratch
[ "${KEEP_SCRATCH:-}" ] || rm -rf "$scratch"
mkdir -p "$scratch/tmp" "$scratch/cache/pocl" || exit 1
export TMPDIR="$scratch/tmp" XDG_CACHE_HOME="$scratch/cache" POCL_CACHE_DIR="$scratch/cache/pocl"
export DMKCL_BUILD="$build" CMOCKA_MESSAGE_OUTPUT=TAP
# LLVM inside OpenCL drivers sets an alternate signal stack of its own in threads it makes.
export ASAN_OPTIONS="use_sigaltstack=0"
export LSAN_OPTIONS="suppressions=$PWD/tests/lsan.supp:print_suppressions=0"

# Programs that no sanitizer watches run on an allocator of the C library that ends them where something was
# written next to a block.
guard=
case $build in
*/release | */debug) guard='LD_PRELOAD=libc_malloc_debug.so.0 GLIBC_TUNABLES=glibc.malloc.check=3' ;;
esac

run() { # TEST
    case $1 in
    *.sh) timeout "${TEST_TIMEOUT:-900}" bash "$1" ;;
    *) timeout "${TEST_TIMEOUT:-900}" env $guard "$1" ;;
    esac
}

passed=0 failed=0 skipped=0
for test; do
    log=$scratch/$(basename "$test").log
    begin=$(date +%s)
    run "$test" > "$log" 2>&1 < /dev/null
    status=$?
    seconds=$(($(date +%s) - begin))
    # The leak checker, which stops all threads at the end, has now and then crashed itself when a driver's
    # thread ended just then: that says nothing about the test, which is run once more.
    if [ $status -ne 0 ] && grep -q 'LeakSanitizer has encountered a fatal error' "$log"; then
        echo "$(basename "$test"): the leak checker itself has failed; once more"
        run "$test" > "$log" 2>&1 < /dev/null
        status=$?
    fi
    counts=$(awk -v name="$(basename "$test" .sh)" -v status="$status" -v seconds="$seconds" -f tests/tap.awk "$log")
    printf '%s\n' "$counts" | sed '$d'
    read -r p f s << EOF
$(printf '%s\n' "$counts" | tail -n 1)
EOF
    passed=$((passed + p)) failed=$((failed + f)) skipped=$((skipped + s))
done

[ "$passed" -gt 0 ] || failed=$((failed + 1))
line="$passed passed, $failed failed"
[ "$skipped" -eq 0 ] || line="$line, $skipped skipped"
echo "$line"
[ "$failed" -eq 0 ]
