# Many meshes in one run: what is found and written, failures, resuming, kills at any moment, pipes.
. tests/tap.sh

in=$work/in
out=$work/files
report=$out/report.jsonl
has() { grep -qE -e "$2" "$1"; }
names() { # of the lines of the report, with their state
    sed -E 's/^\{"name": "([^"]*)", "number": ([0-9]+),.*"state": "([a-z]*)".*/\1 \2 \3/' "$report" | sort | tr '\n' ';'
}
lines_are_json() { # FILE: each line an object
    local line
    while IFS= read -r line; do
        printf '%s\n' "$line" > "$work/line"
        is_json "$work/line" || { cat "$work/line"; return 1; }
    done < "$1"
}
fails_with() { # CODE COMMAND...
    local code=$1
    shift
    "$@" > "$work/said_out" 2> "$work/said"
    test $? -eq "$code"
}
mkdir -p "$in/sub"
"$tool" mesh sphere --triangles 400 --out "$in/a.off" > "$work/said_out"
"$tool" mesh torus --triangles 600 --out "$in/sub/b.off" > "$work/said_out"
"$tool" mesh ellipsoid --triangles 400 --out "$in/c.ply" > "$work/said_out"
echo 'no mesh' > "$in/bad.off"
echo 'not looked at' > "$in/notes.txt"
gzip -c "$in/a.off" > "$in/d.off.gz"

# ---- slips ------------------------------------------------------------------------------------

fails 'no operand' 1 'MESH is missing' "$tool" batch
fails 'no mesh' 2 "^dmkcl: batch: the list '-' names no mesh$" "$tool" batch - < /dev/null
mkdir "$work/none"
fails 'a folder without a mesh' 2 "^dmkcl: batch: no mesh in the folder '.*/none' or below it: no file ends in .ply .*.obj$" \
    "$tool" batch "$work/none"
fails 'a file of sources' 1 "'sources.txt' is not a whole number from 1 to 1000000; batch takes a number N of sources on each mesh; a file of sources is for .dmkcl solve.$" \
    "$tool" batch "$in" --sources sources.txt
echo 'x' > "$work/none/file"
fails 'a folder below a file' 2 "^dmkcl: --out-dir: cannot make the folder '.*/none/file/deep'" \
    "$tool" batch "$in/a.off" --out-dir "$work/none/file/deep/er"
check 'the folders above that of the results are made' "$tool" batch "$in/a.off" --out-dir "$work/none/so/deep/"
check 'with the results' test -s "$work/none/so/deep/a.vtp" -a -s "$work/none/so/deep/report.jsonl"
fails 'no list' 2 'none.list' "$tool" batch "$work/none.list"
fails 'resume without a report' 1 'give --report FILE' "$tool" batch "$in" --resume
fails 'files without a folder' 1 'need --out-dir' "$tool" batch "$in" --out .vtp
fails 'a suffix without its dot' 1 "'vtp' is not one of" "$tool" batch "$in" --out-dir "$out" --out vtp
fails 'a suffix of no result' 1 "'.csv' is not one of" "$tool" batch "$in" --out-dir "$out" --out .csv
fails 'one twice' 1 "a.off' is named twice; name it once$" "$tool" batch "$in/a.off" "$in/a.off" --out-dir "$out"
fails 'two of a name' 1 'of the same name' "$tool" batch "$in/a.off" "$in/../in/a.off" --out-dir "$out"
fails 'samples from a point' 1 'begins with a vertex' "$tool" batch "$in" --sources 2 --source 0,0,0
printf '{"name": "a\\\n%04096d\n' 0 > "$work/torn.jsonl"
fails 'a report that ends in a name' 3 'torn.jsonl' "$tool" batch "$in" --report "$work/torn.jsonl"
fails 'a device without a name, as of solve' 1 'device' "$tool" batch "$in" --device ''
rm -rf "$out"

# ---- a run ------------------------------------------------------------------------------------

"$tool" batch "$in" --out-dir "$out" > "$work/summary" 2> "$work/errors"
check 'a bad mesh gives the exit code' test $? -eq 3
check 'is reported once' test "$(grep -c 'bad.off' "$work/errors")" -eq 1
check 'and the others are solved' test "$(names)" = 'a 0 done;bad 0 failed;c 0 done;d 0 done;sub/b 0 done;'
check 'the files are named as the meshes' test "$(cd "$out" && find . -type f | sort | tr '\n' ' ')" = \
    './a.locus.obj ./a.vtp ./c.locus.obj ./c.vtp ./d.locus.obj ./d.vtp ./report.jsonl ./sub/b.locus.obj ./sub/b.vtp '
check 'each line is JSON' lines_are_json "$report"
check 'the end is reported' has "$work/summary" '^of 5 sources on 5 meshes 4 solved, 0 kept, 1 failed'
"$tool" solve "$in/sub/b.off" --vertex 0 --quiet --out "$work/b.vtp" --locus "$work/b.obj"
check 'a mesh of many is solved as if alone' cmp "$work/b.vtp" "$out/sub/b.vtp"
check 'its locus too' cmp "$work/b.obj" "$out/sub/b.locus.obj"
fails 'a report is not written over' 1 '--resume goes on' "$tool" batch "$in" --out-dir "$out"

printf '\357\273\277%s\n\t# a list\n  %s \t\n' "$in/a.off" "$in/sub" > "$work/l.txt"
"$tool" batch "$work/l.txt" --json > "$work/lines"
check 'a list, to standard output' test "$(grep -c '"state": "done"' "$work/lines")" -eq 2
"$tool" batch - --report - < "$work/l.txt" > "$work/lines"
check 'a list, from standard input' test "$(wc -l < "$work/lines")" -eq 2
check 'as JSON Lines' lines_are_json "$work/lines"
# Behind a blank "#" begins a comment where a mesh or folder stands before it, and is else of the name.
mkdir -p "$work/hash/in"
for name in 'no#1.off' 'no #2.off' 'no.off #3.off' 'in/c.off'; do cp "$in/a.off" "$work/hash/$name"; done
printf '%b\n' '#d.off' 'no#1.off\t# a' 'no #2.off   # b # c' 'no.off #3.off' 'in #d' 'e.off # e' 'f # f' > "$work/hash/list"
(tool=$(realpath "$tool") && cd "$work/hash" && "$tool" batch - --json < list > lines 2> errors)
check 'comments behind the names of a list' test "$(report=$work/hash/lines names)" = \
    'c 0 done;e 0 failed;f # f 0 failed;no #2 0 done;no#1 0 done;no.off #3 0 done;'
check 'a file that is not there by its name' has "$work/hash/errors" '^dmkcl: e.off: cannot open: '
check 'or by all of the line' has "$work/hash/errors" '^dmkcl: f # f: cannot open: '

# A missed gap changes the exit code alone, and only of a run without failures.
missed=$work/missed
fails 'a missed gap gives exit code 9, as of solve' 9 'a.off: the gap is .*, above the 1e-06 that --gap asked for' \
    "$tool" batch "$in/a.off" "$in/c.ply" --gap 1e-6 --out-dir "$missed" --quiet
check 'and all is done' test "$(report=$missed/report.jsonl names)" = 'a 0 done;c 0 done;'
check 'with its files' test -s "$missed/a.vtp" -a -s "$missed/c.vtp" -a -s "$missed/c.locus.obj"
check 'and so does a resumed run that keeps what missed it' \
    fails_with 9 "$tool" batch "$in/a.off" "$in/c.ply" --gap 1e-6 --out-dir "$missed" --resume --quiet
check 'a gap that is reached gives exit code 0' "$tool" batch "$in/a.off" --gap 0.5 --json
check 'a mesh that fails gives its code' fails_with 3 "$tool" batch "$in/a.off" "$in/bad.off" --gap 1e-6 --json
printf 'vertex 0\nvertex 99999\n' > "$work/sources.txt"
check 'and a source' fails_with 1 "$tool" solve "$in/a.off" --sources "$work/sources.txt" --gap 1e-6

# ---- resuming ---------------------------------------------------------------------------------

again() { "$tool" batch "$in" --out-dir "$out" --resume "$@" > "$work/summary" 2> "$work/errors"; }
rm "$in/bad.off"
cp "$in/sub/b.off" "$in/a.off"
rm "$out/c.locus.obj"
printf '{"name": "d", "num' >> "$report" # a kill in the middle of a line
again
check 'resuming ends well' test $? -eq 0
check 'says why a mesh is done again' has "$work/summary" '^a: done again: the mesh has changed$'
check 'or a source' has "$work/summary" '^c: done again: a file of it is missing$'
check 'keeps the rest' has "$work/summary" '2 solved, 2 kept, 0 failed'
check 'one line for each' test "$(names)" = 'a 0 done;bad 0 failed;c 0 done;d 0 done;sub/b 0 done;'
# A line that had no room, and those of other ranks behind it.
awk '/"name": "c"/ { sub(/"options":.*/, ""); torn = $0; next } { line[++n] = $0 }
    END { printf "%s", torn; for (i = 1; i <= n; i++) print line[i] }' "$report" > "$work/torn"
cp "$work/torn" "$report"
again
check 'what it says is done again, and no more' has "$work/summary" '1 solved, 3 kept, 0 failed'
check 'with one line for each' test "$(names)" = 'a 0 done;bad 0 failed;c 0 done;d 0 done;sub/b 0 done;'
again --vertex 1
check 'another source is done' has "$work/summary" '4 solved, 0 kept'
check 'and reported' has "$work/summary" '^d: done again: the source is another'
again --vertex 1 --tolerance 0.1
check 'other options are done' has "$work/summary" '^sub/b: done again: the options are others'
again --vertex 1 --tolerance 0.1 --strength 0.5
check 'another strength is one' has "$work/summary" '4 solved, 0 kept'
again --vertex 1 --tolerance 0.1 --strength 0.5 --repair
check 'and a repair' has "$work/summary" '4 solved, 0 kept'
again --vertex 1 --tolerance 0.1
POCL_DEVICES=none again --vertex 1 --tolerance 0.1
check 'with all there is nothing to do, and no device is looked for' has "$work/summary" '0 solved, 4 kept'
(
    flock 9
    again
) 9>> "$report"
check 'two at a time are refused' has "$work/errors" 'another run is writing'

# A name is bytes: one that is no UTF-8 is found again in the report.
mkdir "$work/bytes"
cp "$in/a.off" "$work/bytes/$(printf 'n\374ss"e.off')"
"$tool" batch "$work/bytes" --out-dir "$work/named" --locus .csv --quiet
"$tool" batch "$work/bytes" --out-dir "$work/named" --locus .csv --resume > "$work/summary"
check 'a name of any bytes is known again' has "$work/summary" '0 solved, 1 kept'

# ---- samples ----------------------------------------------------------------------------------

rm -r "$out"
"$tool" batch "$in/sub/b.off" --sources 3 --out-dir "$out" --locus .csv > "$work/summary"
check 'three sources' test "$(names)" = 'b 0 done;b 1 done;b 2 done;'
check 'their files' test "$(ls "$out" | tr '\n' ' ')" = \
    'b-0000.locus.csv b-0001.locus.csv b-0002.locus.csv report.jsonl '
"$tool" batch "$in/sub/b.off" --sources 5 --out-dir "$out" --locus .csv --resume > "$work/summary"
check 'fewer samples are the beginning of more' has "$work/summary" '2 solved, 3 kept'
again_from() { "$tool" batch "$in/sub/b.off" --sources 1 --vertex "$1" --report "$work/from.jsonl" --resume > "$work/summary"; }
again_from 0
again_from 100
check 'samples from another vertex are done again' has "$work/summary" 'done again: the source is another'
again_from 100
check 'and kept then' has "$work/summary" '1 kept'
"$tool" batch "$in/a.off" "$in/bad.off" --sources 3 --json > "$work/lines" 2> "$work/errors"
"$tool" batch "$in/a.off" "$in/bad.off" --sources 3 --report "$work/sum.jsonl" > "$work/summary" 2> "$work/errors"
check 'a bad mesh fails with all its sources' has "$work/summary" '^of 6 sources on 2 meshes 3 solved, 0 kept, 3 failed'
# A soup: each triangle has vertices of its own, and its file's numbers are those that are asked for.
awk 'NR == 2 { n = $1; m = $2; next } NR > 2 && NR <= n + 2 { x[NR - 3] = $0 }
    NR > n + 2 { for (k = 2; k < 5; k++) v[i++] = x[$k] }
    END { print "OFF"; print 3 * m, m, 0; for (j = 0; j < 3 * m; j++) print v[j]
        for (j = 0; j < m; j++) print 3, 3 * j, 3 * j + 1, 3 * j + 2 }' "$in/sub/b.off" > "$work/soup.off"
place() { "$tool" batch "$work/soup.off" --repair --vertex 1700 --json "$@" 2> "$work/errors" | grep -o '"xyz": [^]]*'; }
check 'the first sample of a repaired mesh is a vertex of the file' sh -c 'test -n "$1" && test "$1" = "$2"' - \
    "$(place)" "$(place --sources 1)"
other() { # SOURCE OPTIONS...: one report of two sources' files in one folder
    "$tool" batch "$in/sub/b.off" --vertex "$@" --out-dir "$work/kinds" --report "$work/kinds.jsonl" > "$work/summary"
}
other 0 --locus .vtp && rm "$work/kinds.jsonl" && other 1 --out .vtp && other 1 --locus .vtp --resume
check 'a locus where a result was asked for is another file' has "$work/summary" '1 solved, 0 kept'

# Opposite vertices of a torus of radii 2 and 1 are 6 apart in space: the second sample lies beyond the axis.
check 'samples are far from each other' perl -ne '
    push @x, [$1, $2, $3] if /"xyz": \[([^,]*), ([^,]*), ([^\]]*)\]/;
    END { for $i (0 .. $#x) { for $j (0 .. $i - 1) { my $d = 0; $d += ($x[$i][$_] - $x[$j][$_]) ** 2 for 0 .. 2;
        $least = $d if !defined $least || $d < $least } } exit(@x != 5 || $least < 1.5 ** 2) }' "$report"

# ---- folders ----------------------------------------------------------------------------------

mkdir -p "$work/odd/sub"
cp "$in/a.off" "$work/odd/a.off"
cp "$in/c.ply" "$work/odd/a.ply"
cp "$in/c.ply" "$work/odd/a.off.ply"
ln -s /nowhere "$work/odd/notes"
ln -s .. "$work/odd/sub/up"
check 'links that lead nowhere or up' "$tool" batch "$work/odd" --report "$work/odd.jsonl" --quiet
check 'names that become the same keep their suffix' test "$(grep -o '^{"name": "[^"]*' "$work/odd.jsonl" | cut -c11- | sort | tr '\n' ' ')" = \
    'a.off a.off.ply a.ply '
ln -s /nowhere "$work/odd/b.off"
"$tool" batch "$work/odd" --report "$work/odd2.jsonl" > "$work/summary" 2> "$work/errors"
check 'a mesh that is a link to nowhere fails, and the others go on' has "$work/summary" '^of 4 .* 3 solved, 0 kept, 1 failed'

mkdir -p "$work/deep/sub/more" "$work/shut"
echo 'no mesh' > "$work/deep/a.off"
cp "$in/a.off" "$work/deep/sub/more/b.off"
touch "$work/shut/sub"
"$tool" batch "$work/deep" --out-dir "$work/shut" --threads 1 --quiet 2> "$work/errors"
check 'a folder that cannot be made is told in the report, not what failed before' \
    has "$work/shut/report.jsonl" '"name": "sub/more/b".*"error": "--out-dir: cannot make the folder .*/shut/sub/more.: Not a directory"'
check 'and what failed before with its own words' has "$work/shut/report.jsonl" '"name": "a".*"error": "[^"]*a.off'

# ---- files that stay as they are -----------------------------------------------------------------

fails 'a folder of meshes is none for results' 1 "--out-dir: '$in' is looked through" \
    "$tool" batch "$in" --out-dir "$in/sub/.."
own=$work/own
mkdir "$own"
cp "$in/c.ply" "$own/c.ply"
ln -s c.ply "$own/d.ply"
fails 'a mesh is not written over' 1 "--out-dir: '$own/c.ply' is read by this run" \
    "$tool" batch "$own/c.ply" --out-dir "$own" --out .ply
fails 'nor by a link to it' 1 "--out-dir: '$own/d.ply' is read by this run" \
    "$tool" batch "$own/d.ply" --out-dir "$own" --out .ply --report "$work/own.jsonl"
check 'and is as it was' cmp "$in/c.ply" "$own/c.ply"
"$tool" solve "$own/c.ply" --vertex 0 --quiet --out "$own/b.pvtp"
"$tool" mesh sphere --triangles 100 --quiet --out "$own/b.off"
fails 'nor as a piece of a PVTP file' 1 "--out-dir: '$own/b_0000.vtp' is read by this run" \
    "$tool" batch "$own/b.off" "$own/b_0000.vtp" --out-dir "$own" --out .pvtp --report "$work/piece.jsonl"
fails 'which solve does not either' 1 "--out: '$own/b.pvtp' is read by this run" \
    "$tool" solve "$own/b_0000.vtp" --vertex 0 --out "$own/b.pvtp"
fails 'nor does it write one piece twice' 1 "--out: '$own/e_0000.vtp' is also a file of --out" \
    "$tool" solve "$own/c.ply" --vertex 0 --out "$own/e.pvtp" --out "$own/e_0000.vtp"
fails 'the report is no result' 1 "--report: '$own/e/c.tangent.txt' is also a file of a result" \
    "$tool" batch "$own/c.ply" --out-dir "$own/e" --tangent .txt --report "$own/e/c.tangent.txt"
mkdir "$own/pair"
cp "$in/a.off" "$own/pair/x.off"
cp "$in/c.ply" "$own/pair/x.locus.ply"
"$tool" batch "$own/pair" --out-dir "$own/f" --out .vtp --locus .vtp --quiet
check 'a mesh whose name ends as that of a cut locus keeps its suffix' test "$(ls "$own/f" | tr '\n' ' ')" = \
    'report.jsonl x.locus.ply.locus.vtp x.locus.ply.vtp x.locus.vtp x.vtp '

# ---- kills ------------------------------------------------------------------------------------

rm -r "$out"
mkdir "$work/many"
for k in $(seq -w 24); do cp "$in/c.ply" "$work/many/$k.ply"; done
"$tool" batch "$work/many" --out-dir "$out" --quiet
mv "$out" "$work/whole"
resume=
for k in $(seq 12); do
    "$tool" batch "$work/many" --out-dir "$out" --quiet $resume &
    pid=$!
    sleep "0.$((RANDOM % 25 + 10))"
    kill -KILL "$pid" 2> /dev/null
    wait "$pid" 2> /dev/null
    [ -s "$report" ] && resume=--resume
done
check 'after 12 kills the rest is done' "$tool" batch "$work/many" --out-dir "$out" --quiet $resume
check 'nothing is lost or doubled' test "$(names)" = "$(for k in $(seq -w 24); do printf '%s 0 done;' "$k"; done)"
check 'each line is whole' lines_are_json "$report"
check 'so are the files, and no other is left' diff -r --exclude=report.jsonl "$work/whole" "$out"

env --default-signal=INT "$tool" batch "$work/many" --out-dir "$work/stopped" --quiet 2> "$work/errors" &
pid=$!
for _ in $(seq 600); do
    test -s "$work/stopped/report.jsonl" && break
    sleep 0.01
done
kill -INT "$pid"
wait "$pid"
check 'an interruption ends it' test $? -eq 130
# In numbers, or on a busy machine, which has to end within the second, in words.
check 'and says how to go on' has "$work/errors" 'dmkcl: interrupted.*: --resume does '
check 'what is reported is whole' lines_are_json "$work/stopped/report.jsonl"

# ---- pipes -------------------------------------------------------------------------

sphere=$work/sphere.off
torus=$work/torus.off
"$tool" mesh sphere --triangles 300 --quiet --out "$sphere"
"$tool" mesh torus --triangles 400 --quiet --out "$torus"
mkfifo "$work/report" "$work/mesh.off"
(sleep 1; timeout 9 cat "$work/report" > "$work/lines") &
check 'a report that is a pipe waits for its reader' timeout 60 "$tool" batch "$sphere" --quiet --report "$work/report"
wait $!
check 'which has all lines' test "$(grep -c '"state": "done"' "$work/lines")" -eq 1
timeout 60 head -c 1 "$work/report" > "$work/lines" &
env --default-signal=PIPE timeout 60 "$tool" batch "$torus" --sources 60 --quiet --report "$work/report" 2> "$work/said"
check 'a reader that has gone ends the batch' test $? -eq 141
from_pipe() { # [OPTIONS]: the mesh by a pipe
    cat "$sphere" > "$work/mesh.off" &
    timeout 60 "$tool" batch "$work/mesh.off" --report "$work/piped.jsonl" "$@" > "$work/summary" 2> "$work/errors"
}
check 'a mesh from a pipe' from_pipe
check 'has no digest' has "$work/piped.jsonl" '"digest": ""'
check 'so it is done again' from_pipe --resume
check 'for that reason' has "$work/summary" '^mesh: done again: the mesh is a pipe, or cannot be read$'
check 'and has one line' test "$(wc -l < "$work/piped.jsonl")" -eq 1

# ---- what is looked through ---------------------------------------------------------------------

deep=$work/deep.list # a folder, whatever its name, and below it one that cannot be opened: there are too many above it
mkdir -p "$deep/$(printf 'd/%.0s' $(seq 220))"
cp "$sphere" "$deep/a.off"
(ulimit -n 200 && "$tool" batch "$deep" --out-dir "$work/shallow" > "$work/summary" 2> "$work/errors")
check 'a folder below that cannot be opened fails' test $? -eq 2
check 'by its name' has "$work/shallow/report.jsonl" '"name": "(d/)+d".*"state": "failed"'
check 'and the rest goes on' has "$work/summary" '^of 2 .* 1 solved, 0 kept, 1 failed'
echo "$sphere" > "$work/shallow/sphere.tangent.txt"
fails 'a list is not written over' 1 "^dmkcl: --out-dir: .*/sphere.tangent.txt' is read by this run" \
    "$tool" batch "$work/shallow/sphere.tangent.txt" --out-dir "$work/shallow" --tangent .txt --report "$work/listed.jsonl"

# ---- and what is done ---------------------------------------------------------------------------

done_dir=$work/done
again_done() { "$tool" batch "$@" --out-dir "$done_dir" --resume > "$work/summary" 2> "$work/errors"; }
cp "$sphere" "$work/gone.off"
again_done "$work/gone.off"
rm "$work/gone.off"
again_done "$work/gone.off"
check 'a mesh that is gone fails' test $? -eq 2
check 'and has no other line' test "$(grep -o '"state": "[a-z]*"' "$done_dir/report.jsonl")" = '"state": "failed"'
mkdir "$work/pieces"
cp "$torus" "$work/pieces/a.off"
cp "$sphere" "$work/pieces/a_0000.off"
cp "$sphere" "$work/pieces/b_0000.off"
"$tool" batch "$work/pieces" --out-dir "$work/in_pieces" --out .vtp --out .pvtp --quiet
check 'a mesh whose name is that of a piece keeps its suffix' test "$(cd "$work/in_pieces" && ls *.vtp | tr '\n' ' ')" = \
    'a.vtp a_0000.off.vtp a_0000.off_0000.vtp a_0000.vtp b_0000.vtp b_0000_0000.vtp '
rm "$work/in_pieces/a_0000.vtp"
"$tool" batch "$work/pieces" --out-dir "$work/in_pieces" --out .vtp --out .pvtp --resume > "$work/summary"
check 'a missing piece is a missing file' has "$work/summary" '^a: done again: a file of it is missing$'
check 'and no other is' has "$work/summary" '1 solved, 2 kept'

again_done "$sphere"
printf '\n \r\n' >> "$done_dir/report.jsonl"
again_done "$sphere"
check 'blank lines in a report are passed over' has "$work/summary" '0 solved, 1 kept'
check 'and go' test -z "$(grep -vE '[^[:space:]]' "$done_dir/report.jsonl")"
printf 'x\ny\n' > "$work/other.jsonl"
fails 'a line of something else is shown without its end' 3 "a line begins with 'x'; choose" \
    "$tool" batch "$sphere" --report "$work/other.jsonl" --resume

cp "$torus" "$work/a.off"
cp "$sphere" "$work/a-0001.off"
again_done "$work/a-0001.off"
mv "$done_dir/a-0001.vtp" "$work/first.vtp"
again_done "$work/a.off" --sources 2
check 'files that another source takes over are none of a line' sh -c '! grep "\"name\": \"a-0001\"" "$1"' - \
    "$done_dir/report.jsonl"
again_done "$work/a-0001.off"
check 'and are written again' cmp "$done_dir/a-0001.vtp" "$work/first.vtp"
again_done "$work/a.off" --sources 2
check 'and so on' has "$work/summary" '1 solved, 1 kept'
tap_end
