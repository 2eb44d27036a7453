# Paths and cuts on the command line: files, figures, topology of genus 0, 1 and 2, borders.
. tests/tap.sh

sphere=$work/sphere.off
torus=$work/torus.off
has() { grep -qE -e "$2" "$1"; }
output_has() { # PATTERN COMMAND...
    local pattern=$1
    shift
    "$@" > "$work/said_out" || return
    has "$work/said_out" "$pattern" || { cat "$work/said_out"; return 1; }
}
"$tool" mesh sphere --source 0,0,1 --out "$sphere" --quiet
"$tool" mesh torus --source 3,0,0 --triangles 2000 --out "$torus" --quiet

# ---- slips ------------------------------------------------------------------------------------

for command in path cut; do
    check "$command --help" output_has "^usage: dmkcl $command" "$tool" $command --help
    check "--help knows $command" output_has "^  $command " "$tool" --help
    fails "$command: no source" 1 "$command: no source given" "$tool" $command x.off
done
fails 'path: no end' 1 'no end given' "$tool" path x.off --vertex 0
fails 'path: two ends' 1 'not both' "$tool" path x.off --vertex 0 --to 1,2,3 --to-vertex 1
fails 'path: a strange suffix' 1 'expected one of .*.obj' \
    "$tool" path x.off --vertex 0 --to-vertex 1 --out x.png
fails 'path: a vertex that is not there' 1 '99999999' \
    "$tool" path "$torus" --vertex 0 --to-vertex 99999999
fails 'cut: no file' 1 '--out FILE or --picture FILE is missing' "$tool" cut x.off --vertex 0
fails 'cut: a strange suffix' 1 'expected one of .*.obj' "$tool" cut x.off --vertex 0 --out x.png

# ---- paths ------------------------------------------------------------------------------------

check 'a path over the sphere' "$tool" path "$sphere" --source 0,0,1 --to 0.6,0,-0.8 \
    --out "$work/p.obj" --out "$work/p.vtp" --out "$work/p.csv"
# The great circle has the angle acos(-0.8) = 2.4981; the polyhedron is a little smaller.
check 'its length is printed' output_has 'length 2\.4[89]' \
    "$tool" path "$sphere" --source 0,0,1 --to 0.6,0,-0.8
check 'OBJ has one line' test "$(grep -c '^l ' "$work/p.obj")" -eq 1
check 'VTP is whole' has "$work/p.vtp" '</VTKFile>'
check 'VTP has the distance' grep -qa 'Name="distance"' "$work/p.vtp"
check 'VTP has nothing that a path has not' bash -c "! grep -qa 'Name=\"mu\"' '$work/p.vtp'"
check 'CSV has its columns' has "$work/p.csv" '^x,y,z,triangle,w0,w1,w2,distance$'
check 'it begins at the source, ends at the end, lies in the plane y = 0, grows evenly' awk -F, '
    NR == 1 { next }
    NR == 2 { if ($3 < 0.999 || $8 != 0) bad = 1 }
    NR > 2 { step = sqrt(($1 - x)^2 + ($2 - y)^2 + ($3 - z)^2)
        if (step - ($8 - d) > 1e-9 || ($8 - d) - step > 1e-9) bad = 2 }
    $2 > 0.1 || $2 < -0.1 { bad = 3 }
    { x = $1; y = $2; z = $3; d = $8 }
    END { if (x < 0.55 || x > 0.65 || z > -0.75 || NR < 10) bad = 4; print bad; exit bad }' \
    "$work/p.csv"
check 'a path to the source is short' output_has 'length 0,' \
    "$tool" path "$torus" --vertex 0 --to-vertex 0
check '--quiet prints nothing' \
    test -z "$("$tool" path "$torus" --vertex 0 --to-vertex 9 --quiet 2>&1)"

# A square of 20 x 20 unit squares with a hole from (6, 8) to (14, 12): from (1, 9) to (19, 10) the way
# leads along two of its corners, (6, 8) and (14, 8).
awk 'BEGIN { n = 20; print "OFF"; print (n + 1)^2, 2 * (n * n - 32), 0
    for (j = 0; j <= n; j++) for (i = 0; i <= n; i++) print i, j, 0
    for (j = 0; j < n; j++) for (i = 0; i < n; i++) { a = j * (n + 1) + i
        if (i >= 6 && i < 14 && j >= 8 && j < 12) continue
        print 3, a, a + 1, a + n + 2; print 3, a, a + n + 2, a + n + 1 } }' > "$work/hole.off"
bent=$(awk 'BEGIN { printf "%.8f", sqrt(26) + 8 + sqrt(29) }' | sed 's/\./\\./')
check 'a path bends around a hole' output_has "length ${bent}" \
    "$tool" path "$work/hole.off" --source 1,9,0 --to 19,10,0 --out "$work/bent.csv"
check 'at its corners' test "$(grep -cE '^(6|14),8,0,' "$work/bent.csv")" -eq 2
check 'no point comes twice' test -z "$(cut -d, -f1-3 "$work/bent.csv" | uniq -d)"

# Two tori in one file, the second one 10 further on; its vertices are numbered behind the first's.
two_meshes "$torus" > "$work/two.off"
n=$(awk 'NR == 2 { print $1 / 2; exit }' "$work/two.off")
check 'a path on the second component' "$tool" path "$work/two.off" --vertex "$n" \
    --to-vertex "$((n + 50))" --out "$work/second.csv"
"$tool" path "$torus" --vertex 0 --to-vertex 50 --out "$work/first.csv" --quiet
# Moving has rounded the coordinates to six digits.
check 'is that of the first one, moved' awk -F, '
    NR == FNR { x[FNR] = $1; d[FNR] = $8; n = FNR; next }
    FNR > 1 && ($1 - 10 - x[FNR] > 1e-3 || x[FNR] - $1 + 10 > 1e-3 || $8 - d[FNR] > 1e-3) { bad = 1 }
    END { exit bad || FNR != n || n < 3 }' "$work/first.csv" "$work/second.csv"
fails 'no path leads to the other component' 1 "the end of the path at vertex $n is not on the component" \
    "$tool" path "$work/two.off" --vertex 0 --to-vertex "$n"
fails 'nor to a point there' 1 'the end of the path in triangle [0-9]+ is not on the component' \
    "$tool" path "$work/two.off" --vertex 0 --to 12.1,2.1,0.3

# ---- cuts -------------------------------------------------------------------------------------

is_disk() { # FILE
    output_has 'Euler characteristic 1, 1 border loop' "$tool" info "$1"
}
# The boundary of a plate of 5 x 3 unit cubes without the second and the fourth of the middle row,
# each square cut in 3 x 3: genus 2.
awk 'function corner(x, y, z, key) {
        key = x " " y " " z
        if (!(key in number)) { number[key] = nv + 0; place[nv++] = key }
        return number[key]
    }
    function solid(x, y, z) {
        return x >= 0 && x < 5 && y >= 0 && y < 3 && z == 0 && !(y == 1 && (x == 1 || x == 3))
    }
    function square(ox, oy, oz, ax, ay, az, bx, by, bz, i, j, a, b, c, d) {
        for (i = 0; i < 3; i++) for (j = 0; j < 3; j++) {
            a = corner(3*ox + ax*i + bx*j, 3*oy + ay*i + by*j, 3*oz + az*i + bz*j)
            b = corner(3*ox + ax*(i+1) + bx*j, 3*oy + ay*(i+1) + by*j, 3*oz + az*(i+1) + bz*j)
            c = corner(3*ox + ax*(i+1) + bx*(j+1), 3*oy + ay*(i+1) + by*(j+1), 3*oz + az*(i+1) + bz*(j+1))
            d = corner(3*ox + ax*i + bx*(j+1), 3*oy + ay*i + by*(j+1), 3*oz + az*i + bz*(j+1))
            face[nt++] = a " " b " " c
            face[nt++] = a " " c " " d
        }
    }
    BEGIN {
        for (x = 0; x < 5; x++) for (y = 0; y < 3; y++) {
            if (!solid(x, y, 0)) continue
            square(x, y, 1, 1, 0, 0, 0, 1, 0)
            square(x, y, 0, 0, 1, 0, 1, 0, 0)
            if (!solid(x + 1, y, 0)) square(x + 1, y, 0, 0, 1, 0, 0, 0, 1)
            if (!solid(x - 1, y, 0)) square(x, y, 0, 0, 0, 1, 0, 1, 0)
            if (!solid(x, y + 1, 0)) square(x, y + 1, 0, 0, 0, 1, 1, 0, 0)
            if (!solid(x, y - 1, 0)) square(x, y, 0, 1, 0, 0, 0, 0, 1)
        }
        print "OFF"; print nv, nt, 0
        for (i = 0; i < nv; i++) print place[i]
        for (i = 0; i < nt; i++) print 3, face[i]
    }' > "$work/plate.off"
check 'the plate has genus 2' output_has 'genus 2' "$tool" info "$work/plate.off"
cut() { # NAME SOURCE [LOOPS]
    check "cut: $1" output_has 'Euler characteristic 1, 1 border loop$' \
        "$tool" cut "$work/$1.off" --source="$2" --out "$work/cut_$1.obj" --out "$work/cut_$1.off"
    check "cut: $1 is a disk" is_disk "$work/cut_$1.obj"
    check "cut: $1 in two formats is the same" is_disk "$work/cut_$1.off"
}
cut sphere 0,0,1
check 'the sphere is slit by two edges' output_has 'border loop of 4 edges' \
    "$tool" info "$work/cut_sphere.obj"
cut torus 3,0,0
cut plate 4,4,3
check 'the cut torus has two loops' output_has 'with 2 loops' \
    "$tool" cut "$torus" --vertex 0 --out "$work/x.obj"
# The first vertices are the torus' own; OFF keeps every bit.
check 'the old vertices keep their numbers' \
    cmp <(sed -n "3,$((n + 2))p" "$torus") <(sed -n "3,$((n + 2))p" "$work/cut_torus.off")
check 'cutting keeps the area' test \
    "$("$tool" info "$torus" | awk '/^area/ { printf "%.6f", $2 }')" = \
    "$("$tool" info "$work/cut_torus.obj" | awk '/^area/ { printf "%.6f", $2 }')"
check 'cut: the second of two components' "$tool" cut "$work/two.off" --vertex "$n" \
    --out "$work/second.obj"
check 'gives a disk there' is_disk "$work/second.obj"
check 'of that component alone' awk '/^v / && $2 < 6 { exit 1 }' "$work/second.obj"

# A smooth surface of genus 3, of which large parts curve negatively: rays that meet there have left the
# source in nearly one direction, and 6,000 triangles do not show well where. 80,000 have a locus of 25.02.
gzip -dc tests/data/triple_torus.off.gz > "$work/triple.off"
check 'the locus on the triple torus has no detours' output_has \
    'cut locus  length 25\.[0-3][0-9]* in 1 piece, 6 loops, 1 end' \
    "$tool" solve "$work/triple.off" --source 1.9,0.3,0.2
cut triple 1.9,0.3,0.2

# A square with its border: a disk already.
awk 'BEGIN { n = 10; print "OFF"; print (n + 1)^2, 2 * n * n, 0
    for (j = 0; j <= n; j++) for (i = 0; i <= n; i++) print i, j + 0.2 * (i % 2), 0
    for (j = 0; j < n; j++) for (i = 0; i < n; i++) { a = j * (n + 1) + i
        print 3, a, a + 1, a + n + 2; print 3, a, a + n + 2, a + n + 1 } }' > "$work/square.off"
cut square 5,5,0
gunzip -c tests/data/once/spike-81.off.gz > "$work/needles.off"
check 'cut: needles at which a solve ends in vain' output_has 'Euler characteristic 1, 1 border loop$' \
    "$tool" cut "$work/needles.off" --vertex 0 --out "$work/x.obj"
check 'a disk stays as it is' output_has '121 vertices, 200 triangles' \
    "$tool" info "$work/cut_square.off"
tap_end
