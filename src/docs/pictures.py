"""The pictures of the pages, from computed results: python pictures.py FOLDER."""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import LogNorm, Normalize

import dmkcl

RED, BLUE, GREY = "#cc1c21", "#1f5a96", "#555555"


class Scene:
    """Triangles and lines on them, drawn from back to front."""

    def __init__(self, mesh, direction, up=(0, 0, 1)):
        back = np.array(direction, float)
        back /= np.linalg.norm(back)
        right = np.cross(up, back)
        right /= np.linalg.norm(right)
        self.frame = np.array([right, np.cross(back, right), back])
        self.mesh, self.items = mesh, []
        corner = mesh.vertices[mesh.faces]
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        light = np.array([0.3, 0.5, 0.8]) @ self.frame
        self.front = normal @ back > 0
        self.shade = 0.72 + 0.28 * np.clip(normal @ light, 0, 1)
        self.size = mesh.info["mean_edge"]

    def surface(self, colours, edges="none", width=0.0):
        corner = self.mesh.vertices[self.mesh.faces] @ self.frame.T
        for k in np.flatnonzero(self.front):
            shown = (*np.clip(np.asarray(colours[k])[:3] * self.shade[k], 0, 1), 1)
            edge = shown if edges == "none" else edges
            self.items.append((corner[k, :, 2].mean(), corner[k, :, :2], shown, edge, width or 0.3))

    def lines(self, pairs, colour, width, lift=1.0):
        """pairs: (k, 2, 3) ends; colour: one, or k of them."""
        ends = np.asarray(pairs) @ self.frame.T
        colours = [colour] * len(ends) if isinstance(colour, str) else colour
        for pair, ink in zip(ends, colours):
            self.items.append((pair[:, 2].mean() + lift * self.size, pair[:, :2], "none", ink, width))

    def draw(self, ax):
        self.items.sort(key=lambda item: item[0])
        _, shapes, faces, edges, widths = zip(*self.items)
        ax.add_collection(
            PolyCollection(shapes, facecolors=faces, edgecolors=edges, linewidths=widths, closed=False)
        )
        ax.autoscale_view()
        ax.set_aspect("equal")
        ax.axis("off")


def contour_lines(mesh, values, levels):
    """Ends of the segments at which the piecewise linear function has these values."""
    found = []
    value, corner = values[mesh.faces], mesh.vertices[mesh.faces]
    for level in levels:
        above = value > level
        for k in range(3):  # the corner k is on one side, the two others on the other one
            i, j = (k + 1) % 3, (k + 2) % 3
            at = (above[:, i] == above[:, j]) & (above[:, k] != above[:, i])
            ends = []
            for other in (i, j):
                t = (level - value[at, k]) / (value[at, other] - value[at, k])
                ends.append(corner[at, k] + t[:, None] * (corner[at, other] - corner[at, k]))
            found.append(np.stack(ends, axis=1))
    return np.concatenate(found)


def window(ax):
    """A window of the edge AB seen from s runs over the triangle to the two far edges."""
    a, b, c, s = map(np.array, ((0.0, 0.0), (4.0, 0.0), (2.3, 3.0), (1.2, -2.2)))
    ax.add_patch(plt.Polygon([a, b, c], facecolor="#eef2f7", edgecolor=GREY))
    interval = np.array([[1.1, 0], [2.7, 0]])
    ends = []
    for p, q in zip(interval, ((a, c), (b, c))):
        ray = p - s
        side = q[1] - q[0]
        t = np.linalg.solve(np.column_stack([ray, -side]), q[0] - s)[0]
        ends.append(s + t * ray)
        ax.plot(*zip(s, ends[-1]), color=BLUE, lw=1)
    ax.add_patch(plt.Polygon([*interval, ends[1], c, ends[0]], facecolor=BLUE, alpha=0.15, lw=0))
    ax.plot(*interval.T, color=RED, lw=4, solid_capstyle="butt")
    ax.plot(*zip(ends[0], c, ends[1]), color=RED, lw=4, solid_joinstyle="round")
    ax.plot(*s, "o", color=BLUE)
    for text, place in (("$s$", s + (0.15, -0.1)), ("$b_0$", (0.9, -0.4)), ("$b_1$", (2.65, -0.4))):
        ax.text(*place, text, fontsize=13)
    ax.text(0.0, -1.3, r"$\sigma$ to the source", color=BLUE, ha="right")
    ax.plot([s[0], 0.1], [s[1], -1.4], ":", color=BLUE)
    ax.set_xlim(-1.6, 4.3)
    ax.set_aspect("equal")
    ax.axis("off")


def geodesics(folder):
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.9), width_ratios=(1, 1.25))
    window(left)
    mesh = dmkcl.surfaces.ellipsoid(1, 0.7, 0.55, n_triangles=9000)
    source = int(np.argmax(mesh.vertices @ (0.7, -0.5, 0.5)))
    found = dmkcl.Geodesics(mesh, source)
    scene = Scene(mesh, (0.35, -0.8, 0.5))
    colours = plt.get_cmap("Blues_r")(Normalize(-0.3, 1.5 * found.distance.max())(found.distance[mesh.faces].mean(axis=1)))
    scene.surface(colours)
    scene.lines(contour_lines(mesh, found.distance, np.linspace(0, found.distance.max(), 26)[1:-1]), "#2b4c6f", 0.6)
    for end in np.random.default_rng(1).integers(0, len(mesh.vertices), 60):
        path = found.path(vertex=int(end)).points
        scene.lines(np.stack([path[:-1], path[1:]], axis=1), RED, 0.9, lift=2)
    scene.draw(right)
    save(figure, folder, "geodesics")


def locus(folder):
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.9))
    mesh = dmkcl.surfaces.torus(n_triangles=1200, source=(3, 0, 0))
    result = dmkcl.CutLocus(mesh).solve(vertex=0)
    scene = Scene(mesh, (-0.9, -0.6, 1.1))
    scene.surface(np.full((len(mesh.faces), 3), 0.94), edges="#c8c8c8", width=0.4)
    pairs = result.locus.vertices[result.locus.edges]
    crossed = {tuple(sorted(e)) for e in edges_crossed(mesh, result.locus)}
    every = {tuple(sorted(e)) for f in mesh.faces for e in ((f[0], f[1]), (f[1], f[2]), (f[2], f[0]))}
    scene.lines(mesh.vertices[np.array(sorted(every - crossed))], "#9aa4ad", 0.5)
    scene.lines(mesh.vertices[np.array(sorted(crossed))], "#e39a9c", 1.1)
    scene.lines(pairs, RED, 2.2, lift=2)
    scene.draw(left)

    mesh = dmkcl.surfaces.quartic(n_triangles=16000)
    source = int(np.argmax(mesh.vertices @ (0.6, 0.3, 0.7)))
    result = dmkcl.CutLocus(mesh).solve(vertex=source, strength=0.02 * mesh.info["mean_edge"])
    strength = result.locus.edge_strength / mesh.info["mean_edge"]
    norm = LogNorm(0.02, 10)
    scene = Scene(mesh, -mesh.vertices[source] + (0.1, 0.35, 0.2))
    scene.surface(np.full((len(mesh.faces), 3), 0.94))
    colour = plt.get_cmap("viridis_r")(norm(np.minimum(strength, 10)))
    scene.lines(result.locus.vertices[result.locus.edges], list(map(tuple, colour)), 2, lift=2)
    scene.draw(right)
    bar = figure.colorbar(plt.cm.ScalarMappable(norm, "viridis_r"), ax=right, shrink=0.7)
    bar.set_label("strength in mean edges")
    save(figure, folder, "locus")


def of_a_set(folder):
    figure, ax = plt.subplots(figsize=(6, 3.9))
    mesh = dmkcl.surfaces.torus(n_triangles=16000)
    at = dmkcl.Geodesics(mesh, points=[(2.7, 1.2, 0), (-0.4, 2.9, 0.2)])
    locus = at.locus()
    pairs = locus.vertices[locus.edges]
    between = (locus.sources[locus.edges] != locus.sources[locus.edges][..., ::-1]).any(axis=(1, 2))
    scene = Scene(mesh, (-0.5, -0.9, 1.0))
    tints = np.array([(0.95, 0.91, 0.84), (0.90, 0.94, 0.87)])
    scene.surface(tints[at.nearest[mesh.faces[:, 0]]])
    scene.lines(contour_lines(mesh, at.distance, np.arange(0.25, 5, 0.25)), "#9aa4ad", 0.5)
    scene.lines(pairs[between], RED, 2, lift=2)
    scene.lines(pairs[~between], BLUE, 2, lift=2)
    scene.draw(ax)
    save(figure, folder, "set")


def edges_crossed(mesh, graph):
    """Mesh edges on which a vertex of the locus lies: two of its three weights are not 0."""
    on = (graph.bary > 1e-9).sum(axis=1) == 2
    for face, weight in zip(mesh.faces[graph.faces[on]], graph.bary[on]):
        yield face[weight > 1e-9]


def newton(folder):
    figure, ax = plt.subplots(figsize=(6.5, 3.6))
    solver = dmkcl.CutLocus(dmkcl.surfaces.torus(n_triangles=5400, source=(3, 0, 0)))
    for name, colour in (("newton", RED), ("inertial", BLUE), ("euler", GREY)):
        history = solver.solve(vertex=0, method=name, start="uniform").history
        ax.semilogy(history["step"], history["change"], color=colour, label=name, marker="." if name == "newton" else None)
    ax.set_xscale("log")
    ax.set_xlabel("step")
    ax.set_ylabel("relative change of mu per unit time")
    ax.legend()
    save(figure, folder, "newton")


def multigrid(folder):
    figure, ax = plt.subplots(figsize=(6.5, 3.2))
    for n, colour in ((1000, GREY), (8000, BLUE), (64000, RED)):
        mesh = dmkcl.surfaces.quartic(n_triangles=n)
        result = dmkcl.CutLocus(mesh).solve(point=(0.2, 0.58, 0.97), start="uniform")
        label = f"{len(mesh.faces):,} triangles, {result.stats['levels']} levels"
        cycles = np.cumsum(result.history["cg_iterations"])
        ax.semilogy(cycles, result.history["change"], "o-", ms=4, color=colour, label=label)
    ax.set_xlabel("V-cycles so far")
    ax.set_ylabel("relative change of mu")
    ax.legend()
    save(figure, folder, "multigrid")


def certificate(folder):
    figure, ax = plt.subplots(figsize=(6.5, 3.4))
    sizes, lower, upper, exact = [], [], [], []
    for n in (700, 1400, 2800, 5600, 11200, 22400):
        mesh = dmkcl.surfaces.torus(n_triangles=n, source=(3, 0, 0))
        result = dmkcl.CutLocus(mesh).solve(vertex=0)
        sizes.append(len(mesh.faces))
        lower.append(result.certificate.lower)
        upper.append(result.certificate.upper)
        exact.append(result.stats["cost_exact"])
    ax.semilogx(sizes, upper, "v-", color=RED, label="upper bound")
    ax.semilogx(sizes, lower, "^-", color=BLUE, label="lower bound")
    ax.semilogx(sizes, exact, "o", color=GREY, label="integral of the polyhedron's distance")
    ax.axhline(321.4165, color="black", lw=0.8, label="on the smooth torus")
    ax.set_xlabel("triangles")
    ax.set_ylabel("cost")
    ax.legend()
    save(figure, folder, "certificate")


def save(figure, folder, name):
    figure.tight_layout()
    figure.savefig(folder / f"{name}.png", dpi=130)
    plt.close(figure)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for draw in (geodesics, locus, of_a_set, newton, multigrid, certificate):
        draw(folder)
