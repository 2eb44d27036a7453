# Each test again and again, as it is and beside as much other work as the machine has processors twice over: one
# that fails now and then fails here. Its seeds are fixed, so what differs is the time that things take.
# usage: steady.sh BUILD_FOLDER RUNS TEST...      prints what fails, then "# tried N: failed M"
set -u
build=$1 runs=$2
shift 2
tried=0 failed=0
logs=$build/steady
mkdir -p "$logs"
export KEEP_SCRATCH=1 # kernels are compiled once

busy() { while :; do :; done; }
for load in idle busy; do
    pids=
    if [ $load = busy ]; then
        for _ in $(seq $((2 * $(nproc)))); do
            busy &
            pids="$pids $!"
        done
        trap 'kill $pids 2> /dev/null' EXIT
    fi
    for test; do
        name=$(basename "$test" .sh) begin=$SECONDS bad=0
        for run in $(seq "$runs"); do
            tried=$((tried + 1))
            sh tests/run.sh "$build" "$test" > "$logs/$name.said" 2>&1 && continue
            failed=$((failed + 1)) bad=$((bad + 1))
            cp "$logs/$name.said" "$logs/$name-$load-$run.log"
            echo "FAILED: $name, $load, run $run: see $logs/$name-$load-$run.log"
            grep -A 3 'FAILED' "$logs/$name.said" | head -n 8
        done
        printf '%-24s %-5s %4d runs %4d failed %6d s\n' "$name" $load "$runs" $bad $((SECONDS - begin))
    done
    [ -z "$pids" ] || kill $pids
done
trap - EXIT
echo "# tried $tried: failed $failed"
[ "$failed" -eq 0 ]
