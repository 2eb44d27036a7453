"""Random hostile meshes through all commands of the tool, with what must hold whatever the mesh is.
usage: hostile.py TOOL COUNT [--first N] [--seconds S] [--judge PROGRAM] [--keep FOLDER]
Mesh N is the same on every machine: closed or with borders, genus 0 to 20, stretched up to 1:1000, with needles,
hubs, noise, several components, and a source anywhere. Each command ends within S (20) seconds with a documented
exit code; what is refused is refused with a reason. Distances are finite where they must be, at most the edges'
apart, the same from both ends, the lengths of their paths, and with --judge (a program that prints the exact
distances of MESH from VERTEX, one a line) equal to its. A closed surface's cut locus has 2 genus loops, and cut
open it is a disk. Prints what fails, what was refused by exit code, and at last "# tried N: failed M"."""
import argparse
import heapq
import json
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time


# ---- meshes: (list of points, list of triangles) --------------------------------------------


def plate(chance):
    """A plate of cubes with holes: its surface, of as many handles."""
    genus = chance.choice((0, 0, 1, 1, 2, 3, 5, 8, 13, 20))
    wide = max(1, math.ceil(math.sqrt(genus)))
    high = max(1, math.ceil(genus / wide))
    cells = {(i, j) for i in range(2 * wide + 1) for j in range(2 * high + 1)}
    for hole in range(genus):
        cells.discard((2 * (hole % wide) + 1, 2 * (hole // wide) + 1))
    points, triangles = {}, []

    def quad(*corners):
        a, b, c, d = (points.setdefault(p, len(points)) for p in corners)
        triangles.extend([(a, b, c), (a, c, d)] if chance.random() < 0.5 else [(a, b, d), (b, c, d)])

    for i, j in sorted(cells):
        quad((i, j, 1), (i + 1, j, 1), (i + 1, j + 1, 1), (i, j + 1, 1))
        quad((i, j, 0), (i, j + 1, 0), (i + 1, j + 1, 0), (i + 1, j, 0))
        for di, dj, a, b in ((1, 0, (1, 0), (1, 1)), (-1, 0, (0, 1), (0, 0)), (0, 1, (1, 1), (0, 1)), (0, -1, (0, 0), (1, 0))):
            if (i + di, j + dj) not in cells:
                p, q = (i + a[0], j + a[1]), (i + b[0], j + b[1])
                quad((*p, 0), (*q, 0), (*q, 1), (*p, 1))
    return [list(map(float, p)) for p in points], triangles


def sphere(chance):
    """A globe of rings, the poles being hubs."""
    rings, around = chance.randint(1, 12), chance.randint(3, 24)
    points = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]
    for r in range(rings):
        t = math.pi * (r + 1) / (rings + 1)
        points += [[math.sin(t) * math.cos(2 * math.pi * k / around), math.sin(t) * math.sin(2 * math.pi * k / around),
                    math.cos(t)] for k in range(around)]
    at = lambda r, k: 2 + r * around + k % around
    triangles = [(0, at(0, k), at(0, k + 1)) for k in range(around)]
    triangles += [(1, at(rings - 1, k + 1), at(rings - 1, k)) for k in range(around)]
    for r in range(rings - 1):
        for k in range(around):
            triangles += [(at(r, k), at(r + 1, k), at(r + 1, k + 1)), (at(r, k), at(r + 1, k + 1), at(r, k + 1))]
    return points, triangles


def hub(chance):
    """Two cones of one rim: vertices of up to 800 triangles."""
    n = chance.choice((3, 4, 7, 30, 200, 800))
    height = chance.choice((0.01, 1, 1, 30))
    points = [[0.0, 0.0, height], [0.0, 0.0, -chance.choice((0.1, 1, 1))]]
    points += [[math.cos(2 * math.pi * k / n), math.sin(2 * math.pi * k / n), 0.0] for k in range(n)]
    triangles = [(0, 2 + k, 2 + (k + 1) % n) for k in range(n)]
    return points, triangles + [(1, 2 + (k + 1) % n, 2 + k) for k in range(n)]


def sheet(chance):
    """A grid, of a border; rolled up in two cases of three."""
    wide, high = chance.randint(1, 25), chance.randint(1, 25)
    roll = chance.choice((0, 0.6, 1.0))
    points = []
    for j in range(high + 1):
        for i in range(wide + 1):
            x, y = i / wide, j / high
            points.append([math.sin(2 * math.pi * roll * 0.95 * x), 1 - math.cos(2 * math.pi * roll * 0.95 * x), y]
                          if roll else [x, y, 0.1 * math.sin(3 * x) * y])
    triangles = []
    for j in range(high):
        for i in range(wide):
            a = j * (wide + 1) + i
            b, c, d = a + 1, a + wide + 2, a + wide + 1
            triangles += [(a, b, c), (a, c, d)] if chance.random() < 0.5 else [(a, b, d), (b, c, d)]
    return points, triangles


def split(points, triangles, a, b, share):
    """A new vertex on the edge a-b, at that share of it."""
    new = len(points)
    points.append([p + share * (q - p) for p, q in zip(points[a], points[b])])
    for t in list(triangles):
        if a in t and b in t:
            triangles.remove(t)
            triangles += [tuple(new if v == a else v for v in t), tuple(new if v == b else v for v in t)]


def refine(points, triangles):
    """Each triangle in four."""
    middle, finer = {}, []

    def mid(a, b):
        key = (min(a, b), max(a, b))
        if key not in middle:
            middle[key] = len(points)
            points.append([(p + q) / 2 for p, q in zip(points[a], points[b])])
        return middle[key]

    for a, b, c in triangles:
        d, e, f = mid(a, b), mid(b, c), mid(c, a)
        finer += [(a, d, f), (d, b, e), (f, e, c), (d, e, f)]
    return points, finer


def make(number):
    chance = random.Random(1000003 * number + 17)
    points, triangles = chance.choice((plate, plate, sphere, hub, sheet))(chance)
    kinds = chance.sample(("noise", "stretch", "needles", "holes", "parts", "fine"), chance.randint(0, 3))
    if "fine" in kinds and len(triangles) < 700:
        points, triangles = refine(points, triangles)
    if "needles" in kinds:
        share = chance.choice((0.3, 0.05, 1e-3, 1e-5))
        for _ in range(chance.randint(1, 20)):
            t = chance.choice(triangles)
            split(points, triangles, t[0], t[1], share)
    if "holes" in kinds and len(triangles) > 30:
        triangles = drop(chance, triangles, chance.randint(1, 3))
    if "noise" in kinds:
        size = chance.choice((0.01, 0.1, 0.3)) * shortest(points, triangles)
        points = [[x + chance.gauss(0, size) for x in p] for p in points]
    if "stretch" in kinds:
        axis, factor = chance.randrange(3), chance.choice((3, 30, 1000)) ** chance.choice((1, -1))
        points = [[x * (factor if k == axis else 1) for k, x in enumerate(p)] for p in points]
    if "parts" in kinds:
        more, others = sphere(chance)
        triangles = triangles + [tuple(v + len(points) for v in t) for t in others]
        points = points + [[p[0] + 1e4, p[1], p[2]] for p in more]
    used = sorted({v for t in triangles for v in t})
    return points, triangles, chance.choice(used), chance.choice(used)


def drop(chance, triangles, count):
    """Without some triangles, each with its vertices in no other one that goes: holes apart from each other."""
    gone, taken = set(), set()
    for t in chance.sample(triangles, min(20, len(triangles))):
        near = {v for u in triangles if set(u) & set(t) for v in u}
        if len(gone) < count and not near & taken:
            gone.add(t)
            taken |= near
    return [t for t in triangles if t not in gone]


def shortest(points, triangles):
    return min(math.dist(points[t[i]], points[t[i - 1]]) for t in triangles for i in range(3))


# ---- what must hold -------------------------------------------------------------------------


def topology(triangles):
    """(component of each vertex, {component: Euler characteristic}, {component: has a border})"""
    parent = {v: v for t in triangles for v in t}

    def root(v):
        while parent[v] != v:
            parent[v] = parent[parent[v]]
            v = parent[v]
        return v

    for a, b, c in triangles:
        parent[root(a)] = root(b)
        parent[root(c)] = root(b)
    component = {v: root(v) for v in parent}
    edges = {}
    for t in triangles:
        for i in range(3):
            key = tuple(sorted((t[i], t[i - 1])))
            edges[key] = edges.get(key, 0) + 1
    euler, border = {}, {}
    for v in component.values():
        euler[v] = euler.get(v, 0) + 1
    for (a, _), n in edges.items():
        euler[component[a]] -= 1
        border[component[a]] = border.get(component[a], False) or n == 1
    for t in triangles:
        euler[component[t[0]]] += 1
    return component, euler, border, edges


def read_ply(path):
    """{property of the vertices: list}, of a file of results, which is text"""
    lines = open(path).read().split("\n")
    end, n, names = lines.index("end_header"), 0, []
    for line in lines[:end]:
        words = line.split()
        if words[:2] == ["element", "vertex"]:
            n = int(words[2])
        elif words[:1] == ["element"]:
            break
        elif words[:1] == ["property"]:
            names.append(words[2])
    rows = [line.split() for line in lines[end + 1 : end + 1 + n]]
    return {name: [float(r[k]) for r in rows] for k, name in enumerate(names)}


def dijkstra(points, edges, source):
    """Along the edges: an upper bound."""
    near = {}
    for a, b in edges:
        near.setdefault(a, []).append(b)
        near.setdefault(b, []).append(a)
    best, queue = {source: 0.0}, [(0.0, source)]
    while queue:
        d, v = heapq.heappop(queue)
        if d > best[v]:
            continue
        for w in near[v]:
            e = d + math.dist(points[v], points[w])
            if e < best.get(w, math.inf):
                best[w] = e
                heapq.heappush(queue, (e, w))
    return best


class Trial:
    DOCUMENTED = {0, 4, 6, 7}

    def __init__(self, arguments, work, number):
        self.arguments, self.work, self.number = arguments, work, number
        self.points, self.triangles, self.source, self.end = make(number)
        self.component, self.euler, self.border, self.edges = topology(self.triangles)
        self.mesh = f"{work}/mesh.off"
        with open(self.mesh, "w") as file:
            file.write(f"OFF\n{len(self.points)} {len(self.triangles)} 0\n")
            file.writelines(" ".join(map(repr, p)) + "\n" for p in self.points)
            file.writelines("3 %d %d %d\n" % t for t in self.triangles)
        self.wrong, self.codes, self.judged = [], {}, False

    def run(self, name, *options):
        """Whether the command succeeded."""
        begin = time.monotonic()
        limit = self.arguments.seconds * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
        try:
            done = subprocess.run([self.arguments.tool, name, self.mesh, *map(str, options)], stdin=subprocess.DEVNULL,
                                  capture_output=True, timeout=3 * limit, check=False)
        except subprocess.TimeoutExpired:
            self.wrong.append(f"{name}: goes on after {3 * limit:.0f} s")
            return False
        took, text = time.monotonic() - begin, done.stderr.decode(errors="replace").strip()
        self.codes[name] = done.returncode
        if took > limit:
            self.wrong.append(f"{name}: {took:.0f} s")
        if done.returncode not in self.DOCUMENTED:
            self.wrong.append(f"{name}: exit {done.returncode}: {text[-300:]}")
        elif done.returncode != 0 and len(text) < 20:
            self.wrong.append(f"{name}: exit {done.returncode} without a reason: {text}")
        return done.returncode == 0

    def check(self, good, what):
        if not good:
            self.wrong.append(what)

    def distances(self, source, name="distance", file="d.ply"):
        return read_ply(f"{self.work}/{file}")["distance"] if self.run(
            name, "--vertex", source, "--out", f"{self.work}/{file}") else None

    def check_distances(self, d, source, what):
        home, upper = self.component[source], dijkstra(self.points, self.edges, source)
        size = max((upper[v] for v in upper), default=1)
        for v, c in self.component.items():
            if c != home:
                self.check(d[v] == math.inf, f"{what}: {d[v]} on another component")
                continue
            straight = math.dist(self.points[v], self.points[source])
            if not straight * (1 - 1e-9) - 1e-12 * size <= d[v] <= upper[v] * (1 + 1e-9) + 1e-12 * size:
                self.wrong.append(f"{what}: vertex {v} at {d[v]}, between {straight} and {upper[v]}")
                return
        for a, b in self.edges:
            if self.component[a] == home and abs(d[a] - d[b]) > math.dist(self.points[a], self.points[b]) * (1 + 1e-9) + 1e-12 * size:
                self.wrong.append(f"{what}: edge {a}-{b} has {d[a]} and {d[b]}, length {math.dist(self.points[a], self.points[b])}")
                return

    def all(self):
        s, e, w = self.source, self.end, self.work
        home = self.component[s]
        d = self.distances(s)
        if not self.codes.get("distance") == 0:
            return  # refused as a mesh, with a reason; or wrong already
        size = max(x for x in d if math.isfinite(x))
        near = lambda a, b: abs(a - b) <= 1e-9 * max(size, abs(a))
        self.check_distances(d, s, "distance")
        back = self.distances(e, file="b.ply")
        if back:
            self.check(back[s] == d[e] or near(back[s], d[e]), f"distance {s}-{e}: {d[e]} there, {back[s]} back")
        if self.arguments.judge:
            judged = subprocess.run([self.arguments.judge, self.mesh, str(s)], capture_output=True, text=True, check=False)
            exact = [float(x) for x in judged.stdout.split()]
            self.judged = judged.returncode == 0 and len(exact) == len(d)
            if self.judged:
                worst = max((abs(a - b) for a, b, v in zip(d, exact, range(len(d))) if self.component.get(v) == home), default=0)
                self.check(worst <= 1e-9 * size, f"distance: {worst / size:.2g} of the judge's")
        if self.component[e] == home and e != s:
            if self.run("path", "--vertex", s, "--to-vertex", e, "--out", f"{w}/p.csv"):
                rows = [line.split(",") for line in open(f"{w}/p.csv")]
                at = {name.strip(): k for k, name in enumerate(rows[0])}
                line = [[float(r[at[k]]) for k in "xyz"] for r in rows[1:]]
                length = sum(math.dist(a, b) for a, b in zip(line, line[1:]))
                self.check(near(length, d[e]), f"path: length {length}, distance {d[e]}")
        if self.run("solve", "--vertex", s, "--quiet", "--out", f"{w}/s.ply", "--report", f"{w}/r.json"):
            solved, report = read_ply(f"{w}/s.ply"), json.load(open(f"{w}/r.json"))
            self.check(all(x >= 0 for x in solved["distance"]), "solve: a negative distance, or none")
            self.check(all(near(a, b) or a == b for a, b in zip(solved["distance"], d)), "solve: other distances")
            self.check(report["gap"] is None or report["gap"] >= 0, "solve: a negative gap")
            self.check(report["cost_lower"] is not None and report["cost_lower"] <= report["cost_upper"], "solve: the costs")
            if not self.border.get(home):
                self.check(report["locus"]["loops"] == 2 - self.euler[home],
                           f"locus: {report['locus']['loops']} loops, genus {(2 - self.euler[home]) // 2}")
                self.check(report["locus"]["components"] == 1, f"locus: {report['locus']['components']} pieces")
        if self.run("cut", "--vertex", s, "--quiet", "--out", f"{w}/c.off"):
            info = subprocess.run([self.arguments.tool, "info", "--json", f"{w}/c.off"], capture_output=True, check=False)
            m = json.loads(info.stdout) if info.returncode == 0 else {}
            self.check(m.get("euler") == 1 and m.get("n_border_loops") == 1 and m.get("n_components") == 1,
                       f"cut: no disk: {info.stderr.decode()[-200:]} {m.get('euler')} {m.get('n_border_loops')}")
        if self.component[e] == home and e != s:
            with open(f"{w}/m.txt", "w") as file:
                file.write(f"vertex {s} 1\n")
            with open(f"{w}/n.txt", "w") as file:
                file.write(f"vertex {e} 1\n")
            if self.run("transport", "--from", f"{w}/m.txt", "--to", f"{w}/n.txt", "--quiet", "--report", f"{w}/t.json"):
                t = json.load(open(f"{w}/t.json"))
                lower, upper = t.get("cost_lower"), t.get("cost_upper")
                # Of the discrete problem, which on a coarse mesh is far from the distance, W1 of two points.
                self.check(lower is not None and upper is not None and 0 <= lower <= upper, f"transport: {lower} to {upper}")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("tool", type=os.path.abspath)
    parser.add_argument("count", type=int)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--judge")
    parser.add_argument("--keep")
    arguments = parser.parse_args()
    failed, judged, codes = 0, 0, {}
    for number in range(arguments.first, arguments.first + arguments.count):
        work = tempfile.mkdtemp()
        trial = Trial(arguments, work, number)
        try:
            trial.all()
        except (ValueError, KeyError, OSError, IndexError) as error:
            trial.wrong.append(f"{type(error).__name__}: {error}")
        for name, code in trial.codes.items():
            codes[name, code] = codes.get((name, code), 0) + 1
        judged += trial.judged
        if trial.wrong:
            failed += 1
            print(f"FAILED: mesh {number}, {len(trial.triangles)} triangles, source {trial.source}: "
                  + "; ".join(trial.wrong[:4]), flush=True)
            if arguments.keep:
                os.makedirs(arguments.keep, exist_ok=True)
                shutil.copy(trial.mesh, f"{arguments.keep}/hostile-{number}.off")
        shutil.rmtree(work)
    if arguments.judge:
        print(f"distances compared with the judge's on {judged} meshes")
    print("exit codes: " + ", ".join(f"{name} {code}: {n}" for (name, code), n in sorted(codes.items())))
    print(f"# tried {arguments.count}: failed {failed}")
    return failed > 0


if __name__ == "__main__":
    sys.exit(main())
