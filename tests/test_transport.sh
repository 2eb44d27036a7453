# dmkcl transport: forms of measures, report, refusals.
. tests/tap.sh
mesh=meshes/sphere.off

has() { grep -qE -e "$2" "$1"; }
usage() { # NAME PATTERN ARGUMENT...
    local name=$1 pattern=$2
    shift 2
    fails "$name" 1 "$pattern" "$tool" transport "$@"
}

n=$(awk 'NR == 2 { print $1 }' $mesh)
faces=$(awk 'NR == 2 { print $2 }' $mesh)
printf '\357\273\277vertex 5 2 # two\n0.9,0.2,0.4 1\n' > "$work/a"
printf '\n# away\n-1 0 0 3\n' > "$work/b"
awk -v n="$n" 'BEGIN { for (i = 0; i < n; i++) print i == 7 ? 1 : 0 }' > "$work/vertices"
awk -v n="$faces" 'BEGIN { for (i = 0; i < n; i++) print 1 + i % 2 }' > "$work/faces"
awk -v n="$n" 'BEGIN { for (i = 0; i < n; i++) print i == 7 ? 1 : i == 70 ? -1 : 0 }' > "$work/signed"

"$tool" transport $mesh --from "$work/a" --to "$work/b" --out "$work/o.vtp" \
    --out "$work/o.vtu" --out "$work/o.ply" --report "$work/r.json" > "$work/summary" 2> "$work/errors"
check 'atoms to atoms' test $? -eq 0
check 'says nothing where there is no terminal' test ! -s "$work/errors"
check 'the report is JSON' is_json "$work/r.json"
check 'the file has the flux' has "$work/o.vtp" 'Name="flux" NumberOfComponents="3"'
check 'and no distance' sh -c "! grep -aq 'Name=\"distance\"' '$work/o.vtp'"
for key in cost_upper cost_lower gap mass balance steps; do
    check "the report has $key" has "$work/r.json" "\"$key\": [0-9]"
done
check 'its device, as that of `solve`' has "$work/r.json" '^  "device": \{$'
check 'and its steepest triangles' has "$work/r.json" '^  "steep": \['
times='^time .*: read .*, device .*, setup .*, start .*, solve .*, certify .*,$'
check 'the summary has all stages' has "$work/summary" "$times"
check 'the mass' has "$work/r.json" '"mass": 3(\.0*[0-9]*|),'
check 'vertices to triangles, scaled' "$tool" transport $mesh --from "$work/vertices" --to "$work/faces" --normalise
check 'to the even measure' "$tool" transport $mesh --from "$work/vertices" --to uniform --normalise --json
printf 'vertex 5\nvertex 70\n-1 0 0\n' > "$work/set"
"$tool" transport $mesh --from uniform --to "$work/set" --normalise --out "$work/set.vtp" > "$work/summary"
check 'points without masses: how much is their cut locus' has "$work/summary" '^acl +[1-9][0-9,]* triangles'
check 'and the file marks it' has "$work/set.vtp" 'Name="acl"'
check 'one with masses has none' sh -c "! grep -aq 'Name=\"acl\"' '$work/o.vtp'"
printf 'vertex 5 1\nvertex 5 -1\n' > "$work/nothing"
"$tool" transport $mesh --from "$work/nothing" > "$work/summary"
check 'a signed measure that cancels' has "$work/summary" '^way +0 on average'
fails 'one measure where two were meant' 1 'has the total mass 3: expected 0, unless --to is given' \
    "$tool" transport $mesh --from "$work/a"
two_meshes $mesh > "$work/two.off"
printf 'vertex 0 1\nvertex %d 1\n' "$n" > "$work/apart"
fails 'points that are not joined' 1 '^dmkcl: .*apart:2: point 1 lies on component 1, other mass on component 0' \
    "$tool" transport "$work/two.off" --from "$work/apart" --to uniform
printf '# of two spheres\n' > "$work/apart2"
awk -v n="$n" 'BEGIN { for (i = 0; i < 2 * n; i++) print i == 7 || i == n + 3 ? 1 : 0 }' >> "$work/apart2"
fails 'vertices that are not joined' 1 "apart2:$((n + 5)): vertex $((n + 3)) lies on component 1, other mass on component 0" \
    "$tool" transport "$work/two.off" --from "$work/a" --to "$work/apart2" --normalise
check 'one signed measure' "$tool" transport $mesh --from "$work/signed"

check 'a file of arrays' "$tool" solve $mesh --vertex 3 --out "$work/n.vtp" --out "$work/n.vtu"
check 'a file without arrays' "$tool" mesh $mesh --out "$work/bare.vtp" --quiet
check 'an array of points' "$tool" transport $mesh --from "$work/n.vtp:distance" --to uniform --normalise
by_name() { (cd "$work" && "$OLDPWD/$tool" transport "$OLDPWD/$mesh" --from n.vtp:mu --to uniform --normalise); }
check 'an array of a file with a short name' by_name
cp "$work/n.vtu" "$work/N.VTU"
check 'or in capitals' "$tool" transport $mesh --from "$work/N.VTU:mu" --to uniform --normalise
usage 'a file of arrays without the array' 'n.vtp: name the array in it that is the measure: .*/n.vtp:NAME$' \
    $mesh --from "$work/n.vtp" --to uniform
check 'an array of triangles' "$tool" transport $mesh --from "$work/n.vtu:mu" --to uniform --normalise --report "$work/by_name"
fails 'an array that is not there' 3 "no array 'nothing' on points or cells; it has 'u', 'distance', 'mu', 'acl'" \
    "$tool" transport $mesh --from "$work/n.vtp:nothing" --to uniform
fails 'no array at all' 3 'it has none of one number each' "$tool" transport $mesh --from "$work/bare.vtp:mu" --to uniform
fails 'an array of vectors' 3 'several components' "$tool" transport $mesh --from "$work/o.vtp:flux" --to uniform
check 'a larger mesh' "$tool" mesh sphere --triangles 99000 --out "$work/big.off" --quiet
check 'and its arrays' "$tool" solve "$work/big.off" --vertex 0 --out "$work/big.vtp" --quiet
fails 'an array of another mesh' 3 'more than the' "$tool" transport $mesh --from "$work/big.vtp:mu" --to uniform
# Of a tetrahedron, which has as many triangles as vertices.
printf 'OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n' > "$work/four.off"
{
    printf '<VTKFile type="PolyData"><PolyData><Piece NumberOfPoints="4" NumberOfPolys="4">'
    printf '<PointData><DataArray type="Float64" Name="p" format="ascii">1 1 1 1</DataArray></PointData>'
    printf '<CellData><DataArray type="Float64" Name="a.vtp:c.vtp" format="ascii">1 1 1 1</DataArray></CellData>'
    printf '<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>'
    printf '<Polys><DataArray type="Int32" Name="connectivity" format="ascii">0 2 1 0 1 3 0 3 2 1 2 3</DataArray>'
    printf '<DataArray type="Int32" Name="offsets" format="ascii">3 6 9 12</DataArray></Polys></Piece></PolyData></VTKFile>'
} > "$work/four.vtp"
printf 'OFF\n6 4 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n-1 1 0\n-1 0 0\n3 0 1 2\n3 0 2 3\n3 0 3 4\n3 0 4 5\n' > "$work/fan.off"
mass_of() { # ARRAY PATTERN
    "$tool" transport "$work/four.off" --from "$work/four.vtp:$1" --to uniform --normalise --quiet --report "$work/four.json" &&
        has "$work/four.json" "\"mass\": $2"
}
check 'an array of four triangles is no mass of vertices' mass_of a.vtp:c.vtp '2\.366'
check 'and one of four points is' mass_of p '4(\.0*[0-9]*|),'
fails 'of points as many as there are triangles' 3 'four.vtp:p has 4 numbers of points; expected one for each of 6 vertices' \
    "$tool" transport "$work/fan.off" --from "$work/four.vtp:p" --to uniform
# Triangles with corners of their own, which a repair joins, and one before them, which it drops: measures count as in the file.
awk 'BEGIN { c = 0 } NR == 2 { n = $1 } NR > 2 && NR <= n + 2 { p[NR - 3] = $0 }
    NR > n + 2 { for (k = 2; k <= 4; k++) { v[c] = $k; c++ } }
    END { print "OFF"; print c, c / 3 + 1, 0; for (i = 0; i < c; i++) print p[v[i]]
        print "3 0 0 1"
        for (i = 0; i < c; i += 3) print 3, i, i + 1, i + 2
        print v[7], v[700] > "/dev/stderr"
        for (i = 0; i < c; i++) { m = i % 5; sum[v[i]] += m; print m > "'"$work/of_soup"'" }
        for (i = 0; i < n; i++) print sum[i] > "'"$work/of_mesh"'" }' $mesh > "$work/soup.off" 2> "$work/joined"
read -r first second < "$work/joined"
printf 'vertex 7 1\n' > "$work/soup_from"
printf 'vertex 700 1\n' > "$work/soup_to"
printf 'vertex %d 1\n' "$first" > "$work/mesh_from"
printf 'vertex %d 1\n' "$second" > "$work/mesh_to"
cost_of() { # MESH FROM TO
    "$tool" transport "$1" --repair --from "$work/$2" --to "$3" --normalise --quiet --report "$work/cost.json" 2> "$work/errors" &&
        grep '"cost_' "$work/cost.json"
}
as_joined() { # SOUP_FROM MESH_FROM SOUP_TO MESH_TO
    local joined
    joined=$(cost_of "$work/soup.off" "$1" "$3") && test "$joined" = "$(cost_of $mesh "$2" "$4")"
}
check 'vertices count as in the file that is repaired' as_joined soup_from mesh_from "$work/soup_to" "$work/mesh_to"
check 'masses of vertices that become one add up' as_joined of_soup of_mesh uniform uniform
{ echo 5 && cat "$work/faces"; } > "$work/soup_faces"
check 'densities of triangles are those of the file' as_joined soup_faces faces uniform uniform
# Of two spheres in such triangles: what is refused has the numbers and the lines of the file.
awk 'BEGIN { c = 0 } NR == 2 { n = $1 } NR > 2 && NR <= n + 2 { p[NR - 3] = $0 } NR > n + 2 { for (k = 2; k <= 4; k++) v[c++] = $k }
    END { print "OFF"; print c + 1, c / 3, 0; print "9 9 9"; for (i = 0; i < c; i++) print p[v[i]]
        for (i = 1; i <= c; i += 3) print 3, i, i + 1, i + 2 }' "$work/two.off" > "$work/soups.off"
m=$((3 * faces))
of_soups() { # NUMBER: a mass there, and at 1
    echo '# first' && awk -v i="$1" -v n=$((2 * m + 1)) 'BEGIN { for (k = 0; k < n; k++) print k == i || k == 1 ? 1 : 0 }'
}
of_soups $((m + 5)) > "$work/apart3"
fails 'a vertex of a repaired mesh by its line' 1 "apart3:$((m + 7)): vertex $((m + 5)) lies on component" \
    "$tool" transport "$work/soups.off" --repair --quiet --from "$work/apart3" --to uniform --normalise
of_soups 0 > "$work/apart3"
fails 'one that is in no triangle' 1 'apart3:2: vertex 0 has mass, but is in no triangle' \
    "$tool" transport "$work/soups.off" --repair --quiet --from "$work/apart3" --to uniform --normalise
of_faces() { awk -v i="$faces" -v n=$((2 * faces)) 'BEGIN { for (k = 0; k < n; k++) print k == i || k == 1 ? 1 : 0 }'; }
of_faces > "$work/apart4"
fails 'and a triangle' 1 "apart4:$((faces + 1)): triangle $faces lies on component" \
    "$tool" transport "$work/soups.off" --repair --quiet --from "$work/apart4" --to uniform --normalise
printf '9,0,0 1\n0,0,9 1\n0,0.1,9 1\n0,0,1 1\n' > "$work/away"
"$tool" transport $mesh --from "$work/away" --to uniform --normalise > "$work/summary" 2> "$work/errors"
check 'points far from the surface are warned of' has "$work/errors" 'warning: \(9, 0, 0\) is 8 away from the surface'
check 'and how many more' has "$work/errors" 'warning: so are those of 2 more points of .*away$'
usage 'no measure' 'no measure given' $mesh
printf '0x1,0,0 1\n' > "$work/hex"
fails 'a number that is not decimal' 3 'hex:1: expected one number' "$tool" transport $mesh --from "$work/hex" --to "$work/a"
usage 'the second alone' '--to is given without --from' $mesh --to "$work/a"
usage 'masses that differ' '3 to be moved, 1 at the target; make them equal, or scale the second one with --normalise' $mesh --from "$work/a" --to "$work/vertices"
printf 'vertex 99999999 3\n' > "$work/far"
usage 'a vertex that is not there' 'far:1: vertex 99999999 is out of range' $mesh --from "$work/far" --to "$work/b"
usage 'a negative mass' 'signed:71: the mass -1; expected a finite number from 0' $mesh --from "$work/signed" --to "$work/b"
printf 'vertex 5 2\n0.5,0.1,0.2 -3\n' > "$work/negative"
printf '0,0,1 1\nvertex 1 1\n1e308,0,0 1\n' > "$work/beyond"
usage 'a point out of reach' 'beyond:3: the point .* is too far from the mesh' $mesh --from "$work/beyond" --to "$work/b"
usage 'one of a point' 'negative:2: the mass -3; expected' $mesh --from "$work/a" --to "$work/negative"
check 'an array below 0' "$tool" transport $mesh --from "$work/n.vtp:distance" --to uniform --normalise
usage 'one of an array' 'n.vtp:u: number [0-9]+ is -' $mesh --from "$work/n.vtp:u" --to uniform
usage 'points to points' '--from .*set and --to .*set are points without a mass' $mesh --from "$work/set" --to "$work/set"
usage 'points to nothing' '--from .*set: points without a mass .* give --to FILE' $mesh --from "$work/set"
awk -v n="$n" 'BEGIN { for (i = 0; i < n; i++) print 0 }' > "$work/zeros"
usage 'no mass' '--to .*zeros has no mass' $mesh --from "$work/a" --to "$work/zeros"
fails 'no such device' 5 '`dmkcl devices` shows' "$tool" transport $mesh --from "$work/a" --to "$work/b" --device nothing
head -n 9 "$work/vertices" > "$work/few"
fails 'too few numbers' 3 'has 9 numbers; expected' "$tool" transport $mesh --from "$work/few" --to "$work/b"
printf 'vertex 1 2\nabc\n' > "$work/words"
fails 'words' 3 'words:2: expected' "$tool" transport $mesh --from "$work/words" --to "$work/b"
# A number that is left out is no number fewer.
for text in '0.5,,0.2,1' '0.5,0.1,0.2,' ',0.5,0.1,0.2' 'vertex 5,' 'vertex,,5,2' '0.5,0.1-0.2'; do
    echo "$text" > "$work/gaps"
    fails "a gap in $text" 3 'gaps:1: expected one number' "$tool" transport $mesh --from "$work/gaps" --to "$work/b"
done
printf 'vertex,5 , 2\r\n0.5 ,0.1,\t0.2 1\r\n' > "$work/commas"
check 'commas and blanks' "$tool" transport $mesh --from "$work/commas" --to "$work/b" --quiet
printf 'vertex 5 1\rvertex 6 1\r\rvertex 7 1 # more\r' > "$work/returns"
check 'lines that end in carriage returns' "$tool" transport $mesh --from "$work/returns" --to "$work/b" --quiet
printf 'vertex 5 1\rvertex x 1\r' > "$work/returns"
fails 'which count' 3 'returns:2: expected' "$tool" transport $mesh --from "$work/returns" --to "$work/b"
printf 'vertex 5 3\0vertex 6 1\n' > "$work/zero"
fails 'a byte 0' 3 'zero:1: a byte 0 is in the line' "$tool" transport $mesh --from "$work/zero" --to "$work/b"
printf 'vertex 1.5 2\n' > "$work/half"
fails 'half a vertex' 3 'half:1: expected' "$tool" transport $mesh --from "$work/half" --to "$work/b"
fails 'no file' 2 'none' "$tool" transport $mesh --from "$work/none" --to "$work/b"
fails 'a gap that is not reached' 9 'the gap is' \
    "$tool" transport $mesh --from "$work/a" --to "$work/b" --gap 1e-6 --quiet
tap_end
