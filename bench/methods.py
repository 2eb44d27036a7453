#!/usr/bin/env python3
"""Error of the density of each method against its steps and V-cycles.

usage: methods.py [--program DMKCL] [--work build/bench] [--results bench/results] [MESH ...]
For each mesh the density to compare with comes from the default method with --tolerance 1e-5. Each row
is a run stopped at another --tolerance: L1 error = sum area |mu - mu_ref| / sum area mu_ref, and the
cost above the best upper bound of that mesh. Meshes: torus with 22k and quartic with 68k triangles;
armadillo and bear of Debian's libcgal-demo where `make bench` has fetched it. Writes methods.md.
Needs numpy.
"""
import argparse
import json
import os
import subprocess
import time

import numpy as np

METHODS = [  # name, options, tolerances (None: the default)
    ("newton", [], [None, 3e-2, 1e-3, 1e-4]),
    ("newton, uniform start", ["--start", "uniform"], [None, 1e-3]),
    ("inertial", ["--method", "inertial", "--max-steps", "300"], [3e-2, 1e-2, 4e-3, 1e-3]),
    ("euler, dt 0.5", ["--method", "euler", "--max-steps", "300"], [3e-2, 1e-2, 4e-3, 1e-3]),
]


def density(path):
    """(area, mu) per triangle of a binary PLY file that dmkcl wrote."""
    with open(path, "rb") as f:
        blob = f.read()
    end = blob.index(b"end_header\n") + 11
    types = {"double": "<f8", "float": "<f4", "uchar": "u1", "int": "<i4"}
    columns, count, element = {}, {}, None
    for line in blob[:end].decode().splitlines():
        w = line.split()
        if w[0] == "element":
            element = w[1]
            count[element], columns[element] = int(w[2]), []
        elif w[0] == "property" and w[1] == "list":
            columns[element] += [("n", types[w[2]]), (w[4], types[w[3]], 3)]
        elif w[0] == "property":
            columns[element].append((w[2], types[w[1]]))
    v = np.frombuffer(blob, np.dtype(columns["vertex"]), count["vertex"], end)
    f = np.frombuffer(blob, np.dtype(columns["face"]), count["face"], end + v.nbytes)
    x = np.c_[v["x"], v["y"], v["z"]].astype(float)[f["vertex_indices"]]
    area = 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
    return area, f["mu"].astype(float)


def solve(o, mesh, more, tolerance):
    """(report, density), or the reason why there is none."""
    out = f"{o.work}/methods.ply"
    command = [o.program, "solve", mesh, "--vertex", "0", "--quiet", "--report", "-", "--out", out, *more]
    if tolerance:
        command += ["--tolerance", str(tolerance)]
    p = subprocess.run(command, capture_output=True, text=True)
    if p.returncode:
        return None, f"exit {p.returncode}: {p.stderr.strip().splitlines()[-1:]}"
    return json.loads(p.stdout), density(out)


def table(o, name, mesh):
    reference, found = solve(o, mesh, ["--max-steps", "200"], 1e-5)
    if reference is None:
        return [f"No reference: {found}"]
    area, best = found
    mass = (area * best).sum()
    lines = [f"Reference: {reference['steps']} steps, gap {reference['gap']:.1e}.", "",
             "| method | tolerance | steps | V-cycles | solve, s | L1 error | cost above reference | gap |",
             "|---|--:|--:|--:|--:|--:|--:|--:|"]
    for method, more, tolerances in METHODS:
        for tolerance in tolerances:
            r, found = solve(o, mesh, more, tolerance)
            shown = f"{tolerance:g}" if tolerance else "default"
            if r is None:
                why = "not there after the step limit" if "exit 7" in found else found
                lines.append(f"| {method} | {shown} | {why} | | | | | |")
                break
            error = (area * abs(found[1] - best)).sum() / mass
            above = r["cost_upper"] / reference["cost_upper"] - 1
            lines.append(f"| {method} | {shown} | {r['steps']} | {r['v_cycles']} | "
                         f"{r['seconds']['solve']:.3f} | {error:.4f} | {above:.1e} | {r['gap']:.1e} |")
            print(name, lines[-1], flush=True)
    return lines


def main():
    a = argparse.ArgumentParser(description=__doc__,
                                formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("--program", default="build/release/dmkcl")
    a.add_argument("--work", default="build/bench")
    a.add_argument("--results", default="bench/results")
    a.add_argument("mesh", nargs="*")
    o = a.parse_args()
    os.makedirs(o.work, exist_ok=True)
    os.makedirs(o.results, exist_ok=True)
    meshes = o.mesh
    if not meshes:
        for surface, source, refine in [("torus", "3,0,0", 2), ("quartic", "0.533843,0.800764,0.844080", 2)]:
            path = f"{o.work}/methods_{surface}.off"
            more = ["--triangles", "1400"] if surface == "torus" else []
            subprocess.run([o.program, "mesh", surface, "--refine", str(refine), "--source", source,
                            "--out", path, "--quiet", *more], check=True)
            meshes.append(path)
        real = [f"{o.work}/real/{m}.off" for m in ("bear", "armadillo")]
        meshes += [m for m in real if os.path.exists(m)]
    lines = ["# Methods: error of the density against steps", "",
             f"`make bench-methods`, {time.strftime('%Y-%m-%d')}. Source: vertex 0. Each row is a run that "
             "stopped at the tolerance; the reference is the default method with tolerance 1e-5. Seconds "
             "are of one run, on a machine that may do other work. Anderson acceleration is not implemented.", ""]
    for mesh in meshes:
        with open(mesh) as f:
            n = f.read(200).split()[2]
        name = os.path.basename(mesh).removesuffix(".off").removeprefix("methods_")
        lines += [f"## {name}, {n} triangles", "", *table(o, name, mesh), ""]
        with open(f"{o.results}/methods.md", "w") as f:
            f.write("\n".join(lines))
    print("\n".join(lines))


if __name__ == "__main__":
    main()
