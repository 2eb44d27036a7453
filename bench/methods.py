#!/usr/bin/env python3
"""Error of the density of each method against its steps and V-cycles.

usage: methods.py [--program DMKCL] [--anderson BENCH_ANDERSON] [--work build/bench]
                  [--results bench/results] [MESH ...]
For each mesh the density to compare with comes from the default method with --tolerance 1e-5. Each row
is a run stopped at another --tolerance: L1 error = sum area |mu - mu_ref| / sum area mu_ref, and the
cost above the best upper bound of that mesh. Anderson's rows are the first steps of one run with at most
such an error (bench/anderson.c). Meshes: torus with 22k and quartic with 68k triangles;
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
    ("newton", [], [None, 3e-2, 1.5e-2, 1e-3, 1e-4]),
    ("newton, uniform start", ["--start", "uniform"], [None, 1e-3]),
    ("inertial", ["--method", "inertial", "--max-steps", "300"], [3e-2, 1e-2, 4e-3, 1e-3, 5e-4]),
    ("euler, dt 0.5", ["--method", "euler", "--max-steps", "300"], [3e-2, 1e-2, 4e-3, 1e-3]),
]

ANDERSON = [(5, [0.05, 0.02, 0.01, 0.005, 0.002]), (3, [0.02, 0.01]), (10, [0.02, 0.01])]  # m, errors
COMPARED = 0.01  # error that the sentence below each table is about


def density(path):
    """(area, mu) per triangle of a PLY file of results, which is text."""
    with open(path) as f:
        lines = f.read().split("\n")
    end = lines.index("end_header")
    count, names = {}, {}
    for word in map(str.split, lines[:end]):
        if word[0] == "element":
            element, count[word[1]] = word[1], int(word[2])
        elif word[0] == "property":
            names.setdefault(element, []).append(word[-1])
    n = end + 1 + count["vertex"]
    vertex = np.loadtxt(lines[end + 1 : n])
    face = np.loadtxt(lines[n : n + count["face"]])
    x = vertex[face[:, 1:4].astype(int), :3]
    area = 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
    return area, face[:, 3 + names["face"].index("mu")]


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


def row(method, stop, steps, v_cycles, seconds, error, above, gap):
    return (f"| {method} | {stop} | {steps} | {v_cycles} | {seconds:.3f} | {error:.4f} | {above:.1e} | "
            f"{gap:.1e} |")


def tool_rows(o, mesh, reference, area, best):
    """(method, V-cycles, error, line) of each run of the tool."""
    for method, more, tolerances in METHODS:
        for tolerance in tolerances:
            r, found = solve(o, mesh, more, tolerance)
            shown = f"{tolerance:g}" if tolerance else "default"
            if r is None:
                why = "not there after the step limit" if "exit 7" in found else found
                yield method, 0, 1, f"| {method} | {shown} | {why} | | | | | |"
                break
            error = (area * abs(found[1] - best)).sum() / (area * best).sum()
            above = r["cost_upper"] / reference["cost_upper"] - 1
            yield method, r["v_cycles"], error, row(method, shown, r["steps"], r["v_cycles"],
                                                    r["seconds"]["solve"], error, above, r["gap"])


def anderson_rows(o, mesh):
    """The same of Anderson acceleration, one run for each m."""
    for m, errors in ANDERSON:
        method = f"anderson, m {m}"
        command = [o.anderson, mesh, str(m), "100", str(min(errors))]
        p = subprocess.run(command, capture_output=True, text=True)
        if p.returncode:
            yield method, 0, 1, f"| {method} | | exit {p.returncode}: {p.stderr.strip()} | | | | | |"
            continue
        steps = [[float(x) for x in line.split(",")] for line in p.stdout.splitlines()]
        for wanted in errors:
            found = next((s for s in steps if s[3] <= wanted), None)
            k, v_cycles, seconds, error, above, gap = found or steps[-1]
            stop = f"L1 {wanted:g}" if found else "last"
            yield method, int(v_cycles), error, row(method, stop, int(k), int(v_cycles), seconds, error,
                                                    above, gap)
            if not found:
                break


def table(o, name, mesh):
    reference, found = solve(o, mesh, ["--max-steps", "200"], 1e-5)
    if reference is None:
        return [f"No reference: {found}"]
    lines = [f"Reference: {reference['steps']} steps, gap {reference['gap']:.1e}.", "",
             "| method | tolerance | steps | V-cycles | solve, s | L1 error | cost above reference | gap |",
             "|---|--:|--:|--:|--:|--:|--:|--:|"]
    points = {}  # method -> (error, V-cycles) of its rows
    for rows in (tool_rows(o, mesh, reference, *found), anderson_rows(o, mesh)):
        for method, v_cycles, error, line in rows:
            lines.append(line)
            print(name, line, flush=True)
            if v_cycles:
                points.setdefault(method, []).append((error, v_cycles))
    return lines + ["", compare(points)]


def compare(points):
    """V-cycles of each method to the error COMPARED, and Anderson's beside the others'."""
    cycles, seen = {}, []
    for method, p in points.items():
        error, v_cycles = np.array(sorted(p)).T
        if error[0] <= COMPARED <= error[-1]:
            cycles[method] = np.interp(np.log(COMPARED), np.log(error), v_cycles)
            seen.append(f"{method} {cycles[method]:.0f}")
        else:
            seen.append(f"{method} {'not reached' if error[0] > COMPARED else 'before its first row'}")
    text = (f"V-cycles to an L1 error of {COMPARED:g}, between rows in proportion to the error's "
            f"logarithm: {'; '.join(seen)}.")
    if {"anderson, m 5", "newton", "inertial"} <= cycles.keys():
        ours = cycles["anderson, m 5"]
        text += (f" Anderson acceleration with m 5 takes {ours / cycles['inertial']:.2f} times those of "
                 f"inertial and {ours / cycles['newton']:.1f} times those of newton.")
    return text


def main():
    a = argparse.ArgumentParser(description=__doc__,
                                formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("--program", default="build/release/dmkcl")
    a.add_argument("--anderson", default="build/release/bench-anderson")
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
             "are of one run, on a machine that may do other work. Anderson acceleration of the explicit steps in "
             "log mu (the inertial method's, without inertia), with the last m differences, is not in the "
             "library but in `bench/anderson.c`: its rows are the first steps with at most the L1 error given "
             "as tolerance, its vector arithmetic is on one thread. V-cycles include those of one certificate.", ""]
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
