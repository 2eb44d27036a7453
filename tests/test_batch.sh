# Many sources in one run: names, figures, failures, what an interruption leaves, resuming.
. tests/tap.sh

torus=$work/torus.off
list=$work/list.txt
out=$work/files
has() { grep -qE -e "$2" "$1"; }
holds() { # FOLDER FILES
    test "$(ls -A "$1" | tr '\n' ' ')" = "$2" || { ls -A "$1"; return 1; }
}
batch() { # SOURCES [OPTIONS]: all kinds of files into $out
    local sources=$1
    shift
    "$tool" solve "$torus" --sources "$sources" --out "$out/a.vtp" --locus "$out/b.obj" \
        --tangent "$out/c.csv" --report "$out/d.json" "$@"
}
all() { # NUMBERS...: the files of these sources
    local kind k
    for kind in a:vtp b:obj c:csv d:json; do
        for k; do printf '%s-%s.%s ' "${kind%:*}" "$k" "${kind#*:}"; done
    done
}
"$tool" mesh torus --source 3,0,0 --triangles 2000 --out "$torus" > "$work/said_out"

# ---- slips ------------------------------------------------------------------------------------

bad() { # NAME LINE TEXT: the text is refused, its line named
    local name=$1 line=$2
    printf "$3" > "$work/bad.txt"
    fails "sources: $name" 3 "bad.txt:$line: .*expected X,Y,Z or vertex I" \
        "$tool" solve "$torus" --sources "$work/bad.txt"
}
bad 'two numbers' 2 '1,0,0\n1,2\n'
bad 'four numbers' 1 '1,2,3,4\n'
bad 'a number too near' 1 '1,2,3x\n'
bad 'two commas' 1 '1,,2,3\n'
bad 'not finite' 3 '# here\n\n1,2,nan\n'
bad 'not decimal' 1 '0,0x10,0\n'
bad 'no vertex' 1 'vertex\n'
bad 'a vertex below 0' 1 'vertex -1\n'
bad 'half a vertex' 1 'vertex 1.5\n'
bad 'a vertex too far up' 1 'vertex 99999999999999999999999\n'
printf '# nothing\n\n' > "$work/bad.txt"
fails 'sources: none' 3 'contains no sources' "$tool" solve "$torus" --sources "$work/bad.txt"
fails 'sources: no file' 2 'none.txt' "$tool" solve "$torus" --sources "$work/none.txt"
printf '3,0,0\n' > "$list"
fails 'sources and a source' 1 'give one of --source, --vertex and --sources$' "$tool" solve "$torus" --sources "$list" --vertex 0
fails 'resume alone' 1 '--sources' "$tool" solve "$torus" --vertex 0 --resume
fails 'resume without files' 1 'skips sources whose files exist' \
    "$tool" solve "$torus" --sources "$list" --resume

# ---- a batch ----------------------------------------------------------------------------------

mkdir "$out"
printf '\357\273\277# three\n3,0,0\n\n  vertex 7   # the second\n-3 0, 0\n' > "$list"
batch "$list" > "$work/summary" 2> "$work/errors"
check 'three sources' test $? -eq 0
check 'are quiet on the standard error' test ! -s "$work/errors"
check 'write their numbered files and nothing else' holds "$out" "$(all 0000 0001 0002)"
check 'print a line each' test "$(grep -cE '^000[012]  \(.*cut locus [0-9]' "$work/summary")" -eq 3
check 'and their number' has "$work/summary" '^of 3 sources 3 solved, 0 kept, 0 failed'
check 'the mesh is reported once' test "$(grep -c '^mesh' "$work/summary")" -eq 1
for k in 0 1 2; do
    check "report $k is JSON" is_json "$out/d-000$k.json"
done
check 'a report names its own files' has "$out/d-0001.json" 'a-0001.vtp'
check 'the first one carries the set-up' has "$out/d-0000.json" '"setup": 0*[.]?0*[1-9]'
check 'the next ones do not' has "$out/d-0001.json" '"setup": 0,'
check 'each has seconds of its own' has "$out/d-0001.json" '"solve": 0*[.]?0*[1-9]'
"$tool" solve "$torus" --vertex 7 --quiet --locus "$work/single.obj" --tangent "$work/single.csv"
check 'a source of many is solved as if alone' cmp "$work/single.obj" "$out/b-0001.obj"
check 'its tangent cut locus too' cmp "$work/single.csv" "$out/c-0001.csv"
check '--json prints a report for each' test 3 -eq \
    "$("$tool" solve "$torus" --sources "$list" --json | grep -c '^{')"

# ---- the tangent cut locus --------------------------------------------------------------------

check 'the tangent cut locus has its columns' has "$out/c-0000.csv" '^angle,time,x,y,z,kind$'
"$tool" solve "$torus" --source 3,0,0 --quiet --locus "$work/locus.csv"
check 'two rows for each vertex of the locus' test "$(wc -l < "$out/c-0000.csv")" -eq \
    "$((2 * $(wc -l < "$work/locus.csv") - 1))"
# The cut time of the direction along the outer equator is its half length, 3 pi; the torus has
# ends at sin and cos of other angles, and the shortest time is that of a circle around the tube, pi.
check 'by angle in [0, 2 pi), with times from pi to the diameter' awk -F, '
    NR == 1 { next }
    $1 < last || $1 < 0 || $1 >= 6.283186 { print "angle", $0; bad = 1 }
    $2 < 3.1 || $2 > 9.5 || NF != 6 || $6 !~ /^[0-3]$/ { print "row", $0; bad = 1 }
    { last = $1; if (NR == 2 || $2 < least) least = $2 }
    END { if (least > 3.2) { print "least", least; bad = 1 } exit bad }' "$out/c-0000.csv"

# ---- failures and resuming --------------------------------------------------------------------

rm -r "$out"
mkdir "$out"
printf '3,0,0\nvertex 99999999\nvertex 7\n' > "$list"
batch "$list" > "$work/summary" 2> "$work/errors"
check 'a source that fails gives the exit code' test $? -eq 1
check 'is reported with its line' has "$work/errors" 'list.txt:2: .*99999999'
check 'and the others go on' holds "$out" "$(all 0000 0002)"
check 'the number of failures is reported' has "$work/summary" '2 solved, 0 kept, 1 failed'

echo kept > "$out/a-0000.vtp"
rm "$out/d-0002.json"
printf '3,0,0\n3,0,0\nvertex 7\n' > "$list"
batch "$list" --resume > "$work/summary"
check 'resuming ends well' test $? -eq 0
check 'does what is left' holds "$out" "$(all 0000 0001 0002)"
check 'and says so' has "$work/summary" '2 solved, 1 kept, 0 failed'
check 'keeps what is there' test "$(cat "$out/a-0000.vtp")" = kept
check 'without --resume all is made anew' batch "$list" --quiet
check 'over what is there' has "$out/a-0000.vtp" '</VTKFile>'

batch "$list" --quiet --gap 1e-6 2> "$work/said"
check 'a missed gap gives its exit code' test $? -eq 9
batch "$list" --quiet --gap 1e-6 --resume 2> "$work/said"
check 'and a resumed run, which keeps it' test $? -eq 9

rm -r "$out"
mkdir "$out"
awk 'BEGIN { for (i = 0; i < 2000; i++) print "vertex " i % 500 }' > "$list"
env --default-signal=INT "$tool" solve "$torus" --sources "$list" --out "$out/a.vtp" --report "$out/d.json" \
    > "$work/summary" &
pid=$!
for _ in $(seq 600); do
    test -e "$out/d-0000.json" && break
    sleep 0.1
done
kill -INT "$pid"
wait "$pid"
check 'an interruption ends all of it' test $? -eq 130
check 'what was solved is whole' is_json "$out/d-0000.json"
check 'nothing half-done is left' test -z "$(ls -A "$out" | grep -E '\.tmp$|json\.')"

printf 'vertex 0\nvertex 7\n' > "$list"
pieces() { "$tool" solve "$torus" --sources "$list" --out "$work/of.pvtp" --resume > "$work/summary"; }
pieces
rm "$work/of-0001_0000.vtp"
pieces
check 'pieces count as files' has "$work/summary" '1 solved, 1 kept'
tap_end
