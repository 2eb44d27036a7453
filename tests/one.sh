#!/bin/sh
# Run one test for run.sh, print what failed and keep its three counts.
# usage: one.sh SCRATCH TEST
set -u
scratch=$1 test=$2
file=$(basename "$test") name=$(basename "$test" .sh)
export TMPDIR="$scratch/tmp/$file"
mkdir -p "$TMPDIR" || exit 1

# Programs that no sanitizer watches run on an allocator of the C library that ends them where something was
# written next to a block.
guard=
case $DMKCL_BUILD in
*/release | */debug) guard='LD_PRELOAD=libc_malloc_debug.so.0 GLIBC_TUNABLES=glibc.malloc.check=3' ;;
esac

# In the background, for an end that is asked for to reach it.
run() {
    case $test in
    *.sh) set -- bash "$test" ;;
    *) set -- env $guard "$test" ;;
    esac
    env --default-signal=INT timeout "${TEST_TIMEOUT:-900}" "$@" > "$log" 2>&1 < /dev/null &
    trap "kill $!; exit 130" INT TERM HUP
    wait $!
}

log=$scratch/$file.log
begin=$(date +%s)
run
status=$?
seconds=$(($(date +%s) - begin))
# The leak checker, which stops all threads at the end, has now and then crashed itself when a driver's
# thread ended just then: that says nothing about the test, which is run once more.
if [ $status -ne 0 ] && grep -q 'LeakSanitizer has encountered a fatal error' "$log"; then
    echo "$file: the leak checker itself has failed; once more"
    run
    status=$?
fi
counts=$(awk -v name="$name" -v status="$status" -v seconds="$seconds" -f tests/tap.awk "$log")
printf '%s\n' "$counts" | sed '$d'
printf '%s\n' "$counts" | tail -n 1 > "$scratch/$file.counts"
