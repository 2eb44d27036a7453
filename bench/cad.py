#!/usr/bin/env python3
"""Machine parts as CAD programs triangulate them: long needles, many borders, soups of corners.

usage: cad.py --models FOLDER [--program DMKCL] [--every N] [--judge N] [--out FILE.md]
    apt-get download kicad-packages3d && dpkg-deb -x kicad-packages3d_*.deb parts
    cad.py --models parts --out bench/results/cad.md
The models are the VRML files of Debian's kicad-packages3d, 6,227 electronic components; every Nth is taken, and of that
the largest surface. `batch --repair` solves it from its first vertex, `cut` opens it; of one in --judge of them
the distances are compared with pygeodesic's. The table counts what is solved and has the worst of it. Needs numpy and
pygeodesic.
"""
import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pygeodesic.geodesic

import accuracy

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "../tests"))
import hostile  # noqa: E402


def largest_surface(text):
    """Corners, one text each, and polygons of the IndexedFaceSet of VRML 2.0 that has most of these."""
    points, faces = (re.findall(word + r"\s*\[([^\]]*)\]", text) for word in ("point", "coordIndex"))
    point, face = max(zip(points, faces), key=lambda pair: len(pair[1]), default=("", ""))
    corners = [" ".join(p.split()) for p in point.split(",") if p.strip()]
    polygons = [p.split() for p in " ".join(face.replace(",", " ").split()).split("-1")]
    return corners, [p for p in polygons if len(p) > 2]


def write_obj(path, corners, polygons):
    """With the corners that are used only: the first one is to be the source."""
    used = sorted({int(i) for p in polygons for i in p})
    number = {old: k + 1 for k, old in enumerate(used)}
    with open(path, "w") as out:
        out.writelines(f"v {corners[i]}\n" for i in used)
        out.writelines("f " + " ".join(str(number[int(i)]) for i in p) + "\n" for p in polygons)


def run(program, *words):
    return subprocess.run([program, *map(str, words), "--quiet"], capture_output=True, text=True)


def solve_all(program, meshes, folder):
    """What the report says of each mesh."""
    run(program, "batch", meshes, "--repair", "--vertex", 0, "--out-dir", folder, "--report", f"{folder}/report.jsonl")
    return [json.loads(line) for line in open(f"{folder}/report.jsonl")]


def what_is_wrong(program, mesh, folder):
    """What is wrong with the surface that `cut` cuts open."""
    cut = f"{folder}/cut.off"
    done = run(program, "cut", mesh, "--repair", "--vertex", 0, "--out", cut)
    if done.returncode:
        return done.stderr.strip()
    info = json.loads(subprocess.run([program, "info", cut, "--json"], capture_output=True, text=True).stdout)
    return "" if info["euler"] == 1 and info["n_border_loops"] == 1 else "the surface cut open is no disk"


def differences(program, mesh, folder):
    """By how much distances are longer, and shorter, than pygeodesic's at most, over the largest distance. Each is the
    length of a path: who has the longer one is wrong."""
    clean, values = f"{folder}/clean.off", f"{folder}/values.ply"
    run(program, "mesh", mesh, "--repair", "--out", clean)
    x, t = accuracy.read_off(clean)
    source = int(t[len(t) // 2][0])
    run(program, "distance", clean, "--vertex", source, "--out", values)
    own = np.array(hostile.read_ply(values)["distance"])
    other, _ = pygeodesic.geodesic.PyGeodesicAlgorithmExact(x, t).geodesicDistances(np.array([source]), None)
    reached = np.isfinite(own)
    difference = (own - other)[reached] / own[reached].max()
    return difference.max(), -difference.min()


def main():
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--models", required=True)
    options.add_argument("--program", default="build/release/dmkcl")
    options.add_argument("--every", type=int, default=1)
    options.add_argument("--judge", type=int, default=20)
    options.add_argument("--out")
    o = options.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        meshes = Path(folder, "meshes")
        meshes.mkdir()
        for path in sorted(Path(o.models).rglob("*.wrl"))[::o.every]:
            corners, polygons = largest_surface(path.read_text(errors="replace"))
            if polygons:
                write_obj(meshes / f"{path.stem}.obj", corners, polygons)
        all_meshes = sorted(meshes.iterdir())
        results = solve_all(o.program, meshes, folder)
        solved = [r for r in results if "gap" in r]
        wrongs = [what_is_wrong(o.program, mesh, folder) for mesh in all_meshes]
        longer, shorter = zip(*(differences(o.program, mesh, folder) for mesh in all_meshes[::o.judge]))
    gaps = np.array([r["gap"] for r in solved])
    sizes = np.array([r["mesh"]["n_triangles"] for r in solved])
    loops = np.array([r["mesh"]["n_border_loops"] for r in solved])
    angles = np.array([r["mesh"]["min_angle"] for r in solved])
    rows = [
        ("meshes, solved", f"{len(results)}, {len(solved)}"),
        ("triangles: least, median, most", f"{sizes.min()}, {int(np.median(sizes))}, {sizes.max()}"),
        ("smallest angle of a mesh, degrees: median, least", f"{np.median(angles):.2g}, {angles.min():.1g}"),
        ("border loops of a mesh: median, most", f"{int(np.median(loops))}, {loops.max()}"),
        ("gap: median, 99 %, worst", ", ".join(f"{100 * g:.2g} %" for g in np.percentile(gaps, [50, 99, 100]))),
        ("cut open, a disk with one border", f"{wrongs.count('')} of {len(wrongs)}"),
        ("distances, over the largest, against pygeodesic's: longer by, shorter by at most; on so many meshes",
         f"{max(longer):.1e}, {max(shorter):.1e}, {len(longer)}"),
    ]
    text = "| parts of KiCad's library | |\n|---|--:|\n" + "".join(f"| {a} | {b} |\n" for a, b in rows)
    print(text, end="")
    for mesh, wrong in zip(all_meshes, wrongs):
        if wrong:
            print(f"{mesh.name}: {wrong}")
    for r in results:
        if "gap" not in r:
            print(r["name"], r["error"])
    if o.out:
        Path(o.out).write_text("# Machine parts\n\n" + text)


if __name__ == "__main__":
    main()
