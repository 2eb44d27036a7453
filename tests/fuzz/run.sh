#!/bin/sh
# Run fuzzing drivers one after another and count: `make fuzz`.
# usage: run.sh BUILD_FOLDER SECONDS DRIVER...    SECONDS: for all of them, shared out as below
# Inputs that reach new code are kept in BUILD_FOLDER/learned and begun with the next time; an input that
# breaks a promise is kept in BUILD_FOLDER/found. The last line gives the number of executions and of
# drivers that found something, the one before those of readers of files, in all runs too.
set -u
build=$1 all=$2
shift 2
export ASAN_OPTIONS="max_allocation_size_mb=512:allocator_may_return_null=0:detect_leaks=1"
export UBSAN_OPTIONS=print_stacktrace=1
mkdir -p "$build/found"

complain() { # WHAT
    failed=$((failed + 1))
    printf ', FAILED: %s, see %s\n' "$1" "$log"
}

tried=0 failed=0 files=0
for name; do
    learned=$build/learned/$name log=$build/$name.log
    mkdir -p "$learned"
    longest=4096 words= quiet=0 most=10
    case $name in
    mesh) share=60 ;;
    sources) share=10 quiet=2 ;; # its errors go to the standard error
    number) share=10 longest=400 ;;
    surface) share=20 longest=140 most=60 ;; # seconds are those of a busy machine
    *) share=10 ;;
    esac
    seconds=$(((all * share + 99) / 100))
    if [ -e "tests/fuzz/$name.dict" ]; then words=-dict=tests/fuzz/$name.dict; fi
    "$build/fuzz/$name" -max_total_time="$seconds" -max_len=$longest -timeout=$most -rss_limit_mb=2048 \
        -print_final_stats=1 -close_fd_mask=$quiet -artifact_prefix="$build/found/$name-" $words \
        "$learned" "tests/fuzz/corpus/$name" > "$log" 2>&1
    status=$?
    n=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    tried=$((tried + ${n:-0}))
    case $name in mesh | sources) files=$((files + ${n:-0})) ;; esac
    printf '%-10s %10s executions in %s s' "$name" "${n:-0}" "$seconds"
    if [ "$status" -ne 0 ]; then
        complain 'something found'
        grep -E 'broken promise|SUMMARY|runtime error|Test unit written' "$log" | sed 's/^/    /'
    elif grep -q '^reader .* 0 taken' "$log"; then
        complain 'a reader that never took anything'
    else
        echo ', nothing found'
    fi
    sed -n 's/^reader /    /p' "$log"
done
# A long time may come in pieces: executions of all runs with the same readers since the last finding.
tally=$build/tally-$(cat src/io/*.[ch] src/cli/sources.c tests/fuzz/mesh.c tests/fuzz/sources.c |
    cksum | cut -d' ' -f1)
if [ "$failed" -eq 0 ]; then echo "$files" >> "$tally"; else : > "$tally"; fi
echo "readers of files: $files executions;" \
    "as they are now, in all runs $(awk '{ n += $1 } END { print n + 0 }' "$tally") without a finding"
echo "# tried $tried: failed $failed"
[ "$failed" -eq 0 ]
