# The tool under mpirun: one to four ranks give the files of the plain program; sources are dealt out; slips are
# reported once, and a rank that fails or is killed ends the job.
. tests/tap.sh

export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export OMPI_MCA_rmaps_base_oversubscribe=1 PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe # of Open MPI 4 and 5
config=$(basename "$DMKCL_BUILD")
if ! command -v mpirun > "$work/where"; then
    skip 'several ranks' 'there is no mpirun here: `make MPI=1` installs what it needs'
    tap_end
    exit 0
fi
case $config in
release | debug) ;;
*)
    skip 'several ranks' "Open MPI's own leaks and races are not ours: not with CONFIG=$config"
    tap_end
    exit 0
    ;;
esac
check 'the tool is built for mpirun' make -s CONFIG="$config" MPI=1 mpi
mpi=build/mpi$([ "$config" = release ] || echo "-$config")/dmkcl
plain=$tool
mesh=$work/mesh.ply
list=$work/list.txt
has() { grep -qE -e "$2" "$1"; }
ranks() { # N ARGUMENTS...
    local n=$1
    shift
    timeout -k 5 120 mpirun -n "$n" "$mpi" "$@"
}
# One rank never comes, which the other one waits for half a minute; looked at in the end.
wait_for_nobody() {
    local begin=$SECONDS status
    timeout -k 5 60 mpirun -n 1 "$mpi" devices : -n 1 sleep 55 > "$work/waited" 2>&1
    status=$?
    echo "status $status after $((SECONDS - begin)) s" >> "$work/waited"
}
wait_for_nobody &
waiting=$!
"$plain" mesh quartic --triangles 20000 --out "$mesh" > "$work/said_out"

# ---- the same results -------------------------------------------------------------------------

solve() { # NAME COMMAND...: its files are NAME.*
    local name=$1
    shift
    "$@" solve "$mesh" --vertex 7 --out "$work/$name.vtp" --locus "$work/$name.obj" --tangent "$work/$name.csv" \
        --report "$work/$name.json"
}
check 'the plain program solves' solve plain "$plain"
for n in 1 2 3 4; do
    check "$n ranks solve" solve "r$n" ranks "$n"
    for kind in vtp obj csv; do
        check "$n ranks: the plain program's $kind, byte by byte" cmp "$work/plain.$kind" "$work/r$n.$kind"
    done
    check "$n ranks: the report is JSON" is_json "$work/r$n.json"
done
figure() { sed -n "s/.*\"$2\": \([^,]*\),*$/\1/p" "$1" | head -n 1; }
for key in cost_upper cost_lower steps cg_iterations; do
    check "4 ranks: $key of the plain program" \
        test "$(figure "$work/plain.json" $key)" = "$(figure "$work/r4.json" $key)"
done
check 'the report lists four ranks, each with its own rows' test "$(grep -c '"own_rows": [1-9]' "$work/r4.json")" -eq 4
check 'work goes on while messages are under way' test "$(figure "$work/r4.json" overlapped)" -gt 50
check 'one rank deals nothing out' test "$(grep -c own_rows "$work/r1.json")" -eq 0
# ---- the density alone ------------------------------------------------------------------------

alone() { # NAME COMMAND...
    local name=$1
    shift
    "$@" solve "$mesh" --vertex 7 --density-only --out "$work/$name.vtp" --out "$work/$name.pvtp" --report "$work/$name.json"
}
check 'the plain program solves for the density alone' alone only "$plain"
check 'which has no distance' sh -c "! grep -q 'Name=\"distance\"' '$work/only.vtp' && ! grep -q cut_locus '$work/only.json'"
for n in 1 2 3 4; do
    check "$n ranks do" alone "only$n" ranks "$n"
    check "$n ranks: the same density" cmp "$work/only.vtp" "$work/only$n.vtp"
    check "$n ranks: the same pieces" cmp "$work/only_0000.vtp" "$work/only${n}_0000.vtp"
    for key in cost_upper cost_lower steps cg_iterations; do
        check "$n ranks: $key of the plain program" \
            test "$(sed -n "s/.*\"$key\": \([^,]*\),*$/\1/p" "$work/only.json" | head -n 1)" = \
            "$(sed -n "s/.*\"$key\": \([^,]*\),*$/\1/p" "$work/only$n.json" | head -n 1)"
    done
done
check 'it makes no cut locus' sh -c "! '$plain' solve '$mesh' --vertex 7 --density-only --locus '$work/none.obj' 2> '$work/err' && grep -q density-only '$work/err'"

summary() {
    ranks 3 solve "$mesh" --vertex 7 > "$work/summary" && test "$(grep -c 'cut locus' "$work/summary")" -eq 1 &&
        has "$work/summary" '^ranks +3, [0-9.]+ % of the rows'
}
check 'one summary, which names the ranks' summary
check 'commands without a share of the work run once' \
    sh -c "test \$(timeout 60 mpirun -n 3 '$mpi' info '$mesh' | grep -c triangles) -eq \$('$mpi' info '$mesh' | grep -c triangles)"

# ---- sources dealt out ------------------------------------------------------------------------

for k in 0 5000 9000 2500 7000; do echo "vertex $k"; done > "$list"
mkdir "$work/plain" "$work/dealt"
sources() { # FOLDER OPTIONS COMMAND...
    local folder=$1 options=$2
    shift 2
    "$@" solve "$mesh" --sources "$list" --out "$folder/a.vtp" --report "$folder/a.json" $options
}
check 'five sources by the plain program' sources "$work/plain" "" "$plain"
dealt() { sources "$work/dealt" "" ranks 3 > "$work/lines"; }
check 'five sources by three ranks' dealt
for k in 0 1 2 3 4; do
    check "source $k: the same result" cmp "$work/plain/a-000$k.vtp" "$work/dealt/a-000$k.vtp"
done
check 'each source has one line, and the sum is of all ranks' \
    sh -c "test \$(grep -c '^000[0-4]  (' '$work/lines') -eq 5 && grep -q '^of 5 sources 5 solved, 0 kept, 0 failed' '$work/lines'"
resumed() {
    rm "$work/dealt/a-0002.vtp" && sources "$work/dealt" --resume ranks 2 > "$work/lines" &&
        has "$work/lines" '^of 5 sources 1 solved, 4 kept, 0 failed'
}
check 'what is missing is done again, and no more' resumed

# ---- meshes dealt out -------------------------------------------------------------------------

mkdir "$work/shapes"
for n in 1200 1600 2000 2400 2800 3200; do "$plain" mesh sphere --triangles "$n" --quiet --out "$work/shapes/s$n.off"; done
shapes() { # FOLDER COMMAND...
    local folder=$1
    shift
    "$@" batch "$work/shapes" --vertex 0 --out-dir "$folder" --out .vtp --report "$folder.jsonl"
}
check 'six meshes by the plain program' shapes "$work/one" "$plain"
check 'six meshes by three ranks' shapes "$work/three" ranks 3
for n in 1200 2000 3200; do
    check "mesh of $n: the same result" cmp "$work/one/s$n.vtp" "$work/three/s$n.vtp"
done
check 'one report with a line for each mesh' test "$(grep -c '"state": "done"' "$work/three.jsonl")" -eq 6
again() {
    rm "$work/three/s2000.vtp" && ranks 2 batch "$work/shapes" --vertex 0 --out-dir "$work/three" --out .vtp \
        --report "$work/three.jsonl" --resume > "$work/lines" && has "$work/lines" '^of 6 .* 1 solved, 5 kept, 0 failed'
}
check 'two ranks do again what is missing' again

# ---- slips and faults -------------------------------------------------------------------------

once() { # CODE PATTERN ARGUMENTS...: three ranks end with the code and say so once
    local code=$1 pattern=$2 status
    shift 2
    ranks 3 "$@" > "$work/out" 2> "$work/err"
    status=$?
    test "$status" -eq "$code" && test "$(grep -cE -e "$pattern" "$work/err")" -eq 1 && return 0
    echo "status $status"
    cat "$work/out" "$work/err"
    return 1
}
check 'a bad option is reported once' once 1 "no option '--sauce'" solve "$mesh" --sauce 3
check 'a report that is there is reported once, by a usual end' once 1 '--resume goes on' batch "$work/shapes" \
    --report "$work/three.jsonl"
check 'without an abort' sh -c '! grep -q MPI_ABORT "$1"' - "$work/err"
check 'a missing file is reported once' once 2 'none.ply' solve "$work/none.ply" --vertex 0
check 'a vertex out of range is reported once' once 1 'vertex' solve "$mesh" --vertex 99999999
check 'one of a mesh in pieces, too' once 1 'vertex 99999999 is out of range' solve "$mesh" --vertex 99999999 --density-only
cat > "$work/sheets.py" <<'END'
import struct, sys
x = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1)]
t = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3), (0, 1, 4)]
head = "ply\nformat binary_little_endian 1.0\nelement vertex 5\nproperty double x\nproperty double y\nproperty double z\n"
head += "element face 5\nproperty list uchar int vertex_indices\nend_header\n"
open(sys.argv[1], "wb").write(head.encode() + b"".join(struct.pack("<3d", *v) for v in x) +
                              b"".join(struct.pack("<B3i", 3, *f) for f in t))
END
python3 "$work/sheets.py" "$work/sheets.ply"
check 'a mesh in pieces that is refused is refused once' once 4 'sheets.ply: non-manifold edge 0-1: triangles 0, 1 and 4 share it' \
    solve "$work/sheets.ply" --vertex 0 --density-only
check 'too few steps are reported once' once 7 'did not reach the tolerance' solve "$mesh" --vertex 7 --max-steps 1
# Each rank in a folder of its own, as on machines without a common disk.
mkdir "$work/here" "$work/there"
"$plain" mesh quartic --triangles 2000 --quiet --out "$work/here/m.ply"
apart() { # OPTIONS
    timeout -k 5 60 mpirun -n 1 -wdir "$work/here" "$PWD/$mpi" solve m.ply --vertex 7 "$@" : \
        -n 1 -wdir "$work/there" "$PWD/$mpi" solve m.ply --vertex 7 "$@" 2> "$work/err"
}
cp "$work/here/m.ply" "$work/there"
check 'copies of a file are one' apart --quiet --density-only
{ head -c 900 "$work/here/m.ply" && printf XX && tail -c +903 "$work/here/m.ply"; } > "$work/there/m.ply" # a coordinate
another() {
    apart --density-only
    test $? -eq 2 && test "$(grep -c "^dmkcl: 'm.ply' on rank 1 is another file" "$work/err")" -eq 1
}
check 'another file by the same name is an error' another
# The second rank alone cannot write where its device's kernels are kept, has no device, or the like.
lonely() {
    local begin=$SECONDS status
    timeout -k 5 120 mpirun -n 1 "$mpi" solve "$mesh" --vertex 7 --quiet : -n 1 -x OCL_ICD_VENDORS=/nowhere \
        "$mpi" solve "$mesh" --vertex 7 --quiet --out "$work/lonely.vtp" > "$work/out" 2> "$work/err"
    status=$?
    test "$status" -eq 5 && test "$(grep -c '^dmkcl: ' "$work/err")" -eq 1 && test ! -e "$work/lonely.vtp" &&
        test $((SECONDS - begin)) -lt 60 && return 0
    echo "status $status after $((SECONDS - begin)) s"
    cat "$work/err"
    return 1
}
check 'a rank that fails alone ends the job with its message' lonely
# Of two ranks the last one, which traces the cut locus, gets no memory at a call near its end.
faulty() { # AT FOLDER
    timeout -k 5 60 mpirun -n 1 "$faults" solve "$work/small.off" --vertex 7 --quiet --out "$2/a.vtp" --locus "$2/a.obj" : \
        -n 1 -x "DMK_FAULT=memory:$1" -x "DMK_FAULT_LOG=$2/log" \
        "$faults" solve "$work/small.off" --vertex 7 --quiet --out "$2/a.vtp" --locus "$2/a.obj" 2> "$work/err"
}
lost_locus() { # CALLS SECONDS: so many before the last one; all is over in so many seconds, as the others are told or not
    local begin=$SECONDS status
    mkdir "$work/lost"
    faulty $((calls - $1)) "$work/lost"
    status=$?
    test "$status" -eq 8 && test "$(grep -c '^dmkcl: ' "$work/err")" -eq 1 && has "$work/err" '^dmkcl: out of memory' &&
        cmp "$work/small.vtp" "$work/lost/a.vtp" && test "$(cd "$work/lost" && echo a*)" = a.vtp &&
        test $((SECONDS - begin)) -lt "$2" && rm -r "$work/lost" && return 0
    echo "status $status after $((SECONDS - begin)) s:" && ls -A "$work/lost"
    cat "$work/err"
    rm -r "$work/lost"
    return 1
}
faults=build/mpi$([ "$config" = release ] || echo "-$config")/faults/dmkcl
check 'the tool for mpirun is built with faults' make -s CONFIG="$config" MPI=1 "$faults"
"$plain" mesh quartic --triangles 2000 --quiet --out "$work/small.off"
"$plain" solve "$work/small.off" --vertex 7 --quiet --out "$work/small.vtp"
mkdir "$work/whole"
check 'no call fails that is not there' faulty 1000000 "$work/whole"
calls=$(cut -d ' ' -f 1 "$work/whole/log")
check 'a cut locus that the last rank fails at early: its message, and the density is written' lost_locus 50 9
check 'one that it fails at late' lost_locus 25 9
check 'one that is traced and cannot be told to the others' lost_locus 8 40
they() { pgrep -f "^$mpi solve $mesh --vertex 7 --method euler"; }
met() { # how many ranks have OpenCL, which they open when all are there
    local pid
    for pid in $(they); do grep -qs libpocl "/proc/$pid/maps" && echo; done | wc -l
}
count() { they | wc -l; }
process_of() { # RANK
    local pid
    for pid in $(they); do tr '\0' '\n' < "/proc/$pid/environ" | grep -qx "OMPI_COMM_WORLD_RANK=$1" && echo "$pid"; done
}
# Not by setsid: Linux 6.18 lets ranks that wait in a session of their own keep other sessions, this test too, from the
# processors, for up to 134 s here.
start() { # COUNT: three ranks; comes back when COUNT, met or count, says three, or after 40 seconds
    local begin=$SECONDS
    rm -rf "$work/kill" && mkdir "$work/kill"
    timeout -k 5 150 mpirun -n 3 $below "$mpi" solve "$mesh" --vertex 7 --method euler --tolerance 1e-9 \
        --max-steps 1000000 --quiet --out "$work/kill/a.vtp" > "$work/out" 2> "$work/err" &
    job=$!
    while [ "$($1)" -lt 3 ] && [ $((SECONDS - begin)) -lt 40 ]; do sleep 0.05; done
    echo "after $((SECONDS - begin)) s, ranks here: $(count), with OpenCL: $(met)"
}
# mpirun itself may linger when all its ranks have ended, or miss that one has (Open MPI 4.1); it is told to end then.
lingers=0
wait_for_end() { # SECONDS: no rank is left then, and no file or half of one; the status of mpirun
    local begin=$SECONDS
    while [ -n "$(they)" ] && [ $((SECONDS - begin)) -lt "$1" ]; do sleep 0.1; done
    echo "rank $victim killed, after $((SECONDS - begin)) s there are:" && they
    test -z "$(they)" && test -z "$(ls -A "$work/kill")" || return 1
    for _ in $(seq 100); do kill -0 "$job" 2> "$work/late" && sleep 0.1; done
    if kill "$job" 2> "$work/late"; then
        lingers=$((lingers + 1))
        wait "$job"
        status=-1
    else
        wait "$job"
        status=$?
    fi
}
killed() { # SECONDS RANK: it dies by SIGKILL then, and the job ends
    local job victim
    start met
    sleep "$1"
    victim=$(process_of "$2")
    test -n "$victim" && kill -KILL "$victim"
    wait_for_end 40 && test "$status" -ne 0 && test "$status" -ne 124 && return 0
    echo "status $status"
    return 1
}
killed_early() { # which, until all ranks have found each other, half a minute ends
    local job victim
    start count
    victim=$(process_of 1)
    test -n "$victim" && kill -KILL "$victim"
    wait_for_end 45
}
missed() {
    wait "$waiting"
    cat "$work/waited"
    has "$work/waited" '^dmkcl: the other ranks do not answer' && has "$work/waited" '^status 5 after (2[5-9]|3.|4.) s'
}
# A shell between mpirun and the ranks hides from it that one has been killed.
printf '"$@"\nstatus=$?\n[ $status -ne 137 ] || kill -STOP $$\nexit $status\n' > "$work/hide.sh"
hidden() { # RANK
    below="sh $work/hide.sh" killed 0.2 "$1" && { test "$status" -eq 5 || test "$status" -eq -1; } &&
        has "$work/err" "^dmkcl: rank $1 has ended without a word" && return 0
    cat "$work/err"
    return 1
}
check 'a rank that never comes is missed' missed
check 'a killed rank that mpirun does not see: the first one ends the job with a word' hidden 1
check 'the first rank killed so: the second one does' hidden 0
check 'a rank killed as it starts: the others end' killed_early
# Other moments each time, counted from when all three have met; KILLS=20 tries as many.
for k in $(seq "${KILLS:-6}"); do
    seconds=$((RANDOM % 2)).$((RANDOM % 10))$((RANDOM % 10))
    check "rank $((k % 3)) killed after $seconds s ends the job" killed "$seconds" $((k % 3))
done
[ $lingers -eq 0 ] || echo "# mpirun lingered after all its ranks had ended: $lingers times"
tap_end
