# What the tool tells in figures is what there is: report, tangent cut locus, exit codes of many sources, and what a
# resumed run does again. Times and memory within bounds that a wrong unit or place would break.
. tests/tap.sh

mesh=$work/torus.off
"$tool" mesh torus --triangles 1500 --quiet --out "$mesh"

# The mesh comes through a pipe, half a second late: reading takes that long, and nothing else does.
mkfifo "$work/slow.off"
(sleep 0.6; cat "$mesh" > "$work/slow.off") &
"$tool" solve "$work/slow.off" --vertex 0 --quiet --locus "$work/l.csv" --tangent "$work/t.csv" --out "$work/o.vtp" \
    --report "$work/r.json"
check 'a run with all its files' test $? -eq 0
wait
"$tool" info --json "$mesh" > "$work/info.json"
cat > "$work/look.py" << 'EOF'
import csv, json, math, resource, subprocess, sys
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
    for stage in ("setup", "start", "solve", "certify", "locus", "write"):
        assert 0 < s[stage] < s["total"], (stage, s)
    assert s["total"] >= max(s["read"], s["device"]) and s["setup"] != s["read"] != s["device"]
    parts = s["setup"] + s["start"] + s["solve"] + s["certify"] + s["locus"] + s["write"]
    assert parts <= s["total"] - s["read"] + 1e-3, s      # they follow the reading
    assert max(s["read"], s["device"]) + parts >= 0.5 * s["total"], s
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
check 'the memory' look memory
check 'the cut locus in the report' look locus
check 'the tangent cut locus' look tangent

# ---- many sources: the exit code of the first failure -----------------------------------------

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
tap_end
