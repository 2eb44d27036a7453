# What is written where: no output takes the place of an input or of another one, by whatever names; links and
# modes stay for every output; the report is JSON whatever the files are called.
. tests/tap.sh

mesh=$work/mesh.off
"$tool" mesh sphere --triangles 300 --quiet --out "$mesh"
printf 'vertex 0\nvertex 7\n' > "$work/list.txt"
cp "$mesh" "$work/copy.off"
mkdir "$work/folder"

refused() { # NAME PATTERN ARGUMENT...: exit code 1, and the mesh is what it was
    local name=$1 pattern=$2
    shift 2
    fails "$name" 1 "$pattern" "$tool" "$@"
    check "$name: the mesh is as before" cmp "$mesh" "$work/copy.off"
}
# A mesh is known by its content, whatever its name.
for kind in report:json tangent:csv; do
    option=${kind%:*} suffix=${kind#*:}
    cp "$mesh" "$work/in.$suffix"
    ln -s "in.$suffix" "$work/link.$suffix"
    ln "$work/in.$suffix" "$work/hard.$suffix"
    for name in in:the_mesh link:a_link_to_it hard:another_of_its_names folder/../in:it_by_another_way; do
        refused "--$option on ${name#*:}" "--$option: .*${name%:*}.$suffix' is read by this run" \
            solve "$work/in.$suffix" --vertex 0 --$option "$work/${name%:*}.$suffix"
        check "which is as before" cmp "$work/in.$suffix" "$work/copy.off"
    done
done
refused 'cut --out on the mesh' '--out: .*is read' cut "$mesh" --vertex 0 --out "$mesh"
refused 'mesh --out on the mesh' '--out: .*is read' mesh "$mesh" --out "$mesh"
refused '--report on the list' '--report: .*list-0000.txt|--report: .*is read' \
    solve "$mesh" --sources "$work/list.txt" --report "$work/list.txt"
cp "$mesh" "$work/n-0001.csv"
fails 'a numbered name that is the mesh' 1 "--tangent: '.*n-0001.csv' is read" \
    "$tool" solve "$work/n-0001.csv" --sources "$work/list.txt" --tangent "$work/n.csv"
check 'it is as before' cmp "$work/n-0001.csv" "$work/copy.off"
refused 'two outputs of one name' "--report: .*a.txt' is also a file of --tangent" \
    solve "$mesh" --vertex 0 --tangent "$work/a.txt" --report "$work/a.txt"
refused 'the standard output by the option that was given' \
    '^dmkcl: --json and --out - both write to the standard output; use --report FILE for the figures$' \
    solve "$mesh" --vertex 0 --out - --json
refused 'by another way' "--tangent: .*is also a file of --locus" \
    solve "$mesh" --vertex 0 --locus "$work/a.csv" --tangent "$work/folder/../a.csv"
refused 'of one option' '--out: .*is also a file of --out' solve "$mesh" --vertex 0 --out "$work/a.vtp" --out "$work/a.vtp"
ln -s ../a.vtp "$work/folder/to-a.vtp"
refused 'a piece that is not there yet' "--locus: .*/p_0001.vtp' is also a file of --out" \
    solve "$mesh" --vertex 0 --out "$work/p.pvtp" --locus "$work/p_0001.vtp"
refused 'whichever comes first' "--out: .*/p.x.pvtp' is also a file of --out" \
    mesh "$mesh" --out "$work/p.x_0012.vtp" --out "$work/p.x.pvtp"
refused 'by a link to where no file is yet' "--locus: .*to-a.vtp' is also a file of --out" \
    solve "$mesh" --vertex 0 --out "$work/a.vtp" --locus "$work/folder/to-a.vtp"
rm "$work/folder/to-a.vtp"
fails 'a path has lines' 1 "has no suffix of a format for lines; expected one of .vtp .obj .csv" \
    "$tool" path "$mesh" --vertex 0 --to 1,0,0 --out "$work/a.off"
ln -s none/x.vtp "$work/astray.vtp"
ln -s loop.vtp "$work/loop.vtp"
no_place() { fails "$1" 2 "^dmkcl: --out: $2\$" "$tool" solve "$mesh" --vertex 0 --out "$3"; }
no_place 'a link into a folder that is not there' "the folder '.*/none' does not exist; make it first" "$work/astray.vtp"
no_place 'a link to itself' "cannot write into the folder of '.*loop.vtp': Too many levels of symbolic links" "$work/loop.vtp"
no_place 'a file for a folder' "cannot write into the folder of '.*/mesh.off/x.vtp': Not a directory" "$mesh/x.vtp"
check 'nothing was written' sh -c '! ls "$1"/a.* 2> /dev/null' - "$work"
check 'names that only look alike are fine' "$tool" solve "$mesh" --vertex 0 --quiet --out "$work/folder/mesh.ply" \
    --tangent "$work/mesh.txt" --report "$work/folder/mesh.txt"
# What is written under the name of another format is not what the name says.
for name in t.vtp t.obj t.json t; do
    refused "--tangent $name" "--tangent: '.*/$name' has no suffix of a format for a tangent cut locus; expected one of .csv .txt" \
        solve "$mesh" --vertex 0 --tangent "$work/$name"
done
for name in r.vtp r.off r.csv r.SVG; do
    for command in 'solve --vertex 0' 'distance --vertex 0' 'path --vertex 0 --to-vertex 1' 'cut --vertex 0' 'transport --from uniform' batch; do
        refused "${command%% *} --report $name" "--report: '.*/$name' has the suffix of another format, and the report is JSON" \
            ${command%% *} "$mesh" ${command#"${command%% *}"} --report "$work/$name"
    done
done
refused 'batch --tangent .obj' "--tangent: '.obj' is not one of .csv .txt" batch "$mesh" --out-dir "$work/none" --tangent .obj
check 'no folder was made for it' test ! -e "$work/none"

# ---- links and modes --------------------------------------------------------------------------

for kind in out:vtp locus:obj tangent:csv report:json; do
    option=${kind%:*} file=$work/real.${kind#*:}
    echo old > "$file"
    chmod 640 "$file"
    ln -s "${file##*/}" "$work/via.${kind#*:}"
    ln -s "new.${kind#*:}" "$work/dangling.${kind#*:}"
    check "--$option over a link" "$tool" solve "$mesh" --vertex 0 --quiet --$option "$work/via.${kind#*:}"
    check "--$option: the link stays" test -L "$work/via.${kind#*:}"
    check "--$option: its file is new" sh -c '! grep -qx old "$1"' - "$file"
    check "--$option: with the mode that it had" test "$(stat -c %a "$file")" = 640
    check "--$option over a link to nothing" "$tool" solve "$mesh" --vertex 0 --quiet --$option "$work/dangling.${kind#*:}"
    check "--$option: makes its file" test -f "$work/new.${kind#*:}" -a -L "$work/dangling.${kind#*:}"
    check "--$option: with the mode of a new file" \
        test "$(stat -c %a "$work/new.${kind#*:}")" = "$(printf '%o' $((0666 & ~0$(umask))))"
done

# ---- pipes and devices ------------------------------------------------------------------------

# COMMAND OPTION SUFFIX ARGUMENT...: what --OPTION writes to a file named by its suffix is what it writes anywhere else.
streams() {
    local command=$1 option=$2 suffix=$3 file=$work/stream.$3 name="$1 --$2" format=--format
    shift 3
    case $option in report | tangent | picture) format= ;; esac
    check "$name: a file" "$tool" "$command" "$@" --quiet "--$option" "$file"
    seconds() { sed -E 's/"(read|device|setup|start|solve|certify|locus|write|total|distance|peak_memory)": [^,]*/"\1": 0/;
        s/stream\.[a-z]*|pipe\.[a-z]*|none|-"$/FILE/' "$1"; }
    same() { cmp <(seconds "$1") <(seconds "$file"); }
    rm -f "$work/pipe.$suffix" "$work/pipe"
    mkfifo "$work/pipe.$suffix" "$work/pipe"
    cat "$work/pipe.$suffix" > "$work/came" &
    check "$name: a pipe with a name" "$tool" "$command" "$@" --quiet "--$option" "$work/pipe.$suffix"
    wait $!
    check "$name: brings the same" same "$work/came"
    check "$name: the pipe stays" test -p "$work/pipe.$suffix"
    cat "$work/pipe" > "$work/came" &
    check "$name: a pipe without a suffix" "$tool" "$command" "$@" --quiet "--$option" "$work/pipe" ${format:+$format $suffix}
    wait $!
    check "$name: brings the same again" same "$work/came"
    check "$name: /dev/null" "$tool" "$command" "$@" --quiet "--$option" /dev/null
    check "$name: /dev/null stays" test -c /dev/null
    check "$name: nothing takes its place" sh -c '! ls "$1"/.dmkcl-* /dev/.dmkcl-* 2> /dev/null' - "$work"
    [ "$option" = report ] && return # whose standard output is tested with the reports
    for out in - /dev/stdout /dev/fd/1 /proc/self/fd/1 "$work/to.stdout"; do
        echo before > "$work/came"
        check "$name $out: into a file" sh -c 'out=$1 err=$2; shift 2; "$@" >> "$out" 2> "$err"' - "$work/came" "$work/err" \
            "$tool" "$command" "$@" "--$option" "$out" ${format:+$format $suffix}
        check "$name $out: behind what is there" test "$(head -n 1 "$work/came")" = before
        sed -i 1d "$work/came"
        check "$name $out: and nothing else" same "$work/came"
        check "$name $out: the summary elsewhere" grep -qE '^(wrote|[^ ]*: )' "$work/err"
    done
}
ln -s /dev/stdout "$work/to.stdout"
printf 'vertex 0 1\n' > "$work/a.txt"
printf 'vertex 7 1\n' > "$work/b.txt"
streams solve out ply "$mesh" --vertex 0
streams solve locus obj "$mesh" --vertex 0
streams solve tangent csv "$mesh" --vertex 0
streams solve report json "$mesh" --vertex 0
streams distance out vtu "$mesh" --vertex 0
streams distance report json "$mesh" --vertex 0
streams path out csv "$mesh" --vertex 0 --to-vertex 9
streams cut out obj "$mesh" --vertex 0
streams cut picture svg "$mesh" --vertex 0
streams transport out vtp "$mesh" --from "$work/a.txt" --to "$work/b.txt"
streams mesh out off sphere --triangles 300

check 'without --format it is VTP' sh -c '"$1" solve "$2" --vertex 0 --quiet --out - | grep -q "<VTKFile type=.PolyData" &&
    "$1" solve "$2" --vertex 0 --quiet --locus - | grep -q "<Lines>" && "$1" mesh "$2" --quiet --out - |
    "$1" info - | grep -q "152 vertices"' - "$tool" "$mesh"
check 'the suffix goes before --format' sh -c '"$1" mesh "$2" --quiet --out "$3/suffix.off" --format ply &&
    cmp "$2" "$3/suffix.off"' - "$tool" "$mesh" "$work"
check '--format names that of a file without a suffix' sh -c '"$1" mesh "$2" --quiet --out "$3/none" --format off &&
    cmp "$2" "$3/none"' - "$tool" "$mesh" "$work"
check 'an input from a pipe' sh -c 'cat "$2" | "$1" distance - --vertex 0 --quiet --out "$3/in.ply" &&
    "$1" distance "$2" --vertex 0 --quiet --out "$3/direct.ply" && cmp "$3/in.ply" "$3/direct.ply"' - "$tool" "$mesh" "$work"
check 'sources from a pipe' sh -c 'echo vertex 0 | "$1" distance "$2" --sources - --quiet --out "$3/in.ply" &&
    cmp "$3/in.ply" "$3/direct.ply"' - "$tool" "$mesh" "$work"
check 'a measure from a pipe' sh -c '"$1" transport "$2" --from - --to "$3/b.txt" --quiet --out "$3/in.vtp" < "$3/a.txt" &&
    cmp "$3/in.vtp" "$3/stream.vtp"' - "$tool" "$mesh" "$work"
check 'two outputs may go to /dev/null' "$tool" solve "$mesh" --vertex 0 --quiet --out /dev/null --locus /dev/null --report /dev/null
check 'and those of many sources' "$tool" solve "$mesh" --sources "$work/list.txt" --quiet --out /dev/null
refused 'two files on the standard output' "--locus: '-' is also a file of --out" solve "$mesh" --vertex 0 --out - --locus -
refused 'a file and the report' '^dmkcl: --json and --out - both write to the standard output; use --report FILE' \
    solve "$mesh" --vertex 0 --out /dev/stdout --json
refused 'a report and lines' '^dmkcl: --report - and --locus - both write to the standard output; use --report FILE' \
    solve "$mesh" --vertex 0 --locus - --report -
refused 'a report and a path' '^dmkcl: --json and --out - both write to the standard output; use --report FILE' \
    path "$mesh" --vertex 0 --to-vertex 1 --out - --json
refused 'two files in one pipe' "--locus: .*pipe' is also a file of --out" solve "$mesh" --vertex 0 --out "$work/pipe" --locus "$work/pipe"
refused 'many sources on the standard output' "--sources writes a file for each source, and '-' is one stream" \
    solve "$mesh" --sources "$work/list.txt" --out -
refused 'a stream of a format that cannot hold it' "--format: off cannot hold a result, and --out: '-' has no suffix" \
    distance "$mesh" --vertex 0 --out - --format off
ln -s /dev/null "$work/null.pvtp"
for name in 'l\344' 'tab\t' 'line\n' 'cut\342\202'; do
    refused "an index that XML cannot hold: $name" 'names its pieces, and can do so only in UTF-8 without control characters' \
        solve "$mesh" --vertex 0 --out "$work/$(printf "${name}_").pvtp"
done
mkdir "$work/$(printf 'l\344')"
check 'whatever the folder is called' "$tool" mesh "$mesh" --quiet --out "$work/$(printf 'l\344/\342\202\254 &').pvtp"
refused 'several files in one stream' 'PVTP is several files' solve "$mesh" --vertex 0 --out "$work/null.pvtp"
fails 'the standard output is full' 2 'the standard output: cannot write' bash -c "'$tool' mesh '$mesh' --out - > /dev/full"
check 'the reader has gone' bash -c "set -o pipefail; '$tool' mesh torus --refine 1 --quiet --out - | head -c 1; test \$? -eq 141"
check 'what the reader takes is enough' sh -c '"$1" mesh "$2" --quiet --out - --format off | head -n 1 | grep -q OFF' - "$tool" "$mesh"

# ---- names in the report ----------------------------------------------------------------------

# The name in the report, as bytes, is the name again.
named() { # NAME
    cp "$mesh" "$work/folder/$1.off" || return
    "$tool" solve "$work/folder/$1.off" --vertex 0 --json > "$work/report.json" || return
    is_json "$work/report.json" || return
    iconv -f UTF-8 -t UTF-8 "$work/report.json" > "$work/said_out" || return
    python3 - "$work/report.json" "$work/folder/$1.off" << 'EOF'
import json, os, sys
name = json.load(open(sys.argv[1], encoding="utf-8"))["mesh"]["file"]
sys.exit(name.encode("utf-8", "surrogateescape") != os.fsencode(sys.argv[2]))
EOF
}
check 'a name of quotes, backslashes and controls' named "$(printf 'a"b\\c\td\001e')"
check 'a name of UTF-8' named "$(printf 'fl\303\244che-\342\202\254-\360\237\230\200')"
check 'a name that is not UTF-8' named "$(printf 'fl\344che\377')"
check 'UTF-8 that is cut short' named "$(printf 'a\342\202')"
check 'longer forms than needed' named "$(printf 'a\300\257b\340\200\257')"
check 'surrogates, and beyond the last character' named "$(printf 'a\355\240\200b\364\220\200\200')"
tap_end
