# What is written where: no output takes the place of an input or of another one, by whatever names; links and
# modes stay for every output; the report is JSON whatever the files are called.
. tests/tap.sh

mesh=$work/mesh.off
"$tool" mesh sphere --triangles 300 --quiet --out "$mesh"
printf 'vertex 0\nvertex 7\n' > "$work/list.txt"
cp "$mesh" "$work/copy.off"
ln -s mesh.off "$work/link.off"
ln "$mesh" "$work/hard.off"
mkdir "$work/folder"

refused() { # NAME PATTERN ARGUMENT...: exit code 1, and the mesh is what it was
    local name=$1 pattern=$2
    shift 2
    fails "$name" 1 "$pattern" "$tool" "$@"
    check "$name: the mesh is as before" cmp "$mesh" "$work/copy.off"
}
for option in report tangent; do
    refused "--$option on the mesh" "--$option: .* is read by this run" solve "$mesh" --vertex 0 --$option "$mesh"
    refused "--$option on a link to it" "--$option: .*link.off' is read" solve "$mesh" --vertex 0 --$option "$work/link.off"
    refused "--$option on another of its names" "--$option: .*is read" solve "$mesh" --vertex 0 --$option "$work/hard.off"
    refused "--$option on it by another way" "--$option: .*is read" solve "$mesh" --vertex 0 --$option "$work/folder/../mesh.off"
done
refused 'cut --out on the mesh' '--out: .*is read' cut "$mesh" --vertex 0 --out "$mesh"
refused 'mesh --out on the mesh' '--out: .*is read' mesh "$mesh" --out "$mesh"
refused '--report on the list' '--report: .*list-0000.txt|--report: .*is read' \
    solve "$mesh" --sources "$work/list.txt" --report "$work/list.txt"
cp "$mesh" "$work/n-0001.off"
fails 'a numbered name that is the mesh' 1 "--tangent: '.*n-0001.off' is read" \
    "$tool" solve "$work/n-0001.off" --sources "$work/list.txt" --tangent "$work/n.off"
check 'it is as before' cmp "$work/n-0001.off" "$work/copy.off"
refused 'two outputs of one name' "--report: .*a.csv' is also a file of --tangent" \
    solve "$mesh" --vertex 0 --tangent "$work/a.csv" --report "$work/a.csv"
refused 'by another way' "--tangent: .*is also a file of --locus" \
    solve "$mesh" --vertex 0 --locus "$work/a.csv" --tangent "$work/folder/../a.csv"
refused 'of one option' '--out: .*is also a file of --out' solve "$mesh" --vertex 0 --out "$work/a.vtp" --out "$work/a.vtp"
check 'nothing was written' sh -c '! ls "$1"/a.* 2> /dev/null' - "$work"
check 'names that only look alike are fine' "$tool" solve "$mesh" --vertex 0 --quiet --out "$work/folder/mesh.ply" \
    --tangent "$work/mesh.csv" --report "$work/folder/mesh.csv"

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
    mkfifo "$work/pipe.${kind#*:}"
    fails "--$option on a pipe" 2 'not a regular file' "$tool" solve "$mesh" --vertex 0 --$option "$work/pipe.${kind#*:}"
done

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
