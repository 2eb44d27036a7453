#!/usr/bin/env python3
"""How near the computed cut loci lie to the exact ones: a table of errors and rates.

usage: accuracy.py [--program DMKCL] [--sizes 5,20,80,320] [--surfaces torus,...] [--meshes plain,...]
                   [--rivals] [--out FILE.csv]
    accuracy.py --surfaces torus --rivals --out bench/results/accuracy.csv
The rows of other surfaces in FILE.csv stay; beside it comes FILE.md, the same as tables.
Surfaces: torus (exact locus in closed form), ellipsoid and quartic (bench/data: cut times by Newton's
method on geodesics shot from the source on the smooth surface, ends by the conjugate time), umbilic
(the ellipsoid from an umbilic: the locus is the opposite point).
Meshes: plain (dmkcl mesh), jittered (its points moved by about a tenth of an edge, on the surface),
aligned (torus only: a grid whose lines hold the locus), rough and noisy (its points moved off the
surface, by 2 % and 5 % of an edge in each direction). All lengths in units of h, the mean edge length:
  false    share of the output's length farther than 3 h from the exact locus
  missed   share of the exact length with no output within 3 h
  out, ref mean distance from the output to the exact locus and back; max: the largest of both
  tip      largest distance of an end from the exact end nearest to it
  length   relative error of the total length
and loops, components, ends, branches (ends and branch points nearer than 3 h counted once).
--rivals adds the triangles with mu <= 1e-4, the paper's choice, and <= 1e-2, and, with pygeodesic, the edges across which the gradient of
the exact distance on the polyhedron turns by more than 0.3 and 0.5 radians. Needs numpy and scipy.
"""
import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

HERE = os.path.dirname(os.path.abspath(__file__))
NOISE = {"rough": 0.02, "noisy": 0.05}  # of a mean edge
SURFACES = {  # name of dmkcl mesh, source, refinements for about 5k, 20k, 80k, 320k triangles
    "torus": ("torus", (3, 0, 0), {5: 0, 20: 1, 80: 2, 320: 3}),
    "ellipsoid": ("ellipsoid", (-0.151128, -0.350718, 0.295520), {5: 1, 20: 2, 80: 3, 320: 4}),
    "umbilic": ("ellipsoid", (-(1 / 75) ** 0.5, 0, (2 / 3) ** 0.5), {5: 1, 20: 2, 80: 3, 320: 4}),
    "quartic": ("quartic", (0.533843, 0.800764, 0.844080), {5: 0, 20: 1, 80: 2, 320: 3}),
}


def torus_lines():
    tip = np.pi / np.sqrt(3)

    def arc(radius, low, high):
        a = np.linspace(low, high, 2001)
        return np.c_[radius * np.cos(a), radius * np.sin(a), 0 * a]

    b = np.linspace(0, 2 * np.pi, 2001)
    return [arc(1, 0, 2 * np.pi), arc(3, tip, 2 * np.pi - tip),
            np.c_[-2 - np.cos(b), 0 * b, np.sin(b)]]


def exact_lines(name):
    if name == "torus":
        return torus_lines()
    if name == "umbilic":
        return []
    rows = list(csv.DictReader(open(f"{HERE}/data/{name}_cut.csv")))
    x = np.array([[float(r[k]) for k in "xyz"] for r in rows])
    edge = np.array([int(r["edge"]) for r in rows])
    return [refined(name, x[edge == k]) for k in np.unique(edge)]


def refined(name, line):
    """The chords between the given points leave the curve by up to 1e-3: a spline, on the surface."""
    line = line[np.r_[True, np.linalg.norm(np.diff(line, axis=0), axis=1) > 1e-9]]
    s = np.r_[0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]
    t = np.interp(np.arange(0, len(s) - 1 + 1 / 16, 1 / 8), np.arange(len(s)), s)
    return on_surface(name, CubicSpline(s, line)(t))


def exact_ends(lines):
    """Ends of lines that are no other line's end."""
    ends = np.array([line[i] for line in lines for i in (0, -1)])
    near = cKDTree(ends).query_ball_point(ends, 1e-5)
    return np.array([e for e, n in zip(ends, near) if len(n) == 1])


# ---- measures -------------------------------------------------------------------------------------


def sample(lines, step):
    """Points along the lines, their weights, and the segment (a, b) each lies on."""
    p = np.vstack([line[:-1] for line in lines])
    q = np.vstack([line[1:] for line in lines])
    length = np.linalg.norm(q - p, axis=1)
    n = np.maximum(1, np.ceil(length / step)).astype(int)
    k = np.repeat(np.arange(len(n)), n)
    s = (np.arange(len(k)) - np.repeat(np.cumsum(n) - n, n) + 0.5) / n[k]
    return p[k] + s[:, None] * (q - p)[k], (length / n)[k], p[k], q[k]


def distances(points, target):
    """Distance to the nearest of the target's segments, found among those of its nearest samples."""
    _, near = cKDTree(target[0]).query(points, k=min(4, len(target[0])))
    best = np.full(len(points), np.inf)
    for k in near.reshape(len(points), -1).T:
        a, b = target[2][k], target[3][k]
        d = b - a
        t = ((points - a) * d).sum(1) / np.maximum((d * d).sum(1), 1e-300)
        foot = a + np.clip(t, 0, 1)[:, None] * d
        best = np.minimum(best, np.linalg.norm(points - foot, axis=1))
    return best


def groups(points, radius):
    if len(points) < 2:
        return len(points)
    return len(set(fcluster(linkage(points, "single"), radius, "distance")))


def read_obj(path):
    x, lines = [], []
    for text in open(path):
        t = text.split()
        if t and t[0] == "v":
            x.append([float(v) for v in t[1:4]])
        elif t and t[0] == "l":
            lines.append([int(v) - 1 for v in t[1:]])
    return np.array(x).reshape(-1, 3), lines


def score(name, locus, h):
    x, lines = read_obj(locus)
    if name == "umbilic":
        opposite = -np.array(SURFACES[name][1])
        far = np.linalg.norm(x - opposite, axis=1).max() / h if len(x) else np.inf
        return dict(max=far, points=len(x), lines=len(lines))
    if not lines:  # one point, or nothing that strong
        return {**dict.fromkeys(("out", "ref", "max", "tip"), np.inf), "false": 0.0, "missed": 1.0,
                "length": -1.0, "ends": 0, "branches": 0}
    degree = np.bincount([v for l in lines for e in zip(l, l[1:]) for v in e], minlength=len(x))
    exact = exact_lines(name)
    out, ref = sample([x[l] for l in lines], h / 4), sample(exact, h / 4)
    d_out, d_ref = distances(out[0], ref) / h, distances(ref[0], out) / h
    ends = x[degree == 1]
    tip = cKDTree(exact_ends(exact)).query(ends)[0].max() / h if len(ends) else np.inf
    return {"false": out[1][d_out > 3].sum() / out[1].sum(),
            "missed": ref[1][d_ref > 3].sum() / ref[1].sum(),
            "out": (out[1] * d_out).sum() / out[1].sum(),
            "ref": (ref[1] * d_ref).sum() / ref[1].sum(), "max": max(d_out.max(), d_ref.max()),
            "tip": tip, "length": out[1].sum() / ref[1].sum() - 1,
            "ends": groups(ends, 3 * h), "branches": groups(x[degree > 2], 3 * h)}


# ---- meshes ---------------------------------------------------------------------------------------


def read_off(path):
    t = open(path).read().split()
    n, m = int(t[1]), int(t[2])
    x = np.array(t[4:4 + 3 * n], float).reshape(-1, 3)
    return x, np.array(t[4 + 3 * n:4 + 3 * n + 4 * m], int).reshape(-1, 4)[:, 1:]


def write_off(path, x, triangles):
    with open(path, "w") as f:
        f.write(f"OFF\n{len(x)} {len(triangles)} 0\n")
        f.writelines("%.17g %.17g %.17g\n" % tuple(p) for p in x)
        f.writelines("3 %d %d %d\n" % tuple(t) for t in triangles)


def mean_edge(x, triangles):
    e = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    e = np.unique(np.sort(e, axis=1), axis=0)
    return np.linalg.norm(x[e[:, 0]] - x[e[:, 1]], axis=1).mean()


def implicit(name, x):
    """Value and gradient of the function whose zero set the surface is."""
    if name == "torus":
        q = np.hypot(x[:, 0], x[:, 1])
        k = 2 * (q - 2) / q
        return (q - 2) ** 2 + x[:, 2] ** 2 - 1, np.c_[k * x[:, 0], k * x[:, 1], 2 * x[:, 2]]
    if name == "quartic":
        return (x ** 4).sum(1) - 1, 4 * x ** 3
    s = np.array([25, 1 / 0.36, 1])
    return (s * x * x).sum(1) - 1, 2 * s * x


def on_surface(name, x):
    for _ in range(20):
        value, gradient = implicit(name, x)
        x = x - (value / (gradient ** 2).sum(1))[:, None] * gradient
    return x


def jitter(name, x, triangles, amount):
    """Move all points but the first by about `amount` times their shortest edge, on the surface."""
    shortest = np.full(len(x), np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        a, b = triangles[:, i], triangles[:, j]
        length = np.linalg.norm(x[a] - x[b], axis=1)
        np.minimum.at(shortest, a, length)
        np.minimum.at(shortest, b, length)
    y = x + np.random.default_rng(1).normal(size=x.shape) * amount * shortest[:, None]
    y = on_surface(name, y)
    y[0] = x[0]
    return y


def noisy(x, triangles, amount):
    y = x + np.random.default_rng(2).normal(size=x.shape) * amount * mean_edge(x, triangles)
    y[0] = x[0]
    return y


def aligned_torus(thousands):
    n = int(round((thousands * 1000 / 4) ** 0.5))
    n += n % 2
    a, b = np.meshgrid(2 * np.pi * np.arange(2 * n) / (2 * n), 2 * np.pi * np.arange(n) / n,
                       indexing="ij")
    x = np.c_[((2 + np.cos(b)) * np.cos(a)).ravel(), ((2 + np.cos(b)) * np.sin(a)).ravel(),
              np.sin(b).ravel()]
    i, j = np.meshgrid(np.arange(2 * n), np.arange(n), indexing="ij")
    i1, j1 = (i + 1) % (2 * n), (j + 1) % n
    c = [(p * n + q).ravel() for p, q in ((i, j), (i1, j), (i1, j1), (i, j1))]
    return x, np.vstack([np.c_[c[0], c[1], c[2]], np.c_[c[0], c[2], c[3]]])


def make_mesh(program, name, kind, thousands, path):
    surface, source, refinements = SURFACES[name]
    if kind == "aligned":
        write_off(path, *aligned_torus(thousands))
        return
    subprocess.run([program, "mesh", surface, "--source", ",".join(map(repr, source)), "--refine",
                    str(refinements[thousands]), "--out", path, "--quiet"], check=True)
    if kind == "jittered":
        x, triangles = read_off(path)
        write_off(path, jitter(surface, x, triangles, 0.1), triangles)
    if kind in NOISE:
        x, triangles = read_off(path)
        write_off(path, noisy(x, triangles, NOISE[kind]), triangles)


# ---- rivals ---------------------------------------------------------------------------------------


def shares(name, points, weights, h):
    exact = sample(exact_lines(name), h / 4)
    if len(points) == 0:
        return dict(false=0, missed=1)
    d = distances(points, exact) / h
    back = cKDTree(points).query(exact[0])[0] / h
    return {"false": weights[d > 3].sum() / weights.sum(),
            "missed": exact[1][back > 3].sum() / exact[1].sum()}


def gradient_jump(name, x, triangles, h, angles):
    """Edges of the mesh across which the gradient of the exact polyhedral distance turns by more than
    each of the angles."""
    from pygeodesic import geodesic
    d = geodesic.PyGeodesicAlgorithmExact(x, triangles).geodesicDistances(np.array([0]))[0]
    p, q, r = x[triangles[:, 0]], x[triangles[:, 1]], x[triangles[:, 2]]
    normal = np.cross(q - p, r - p)
    area = np.linalg.norm(normal, axis=1)[:, None]
    normal /= area
    g = (d[triangles[:, 0]][:, None] * np.cross(normal, r - q)
         + d[triangles[:, 1]][:, None] * np.cross(normal, p - r)
         + d[triangles[:, 2]][:, None] * np.cross(normal, q - p)) / area
    g /= np.linalg.norm(g, axis=1)[:, None]
    ends = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    order = np.lexsort(np.sort(ends, axis=1).T)  # the two sides of each edge one after the other
    s, t = order[::2] % len(triangles), order[1::2] % len(triangles)
    turn = np.arccos(np.clip((g[s] * g[t]).sum(1), -1, 1))
    a, b = x[ends[order[::2], 0]], x[ends[order[::2], 1]]
    for angle in angles:
        mine = turn > angle
        yield angle, shares(name, 0.5 * (a + b)[mine], np.linalg.norm(b - a, axis=1)[mine], h)


def density_threshold(name, program, mesh, h, bound, folder):
    """The triangles with mu <= bound, weighted by the square root of their area."""
    import meshio
    path = os.path.join(folder, "result.vtu")
    subprocess.run([program, "solve", mesh, "--vertex", "0", "--threshold", bound, "--out", path,
                    "--quiet"], check=True)
    r = meshio.read(path)
    triangles = r.cells_dict["triangle"][np.array(r.cell_data["acl"][0]).ravel() > 0]
    x = r.points
    p, q, s = x[triangles[:, 0]], x[triangles[:, 1]], x[triangles[:, 2]]
    return shares(name, (p + q + s) / 3, np.linalg.norm(np.cross(q - p, s - p), axis=1) ** 0.5, h)


# ---- the table ------------------------------------------------------------------------------------


def one(program, name, kind, thousands, rivals, folder):
    mesh, locus = os.path.join(folder, "mesh.off"), os.path.join(folder, "locus.obj")
    make_mesh(program, name, kind, thousands, mesh)
    text = subprocess.run([program, "solve", mesh, "--vertex", "0", "--locus", locus, "--json",
                           "--quiet"], check=True, capture_output=True, text=True).stdout
    report = json.loads(text)
    x, triangles = read_off(mesh)
    h = mean_edge(x, triangles)
    row = dict(surface=name, mesh=kind, test="locus", triangles=len(triangles), h=h)
    row.update(score(name, locus, h))
    row.update({k: report["locus"][k] for k in ("loops", "components")})
    yield row
    if not rivals or name == "umbilic" or kind in NOISE:
        return
    for bound in ("1e-4", "1e-2"):
        yield dict(surface=name, mesh=kind, test=f"mu <= {bound}", triangles=len(triangles), h=h,
                   **density_threshold(name, program, mesh, h, bound, folder))
    if thousands > 20:  # exact distances take minutes on larger meshes
        return
    for angle, share in gradient_jump(name, x, triangles, h, (0.3, 0.5)):
        yield dict(surface=name, mesh=kind, test=f"jump > {angle}", triangles=len(triangles), h=h,
                   **share)


def add_rates(rows):
    """Order of convergence in h against the next coarser mesh of the same kind."""
    last = {}
    for row in rows:
        key = (row["surface"], row["mesh"])
        if row["test"] == "locus" and "out" in row:
            if key in last:
                old = last[key]
                e0, e1 = old["out"] * old["h"], row["out"] * row["h"]
                row["rate"] = np.log(e0 / e1) / np.log(old["h"] / row["h"])
            last[key] = row


COLUMNS = ["surface", "mesh", "test", "triangles", "h", "false", "missed", "out", "ref", "max", "tip",
           "length", "ends", "branches", "loops", "components", "points", "lines", "rate"]
TITLES = {"false": "false, %", "missed": "missed, %", "out": "mean out, h", "ref": "mean back, h",
          "max": "max, h", "tip": "tip, h", "length": "length, %", "rate": "order"}


def cell(column, value):
    if value == "" or value is None:
        return ""
    if column in ("false", "missed", "length"):
        return f"{100 * float(value):.2f}"
    if column in ("out", "ref", "max", "tip"):
        return f"{float(value):.3f}"
    return f"{float(value):.1f}" if column == "rate" else str(value)


def markdown(rows, columns):
    yield "| " + " | ".join(TITLES.get(c, c) for c in columns) + " |"
    yield "|" + "|".join("---" if c in ("surface", "mesh", "test") else "--:" for c in columns) + "|"
    for row in rows:
        yield "| " + " | ".join(cell(c, row.get(c, "")) for c in columns) + " |"


def write_tables(path, rows, rivals):
    done = {row["surface"] for row in rows}
    if os.path.exists(path):
        with open(path, newline="") as f:
            kept = [r for r in csv.DictReader(f)
                    if r["surface"] not in done or not rivals and r["test"] != "locus"]
            rows = [r for r in kept if r["test"] == "locus"] + rows + [
                r for r in kept if r["test"] != "locus"]
    rows.sort(key=lambda r: list(SURFACES).index(r["surface"]))
    with open(path, "w", newline="") as f:
        writer = csv.DictWriter(f, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    own = [r for r in rows if r["test"] == "locus"]
    text = ["# The cut locus against exact ones", "",
            "`bench/accuracy.py --rivals --out bench/results/accuracy.csv`; it explains the columns.",
            "", *markdown([r for r in own if r["surface"] != "umbilic"],
                          ["surface", "mesh", "triangles", "false", "missed", "out", "ref", "max", "tip",
                           "length", "ends", "branches", "loops", "components", "rate"]),
            "", "A locus that is one point: its distance from the exact one.", "",
            *markdown([r for r in own if r["surface"] == "umbilic"],
                      ["surface", "mesh", "triangles", "points", "lines", "max"]),
            "", "Tests on single triangles or edges, for comparison.", "",
            *markdown([r for r in rows if r["test"] != "locus"],
                      ["surface", "mesh", "test", "triangles", "false", "missed"])]
    with open(os.path.splitext(path)[0] + ".md", "w") as f:
        f.write("\n".join(text) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=os.path.join(HERE, "../build/release/dmkcl"))
    parser.add_argument("--sizes", default="5,20,80,320")
    parser.add_argument("--surfaces", default=",".join(SURFACES))
    parser.add_argument("--meshes", default="plain,jittered,aligned,rough,noisy")
    parser.add_argument("--rivals", action="store_true")
    parser.add_argument("--out")
    a = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name in a.surfaces.split(","):
            for kind in a.meshes.split(","):
                if kind == "aligned" and name != "torus":
                    continue
                for size in map(int, a.sizes.split(",")):
                    for row in one(a.program, name, kind, size, a.rivals, folder):
                        rows.append(row)
                        add_rates(rows)
                        print("  ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}"
                                        for k, v in row.items()), flush=True)
    if a.out:
        write_tables(a.out, rows, a.rivals)
    return 0


if __name__ == "__main__":
    sys.exit(main())
