#!/usr/bin/env python3
"""Why the default strength is what it is: the measures of accuracy.py for strengths around it.

usage: strength.py [--library libdmkcl.so] [--program DMKCL] [--sizes 5,20,80] [--out FILE.csv]
The distance is computed once for each mesh, then the locus at each strength. Beside FILE.csv comes
FILE.md: for each strength how many meshes meet all bounds (false and missed at most 0.5 %, mean distance
0.15 h, tips within 2 h, the exact numbers of loops, ends and branch points; a point locus one point
within 1 h). Needs numpy and scipy.
"""
import argparse
import csv
import ctypes
import os
import struct
import sys
import tempfile

import numpy as np
from scipy.spatial import cKDTree

import accuracy

STRENGTHS = (0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1, 1.5, 2, 3)
LOOPS_ENDS = {"torus": (2, 2), "ellipsoid": (0, 2), "quartic": (0, 6)}


class Library:
    """As much of the C interface as is needed; every call that fails ends the program."""

    def __init__(self, path):
        self.c = ctypes.CDLL(path)
        self.c.dmk_context_message.restype = ctypes.c_char_p
        self.context = ctypes.c_void_p()
        self.c.dmk_context_create(ctypes.byref(self.context))
        self.device = self.get(self.c.dmk_device_open, self.defaults(self.c.dmk_device_options_init))

    @staticmethod
    def defaults(init):
        options = ctypes.create_string_buffer(1024)
        init(options, ctypes.c_size_t(len(options)))
        return options

    def get(self, function, *arguments):
        out = ctypes.c_void_p()
        self.check(function(self.context, *arguments, ctypes.byref(out)))
        return out

    def check(self, status):
        if status != 0:
            sys.exit(self.c.dmk_context_message(self.context).decode())

    def loci(self, mesh_path, h, strengths, path):
        """Solve, then write the locus at each strength to `path` and yield the strength."""
        mesh = self.get(self.c.dmk_mesh_read, os.fsencode(mesh_path))
        solver = self.get(self.c.dmk_solver_create, self.device, mesh)
        source = ctypes.create_string_buffer(32)
        self.check(self.c.dmk_mesh_vertex_point(self.context, mesh, ctypes.c_int64(0), source))
        result = self.get(self.c.dmk_solve, solver, source,
                          self.defaults(self.c.dmk_solve_options_init))
        for strength in strengths:
            options = self.defaults(self.c.dmk_locus_options_init)
            struct.pack_into("d", options, 8, strength * h)  # after struct_size
            locus = self.get(self.c.dmk_locus_compute, mesh, result, options)
            self.check(self.c.dmk_locus_write(self.context, locus, os.fsencode(path)))
            self.c.dmk_locus_destroy(ctypes.byref(locus))
            yield strength
        self.c.dmk_result_destroy(ctypes.byref(result))
        self.c.dmk_solver_destroy(ctypes.byref(solver))
        self.c.dmk_mesh_destroy(ctypes.byref(mesh))


def loops_of(path):
    x, lines = accuracy.read_obj(path)
    return sum(len(line) - 1 for line in lines) - len(x) + 1


def exact_branches(name, h):
    """Branch points, those closer than 3 h counted once."""
    if name != "quartic":
        return {"torus": 2, "ellipsoid": 0}[name]
    ends = np.array([line[i] for line in accuracy.exact_lines(name) for i in (0, -1)])
    near = cKDTree(ends).query_ball_point(ends, 1e-5)
    return accuracy.groups(ends[[len(n) > 2 for n in near]], 3 * h)


def good(row):
    if row["surface"] == "umbilic":
        return row["points"] == 1 and row["lines"] == 0 and row["max"] <= 1
    exact = (*LOOPS_ENDS[row["surface"]], exact_branches(row["surface"], row["h"]))
    counts = (row["loops"], row["ends"], row["branches"])
    return (row["false"] <= 0.005 and row["missed"] <= 0.005 and max(row["out"], row["ref"]) <= 0.15
            and row["tip"] <= 2 and counts == exact)


def measure(a, folder):
    library = Library(a.library)
    mesh, locus = os.path.join(folder, "mesh.off"), os.path.join(folder, "locus.obj")
    for name in accuracy.SURFACES:
        for kind in ("plain", "jittered", "aligned", "noisy"):
            if kind == "aligned" and name != "torus":
                continue
            for size in map(int, a.sizes.split(",")):
                accuracy.make_mesh(a.program, name, kind, size, mesh)
                x, triangles = accuracy.read_off(mesh)
                h = accuracy.mean_edge(x, triangles)
                for strength in library.loci(mesh, h, STRENGTHS, locus):
                    row = dict(surface=name, mesh=kind, triangles=len(triangles), h=h,
                               strength=strength)
                    row.update(accuracy.score(name, locus, h))
                    row["loops"] = loops_of(locus)
                    row["good"] = int(good(row))
                    yield row


def summary(rows):
    columns = ["plain", "jittered", "aligned", "noisy"]
    yield "# The default strength"
    yield ""
    yield "`bench/strength.py`: meshes of which the locus meets all bounds, of all meshes, by strength. The"
    yield "worst shares are over all meshes with a locus of lines. Strengths in mean edges; 0 is the default, 0.2 or more."
    yield ""
    yield "| strength | " + " | ".join(columns) + " | worst false, % | worst missed, % |"
    yield "|--:|" + "--:|" * (len(columns) + 2)
    for strength in STRENGTHS:
        mine = [r for r in rows if r["strength"] == strength]
        lines = [r for r in mine if r["surface"] != "umbilic"]
        cells = []
        for kind in columns:
            some = [r["good"] for r in mine if r["mesh"] == kind]
            cells.append(f"{sum(some)} of {len(some)}")
        worst = [f"{100 * max(r[k] for r in lines):.2f}" for k in ("false", "missed")]
        yield f"| {strength} | " + " | ".join(cells + worst) + " |"


def main():
    here = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "build", "release")
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--library", default=os.path.join(here, "libdmkcl.so"))
    parser.add_argument("--program", default=os.path.join(here, "dmkcl"))
    parser.add_argument("--sizes", default="5,20,80")
    parser.add_argument("--out")
    a = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = list(measure(a, folder))
    text = "\n".join(summary(rows)) + "\n"
    sys.stdout.write(text)
    if a.out:
        columns = list(dict.fromkeys(k for row in rows for k in row))
        with open(a.out, "w", newline="") as f:
            writer = csv.DictWriter(f, columns)
            writer.writeheader()
            writer.writerows(rows)
        with open(os.path.splitext(a.out)[0] + ".md", "w") as f:
            f.write(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
