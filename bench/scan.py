#!/usr/bin/env python3
"""The cut locus on real meshes, judged by distances that share no code with it.

usage: scan.py [--program DMKCL] [--meshes FOLDER] [--names bear,camel,...] [--stability] [--store FOLDER]
               [--out FILE.csv]
    scan.py --out bench/results/scan.csv
    scan.py --meshes tests/data --names rough --stability --store tests/data --out bench/results/scan.csv
The meshes are those of Debian's libcgal-demo, where `make bench` puts them, three sources each. The judge: exact distances
on the polyhedron by pygeodesic, on the mesh cut 1:4 without moving it, so that the gradient of the distance
is known on four pieces of each triangle; across a piece of the cut locus it jumps. Lengths in h, the mean edge.
  false    share of the locus' length farther than 3 h from all edges across which the gradient turns by more
           than WEAK radians
  missed   share of the edges across which it turns by more than STRONG, in groups of at least 3 h,
           farther than 3 h from the locus
  long     edges of the locus that do not lie in one triangle
--stability solves again on the mesh cut 1:4, with slid vertices and with 2 % noise:
  moved    the largest share of the locus farther than 3 h from the other one with half the strength, both ways
  clear    the same share of what is clear: paths meet there at BLUNT radians or more; the rest only joins that,
           and where it runs is not decided at the mesh's resolution
--store writes NAME-SOURCE.jumps, points of the edges that `false` and `missed` are measured by: `weak` or `strong`,
x, y, z. tests/test_locus.c measures tests/data/rough.off by those again, a bumpy sphere of 5,120 triangles with fine
bumps and 2 % noise; rows of other meshes in FILE.csv stay. Needs numpy, scipy, pygeodesic.
"""
import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

import accuracy

WEAK, STRONG, NEAR = 0.1, 0.7, 3
BLUNT = 0.2
NAMES = "bear,camel,lion-head,mannequin-devil,man,fandisk"


def load(path):
    words = [w for line in open(path) for w in line.split("#")[0].split()]
    words = words[1:] if words[0] == "OFF" else words
    n, m = int(words[0]), int(words[1])
    x = np.array(words[3:3 + 3 * n], float).reshape(-1, 3)
    return x, np.array(words[3 + 3 * n:3 + 3 * n + 4 * m], int).reshape(-1, 4)[:, 1:]


def quarter(x, t):
    """Every triangle cut into four; the surface stays."""
    e = np.sort(np.vstack([t[:, [1, 2]], t[:, [2, 0]], t[:, [0, 1]]]), axis=1)
    edge, which = np.unique(e, axis=0, return_inverse=True)
    m = len(x) + which.reshape(3, -1).T
    y = np.vstack([x, x[edge].mean(1)])
    return y, np.vstack([np.c_[t[:, 0], m[:, 2], m[:, 1]], np.c_[m[:, 2], t[:, 1], m[:, 0]],
                         np.c_[m[:, 1], m[:, 0], t[:, 2]], m])


def slid(x, t, source):
    """Vertices moved by a third of the way to the mean of their neighbours, along the surface."""
    e = np.vstack([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    total, count = np.zeros_like(x), np.zeros(len(x))
    np.add.at(total, e[:, 0], x[e[:, 1]])
    np.add.at(count, e[:, 0], 1)
    move = total / np.maximum(count, 1)[:, None] - x
    face = np.cross(x[t[:, 1]] - x[t[:, 0]], x[t[:, 2]] - x[t[:, 0]])
    normal = np.zeros_like(x)
    for k in range(3):
        np.add.at(normal, t[:, k], face)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    move -= (move * normal).sum(1)[:, None] * normal
    border = {tuple(sorted(p)) for p in e.tolist()}
    seen = set(map(tuple, e.tolist()))
    fixed = {v for a, b in border for v in (a, b) if not ((a, b) in seen and (b, a) in seen)}
    move[list(fixed | {source})] = 0
    return x + move / 3


def jumps(x, t, source):
    """Ends of the edges and the angle by which the gradient of the exact distance turns across each."""
    from pygeodesic import geodesic
    d = geodesic.PyGeodesicAlgorithmExact(x, t).geodesicDistances(np.array([source]))[0]
    p, q, r = x[t[:, 0]], x[t[:, 1]], x[t[:, 2]]
    n = np.cross(q - p, r - p)
    double = np.linalg.norm(n, axis=1)[:, None]
    n /= np.maximum(double, 1e-300)
    g = (d[t[:, 0]][:, None] * np.cross(n, r - q) + d[t[:, 1]][:, None] * np.cross(n, p - r)
         + d[t[:, 2]][:, None] * np.cross(n, q - p)) / np.maximum(double, 1e-300)
    g /= np.maximum(np.linalg.norm(g, axis=1), 1e-300)[:, None]
    e = np.vstack([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    key = np.sort(e, axis=1)
    order = np.lexsort(key.T)
    same = (key[order][1:] == key[order][:-1]).all(1)
    a, b = order[:-1][same], order[1:][same]
    f, h = a % len(t), b % len(t)
    # unfold the second triangle's gradient into the plane of the first
    along = x[e[a, 1]] - x[e[a, 0]]
    along /= np.linalg.norm(along, axis=1)[:, None]

    def angle(k):
        return np.arctan2((np.cross(n[k], along) * g[k]).sum(1), (along * g[k]).sum(1))
    turn = np.abs((angle(f) - angle(h) + np.pi) % (2 * np.pi) - np.pi)
    return x[e[a, 0]], x[e[a, 1]], turn


def sampled(a, b, step):
    n = np.maximum(1, np.ceil(np.linalg.norm(b - a, axis=1) / step)).astype(int)
    k = np.repeat(np.arange(len(n)), n)
    s = ((np.arange(len(k)) - np.repeat(np.cumsum(n) - n, n) + 0.5) / n[k])[:, None]
    return a[k] + s * (b - a)[k], (np.linalg.norm(b - a, axis=1) / n)[k]


def far(x, weight, target, reach):
    if len(x) == 0:
        return 0.0
    if len(target) == 0:
        return 1.0
    d, _ = cKDTree(target).query(x, distance_upper_bound=reach)
    return weight[~np.isfinite(d)].sum() / weight.sum()


def groups(a, b, reach):
    """Only edges in connected groups longer than `reach`: single ones are where a geodesic grazes a vertex."""
    points, where = np.unique(np.round(np.vstack([a, b]), 12), axis=0, return_inverse=True)
    i, j = where[:len(a)], where[len(a):]
    n, label = connected_components(coo_matrix((np.ones(len(i)), (i, j)), shape=(len(points),) * 2), directed=False)
    length = np.bincount(label[i], np.linalg.norm(a - b, axis=1), n)
    return length[label[i]] >= reach


def locus_of(program, mesh, source, folder, strength=0):
    """Both ends of each edge, the angle at which paths meet on it, and what the report says."""
    path, table = os.path.join(folder, "locus.obj"), os.path.join(folder, "locus.csv")
    option = ["--strength", repr(strength)] if strength else []
    text = subprocess.run([program, "solve", mesh, "--vertex", str(source), "--locus", path, "--locus", table, "--json",
                           "--quiet", *option], check=True, capture_output=True, text=True).stdout
    info = json.loads(text)["locus"]
    x, lines = accuracy.read_obj(path)
    with open(table) as f:
        angle = np.array([float(r["meeting_angle"]) for r in csv.DictReader(f)])
    pairs = [(i, j) for line in lines for i, j in zip(line, line[1:])]
    ends = np.array(pairs, int).reshape(-1, 2)
    return x[ends[:, 0]], x[ends[:, 1]], angle[ends].mean(axis=1), info


def store(path, points, step):
    """The points, those in a cube of side `step` once."""
    with open(path, "w") as f:
        for kind, x in points.items():
            _, first = np.unique(np.floor(x / step), axis=0, return_index=True)
            f.writelines(f"{kind} {p[0]:.4f} {p[1]:.4f} {p[2]:.4f}\n" for p in x[np.sort(first)])


def judge(program, mesh, source, folder, keep):
    x, t = load(mesh)
    h = accuracy.mean_edge(x, t)
    a, b, _, info = locus_of(program, mesh, source, folder)
    p, q, turn = jumps(*quarter(x, t), source)
    out = sampled(a, b, h / 4)
    weak = sampled(p[turn > WEAK], q[turn > WEAK], h / 4)
    strong = turn > STRONG
    strong[strong] = groups(p[strong], q[strong], NEAR * h)
    ref = sampled(p[strong], q[strong], h / 4)
    if keep:
        name = os.path.splitext(os.path.basename(mesh))[0]
        store(os.path.join(keep, f"{name}-{source}.jumps"), {"weak": weak[0], "strong": ref[0]}, h / 2)
    longest = np.linalg.norm(x[t] - x[np.roll(t, 1, axis=1)], axis=2).max()
    return {"false": far(*out, weak[0], NEAR * h), "missed": far(*ref, out[0], NEAR * h),
            "long": int((np.linalg.norm(a - b, axis=1) > longest).sum()), "length": out[1].sum(),
            "ends": info["endpoints"], "branches": info["branch_points"], "strength": info["strength"] / h}


def share_moved(one, two, h, least):
    """Of what meets at `least` radians or more."""
    some = one[2] >= least
    return far(*sampled(one[0][some], one[1][some], h / 4), sampled(*two[:2], h / 4)[0], NEAR * h) if some.any() else 0


def moved(program, mesh, source, folder):
    x, t = load(mesh)
    h = accuracy.mean_edge(x, t)
    y = accuracy.noisy(x, t, 0.02)
    y[source] = x[source]
    changed = [quarter(x, t), (slid(x, t, source), t), (y, t)]
    mine = [locus_of(program, mesh, source, folder)]
    strength = mine[0][3]["strength"]
    mine.append(locus_of(program, mesh, source, folder, strength / 2))
    pairs = []
    for k, (z, s) in enumerate(changed):
        path = os.path.join(folder, f"changed{k}.off")
        accuracy.write_off(path, z, s)
        other = [locus_of(program, path, source, folder, part * strength) for part in (1, 0.5)]
        pairs += [(mine[0], other[1]), (other[0], mine[1])]
    return {"moved": max(share_moved(*p, h, 0) for p in pairs), "clear": max(share_moved(*p, h, BLUNT) for p in pairs)}


COLUMNS = ["mesh", "source", "triangles", "false", "missed", "long", "moved", "length", "ends", "branches", "strength", "clear"]
REAL = ("false", "missed", "moved", "length", "strength", "clear")


def read_rows(path):
    if not path or not os.path.exists(path):
        return []
    with open(path) as f:
        return [{k: v if k == "mesh" or v == "" else float(v) if k in REAL else int(v) for k, v in r.items()}
                for r in csv.DictReader(f)]


def write_tables(path, rows):
    with open(path, "w", newline="") as f:
        writer = csv.DictWriter(f, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    with open(os.path.splitext(path)[0] + ".md", "w") as f:
        f.write("# The cut locus on real meshes\n\n`bench/scan.py --stability --out bench/results/scan.csv`; it explains "
                "what the columns are.\n\n| mesh | source | triangles | false, % | missed, % | long | moved, % | clear, % | "
                "ends | branches | strength, h |\n|---|" + "--:|" * 10 + "\n")
        for r in rows:
            part = " | ".join("" if r[k] == "" else f"{100 * r[k]:.2f}" for k in ("moved", "clear"))
            f.write(f"| {r['mesh']} | {r['source']} | {r['triangles']} | {100 * r['false']:.2f} | {100 * r['missed']:.2f} "
                    f"| {r['long']} | {part} | {r['ends']} | {r['branches']} | {r['strength']:.2f} |\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=os.path.join(accuracy.HERE, "../build/release/dmkcl"))
    parser.add_argument("--meshes", default=os.path.join(accuracy.HERE, "../build/bench/real"))
    parser.add_argument("--names", default=NAMES)
    parser.add_argument("--stability", action="store_true")
    parser.add_argument("--store")
    parser.add_argument("--out")
    a = parser.parse_args()
    names = a.names.split(",")
    rows = [r for r in read_rows(a.out) if r["mesh"] not in names]
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            mesh = os.path.join(a.meshes, name + ".off")
            x, t = load(mesh)
            for source in (0, len(x) // 3, 2 * len(x) // 3):
                row = {"mesh": name, "source": source, "triangles": len(t), "moved": "", "clear": "",
                       **judge(a.program, mesh, source, folder, a.store)}
                if a.stability:
                    row.update(moved(a.program, mesh, source, folder))
                rows.append(row)
                print("  ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in row.items()),
                      flush=True)
                if a.out:
                    write_tables(a.out, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
