# Calls that fail, signals, full disks: a sample of what `make faults` tries one by one.
. tests/tap.sh

# counted NAME COMMAND...: the last line says that nothing failed of what was tried.
counted() {
    local name=$1
    shift
    "$@" > "$work/counted" 2>&1
    check "$name" grep -E '^# tried [1-9][0-9]*: failed 0$' "$work/counted"
    grep -q ': failed 0$' "$work/counted" || sed 's/^/# /' "$work/counted"
}
counted 'the library when calls fail' "$DMKCL_BUILD/faults/library" 40
counted 'the tool when calls fail or signals come' bash tests/faults/tool.sh "$DMKCL_BUILD" 1

# No OpenCL call, and no other that can fail, goes around the wrapped ones.
check 'every OpenCL call of the library is tried' sh -c '
    nm "$1/libdmkcl.a" | sed -n "s/^ *U \(cl[A-Z].*\)/\1/p" | sort -u > "$2/used"
    nm "$1/tests/faults/wrap.o" | sed -n "s/.* T __wrap_//p" | sort -u > "$2/wrapped"
    test -s "$2/used" && test -z "$(comm -23 "$2/used" "$2/wrapped")"' - "$DMKCL_BUILD" "$work"

torus=$work/torus.off
"$tool" mesh torus --source 3,0,0 --triangles 2000 --out "$torus" > "$work/said_out"
mkdir "$work/files"
empty() { test -z "$(ls -A "$1")" || { ls -A "$1"; return 1; }; }

# ---- a device that fails ------------------------------------------------------------------------

# From a call in the middle of the first of three meshes on, until a device is opened anew.
mkdir "$work/three"
for k in 1 2 3; do cp "$torus" "$work/three/$k.off"; done
renewed() { # FOLDER ORDER
    DMK_FAULT=$2 DMK_FAULT_LOG=$work/log "$DMKCL_BUILD/faults/dmkcl" batch "$work/three" --threads 1 --out-dir "$1" \
        > "$work/summary" 2> "$work/err"
}
check 'a batch whose device does not fail' renewed "$work/first" opencl:999999999
read -r calls live < "$work/log"
renewed "$work/lost" "opencl:$((calls / 5)):lasting:renewed:code=-36"
check 'one whose device fails has its exit code' test $? -eq 5
check 'says so once' test "$(grep -c '^dmkcl: .*three/1.off: CL_INVALID_COMMAND_QUEUE' "$work/err")" -eq 1
check 'and solves the other meshes on a new one' grep -q '^of 3 .* 2 solved, 0 kept, 1 failed' "$work/summary"
check 'as without a fault' cmp "$work/first/3.vtp" "$work/lost/3.vtp"
check 'no less is given back' test "$(cut -d ' ' -f 2 "$work/log")" -le "$live"
renewed "$work/none" "opencl:$((calls / 5)):lasting:code=-36"
check 'where none can be opened anew the summary says how much is left' \
    grep -q '^of 3 .* 0 solved, 0 kept, 1 failed, 2 left' "$work/summary"
sources() { # FOLDER ORDER
    DMK_FAULT=$2 DMK_FAULT_LOG=$work/log "$DMKCL_BUILD/faults/dmkcl" solve "$torus" --sources "$work/sources.txt" \
        --out "$1/a.vtp" > "$work/summary" 2> "$work/err"
}
printf 'vertex 1\nvertex 2\nvertex 3\n' > "$work/sources.txt"
mkdir "$work/each" "$work/anew"
check 'sources on a device that does not fail' sources "$work/each" opencl:999999999
read -r calls live < "$work/log"
sources "$work/anew" "opencl:$((calls / 5)):lasting:renewed:code=-36"
check 'on one that fails: its exit code' test $? -eq 5
check 'the other sources have a new one' grep -q '^of 3 .* 2 solved, 0 kept, 1 failed, [0-9.]* s$' "$work/summary"
check 'and the same files' cmp "$work/each/a-0002.vtp" "$work/anew/a-0002.vtp"
check 'no less is given back then' test "$(cut -d ' ' -f 2 "$work/log")" -le "$live"
sources "$work/anew" "opencl:$((calls / 5)):lasting:code=-36"
check 'without a new one nothing goes on' grep -q '^of 3 .* 0 solved, 0 kept, 2 failed, 1 left' "$work/summary"
check 'what failed is done by --resume' "$tool" batch "$work/three" --threads 1 --out-dir "$work/lost" --resume
check 'as if it had not' cmp "$work/first/1.vtp" "$work/lost/1.vtp"

# ---- no memory for a worker ------------------------------------------------------------------------

reported_or_failed() { # without memory at one of the first calls
    local at lines
    for at in $(seq 20); do
        lines=$(DMK_FAULT=memory:$at "$DMKCL_BUILD/faults/dmkcl" batch "$torus" --threads 1 --json 2> "$work/err" | wc -l
            exit "${PIPESTATUS[0]}") && test "$lines" -ne 1 && echo "call $at" && return 1
    done
    return 0
}
check 'a batch without memory at one of its first calls solves or fails' reported_or_failed

# ---- a report that another run replaces between open and lock -----------------------------------------

stopped_at() { # CALL: a batch that stops there, whether with its report open
    DMK_FAULT=file:$1:signal=19 "$DMKCL_BUILD/faults/dmkcl" batch "$torus" --vertex 1 --resume --report "$work/turn.jsonl" \
        > "$work/summary" 2> "$work/err" &
    stopped=$!
    for _ in $(seq 100); do
        grep -q '^State:.*T' "/proc/$stopped/status" && break
        sleep 0.02
    done
    ls -l "/proc/$stopped/fd" 2>&1 | grep -q turn.jsonl && return 0
    kill -KILL "$stopped"
    wait "$stopped" 2> "$work/late"
    return 1
}
"$tool" batch "$torus" --vertex 0 --report "$work/turn.jsonl" --quiet
call=1
until stopped_at $call || [ $call -gt 50 ]; do call=$((call + 1)); done
"$tool" batch "$torus" --vertex 1 --report "$work/turn.jsonl" --quiet --resume
kill -CONT "$stopped"
wait "$stopped"
check 'the batch goes on with the new one' grep -q '0 solved, 1 kept' "$work/summary"

# ---- no room ----------------------------------------------------------------------------------

large=$work/large.off
"$tool" mesh torus --source 3,0,0 --triangles 40000 --out "$large" > "$work/said_out"
full() ( # a file may not grow beyond 1 MiB: enough for what PoCL writes
    ulimit -f 1024
    "$@"
)
"$tool" solve "$large" --vertex 0 --quiet
fails 'a file that may not grow so long' 2 'a.vtp: cannot write: File too large' \
    full "$tool" solve "$large" --vertex 0 --quiet --out "$work/files/a.vtp"
check 'leaves nothing' empty "$work/files"
said_full() { "$tool" "$@" > /dev/full 2> "$work/err"; test $? -eq 2 && grep -q 'No space left' "$work/err"; }
check 'a full standard output of solve' said_full solve "$torus" --vertex 0
check 'of its report' said_full solve "$torus" --vertex 0 --json
printf 'vertex %s\n' 0 1 2 3 > "$work/many"
check 'of many sources' said_full solve "$torus" --sources "$work/many"
check 'which is said once' test "$(grep -c . "$work/err")" -eq 1
check 'and of their reports' said_full solve "$torus" --sources "$work/many" --json
check 'once, too' test "$(grep -c . "$work/err")" -eq 1
said_full solve "$torus" --sources "$work/many" --quiet --locus "$work/files/m.obj" --report -
check 'files are written all the same' test "$(ls "$work/files" | grep -c 'm-000[0-3].obj')" -eq 4
rm -f "$work"/files/m-*
check 'of devices' said_full devices
check 'of info' said_full info "$torus"

# ---- a small file that unpacks to a large one ---------------------------------------------------

head -c 200000000 /dev/zero | gzip -9 > "$work/zeros.off.gz"
fails 'a packed file of nothing' 3 'zeros.off.gz: unpacks to more than 500 times its size' \
    "$tool" info "$work/zeros.off.gz"

# ---- closed standard streams: their numbers are not lent to files -----------------------------

"$tool" solve "$torus" --vertex 0 --quiet --out "$work/files/ref.vtp"
"$tool" solve "$torus" --vertex 0 --verbose --out "$work/files/a.vtp" < /dev/null >&- 2>&-
check 'closed standard output is an error' test $? -eq 2
check 'and the files are as ever' cmp "$work/files/a.vtp" "$work/files/ref.vtp"
"$tool" solve "$torus" --vertex 0 --quiet --out "$work/files/a.vtp" <&- >&- 2>&-
check 'with all three closed too' cmp "$work/files/a.vtp" "$work/files/ref.vtp"
rm "$work/files"/*

# ---- a signal within a stage that has no steps ---------------------------------------------------

stop_in() { # STAGE COMMAND...: the stage is reported when it starts; a signal that comes too late: again
    local stage=$1 status try
    shift
    mkfifo "$work/stages"
    for try in 1 2 3 4 5; do
        rm -f "$work/files"/*
        "$tool" "$@" --verbose > "$work/said_out" 2> "$work/stages" &
        while read -r word _; do
            [ "$word" != "$stage" ] || kill -TERM $!
        done < "$work/stages"
        wait $!
        status=$?
        [ $status -ne 0 ] || continue
        break
    done
    rm "$work/stages"
    test $status -eq 130 && empty "$work/files" || { echo "status $status"; return 1; }
}
"$tool" mesh torus --source 3,0,0 --triangles 200000 --out "$large" > "$work/said_out"
check 'a signal while the locus is traced' stop_in locus \
    solve "$large" --vertex 0 --out "$work/files/a.vtp" --locus "$work/files/a.obj"
check 'while the surface is cut' stop_in cut cut "$large" --vertex 0 --out "$work/files/a.off"
check 'while a path is sought' stop_in distance path "$large" --vertex 0 --to=-1,0,0 --out "$work/files/a.csv"
check 'while distances are' stop_in distance distance "$large" --vertex 0 --out "$work/files/a.vtp"

# ---- waiting for the writer of a pipe ---------------------------------------------------------

waits() { # SIGNAL: the tool waits at the pipe and is ended by one signal, at once
    local pid status
    env --default-signal=INT "$tool" solve "$work/pipe" --vertex 0 2> "$work/err" &
    pid=$!
    sleep 0.7
    kill "-$1" "$pid"
    (sleep 5 && kill -9 "$pid") 2> /dev/null &
    wait "$pid"
    status=$?
    kill $! 2> /dev/null
    test "$status" -eq 130 || { echo "status $status"; cat "$work/err"; return 1; }
}
mkfifo "$work/pipe"
check 'a pipe that nobody opens' waits TERM
sleep 4 > "$work/pipe" &
check 'a pipe that nobody writes to' waits TERM
goes_on() { # a script's & has SIGINT ignored: a Ctrl-C for others does not end it
    local pid
    "$tool" info "$work/pipe" > "$work/said_out" &
    pid=$!
    sleep 0.7
    kill -INT "$pid"
    sleep 0.7
    cat meshes/torus.off > "$work/pipe"
    wait "$pid"
}
check 'an ignored signal' goes_on
tap_end
