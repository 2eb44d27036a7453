"""W1 on a surface beside POT: exact linear programming on the matrix of exact geodesic distances.

    python bench/transport.py [--picture FILE.png]

Needs dmkcl (pip install ./src/python), POT and, for the picture, Matplotlib. Times are user CPU seconds.
The two agree up to the discretisation: here a density is linear in each triangle, for POT it sits in the
vertices.
"""

import argparse
import resource

import numpy as np

import dmkcl


def cpu():
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime


def areas(mesh):
    """Area that belongs to each vertex."""
    corner = mesh.vertices[mesh.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.zeros(len(mesh.vertices))
    np.add.at(area, mesh.faces.ravel(), np.repeat(np.linalg.norm(normal, axis=1) / 6, 3))
    return area


def loads(mesh):
    """Pairs of measures, masses of the vertices with sum 1."""
    x, area = mesh.vertices, areas(mesh)

    def bump(*place):
        return np.exp(-((x - place) ** 2).sum(axis=1) / 0.3)

    pairs = {
        "blob to blob": (bump(3, 0, 0), bump(-3, 0, 0)),
        "near blobs": (bump(3, 0, 0), bump(2, 1.6, 0.8)),
        "smooth": (2 + np.sin(2 * x[:, 0]), 2 + np.cos(2 * x[:, 1])),
        "blob to even": (bump(-2, 0, 1), np.ones(len(x))),
    }
    return {name: [d * area / (d * area).sum() for d in pair] for name, pair in pairs.items()}


def compare(mesh):
    import ot

    n = len(mesh.vertices)
    begin = cpu()
    cost = np.array([dmkcl.Geodesics(mesh, v).distance for v in range(n)])
    print(f"{n} vertices: matrix of exact distances {cpu() - begin:.1f} s")
    print("| load | dmkcl: W1 between | seconds | POT emd2 | seconds | difference |")
    print("|---|---|---|---|---|---|")
    solver = dmkcl.CutLocus(mesh)
    for name, (a, b) in loads(mesh).items():
        begin = cpu()
        found = solver.transport(a, b, normalise=True)
        ours, begin = cpu() - begin, cpu()
        exact = ot.emd2(a, b, (cost + cost.T) / 2, numItermax=10**7)
        print(
            f"| {name} | {found.lower:.5f} and {found.upper:.5f} | {ours:.2f} | {exact:.5f} "
            f"| {cpu() - begin:.2f} | {100 * (found.w1 / exact - 1):+.2f} % |"
        )


def draw(path):
    """The density and the flux from blob to blob on a torus, seen from above."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    mesh = dmkcl.surfaces.torus(2, 1, n_triangles=20000)
    a, b = loads(mesh)["blob to blob"]
    found = dmkcl.CutLocus(mesh).transport(a, b, normalise=True)
    corner = mesh.vertices[mesh.faces]
    up = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2] > 0
    centre = corner[up].mean(axis=1)
    figure, axes = plt.subplots(figsize=(6, 6))
    axes.tripcolor(*mesh.vertices[:, :2].T, mesh.faces[up], found.density[up], cmap="viridis")
    some = np.random.default_rng(1).permutation(len(centre))[:700]
    flux = found.flux[up][some]
    size = np.linalg.norm(flux, axis=1)
    keep = size > 0.03 * size.max()
    axes.quiver(*centre[some][keep, :2].T, *(flux[keep, :2] / size[keep, None]).T, color="white", scale=25)
    axes.set_aspect("equal")
    axes.axis("off")
    figure.savefig(path, dpi=80, bbox_inches="tight")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--picture", help="draw blob to blob into this file instead")
    picture = parser.parse_args().picture
    if picture:
        draw(picture)
    else:
        compare(dmkcl.surfaces.torus(2, 1, n_triangles=4000))


if __name__ == "__main__":
    main()
