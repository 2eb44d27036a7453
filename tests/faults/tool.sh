#!/bin/bash
# The tool under faults: calls for memory, files and OpenCL fail or bring a signal, one run for each.
# usage: tool.sh BUILD_FOLDER RUNS    RUNS for each command and kind of fault; 0: one for each call
# After each: the right exit code, files whole or not there, no others, nothing kept. Prints what fails
# and at last the counts.
set -u
build=$1 runs=$2
tool=$PWD/$build/faults/dmkcl
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
tried=0 failed=0
cd "$work" && mkdir out ref || exit 1
"$tool" mesh torus --source 3,0,0 --triangles 1200 --out torus.off > said || exit 1
printf '3,0,0\nvertex 7\n0,0,1\n' > list.txt

declare -A command=(
    [solve]='solve torus.off --vertex 0 --out DIR/a.vtp --locus DIR/b.obj --tangent DIR/c.csv --report DIR/d.json'
    [cut]='cut torus.off --vertex 0 --out DIR/e.ply'
    [path]='path torus.off --vertex 0 --to=-1,1,0.5 --out DIR/f.vtp'
    [batch]='solve torus.off --sources list.txt --out DIR/g.vtu --locus DIR/h.csv'
    [mesh]='mesh torus --triangles 300 --out DIR/i.off'
    [info]='info torus.off'
    [devices]='devices'
)

complain() { # WHAT
    failed=$((failed + 1))
    printf 'FAILED: %s, %s: %s\n' "$name" "$order" "$1"
    sed 's/^/    /' said
}

# A report has seconds in it: it must end as a whole one does.
same() { # FILE REFERENCE
    case $1 in
    *.json) [ "$(tail -n 1 "$1")" = '}' ] ;;
    *) cmp -s "$1" "$2" ;;
    esac
}

files_good() { # how many are whole; complains of others
    local f n=0
    for f in $(ls -A out); do
        if [ ! -e "ref/$f" ]; then
            [ "$killed" = 1 ] || complain "leaves $f"
        elif same "out/$f" "ref/$f"; then
            n=$((n + 1))
        else
            complain "half-written $f"
        fi
    done
    whole=$n
}

# run NAME ORDER ALLOWED: exit codes allowed, blank-separated
run() {
    name=$1 order=$2
    local allowed=" $3 " status killed=0 whole
    rm -rf out log && mkdir out
    { DMK_FAULT=$order DMK_FAULT_LOG=log "$tool" ${command[$name]//DIR/out} > said 2>&1; } 2> /dev/null
    status=$?
    tried=$((tried + 1))
    # Ended by the signal itself: by kill -9, or before there is work to be ended with care.
    [ -e log ] || killed=1
    case $order in
    *signal=9) [ -e log ] && allowed=' 0 ' ;; # in this run the call did not come
    *) [ "$killed" = 0 ] || [ -z "$(ls -A out)" ] || complain 'files of a run that never began' ;;
    esac
    case $allowed in *" $status "*) ;; *) complain "exit code $status" ;; esac
    files_good
    [ "$status" -ne 0 ] || [ "$whole" -eq "${n_files[$name]}" ] || complain "$whole files"
    # One locale lives as long as the program; the second call for memory makes it.
    case $killed:$order:$(cut -d' ' -f2 log 2> /dev/null) in
    1:* | 0:memory:1:lasting:0 | 0:memory:2:lasting:0 | 0:memory:2:0) ;;
    0:*:1) ;;
    *) complain "not given back: $(cat log)" ;;
    esac
    [ "$status" -eq 0 ] || [ "$killed" = 1 ] || grep -q '^dmkcl: ....' said || complain 'no message'
    if [ "$name" = batch ] && { [ "$status" -ne 0 ] || [ "$killed" = 1 ]; }; then resume; fi
}

# What is left of a batch is done by --resume, and then all is there.
resume() {
    local whole killed=1
    "$tool" ${command[batch]//DIR/out} --resume > said 2>&1 || complain "resuming: $?"
    files_good
    [ "$whole" -eq "${n_files[batch]}" ] || complain "$whole files after resuming"
}

declare -A n_files
for name in "${!command[@]}"; do
    "$tool" ${command[$name]//DIR/ref} > said 2>&1 || { cat said; exit 1; }
done
for name in "${!command[@]}"; do
    rm -rf out && mkdir out
    "$tool" ${command[$name]//DIR/out} > said 2>&1 || exit 1
    n_files[$name]=$(ls -A out | wc -l)
done

# Calls to try of all there are: evenly spread, other ones for each command and kind.
choose() { # NUMBER_OF_CALLS SHIFT
    if [ "$runs" -eq 0 ] || [ "$1" -le "$runs" ]; then
        seq 1 "$1"
    else
        awk -v n="$1" -v runs="$runs" -v shift="$2" 'BEGIN {
            for (i = 0; i < runs; i++) { at = int((i + (shift * 0.37) % 1) * n / runs) + 1; print at } }'
    fi
}

shift_by=0
for name in solve cut path batch mesh info devices; do
    for kind in memory file opencl; do
        DMK_FAULT=$kind:999999999 DMK_FAULT_LOG=log "$tool" ${command[$name]//DIR/out} > said 2>&1
        calls=$(cut -d' ' -f1 log)
        shift_by=$((shift_by + 1))
        for at in $(choose "$calls" $shift_by); do
            case $kind in
            memory) run $name "memory:$at" '0 8' ;;
            file) run $name "file:$at:code=28" '0 2 5' ;; # 5: PoCL's cache is full
            opencl) run $name "opencl:$at:code=-5" '0 5' ;;
            esac
        done
        shift_by=$((shift_by + 1))
        for at in $(choose "$calls" $shift_by); do
            case $kind in
            memory) run $name "memory:$at:lasting" '0 8' ;;
            file) run $name "file:$at:lasting:code=5" '0 2 5' ;;
            opencl) run $name "opencl:$at:lasting:code=-4" '0 5 8' ;;
            esac
        done
        # Commands without long work are ended by the signal itself.
        case $name in mesh | info | devices) continue ;; esac
        for number in 2 15 9; do
            shift_by=$((shift_by + 1))
            codes='0 130 143'
            [ $number -ne 9 ] || codes=137
            for at in $(choose "$calls" $shift_by); do
                run $name "$kind:$at:signal=$number" "$codes"
            done
        done
    done
done
echo "# tried $tried: failed $failed"
[ "$failed" -eq 0 ]
