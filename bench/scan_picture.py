#!/usr/bin/env python3
"""A picture of real meshes with their cut loci, coloured by strength, and the sources as dots.

usage: scan_picture.py [--program DMKCL] --out FILE.png MESH.off[:VERTEX[:AZIMUTH]] ...
Loops, whose strength is infinite, have the colour of the strongest. Needs pyvista.
"""
import argparse
import os
import subprocess
import tempfile

import numpy as np
import pyvista

HERE = os.path.dirname(os.path.abspath(__file__))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=os.path.join(HERE, "../build/release/dmkcl"))
    parser.add_argument("--out", required=True)
    parser.add_argument("meshes", nargs="+")
    a = parser.parse_args()
    n = len(a.meshes)
    plot = pyvista.Plotter(off_screen=True, shape=(1, n), window_size=(420 * n, 480), border=False)
    for k, item in enumerate(a.meshes):
        path, vertex, azimuth = (item.split(":") + ["0", "0"])[:3]
        with tempfile.TemporaryDirectory() as folder:
            mesh, locus = os.path.join(folder, "m.vtp"), os.path.join(folder, "l.vtp")
            subprocess.run([a.program, "solve", path, "--vertex", vertex, "--locus", locus, "--out", mesh, "--quiet"],
                           check=True)
            surface, lines = pyvista.read(mesh), pyvista.read(locus)
        edge = np.sqrt(surface.area / surface.n_cells * 4 / 3 ** 0.5)
        strength = lines.cell_data["strength"] / edge
        top = max(strength[np.isfinite(strength)], default=1)
        lines.cell_data["strength"] = np.minimum(strength, top)
        size = surface.length
        plot.subplot(0, k)
        plot.add_mesh(surface, color="#e8e4dc", smooth_shading=True, specular=0.1)
        tubes = lines.tube(radius=0.0025 * size)
        plot.add_mesh(tubes, scalars="strength", log_scale=True, cmap="plasma_r", clim=(0.2, max(top, 1)),
                      scalar_bar_args={"title": "strength, mean edges" + " " * k, "color": "black", "n_labels": 2,
                                       "height": 0.1, "width": 0.7, "position_x": 0.15, "fmt": "%.3g",
                                       "title_font_size": 16, "label_font_size": 14})
        plot.add_mesh(pyvista.Sphere(radius=0.012 * size, center=surface.points[int(vertex)]), color="black")
        plot.camera_position = "xy"
        plot.camera.azimuth = float(azimuth)
    plot.set_background("white")
    plot.screenshot(a.out)


if __name__ == "__main__":
    main()
