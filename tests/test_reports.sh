# The figures that the tool prints are what there is: report, tangent cut locus, exit codes of many sources, and what a
# resumed run does again. Times and memory within bounds that a wrong unit or place would break.
. tests/tap.sh

mesh=$work/torus.off
"$tool" mesh torus --triangles 1500 --quiet --out "$mesh"

# The mesh comes through a pipe, half a second late: reading takes that long, and nothing else does.
mkfifo "$work/slow.off"
(sleep 0.6; cat "$mesh" > "$work/slow.off") &
"$tool" solve "$work/slow.off" --vertex 0 --locus "$work/l.csv" --tangent "$work/t.csv" --out "$work/o.vtp" \
    --report "$work/r.json" > "$work/summary"
check 'a run with all its files' test $? -eq 0
wait
"$tool" info --json "$mesh" > "$work/info.json"
cat > "$work/look.py" << 'EOF'
import csv, json, math, re, resource, subprocess, sys
tool, mesh, work, what = sys.argv[1:]
r, info = json.load(open(work + "/r.json")), json.load(open(work + "/info.json"))
s = r["seconds"]
lines = [l.split() for l in open(mesh)]
nv, nt = int(lines[1][0]), int(lines[1][1])
xyz = [tuple(map(float, l)) for l in lines[2:2 + nv]]
tri = [tuple(map(int, l[1:4])) for l in lines[2 + nv:2 + nv + nt]]
dist = math.dist
def area(t):
    a, b, c = (dist(xyz[t[i]], xyz[t[(i + 1) % 3]]) for i in range(3))
    h = (a + b + c) / 2
    return math.sqrt(h * (h - a) * (h - b) * (h - c))
edges = {tuple(sorted((t[i], t[(i + 1) % 3]))) for t in tri for i in range(3)}
lengths = [dist(xyz[a], xyz[b]) for a, b in edges]
near = lambda a, b, e=1e-12: abs(a - b) <= e * max(abs(a), abs(b))
def mesh_figures():
    m = r["mesh"]
    assert m["n_vertices"] == nv and m["n_triangles"] == nt and m["n_edges"] == len(edges)
    assert m["euler"] == r["euler"] == nv - len(edges) + nt and m["n_components"] == 1
    assert m["n_border_edges"] == m["n_border_loops"] == m["n_unused_vertices"] == 0
    assert near(m["area"], sum(map(area, tri)), 1e-10) and near(r["area"], m["area"], 1e-10)
    assert near(m["min_edge"], min(lengths)) and near(m["max_edge"], max(lengths))
    assert near(m["mean_edge"], sum(lengths) / len(lengths), 1e-10)
    assert m["box_min"] == [min(x[k] for x in xyz) for k in range(3)]
    assert m["box_max"] == [max(x[k] for x in xyz) for k in range(3)]
    assert 0 < m["min_angle"] <= 60 <= m["max_angle"] < 180
    assert min(info["memory"]["host"], info["memory"]["device"]) > 100 * nt
    assert {k: v for k, v in m.items() if k != "file"} == {k: v for k, v in info.items() if k not in ("file", "memory")}
    assert all(near(a, b, 1e-14) for a, b in zip(r["source"]["xyz"], xyz[0]))
def costs():
    assert near(r["gap"], (r["cost_upper"] - r["cost_lower"]) / r["cost_upper"], 1e-6), r["gap"]
    assert 0 <= r["gap"] < 1e-2 and r["cost_lower"] <= r["cost_upper"]
    assert r["steps"] >= 1 and r["cg_iterations"] >= r["steps"] and r["v_cycles"] >= r["steps"] and r["levels"] >= 2
    assert 0 < r["change"] < 1 and r["precision"] in ("double", "single")
def times():
    assert s["read"] >= 0.4, s          # the pipe
    for stage in ("setup", "distance", "start", "solve", "certify", "locus", "write"):
        assert 0 < s[stage] < s["total"], (stage, s)
    assert s["total"] >= max(s["read"], s["device"]) and s["setup"] != s["read"] != s["device"]
    parts = s["setup"] + s["distance"] + s["start"] + s["solve"] + s["certify"] + s["locus"] + s["write"]
    assert parts <= s["total"] - s["read"] + 1e-3, s      # they follow the reading
    assert max(s["read"], s["device"]) + parts >= 0.5 * s["total"], s
def summary():
    text, l = " ".join(open(work + "/summary").read().split()), r["locus"]
    number = lambda n, word: f"{n:,} {word}" + ("" if n == 1 else "s")
    for part in (f"mesh {r['mesh']['file']}: {number(nv, 'vertice')}, {number(nt, 'triangle')}, closed, genus 1 ",
                 f"vertex 0 device {r['device']['name']} ",
                 f"solved in {number(r['steps'], 'step')} with {number(r['cg_iterations'], 'CG iteration')}, {r['precision']}",
                 f"cost between {r['cost_lower']:.8g} and {r['cost_upper']:.8g} (gap {100 * r['gap']:.2g} %), of the",
                 f"cut locus length {l['length']:.6g} in {number(l['components'], 'piece')}, {number(l['loops'], 'loop')}, "
                 f"{number(l['endpoints'], 'end')}, {number(l['branch_points'], 'branch point')} time",
                 f"wrote {work}/r.json: report"):
        assert part in text, (part, text)
    times = dict(re.findall(r"(\w+) ([.0-9]+)[,;]", text[text.index("s: read"):]))
    for stage in ("read", "device", "setup", "distance", "start", "solve", "certify", "locus", "write"):
        assert abs(float(times[stage]) - s[stage]) < 0.00501, (stage, times, s)
    assert abs(float(re.search(r"time ([.0-9]+) s", text).group(1)) - s["total"]) < 0.05 + 0.2 * s["total"], (text, s)
def memory():
    p = subprocess.run([tool, "solve", mesh, "--vertex", "0", "--json"], stdout=subprocess.PIPE, check=True)
    kernel = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
    assert 0.5 * kernel < json.loads(p.stdout)["peak_memory"] < 1.5 * kernel, (p.stdout, kernel)
def tangent():
    turn = 2 * math.pi
    vertices, rows = list(csv.DictReader(open(work + "/l.csv"))), list(csv.DictReader(open(work + "/t.csv")))
    assert len(rows) == 2 * len(vertices) > 20
    angles = [float(q["angle"]) for q in rows]
    assert angles == sorted(angles) and 0 <= angles[0] and angles[-1] < turn
    wanted = sorted((float(v[a]) % turn, float(v["distance"]), float(v["x"]), float(v["y"]), float(v["z"]), v["kind"])
                    for v in vertices for a in ("angle0", "angle1"))
    found = sorted((float(q["angle"]), float(q["time"]), float(q["x"]), float(q["y"]), float(q["z"]), q["kind"])
                   for q in rows)
    for a, b in zip(wanted, found):
        assert a[5] == b[5] and all(near(x, y, 1e-13) or abs(x - y) < 1e-13 for x, y in zip(a[:5], b[:5])), (a, b)
    # An ordinary point has two geodesics, in two directions.
    assert sum(abs(float(v["angle0"]) - float(v["angle1"])) > 1e-3 for v in vertices) > len(vertices) / 2
def locus():
    vertices = list(csv.DictReader(open(work + "/l.csv")))
    l = r["locus"]
    assert l["n_vertices"] == len(vertices) and l["loops"] == l["n_edges"] - l["n_vertices"] + l["components"] == 2
    assert l["endpoints"] == sum(v["kind"] == "1" for v in vertices)
    assert l["branch_points"] == sum(v["kind"] == "2" for v in vertices)
    assert all(float(v["mu"]) >= 0 and float(v["distance"]) > 0 for v in vertices)
globals()[what]()
EOF
look() { python3 "$work/look.py" "$PWD/$tool" "$mesh" "$work" "$1"; }
check 'the mesh in the report' look mesh_figures
check 'costs and gap' look costs
check 'the seconds of each stage' look times
check 'the summary says the same' look summary
check 'the memory' look memory
check 'the cut locus in the report' look locus
check 'the tangent cut locus' look tangent

# ---- distances: two unit squares side by side, and a vertex in no triangle ---------------------

squares=$work/squares.off
awk 'BEGIN { n = 20; m = (n + 1)^2; print "OFF"; print 2 * m + 1, 4 * n * n, 0
    for (s = 0; s < 2; s++) for (j = 0; j <= n; j++) for (i = 0; i <= n; i++) print i / n + 3 * s, j / n, 0
    print 0, 0, 9
    for (s = 0; s < 2; s++) for (j = 0; j < n; j++) for (i = 0; i < n; i++) { a = s * m + j * (n + 1) + i
        print 3, a, a + 1, a + n + 2; print 3, a, a + n + 2, a + n + 1 } }' > "$squares"
cat > "$work/distance.py" << 'EOF'
import json, math, sys
r, n_sources, border, n_reached, farthest, integral = json.load(open(sys.argv[1])), *map(eval, sys.argv[2:])
assert r["n_sources"] == n_sources and r["border"] is border and r["n_reached"] == n_reached, r
assert abs(r["farthest"] - farthest) < 1e-12 and r["error"] == 0 and r["windows"] > r["n_reached"], r
assert abs(r["integral"] - integral) < 3 * r["integral_error"] < 0.02 * integral, (r, integral)
m, s = r["mesh"], r["seconds"]
assert m["n_vertices"] == 883 and m["n_triangles"] == 1600 and m["n_unused_vertices"] == 1, m
assert m["file"].endswith("squares.off") and r["out"] == [m["file"][:-11] + "a.ply"], r
assert 0 < s["read"] and 0 < s["distance"] and 0 < s["write"] <= s["total"] < 20 and 1e6 < r["peak_memory"] < 1e9, r
assert s["read"] + s["distance"] + s["write"] <= s["total"] + 1e-6, s
EOF
from() { # N_SOURCES BORDER N_REACHED FARTHEST INTEGRAL OPTION...: the report of `distance`
    local expected=("${@:1:5}")
    "$tool" distance "$squares" "${@:6}" --quiet --out "$work/a.ply" --report "$work/d.json" &&
        python3 "$work/distance.py" "$work/d.json" "${expected[@]}"
}
printf 'vertex 0\n3,0,0\n' > "$work/corners.txt"
corner='(math.sqrt(2) + math.log(1 + math.sqrt(2))) / 3' # the mean distance from a corner of the unit square
check 'distance from one corner' from 1 False 441 'math.sqrt(2)' "$corner" --vertex 0
check 'from a corner of each' from 2 False 882 'math.sqrt(2)' "2 * $corner" --sources "$work/corners.txt"
check 'from the border' from 0 True 882 0.5 1/3 --border
check 'from both' from 2 True 882 0.5 1/3 --sources "$work/corners.txt" --border
# prints EXPECTED COMMAND...: these lines, but for the one of times and memory.
prints() {
    "${@:2}" 2> "$work/err" | grep -v '^time' > "$work/lines"
    printf "$1" | cmp - "$work/lines" || { cat "$work/lines"; return 1; }
}
on="mesh       $squares: 883 vertices, 1,600 triangles\n"
check 'a summary of one corner' prints "${on}sources    1 point\ndistance   farthest 1.414213562, exact\n           441 vertices lie on \
components without a source\n" "$tool" distance "$squares" --vertex 0
check 'a summary of both and the border' prints "${on}sources    2 points and the border\ndistance   farthest 0.5, exact\n" \
    "$tool" distance "$squares" --sources "$work/corners.txt" --border
check 'a summary of the border' prints "${on}sources    the border\ndistance   farthest 0.5, exact\n" \
    "$tool" distance "$squares" --border
check 'a closed mesh has none' sh -c '"$1" distance meshes/sphere.off --vertex 0 --border --report "$2/closed.json" \
    > "$2/printed" 2> "$2/err" && grep -q "^sources    1 point$" "$2/printed" &&
    grep -q "warning: meshes/sphere.off is closed" "$2/err" && grep -q "\"border\": false" "$2/closed.json"' - "$tool" "$work"
fails 'and no source without it' 1 'no source: the mesh is closed and has no border' \
    "$tool" distance meshes/sphere.off --border

# ---- many sources: the line of each, the exit code of the first failure ------------------------

many() { # LIST OPTION...
    printf "$1" > "$work/list.txt"
    shift
    "$tool" solve "$mesh" --sources "$work/list.txt" --quiet "$@" 2> "$work/err"
}
code() { # CODE LIST OPTION...
    local code=$1 status
    shift
    many "$@"
    status=$?
    test $status -eq "$code" || { echo "status $status"; cat "$work/err"; return 1; }
}
mkdir "$work/lines.d"
printf 'vertex 0\n1,2,3\n' > "$work/list.txt"
"$tool" solve "$mesh" --sources "$work/list.txt" --report "$work/lines.d/r.json" --locus "$work/lines.d/l.obj" > "$work/lines"
cat > "$work/lines.py" << 'EOF'
import json, math, re, sys
work = sys.argv[1]
lines = [l for l in open(work + "/lines") if re.match(r"\d{4}  ", l)]
assert len(lines) == 2, lines
for k, line in enumerate(lines):
    r = json.load(open(f"{work}/lines.d/r-{k:04}.json"))
    l, at = r["locus"], r["source"]["xyz"]
    point = re.search(r"\((.*?)\)", line).group(1).replace(",", " ").split()
    assert all(abs(float(a) - b) < 1e-4 for a, b in zip(point, at)), (line, at)
    away = re.search(r", ([-+.0-9e]+) from the point asked for", line)
    assert bool(away) == (k == 1) and (not away or abs(float(away.group(1)) / math.dist(at, (1, 2, 3)) - 1) < 0.05), line
    for text in (f"{r['steps']} steps", f"cost {r['cost_upper']:.8g}", f"gap {100 * r['gap']:.2g} %",
                 f"cut locus {l['length']:.6g}", f"loops {l['loops']}", f"ends {l['endpoints']}",
                 f"branch points {l['branch_points']}"):
        assert f" {text}," in line, (text, line)
    assert float(re.search(r"([.0-9]+) s$", line).group(1)) <= 30, line
EOF
check 'the line of each source is its report' python3 "$work/lines.py" "$work"
few='--method euler --max-steps 1'
check 'no source that fails' code 0 'vertex 0\nvertex 5\n'
check 'the code of a bad source first' code 1 'vertex 99999999\nvertex 0\n' $few
check 'the code of too few steps first' code 7 'vertex 0\nvertex 99999999\n' $few
check 'a failure in the middle is the code' code 1 'vertex 0\nvertex 99999999\nvertex 5\n'

# ---- resuming: what lacks one of its files is done again, whichever it is ----------------------

outs="--out $work/m/a.vtp --locus $work/m/b.obj --tangent $work/m/c.csv --report $work/m/d.json"
again() { # FILE that is missing: just its source is done
    rm "$work/m/$1"
    many 'vertex 0\nvertex 5\nvertex 9\n' $outs --resume || return
    test -e "$work/m/$1" || return
    test "$(find "$work/m" -newer "$work/stamp" | grep -c .)" -ge 4
}
mkdir "$work/m"
check 'three sources' many 'vertex 0\nvertex 5\nvertex 9\n' $outs
for file in a-0001.vtp b-0000.obj c-0002.csv d-0001.json; do
    sleep 0.02
    touch "$work/stamp"
    check "resuming without $file" again $file
    number=${file#?-}
    check "does only its source" sh -c '! find "$1" -type f -newer "$2" | grep -v -e "-$3\."' - "$work/m" "$work/stamp" \
        "${number%.*}"
done

# The table of src/io/FORMATS.md has each name of each report, and no command that does not write it.
r=$work/reports
mkdir "$r"
echo '3,0,0 1' > "$work/here.txt"
"$tool" solve "$mesh" --vertex 0 --json > "$r/solve.json"
"$tool" solve "$mesh" --vertex 0 --dry-run --json > "$r/dry.json"
"$tool" batch "$mesh" --json > "$r/batch.json"
"$tool" cut "$mesh" --vertex 0 --json > "$r/cut.json"
"$tool" path "$mesh" --vertex 0 --to-vertex 40 --json > "$r/path.json"
"$tool" distance "$mesh" --vertex 0 --json > "$r/distance.json"
"$tool" distance "$mesh" --vertex 0 --locus "$work/lines.csv" --json > "$r/distance-locus.json"
"$tool" transport "$mesh" --from "$work/here.txt" --to uniform --normalise --json > "$r/transport.json"
"$tool" info "$mesh" --json > "$r/info.json"
"$tool" devices --json > "$r/devices.json"
check 'FORMATS.md knows the names of all reports' python3 -c '
import json, re, sys
rows = re.findall(r"(?m)^\| (`[^|]*`) \| ([^|]*) \| ", open("src/io/FORMATS.md").read().split("## What a report holds")[1].split("\n## ")[0])
wide = {"batch": "solve", "dry": "solve --dry-run", "distance-locus": "distance --locus"}
kinds = "solve batch cut path distance distance-locus transport info devices dry".split()
names = {kind: set() for kind in kinds}
for kind in kinds:
    for cells, only in rows:
        said, not_in = re.findall("`(.*?)`", only), only.startswith("all but")
        ways = {kind, wide.get(kind, kind)} | ({"distance"} if kind == "distance-locus" else set())
        if not_in == (not ways & set(said)):
            names[kind].update(re.findall("`(.*?)`", cells))
for kind in kinds:
    written = set(json.load(open(f"{sys.argv[1]}/{kind}.json")))
    if kind == "info":
        written -= set(json.load(open(sys.argv[1] + "/solve.json"))["mesh"])
    if kind == "batch":
        written -= {"name", "number", "wanted", "digest", "options", "state"}
    if kind == "dry":
        assert written == {"dmkcl", "mesh", "euler", "source", "peak_memory", "memory"}, written
        continue
    said = names[kind] - {"ranks"} # of mpirun alone
    assert written == said, (kind, written ^ said)' "$r"
tap_end
