# The tool on the command line: exit codes, errors, files, what a terminal and a pipe see.
. tests/tap.sh

torus=$work/torus.off
has() { grep -qE -e "$2" "$1"; }
output_has() { # PATTERN COMMAND...: on the standard output
    local pattern=$1
    shift
    "$@" > "$work/said_out" || return
    has "$work/said_out" "$pattern" || { cat "$work/said_out"; return 1; }
}
# Only these files are in the folder.
holds() { # FOLDER FILES
    test "$(ls -A "$1" | tr '\n' ' ')" = "$2"
}
usage() { # NAME PATTERN ARGUMENT...: a slip that the tool explains, exit code 1
    local name=$1 pattern=$2
    shift 2
    fails "$name" 1 "$pattern" "$tool" "$@"
}

# ---- help and slips ---------------------------------------------------------------------------

check '--help' output_has '^usage: dmkcl' "$tool" --help
for word in --help help -h; do
    check "help $word" output_has '^usage: dmkcl COMMAND' "$tool" help $word
done
check '--version' output_has '^dmkcl [0-9]+\.[0-9]+\.[0-9]+$' "$tool" --version
for command in solve mesh info devices; do
    check "$command --help" output_has "^usage: dmkcl $command" "$tool" $command --help
    check "--help knows $command" output_has "^  $command " "$tool" --help
done
for name in NO_COLOR XDG_CACHE_HOME; do
    check "--help names $name" output_has "^  $name " "$tool" --help
done
for code in 0 1 2 3 4 5 6 7 8 130; do
    check "--help lists exit code $code" output_has "^  $code  " "$tool" --help
done
usage 'no command' 'command is missing'
usage 'an unknown command' "did you mean 'solve'" slove
usage 'a command like no other' 'dmkcl --help' xxxxxxxxxx
fails 'a word that is like none' 1 "no command 'iqqq'; .dmkcl --help. lists" "$tool" iqqq
usage 'an unknown option' "no option '--sorce'; did you mean '--source'" solve x.off --sorce 1,2,3
usage 'an option like no other' 'solve --help' solve x.off --xxxxxxxxxxxx 1
usage 'a single dash' 'two dashes' solve x.off -source
usage 'a value that is missing' '--source: its value X,Y,Z is missing' solve x.off --source
usage 'a flag with a value' '--quiet: takes no value' solve x.off --quiet=1
usage 'no mesh' 'MESH is missing' solve --vertex 0
usage 'two meshes' "'b.off' is one argument too many" solve a.off b.off --vertex 0
usage 'no source' 'no source given: use --source X,Y,Z, --vertex I or --sources FILE$' solve x.off
usage 'no source of a path' 'no source given: use --source X,Y,Z or --vertex I$' path x.off --to-vertex 1
usage 'two sources' 'not both' solve x.off --vertex 0 --source 1,2,3
# Of two values the first one would be lost; a flag says the same thing twice.
usage 'an option twice' '--vertex: given twice' solve x.off --vertex 0 --vertex=1
for twice in '--source 1,0,0' '--threshold 1' '--method newton' '--report a' '--format ply'; do
    usage "$twice twice" "${twice%% *}: given twice" solve x.off --vertex 0 $twice $twice
done
usage 'sizes twice' '--size: given twice' mesh torus --out x.off --size 1 --size 2
usage 'a source and a list twice' '--sources: given twice' solve x.off --sources a --sources b
check 'a flag twice' "$tool" info meshes/torus.off --json --json
# Options of which one would have no effect beside the other, or alone.
clash() { # PATTERN COMMAND ARGUMENTS...
    usage "${*:2}" "^dmkcl: $2: $1$" "$2" x.off "${@:3}"
}
for command in 'solve --vertex 0' 'batch' 'distance --border' 'path --vertex 0 --to-vertex 1' 'cut --vertex 0' 'transport --from a'; do
    clash 'give --quiet or --verbose, not both' $command --quiet --verbose
done
clash 'give --exact or --tolerance, not both' distance --vertex 0 --exact --tolerance 1e-6
clash '--locus needs points as sources: leave out --border' distance --border --locus x.obj
for option in '--locus x.obj:makes no cut locus' '--tangent x.csv:makes no cut locus' '--strength 1:makes no cut locus' \
    '--threshold 1:marks no approximate cut locus' '--start distance:always starts from mu = 1' '--sources a:goes with one source'; do
    name=${option%%[ :]*} words=${option%:*}
    clash "--density-only ${option#*:}: leave out $name" solve $words --density-only
done
clash '--resume has no effect without --sources' solve --vertex 0 --resume
clash '--strength has no effect without --locus' distance --vertex 0 --strength 1
clash '--normalise has no effect without --to' transport --from a --normalise
for command in 'solve --vertex 0' 'distance --vertex 0'; do
    clash '--format has no effect without --out or --locus' $command --format ply
done
for command in 'path --vertex 0 --to-vertex 1' 'cut --vertex 0 --picture x.svg' 'transport --from a'; do
    clash '--format has no effect without --out' $command --format ply
done
for bad in 3 1,2 1,2,3,4 1,2,x 1,2, '' '1, ,2,3' ' ' '1,2,3,' '1 2' '1 2 3 4' nan,0,0 inf,0,0 0x10,0,0 0,-0X1p3,0 "1;2;3"; do
    usage "--source '$bad'" "--source: '.*' is not a point X,Y,Z; write three numbers joined by commas, as 3,0,0$" solve x.off "--source=$bad"
done
for bad in -1 x 1.5 1e3 0x10 inf '' 99999999999 ' 1'; do
    usage "--vertex '$bad'" '--vertex: .* is not a vertex number' solve x.off "--vertex=$bad"
done
number() { # OPTION BAD...
    local option=$1 bad
    shift
    for bad; do usage "--$option '$bad'" "--$option: '.*' is not a" solve x.off "--$option=$bad"; done
}
number threshold 0 -1 x nan 1,5
number strength 0 -1 x 0x10 inf
number dt 0 1.1 -1 x
number inertia 1 -0.1 x
number tolerance 0 -1 2 x
number gap 0 -1 2 x
number max-steps 0 -1 1.5 x
number threads 0 -1 x
usage '--dt of another method' '--dt is for --method euler' solve x.off --vertex 0 --dt 0.3 --method inertial
usage '--inertia of another method' '--inertia is for --method inertial' solve x.off --vertex 0 --inertia 0.3
usage "--inertia of a batch" "--inertia is for --method inertial" batch x.off --inertia 0
usage "--dt of transport" "--dt is for --method euler" transport x.off --from a --dt 0.1
for command in 'cut --vertex 0' 'distance --vertex 0' 'path --vertex 0 --to-vertex 1' 'solve --vertex 0' 'transport --from a'; do
    fails "${command%% *}: a report without its folder is seen before the mesh is read" 2 "^dmkcl: --report: the folder '.*/nowhere' does not exist; make it first$" \
        "$tool" ${command%% *} x.off ${command#* } --report "$work/nowhere/x.json"
done
fails '--max-steps that are too few' 7 'raise --max-steps or --tolerance' "$tool" solve meshes/sphere.off --vertex 0 --max-steps 1 --quiet
usage '--border of a closed mesh' 'has no border; give a point, too$' distance meshes/sphere.off --border
usage '--method' "'fast' is not one of newton, inertial, euler" solve x.off --method fast
usage '--start' "'cold' is not one of distance, uniform" solve x.off --start cold
usage '--out with a strange suffix' "expected one of .*.vtp" solve x.off --vertex 0 --out x.png
usage '--locus with a strange suffix' "expected one of .*.obj" solve x.off --vertex 0 --locus x.png
fails '--out in no folder' 2 "^dmkcl: --out: the folder '.*/no' does not exist; make it first$" \
    "$tool" solve x.off --vertex 0 --out "$work/no/x.vtp"
fails 'a folder that is a file' 2 '--out: cannot write into the folder of' \
    "$tool" solve x.off --vertex 0 --out meshes/torus.off/x.vtp
fails '--report in no folder' 2 "--report: the folder '.*/no' does not exist" \
    "$tool" solve x.off --vertex 0 --report "$work/no/x.json"
fails '--report on a folder' 2 'neither a regular file nor a pipe' \
    "$tool" solve x.off --vertex 0 --report "$work"
usage '--format of none' "'png' is not one of ply, vtp" solve x.off --vertex 0 --out x --format png
usage '--format of several files' "'pvtp' is not one of ply, vtp" solve x.off --vertex 0 --out x --format pvtp
usage '--format of what is only read' "'stl' is not one of ply, vtp" mesh torus --out x --format stl
usage '--format that holds no result' "--format: off cannot hold a result, and --out: 'x' has no suffix" \
    solve x.off --vertex 0 --out x --format off

usage 'mesh: no --out' '--out FILE is missing' mesh torus
usage 'a tube too thin' 'and at least a ten-thousandth of it, or too many' mesh torus --size 1e6,1e-6 --out x.off
usage 'sizes that do not fit' '^dmkcl: torus with sizes 1, 2: the tube radius B must be smaller than A,' mesh torus --size 1,2 --out x.off
usage 'mesh: an unknown surface' "did you mean 'torus'" mesh tours --out "$work/x.off"
usage 'mesh: a surface like no other' 'expected one of torus, ' mesh xxxxxxxx --out "$work/x.off"
usage 'mesh: a strange suffix' 'expected one of .*.off' mesh torus --out "$work/x.png"
for bad in 0 -1 1,2,3,4 x 1,,2; do
    usage "mesh: --size '$bad'" '--size: .* is not one to three sizes' mesh torus "--size=$bad"
done
usage 'mesh: --refine' "--refine: '99' is not a whole number from 0 to 15" mesh torus --refine 99
usage 'mesh: --refine of a file' "'meshes/torus.off' is a file" \
    mesh meshes/torus.off --refine 1 --out "$work/x.off"
usage 'mesh: --repair of a surface' "--repair is for files, and 'torus' is" mesh torus --repair --out "$work/x.off"
usage 'mesh: a size too many' 'the sphere has no size B; leave it out' mesh sphere --size 1,2 --out "$work/x.off"
usage 'mesh: a huge sphere' 'size A of the sphere is 1e.07' mesh sphere --size 1e7 --out "$work/x.off"
usage 'mesh: a thin torus' 'size B of the torus is 1e-09' mesh torus --size 1,1e-9 --out "$work/x.off"
usage 'mesh: a thin ellipsoid' 'size C of the ellipsoid' mesh ellipsoid --size 1,1,1e-9 --out "$work/x.off"
usage 'mesh: --triangles' '--triangles: .* whole number' mesh torus --triangles 3
usage 'a number that is too large' "'4000000000' is not a whole number from 4 to 1000000000" mesh torus --triangles 4000000000
usage 'a vertex that no mesh has' "'3000000000' is not a vertex number from 0 to 2147483647" solve x.off --vertex 3000000000
for command in solve batch path cut transport 'distance --border'; do
    usage "$command: two places for one report" "${command%% *}: give --report FILE or --json, not both" \
        $command x.off --json --report "$work/x.json"
done
usage 'info: no mesh' 'MESH is missing' info
usage 'a name that is empty' "solve: '' is not a name" solve '' --vertex 0
usage 'one of a batch' "batch: '' is not a name" batch a.off ''
for command in 'solve --vertex 0' 'path --vertex 0 --to-vertex 1' 'transport --from a' batch; do
    usage "a report that is empty: ${command%% *}" "--report: '' is not a file name" $command x.off --report ''
done
usage 'help of two commands' "help: 'cut' is one argument too many" help solve cut
usage 'a version of something' "--version: 'x' is one argument too many" --version x
for readers in 'solve - --sources -' 'distance /dev/stdin --sources -' 'transport x.off --from - --to /dev/fd/0'; do
    usage "two that read it: $readers" 'the standard input can be read once, not 2 times' $readers
done
printf 'vertex 0\n' > "$work/first"
by_socket() { # FILE COMMAND...: which has the file's bytes from a socket
    python3 -c '
import socket, subprocess, sys
here, there = socket.socketpair()
tool = subprocess.Popen(sys.argv[2:], stdin=there, stdout=subprocess.DEVNULL)
there.close()
here.sendall(open(sys.argv[1], "rb").read())
here.close()
sys.exit(tool.wait())' "$@"
}
check 'a mesh from a socket' by_socket meshes/torus.off "$tool" info -
check 'a list from a socket' by_socket "$work/first" "$tool" distance meshes/torus.off --sources -
behind() { # FILE COMMAND...: which has the file behind a line that was read
    { echo read && cat "$1"; } > "$work/longer"
    { read -r _ && "${@:2}" > "$work/printed"; } < "$work/longer"
}
check 'a mesh from where the input stands' behind meshes/torus.off "$tool" info -
check 'a list from there' behind "$work/first" "$tool" distance meshes/torus.off --sources -
usage 'devices: an argument' 'too many' devices x

for point in '3 0 0' ' 3  0,0' '3 0 -0 '; do
    check "'$point' is a point" sh -c '
    "$1" solve meshes/torus.off --source "$3" --dry-run > "$2/a" && "$1" solve meshes/torus.off --source 3,0,0 --dry-run |
    cmp - "$2/a"' - "$tool" "$work" "$point"
done
check 'blanks around the commas of a point' sh -c '
    "$1" solve meshes/torus.off --source "3, 0 ,0 " --dry-run > "$2/a" && "$1" solve meshes/torus.off --source 3,0,0 --dry-run |
    cmp - "$2/a"' - "$tool" "$work"

printf 'OFF\n4 1 0\n0 0 0\n1 0 0\n0 1 0\n5 5 5\n3 0 1 2\n' > "$work/one.off"
one() { "${@:2}" > "$work/printed" && has "$work/printed" "$1"; } # PATTERN COMMAND...
check 'one triangle' one '4 vertices, 1 triangle, ' "$tool" info "$work/one.off"
check 'one unused vertex' one '1 vertex is in no triangle' "$tool" info "$work/one.off"
check 'one triangle of a path' one 'length 1, 1 triangle$' "$tool" path "$work/one.off" --vertex 0 --to-vertex 1
check 'one of a distance' one ': 4 vertices, 1 triangle$' "$tool" distance "$work/one.off" --vertex 0
clash 'give --to or --to-vertex, not both' path --vertex 0 --to 1,0,0 --to-vertex 1

# ---- meshes -----------------------------------------------------------------------------------

check 'mesh makes a torus' "$tool" mesh torus --source 3,0,0 --out "$torus"
check 'which is whole' output_has 'genus 1' "$tool" info "$torus"
check 'mesh writes several files' "$tool" mesh "$torus" --out "$work/several.off" --out "$work/several.ply"
check 'both are there' test -s "$work/several.off" -a -s "$work/several.ply"
check 'mesh turns a file into another format' "$tool" mesh "$torus" --out "$work/torus.vtp"
check 'and back' "$tool" mesh "$work/torus.vtp" --out "$work/again.off"
check 'and it is the same' cmp "$torus" "$work/again.off"
check 'mesh --quiet says nothing' test -z "$("$tool" mesh sphere --quiet --out "$work/sphere.off")"
check 'info --json is JSON' is_json <("$tool" info --json "$torus")
check 'devices lists one' output_has '^  0 ' "$tool" devices
check 'devices --json is JSON' is_json <("$tool" devices --json)
mkdir "$work/full"
fails 'mesh: a disk that is full' 2 'x.off' \
    bash -c 'trap "" XFSZ; ulimit -f 1; exec "$@"' - "$tool" mesh torus --out "$work/full/x.off"
check 'leaves nothing' holds "$work/full" ''
fails 'a pipe that is full' 2 'standard output' bash -c "'$tool' info '$torus' > /dev/full"
"$tool" batch meshes/sphere.off > /dev/full 2> "$work/errors"
check 'whoever finds it full says so' test "$(grep -c 'standard output: No space left on device$' "$work/errors")" = \
    "$(grep -c . "$work/errors")"

# ---- exit codes -------------------------------------------------------------------------------

fails 'exit code 1: a vertex that is not there' 1 '[0-9]' "$tool" solve "$torus" --vertex 99999999
fails 'mesh: no such file' 2 'none.off' "$tool" mesh "$work/none.off" --out "$work/x.off"
fails 'exit code 2: no such mesh' 2 'none.off' "$tool" solve "$work/none.off" --vertex 0
echo 'not a mesh at all' > "$work/junk.off"
fails 'exit code 3: not a mesh' 3 'junk' "$tool" solve "$work/junk.off" --vertex 0
printf 'OFF\n5 3 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n0 -1 0\n3 0 1 2\n3 1 0 3\n3 0 1 4\n' > "$work/three.off"
fails 'exit code 4: an edge of three triangles' 4 '[0-9]' "$tool" solve "$work/three.off" --vertex 0
fails 'exit code 5: no such device' 5 'nothing-like-it' \
    "$tool" solve "$torus" --vertex 0 --device nothing-like-it
fails 'exit code 5: no driver' 5 '.' \
    env OCL_ICD_VENDORS="$work/full" OPENCL_VENDOR_PATH="$work/full" "$tool" solve "$torus" --vertex 0
fails 'drivers that the environment hides' 5 'no OpenCL platform .*; try without OCL_ICD_VENDORS=/dev/null' \
    env OCL_ICD_VENDORS=/dev/null "$tool" solve "$torus" --vertex 0
fails 'exit code 6: too much inertia' 6 'diverged' \
    "$tool" solve "$torus" --vertex 0 --single --method inertial --inertia 0.9999 --out "$work/full/x.vtp"
fails 'exit code 7: one step is not enough' 7 '.' \
    "$tool" solve "$torus" --vertex 0 --max-steps 1 --method euler --out "$work/full/x.vtp"
if [ "${DMKCL_BUILD##*/}" != sanitize ]; then
    fails 'exit code 8: too little memory' 8 'memory' \
        bash -c 'ulimit -v 300000; exec "$@"' - "$tool" mesh torus --refine 7 --out "$work/full/x.off"
else
    skip 'exit code 8: too little memory' 'the address sanitizer needs all the memory there is'
fi
interrupt() { # as Ctrl-C does, once the first step is reported; a script's & would have it ignored
    env --default-signal=INT "$tool" solve "$torus" --vertex 0 --method euler --start uniform --tolerance 1e-300 --verbose \
        --out "$work/full/x.vtp" 2> "$work/steps" &
    local pid=$!
    for _ in $(seq 600); do
        grep -q 'step' "$work/steps" && break
        sleep 0.1
    done
    kill -INT "$pid"
    wait "$pid"
}
interrupt
check 'exit code 130: Ctrl-C' test $? -eq 130
check 'with a word about it' has "$work/steps" 'cancelled'
check 'runs that fail leave nothing' holds "$work/full" ''

fails 'exit code 9: a gap that is not reached' 9 'gap is .* above the 1e-06' \
    "$tool" solve meshes/sphere.off --vertex 0 --gap 1e-6 --quiet --out "$work/gap.vtp"
check 'the files are written all the same' test -s "$work/gap.vtp"
check 'a gap that hides nothing is explained' output_has 'as mu has not settled' \
    "$tool" solve meshes/sphere.off --vertex 0 --method euler --start uniform --tolerance 1
beyond() {
    local n
    "$tool" distance "$torus" --vertex 0 --tolerance 1e-5 --report "$work/beyond.json" > "$work/beyond" &&
        n=$(sed -n 's/^ *"n_beyond": \([0-9]*\),$/\1/p' "$work/beyond.json") && test "$n" -gt 1 &&
        has "$work/beyond" "^distance .*, within 1e-05 of each but $n vertices, there within 1\.[0-9]*e-05$"
}
check 'where an estimate is above the tolerance' beyond
check 'the gap alone ends a run' "$tool" solve meshes/sphere.off --vertex 0 --gap 0.01 --tolerance 1e-12

# ---- a whole run ------------------------------------------------------------------------------

mkdir "$work/run"
"$tool" solve "$torus" --source 3,0,0 --out "$work/run/a.vtp" --out "$work/run/b.vtu" \
    --locus "$work/run/c.obj" --locus "$work/run/d.csv" --report "$work/run/e.json" \
    > "$work/summary" 2> "$work/errors"
check 'exit code 0: a whole run' test $? -eq 0
check 'is quiet in a pipe' test ! -s "$work/errors"
check 'writes its files and nothing else' holds "$work/run" 'a.vtp b.vtu c.obj d.csv e.json '
check 'VTP is whole' has "$work/run/a.vtp" '</VTKFile>'
check 'VTU is whole' has "$work/run/b.vtu" '</VTKFile>'
for name in mu acl u distance; do
    check "VTP has $name" grep -qa "Name=\"$name\"" "$work/run/a.vtp"
done
check 'the locus has lines' has "$work/run/c.obj" '^[lp] '
check 'the summary fits a screen' test "$(wc -l < "$work/summary")" -le 20
for word in mesh source device solved cost 'cut locus' time wrote; do
    check "the summary has the $word" has "$work/summary" "^$word"
done
check 'the summary has no colours in a pipe' test -z "$(tr -cd '\033' < "$work/summary")"

report=$work/run/e.json
check 'the report is JSON' is_json "$report"
for key in mesh n_vertices n_triangles n_edges euler area device precision steps cg_iterations \
    v_cycles cost_upper cost_lower gap seconds read device setup distance start solve certify locus write \
    total peak_memory length loops components endpoints branch_points; do
    check "the report has $key" has "$report" "^ *\"$key\": [^n]"
done
# Two tori side by side, in one file: all there is to say of the second one is about the second one.
two_meshes "$torus" > "$work/two.off"
m=$(awk 'NR == 2 { print $2 / 2 }' "$work/two.off")
check 'of two components the one with the source is solved' \
    output_has 'only the component with the source' "$tool" solve "$work/two.off" --source 13,0,0 \
    --locus "$work/two.csv"
check 'and its cut locus lies on it' \
    awk -F, -v m="$m" 'NR > 1 && ($1 < 6 || $4 < m || $4 >= 2 * m) { exit 1 } END { exit NR < 10 }' \
    "$work/two.csv"
check '--report - prints the report alone' \
    is_json <("$tool" solve "$torus" --vertex 0 --report -)
check '--json does so too' is_json <("$tool" solve "$torus" --vertex 0 --json)
check '--quiet prints nothing' test -z "$("$tool" solve "$torus" --vertex 0 --quiet 2>&1)"
check 'without files it only prints' output_has '^cost' "$tool" solve "$torus" --source=-3,0,0
"$tool" solve "$torus" --vertex 0 --verbose > /dev/null 2> "$work/errors"
check '--verbose reports each step' has "$work/errors" '^solve +step 1 '
check 'and its gap' has "$work/errors" '^solve +step [2-9] .* gap [0-9.]+e-'
check 'a pipe has no colours' test -z "$("$tool" info "$torus" | grep $'\033')"

# A cube of twelve triangles that share no vertices, some turned over.
awk 'BEGIN { n = split("0 2 1 1 2 3 4 5 6 5 7 6 0 1 4 1 5 4 2 6 3 3 6 7 0 2 4 2 4 6 1 3 5 3 5 7", c, " ")
    print "OFF"; print n, n / 3, 0
    for (i = 1; i <= n; i++) print c[i] % 2, int(c[i] / 2) % 2, int(c[i] / 4)
    for (i = 0; i < n; i += 3) print 3, i, i + 1, i + 2 }' > "$work/soup.off"
"$tool" solve "$work/soup.off" --vertex 0 --quiet --report "$work/soup.json" 2> "$work/errors"
check '--quiet says nothing of pieces' test ! -s "$work/errors"
"$tool" info "$work/soup.off" > /dev/null 2> "$work/errors"
check 'a mesh in pieces is warned of, with the way out' \
    has "$work/errors" 'warning: .*soup.off is in 12 pieces.*--repair.* leaves 1'
"$tool" solve "$work/soup.off" --repair --vertex 35 --report "$work/soup.json" > "$work/printed" 2> "$work/errors"
check '--repair says what it does' \
    has "$work/errors" 'repaired: 28 vertices merged with coincident ones, 2 triangles reoriented$'
check 'the vertices are those of the file' has "$work/printed" '^source +\(1, 1, 1\)'
check 'the report has it, too' has "$work/soup.json" '"merged_vertices": 28'
# Three triangles around the vertices 0 and 1, of which a repair makes one and then three; vertex 2 is in none.
printf 'OFF\n9 3 0\n0 0 0\n0 0 0\n9 9 9\n1 0 0\n1 1 0\n0 1 1\n0 0 1\n-1 0 0\n-1 -1 0\n3 0 3 4\n3 1 5 6\n3 0 7 8\n' > "$work/fans.off"
fails 'a vertex that the repair added is none of the file' 1 'vertex 9 is out of range \[0, 8\]$' \
    "$tool" distance "$work/fans.off" --repair --vertex 9
printf 'vertex 1\nvertex 2\n' > "$work/fans"
fails 'an unused vertex has its number of the file' 1 'fans:2: vertex 2 is in no triangle' \
    "$tool" distance "$work/fans.off" --repair --sources "$work/fans"
check 'mesh --repair writes the repaired mesh' "$tool" mesh "$work/soup.off" --repair --out "$work/cube.off"
check 'which is whole' output_has 'closed, genus 0' "$tool" info "$work/cube.off"
"$tool" mesh "$work/soup.off" --out "$work/soup.stl" --quiet 2> /dev/null
printf 'OFF\n4 3 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n3 0 1 3\n3 0 1 2\n' > "$work/broken.off"
"$tool" info "$work/broken.off" 2> "$work/errors"
check 'a refusal that a repair mends names it' has "$work/errors" '[-]-repair'
check 'and it does' "$tool" info --repair "$work/broken.off"
printf 'OFF\n0 0 0\n' > "$work/zero.off"
printf 'OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n' > "$work/points.off"
fails 'a repair of nothing' 4 'zero.off: 0 vertices and 0 triangles: nothing to repair$' "$tool" info "$work/zero.off" --repair
fails 'a repair of points' 4 'points.off: 3 vertices and 0 triangles: nothing to repair$' "$tool" info "$work/points.off" --repair
printf 'OFF\n5 5 0\n1 0 0\n.3 1 0\n-.8 .6 0\n-.8 -.6 1\n.3 -1 1\n3 0 1 2\n3 1 2 3\n3 2 3 4\n3 3 4 0\n3 4 0 1\n' > "$work/moebius.off"
"$tool" distance "$work/moebius.off" --repair --vertex 1 --json > "$work/json" 2> "$work/errors"
check 'what is cut open is warned of' \
    has "$work/errors" 'warning: .*moebius.off was cut open along 1 edge, for it has one side only: distances across'
check 'and counted' has "$work/json" '"seam_edges": 1'
"$tool" solve "$torus" --source 9,0,0 2> "$work/errors" > /dev/null
check 'a source far away is warned of' has "$work/errors" 'warning: \(9, 0, 0\) is 6 away from the surface'
"$tool" solve "$torus" --source 3.01,0,0 2> "$work/errors" > /dev/null
check 'one nearby is not' test ! -s "$work/errors"
for made in '100,0,0:97' '3.3,0,0:0.3' '3.01,0,0:'; do
    "$tool" mesh torus --source "${made%:*}" --out "$work/lifted.off" > "$work/said_out" 2> "$work/errors"
    words="^dmkcl: warning: .${made%%,*}, 0, 0. is away from the surface; the source, .3, 0, 0., is ${made#*:} from it$"
    check "mesh --source ${made%:*}" test "$(grep -cE "$words" "$work/errors")" -eq "$(grep -c . <<< "${made#*:}")" -a "$(wc -l < "$work/errors")" -le 1
done
for command in 'distance --source 9,0,0' 'path --source 3,0,0 --to 9,0,0' 'batch --source 9,0,0 --json'; do
    "$tool" $command "$torus" 2> "$work/errors" > /dev/null
    check "and by ${command%% *}, too" has "$work/errors" 'warning: \(9, 0, 0\) is 6 away from the surface'
done
printf '3.1,0,0\nvertex 0\n' > "$work/two.txt"
printf '3,0,0\n-3,0,0\n' > "$work/far.txt"
"$tool" distance "$torus" --sources "$work/far.txt" --locus "$work/far.obj" --locus "$work/far.vtp" > "$work/lines"
check 'the cut locus of a set has 2g + k - 1 loops' has "$work/lines" '^cut locus  length [0-9.]* in 1 piece, 3 loops'
check 'and is written as lines' has "$work/far.obj" '^l [0-9]+ [0-9]+'
check 'in the other format, too' has "$work/far.vtp" 'Name="strength"'
"$tool" distance "$torus" --sources "$work/far.txt" --locus "$work/far.obj" --json > "$work/lines"
check 'and stands in the report' has "$work/lines" '"loops": 3'
"$tool" solve "$torus" --sources "$work/two.txt" > "$work/lines" 2> /dev/null
check 'a line of many sources has the offset' has "$work/lines" '^0000 .*\), 0\.1[0-9]* from the point asked for: '
check 'but not of a vertex' has "$work/lines" '^0001  \([^:]*\): '
check 'and so does one of a batch' output_has '0\.1[0-9]* from the point asked for' "$tool" batch "$torus" --source 3.1,0,0 --out-dir "$work/one-folder"

# No device is opened: with one that is not there it ends well all the same.
"$tool" solve "$torus" --vertex 0 --dry-run --device none-of-these --out "$work/dry.vtp" > "$work/printed"
check '--dry-run opens no device' test $? -eq 0
check 'and writes no result' test ! -e "$work/dry.vtp"
check 'it prints the memory as info does' test "$(sed -n 's/^memory *//p' "$work/printed")" = \
    "$("$tool" info "$torus" | sed -n 's/^memory *//p')" -a "$(grep -c '^memory .* on the device' "$work/printed")" -eq 1
memory() { sed -n '/"memory": {/,/}/p' "$1"; } # of a report
"$tool" solve "$torus" --vertex 0 --dry-run --json > "$work/dry.json"
"$tool" solve "$torus" --vertex 0 --dry-run --json --single > "$work/single.json"
"$tool" info "$torus" --json > "$work/info.json"
check '--dry-run --json prints a report' is_json "$work/dry.json"
check 'with the bytes of info' test "$(memory "$work/dry.json")" = "$(memory "$work/info.json")" -a -n "$(memory "$work/dry.json")"
check 'with --single it is another device memory' test "$(memory "$work/dry.json")" != "$(memory "$work/single.json")"
usage 'a dry run looks at the source' 'vertex' solve "$torus" --vertex 99999999 --dry-run
printf '3,0,0\nvertex 0\n# here\nvertex 99999\nvertex 88888\n' > "$work/many.txt"
"$tool" solve "$torus" --sources "$work/many.txt" --dry-run > "$work/printed" 2> "$work/errors"
check 'and at each of many' test $? -eq 1
"$tool" solve "$torus" --sources "$work/many.txt" > "$work/said_out" 2> "$work/solved"
check 'with the words of a run' cmp "$work/errors" "$work/solved"
check 'which name each line' test "$(grep -cE '^dmkcl: .*many.txt:[45]: .*(99999|88888)' "$work/errors")" -eq 2
check 'and says what a solve takes all the same' has "$work/printed" '^memory .* on the device'
printf '3,0,0\nvertex 0\n' > "$work/many.txt"
check 'sources that are there' "$tool" solve "$torus" --sources "$work/many.txt" --dry-run
formats() { # COMMAND: those that --format names in its help
    "$tool" "$1" --help | sed -n 's/^.*format of files whose name has no suffix: \(.*\);$/\1/p'
}
for listed in 'solve:ply, vtp, vtu, obj, csv' 'distance:ply, vtp, vtu, obj, csv' 'transport:ply, vtp, vtu' \
    'path:vtp, obj, csv' 'cut:ply, vtp, vtu, off, obj' 'mesh:ply, vtp, vtu, off, obj'; do
    check "the formats of ${listed%%:*}" test "$(formats "${listed%%:*}")" = "${listed#*:}"
done
"$tool" cut "$torus" --vertex 0 --json > "$work/cut.json"
check 'cut --json prints the report, with the cut' \
    sh -c "grep -q '\"n_border_loops\": 1' '$work/cut.json' && grep -q '\"locus\"' '$work/cut.json'"
check 'cut --report writes it' "$tool" cut "$torus" --vertex 0 --report "$work/cut2.json" --quiet
"$tool" cut "$torus" --vertex 0 --out "$work/cut3.off" --picture "$work/cut3.svg" --report "$work/cut3.json" --quiet
check 'with its files and seconds' python3 -c '
import json, sys
r = json.load(open(sys.argv[1] + "/cut3.json"))
assert r["cut"]["out"] == [sys.argv[1] + "/cut3.off"], r["cut"]
assert r["cut"]["picture"] == [sys.argv[1] + "/cut3.svg"], r["cut"]
s = r["seconds"]
assert 0 < s["write"] < s["total"] and s["read"] + s["cut"] + s["write"] <= s["total"], s' "$work"
usage 'a picture that is no drawing' "--picture: '.*p.png' has no suffix of a format for a drawing; expected one of .svg" \
    cut "$torus" --vertex 0 --picture "$work/p.png"
check 'and is the same' sh -c "[ \$(wc -l < '$work/cut.json') = \$(wc -l < '$work/cut2.json') ]"
"$tool" path "$torus" --vertex 0 --to-vertex 40 --json > "$work/path.json"
check 'path --json prints a report and no summary' is_json "$work/path.json"
length=$(sed -n 's/.*"length": \([0-9.e+-]*\),*$/\1/p' "$work/path.json")
"$tool" path "$torus" --vertex 0 --to-vertex 40 --report "$work/path2.json" --out "$work/path.csv" > "$work/printed"
check 'its length is that of the summary' awk -v a="${length:-none}" \
    '{ sub(/.*length /, ""); if (a + 0 > 0 && ($0 - a)^2 < 1e-16 * a^2) good = 1; exit !good }' "$work/printed"
check 'path --report writes it' is_json "$work/path2.json"
check 'with the files and the number of triangles' sh -c \
    "grep -q '/path.csv\"' '$work/path2.json' && grep -q '\"n_triangles\": '\$((\$(wc -l < '$work/path.csv') - 2)) '$work/path2.json'"
usage 'a report on the mesh' "'a.json' is read" path a.json --vertex 0 --to-vertex 1 --report a.json
"$tool" cut "$torus" --vertex 0 --out "$work/cut.obj" --out "$work/cut.vtp" --picture "$work/cut.svg" > "$work/printed"
check 'cut reports flipped triangles' has "$work/printed" '^in the plane [0-9]+ triangles? (is|are) turned over'
check 'a cut as OBJ has a texture coordinate for each vertex' \
    sh -c "[ \$(grep -c '^vt ' '$work/cut.obj') = \$(grep -c '^v ' '$work/cut.obj') ] && grep -q '^f [0-9]*/[0-9]* ' '$work/cut.obj'"
check 'as VTP it has the plane' grep -qa 'Name="plane"' "$work/cut.vtp"
# Its frame ends a margin of 20 behind the last point, both ways.
fits() {
    python3 -c 'import re, sys
text = open(sys.argv[1]).read()
frame = [float(x) for x in re.search("viewBox=\"0 0 (.*?) (.*?)\"", text).groups()]
points = [[float(x) for x in p] for p in re.findall("[ML]([0-9.]+) ([0-9.]+)", text)]
for size, x in zip(frame, zip(*points)):
    assert abs(min(x) - 20) < 0.02 and abs(max(x) - size + 20) < 0.02, (size, min(x), max(x))' "$1"
}
check 'and the picture is a drawing' sh -c "grep -q '^<svg ' '$work/cut.svg' && tail -1 '$work/cut.svg' | grep -q '</svg>'"
check 'which fills its frame' fits "$work/cut.svg"
for strength in 0.04 3; do
    "$tool" solve "$torus" --vertex 0 --strength $strength --locus "$work/l$strength.csv" --quiet
done
check '--strength takes branches away' \
    test "$(wc -l < "$work/l3.csv")" -lt "$(wc -l < "$work/l0.04.csv")"
check 'and nothing else' sh -c "cut -d, -f1-3 '$work/l3.csv' | while read -r x; do grep -qFe \"\$x\" '$work/l0.04.csv' || exit 1; done"
check 'help COMMAND is COMMAND --help' \
    sh -c "'$tool' help cut > '$work/a' && '$tool' cut --help > '$work/b' && cmp '$work/a' '$work/b' &&
        '$tool' --help cut > '$work/b' && cmp '$work/a' '$work/b'"
sh src/cli/man.sh "$tool" > "$work/manual"
check 'the manual lists every command in its synopsis' \
    test "$(sed '/^.SH DESC/,$d' "$work/manual" | grep -c '^.B dmkcl')" = "$(grep -c '^.SH DMKCL' "$work/manual")"
for option in tolerance max-steps method start threads gap dt inertia; do
    check "the help gives the default of --$option" \
        sh -c "'$tool' solve --help | awk '/^  --/ { on = 0 } /^  --$option / { on = 1 } on' | grep -q default"
done

if script -qec true /dev/null > /dev/null 2>&1 < /dev/null; then
    export TERM=xterm # whatever that of the caller is
    script -qec "'$tool' solve '$torus' --vertex 0" /dev/null > "$work/screen" < /dev/null
    check 'a terminal shows the progress' has "$work/screen" 'solve +step'
    check 'on one line that is wiped' has "$work/screen" $'\r\033\\[K'
    script -qec "'$tool' solve '$torus' --vertex 0 --method euler --start uniform --max-steps 400 \
        --tolerance 1e-9" /dev/null > "$work/long" < /dev/null
    check 'and the time left' has "$work/long" 'about [0-9]+ s left'
    check 'and the gap' has "$work/long" 'gap [0-9.]+e-'
    check 'a terminal has colours' has "$work/screen" $'\033\\[1m'
    check 'the summary fits a screen of 24 lines' test "$(wc -l < "$work/screen")" -le 23
    NO_COLOR=1 script -qec "'$tool' info '$torus'" /dev/null > "$work/plain" < /dev/null
    check 'NO_COLOR takes them away' test -z "$(grep $'\033' "$work/plain")"
    NO_COLOR='' script -qec "'$tool' info '$torus'" /dev/null > "$work/bold" < /dev/null
    check 'an empty NO_COLOR does not' has "$work/bold" $'\033\\[1m'
    TERM=dumb script -qec "'$tool' info '$torus'" /dev/null > "$work/plain" < /dev/null
    check 'nor has a dumb terminal any' test -z "$(grep $'\033' "$work/plain")"
    script -qec "stty cols 30; '$tool' solve '$torus' --vertex 0 --method euler --start uniform \
        --max-steps 60 --tolerance 1e-9" /dev/null > "$work/narrow" < /dev/null
    tr '\r' '\n' < "$work/narrow" | grep 'solve  *step' | sed 's/\x1b\[K//g' > "$work/lines"
    check 'a narrow terminal has short lines' awk 'length > 29 { exit 1 } END { exit NR < 1 }' "$work/lines"
else
    skip 'a terminal' 'there is no `script` here to make one, or no /dev/pts'
fi
tap_end
