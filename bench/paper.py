#!/usr/bin/env python3
"""Every experiment of the paper: figures, and a table with the paper's numbers, ours, the exact ones.

usage: paper.py [--program DMKCL] [--out build/paper] [--small bench/results/paper] [--quick]
The meshes are made by `dmkcl mesh`, with as many triangles as the paper's. Into --out go the meshes,
the results, the figures as PNG and table.md; into --small the table and small figures. --quick: the
coarsest mesh of each surface only. Needs numpy, scipy, vtk, matplotlib and pillow: tests/pyenv.sh.
"""
import argparse
import json
import os
import resource
import subprocess
import sys
import time

import numpy as np
import vtk
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar
from scipy.spatial import cKDTree
from vtk.util.numpy_support import vtk_to_numpy

import accuracy
import picture

# Surface of dmkcl mesh, source, refinements, seconds in the paper (a laptop of 2014), and of the
# smooth surface: cost, length of the cut locus, ends, branch points. The exact figures are from
# geodesics shot with a Runge-Kutta method of order eight, cut times by Newton's method on their
# meeting; the torus' length is 4 pi + 2 pi (3 - sqrt 3). Of the quartic's four branch points two pairs
# lie 0.007 and 0.010 apart and count once each. The names are those of accuracy.py.
EXPERIMENTS = {
    "torus": ("torus", (3, 0, 0), (0, 1, 2, 3), {}, 321.416460, 20.5331304, 2, 2),
    "umbilic": ("ellipsoid", (-0.115470, 0, 0.816497), (0, 1, 2), {}, 4.56451130, 0, 0, 0),
    "ellipsoid": ("ellipsoid", (-0.151128, -0.350718, 0.295520), (0, 1, 2), {},
                  3.73820713, 2.05835546, 2, 0),
    "quartic": ("quartic", (0.533843, 0.800764, 0.844080), (2, 3), {2: 782, 3: 4606},
                32.9290006, 7.53604640, 6, 2),
}
LABELS = {"torus": "torus, p = (3, 0, 0)", "umbilic": "ellipsoid, p1 (umbilic)",
          "ellipsoid": "ellipsoid, p2", "quartic": "quartic"}


def seconds_of_children():
    """Processor time, which other work on the machine hardly changes."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


class Run:
    """One mesh, solved; the arrays that figures and tables need."""

    def __init__(self, program, folder, name, refine):
        surface, source = EXPERIMENTS[name][:2]
        self.name, self.refine, self.source = name, refine, np.array(source, float)
        stem = os.path.join(folder, f"{name}-{refine}")
        point = ",".join(map(repr, source))
        mesh = stem + ".off"
        subprocess.run([program, "mesh", surface, f"--source={point}", "--refine", str(refine),
                        "--out", mesh, "--quiet"], check=True)
        begin = seconds_of_children()
        subprocess.run([program, "solve", mesh, f"--source={point}", "--out", stem + ".vtp",
                        "--locus", stem + "-locus.obj", "--tangent", stem + "-tangent.csv",
                        "--report", stem + ".json", "--quiet"], check=True)
        self.seconds = seconds_of_children() - begin
        self.locus, self.tangent = stem + "-locus.obj", stem + "-tangent.csv"
        self.result = picture.read(vtk.vtkXMLPolyDataReader(), stem + ".vtp")
        with open(stem + ".json") as file:
            self.report = json.load(file)
        self.mu = vtk_to_numpy(self.result.GetCellData().GetArray("mu"))
        self.acl = vtk_to_numpy(self.result.GetCellData().GetArray("acl")) != 0
        self.x, self.triangles = accuracy.read_off(mesh)
        self.h = self.report["mesh"]["mean_edge"]
        self.score = accuracy.score(name, self.locus, self.h)

    def cover(self, chosen):
        """Of the chosen triangles: number, share of the area, how well they cover the exact locus."""
        p, q, r = (self.x[self.triangles[:, k]] for k in range(3))
        area = np.linalg.norm(np.cross(q - p, r - p), axis=1) / 2
        centres, weights = ((p + q + r) / 3)[chosen], area[chosen]
        shares = accuracy.shares(self.name, centres, weights, self.h)
        return dict(triangles=int(chosen.sum()), area=weights.sum() / area.sum(), **shares)


# ---- views ---------------------------------------------------------------------------------------


TEXT_SIZE = 22  # pixels
BAR_SHARE = 0.17  # of a panel's width: the bar of colours and its numbers


def table_of_colours(top):
    """From black at 0 to pale yellow at `top`, evenly to the eye."""
    stops = vtk.vtkColorTransferFunction()
    for at, rgb in ((0, (0.0, 0.0, 0.02)), (0.25, (0.34, 0.06, 0.43)), (0.5, (0.74, 0.21, 0.33)),
                    (0.75, (0.98, 0.55, 0.04)), (1, (0.99, 1.0, 0.64))):
        stops.AddRGBPoint(at, *rgb)
    table = vtk.vtkLookupTable()
    table.SetNumberOfTableValues(256)
    for i in range(256):
        table.SetTableValue(i, *stops.GetColor(i / 255), 1)
    table.SetTableRange(0, top)
    table.Build()
    return table


def part_below(run, bound, line=0):
    """The triangles with mu <= bound, coloured from 0 to the bound; their edges `line` pixels wide."""
    data = vtk.vtkPolyData()
    data.ShallowCopy(run.result)
    data.GetCellData().SetActiveScalars("mu")
    part = vtk.vtkThreshold()
    part.SetInputData(data)
    part.SetInputArrayToProcess(0, 0, 0, vtk.vtkDataObject.FIELD_ASSOCIATION_CELLS, "mu")
    part.SetThresholdFunction(vtk.vtkThreshold.THRESHOLD_LOWER)
    part.SetLowerThreshold(bound)
    surface = vtk.vtkGeometryFilter()
    surface.SetInputConnection(part.GetOutputPort())
    shown = picture.actor(surface)
    mapper = shown.GetMapper()
    mapper.SetScalarModeToUseCellFieldData()
    mapper.SelectColorArray("mu")
    mapper.SetLookupTable(table_of_colours(bound))
    mapper.UseLookupTableScalarRangeOn()
    shown.GetProperty().LightingOff()
    if line:
        shown.GetProperty().SetRepresentationToWireframe()
        shown.GetProperty().SetLineWidth(line)
    return shown


def pale_surface(run):
    plain = vtk.vtkPassThrough()
    plain.SetInputData(run.result)
    shown = picture.actor(plain, (0.80, 0.83, 0.88))
    mapper = shown.GetMapper()
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(2, 2)
    shown.GetProperty().SetAmbient(0.35)
    shown.GetProperty().SetDiffuse(0.7)
    return shown


def coloured_surface(run, top):
    shown = picture.surface_actor(run.result, table_of_colours(top))
    shown.GetProperty().SetAmbient(0.6)
    shown.GetProperty().SetDiffuse(0.45)
    return shown


def text_style(style, size):
    style.SetColor(0.1, 0.1, 0.1)
    style.SetFontSize(size)
    style.ShadowOff()
    style.ItalicOff()
    style.BoldOff()


def strip(viewport, actor):
    """A part of the picture beside the shape."""
    shown = vtk.vtkRenderer()
    shown.SetViewport(viewport)
    shown.SetBackground(1, 1, 1)
    shown.AddViewProp(actor)
    return shown


def title_actor(text):
    shown = vtk.vtkTextActor()
    shown.SetInput(text)
    text_style(shown.GetTextProperty(), TEXT_SIZE)
    shown.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
    shown.SetPosition(0.03, 0.2)
    return shown


def bar_actor(top):
    """What the colours up to `top` mean."""
    bar = vtk.vtkScalarBarActor()
    bar.SetLookupTable(table_of_colours(top))
    bar.SetTitle("mu")
    bar.SetNumberOfLabels(3)
    bar.SetLabelFormat("%g")
    bar.UnconstrainedFontSizeOn()
    for style in bar.GetTitleTextProperty(), bar.GetLabelTextProperty():
        text_style(style, TEXT_SIZE - 4)
    bar.SetBarRatio(0.2)
    bar.SetVerticalTitleSeparation(8)
    bar.SetPosition(0.02, 0.1)
    bar.SetWidth(0.96)
    bar.SetHeight(0.8)
    return bar


def eye(run, direction, distance):
    """Where the camera is: `distance` diagonals from the middle."""
    focus = np.array(run.result.GetCenter())
    direction = np.array(direction) / np.linalg.norm(direction)
    return focus, focus + distance * run.result.GetLength() * direction


def ring_actor(run, direction, distance):
    """A circle around the source, moved towards the eye so that nothing hides it."""
    camera = eye(run, direction, distance)[1]
    ring = vtk.vtkRegularPolygonSource()
    ring.SetNumberOfSides(48)
    ring.SetRadius(0.02 * run.result.GetLength())
    ring.SetCenter(run.source + 0.4 * (camera - run.source))
    ring.SetNormal(camera - run.source)
    ring.GeneratePolygonOff()
    shown = picture.actor(ring, (0, 0, 0))
    shown.GetProperty().SetLineWidth(3)
    shown.GetProperty().LightingOff()
    return shown


def locus_actor(run):
    return picture.locus_actor(picture.read(vtk.vtkOBJReader(), run.locus),
                               0.003 * run.result.GetLength())


def view(panel, actors, run, direction, distance, title, top=None):
    """The renderers of one panel: the shape, the title above it and, with `top`, the colours' bar beside it."""
    left, low, right, high = panel
    edge = high - 0.1 * (high - low)
    side = right if top is None else right - BAR_SHARE * (right - left)
    focus, camera = eye(run, direction, distance)
    shown = picture.half(actors, (left, low, side, edge), camera - focus, focus, 1)
    shown.ResetCameraClippingRange()
    views = [shown, strip((left, edge, right, high), title_actor(title))]
    if top is not None:
        views.append(strip((side, low, right, edge), bar_actor(top)))
    return views


def write_png(views, size, path):
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(*size)
    for v in views:
        v.SetLayer(0)
        window.AddRenderer(v)
    window.Render()
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    write = vtk.vtkPNGWriter()
    write.SetFileName(path)
    write.SetInputConnection(grab.GetOutputPort())
    write.Write()


def grid(k, columns, rows):
    column, row = k % columns, rows - 1 - k // columns
    return column / columns, row / rows, (column + 1) / columns, (row + 1) / rows


# ---- figures -------------------------------------------------------------------------------------


def figure_torus(runs, path):
    """mu <= 1e-3 on each mesh, then mu <= 1e-4 on the finest."""
    shown = [(run, 1e-3, f"{len(run.mu):,} triangles, mu <= 1e-3") for run in runs]
    shown.append((runs[-1], 1e-4, f"{len(runs[-1].mu):,} triangles, mu <= 1e-4"))
    columns = 3 if len(shown) > 2 else 2
    rows = -(-len(shown) // columns)
    look = (-1.5, -0.9, 1.7), 2.3
    views = []
    for k, (run, bound, title) in enumerate(shown):
        actors = [pale_surface(run), part_below(run, bound), part_below(run, bound, 3),
                  ring_actor(run, *look)]
        views += view(grid(k, columns, rows), actors, run, *look, title, bound)
    if len(shown) < columns * rows:
        actors = [pale_surface(runs[-1]), locus_actor(runs[-1]), ring_actor(runs[-1], *look)]
        views += view(grid(len(shown), columns, rows), actors, runs[-1], *look,
                      "the cut locus as a graph")
    write_png(views, (600 * columns, 420 * rows), path)


def figure_ellipsoid(rows, path):
    """mu below 0.04 and lines of equal distance; the source lies behind, in the ring."""
    views, columns = [], len(rows[0])
    for r, runs in enumerate(rows):
        # from the side that the source is not on, seen along the shortest axis as far as possible
        direction = (2.2, 0.9, -0.5) if r == 0 else (1.6, 1.7, 0.1)
        for c, run in enumerate(runs):
            actors = [pale_surface(run), part_below(run, 0.04), picture.contour_actor(run.result),
                      ring_actor(run, direction, 3.3)]
            views += view(grid(r * columns + c, columns, len(rows)), actors, run, direction, 3.3,
                          f"p{r + 1}, {len(run.mu):,} triangles", 0.04)
    write_png(views, (430 * columns, 520 * len(rows)), path)


def figure_quartic(runs, path):
    """mu from behind, up to 0.01; and the cut locus as a graph. The source lies on the far side, in the ring."""
    direction, n = (-1.25, -1.65, -0.75), len(runs)
    views = []
    for k, run in enumerate(runs):
        actors = [coloured_surface(run, 0.01), part_below(run, 0.01, 2), ring_actor(run, direction, 2.75)]
        views += view(grid(k, n + 1, 1), actors, run, direction, 2.75,
                      f"{len(run.mu):,} triangles, mu up to 0.01", 0.01)
    run = runs[-1]
    actors = [pale_surface(run), picture.contour_actor(run.result), locus_actor(run),
              ring_actor(run, direction, 2.75)]
    views += view(grid(n, n + 1, 1), actors, run, direction, 2.75, "the cut locus as a graph")
    write_png(views, (620 * (n + 1), 560), path)


def exact_tangent_torus(angles):
    """Cut times at (3, 0, 0): a geodesic is minimal until it meets the inner equator, the opposite
    meridian or the outer equator again. phi runs around the axis, v around the tube, v = 0 outside."""

    def geodesic(_, y):
        phi_dot, v_dot, v = y[2], y[3], y[1]
        r, slope = 2 + np.cos(v), -np.sin(v)
        return [phi_dot, v_dot, -2 * slope / r * v_dot * phi_dot, r * slope * phi_dot ** 2]

    def inner(_, y):
        return abs(y[1]) - np.pi

    def opposite(_, y):
        return abs(y[0]) - np.pi

    def outer(_, y):
        return y[1] if y[1] != 0 else 1.0

    for event in (inner, opposite, outer):
        event.terminal = True
    outer.direction = -1
    times = []
    for angle in angles:
        start = [0, 1e-12, np.cos(angle) / 3, max(abs(np.sin(angle)), 1e-9)]
        run = solve_ivp(geodesic, (0, 20), start, "DOP853", events=(inner, opposite, outer),
                        rtol=1e-10, atol=1e-12)
        times.append(run.t[-1])
    return np.array(times)


def tangent_error(run):
    """The exact curve, our points, and the distances of these from it, all in the tangent plane."""
    table = np.genfromtxt(run.tangent, delimiter=",", names=True)
    angles = np.linspace(0, np.pi, 721)
    times = exact_tangent_torus(angles)
    a, t = np.r_[angles, -angles[::-1]], np.r_[times, times[::-1]]
    curve = np.c_[t * np.cos(a), t * np.sin(a)]
    step = np.roll(curve, -1, 0) - curve
    tree = cKDTree(np.vstack([curve + s * step for s in np.arange(10) / 10]))

    def turned(by):
        a, t = table["angle"] + by, table["time"]
        return np.c_[t * np.cos(a), t * np.sin(a)]

    # our angles count from an edge at the source
    by = min(np.linspace(0, 2 * np.pi, 721), key=lambda x: tree.query(turned(x))[0].mean())
    by = minimize_scalar(lambda x: tree.query(turned(x))[0].mean(), (by - 0.01, by, by + 0.01)).x
    return curve, turned(by), tree.query(turned(by))[0]


def figure_tangent(run, path):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    curve, points, off = tangent_error(run)
    figure, axes = plt.subplots(figsize=(5, 5.4))
    axes.fill(*curve.T, color="#f6d87a", alpha=0.3)
    axes.plot(*curve.T, color="0.3", lw=1, label="exact")
    axes.plot(*points.T, ".", color="#cc1c21", ms=3, label=f"computed, {len(run.mu):,} triangles")
    axes.plot(0, 0, "o", color="black", ms=4, label="source")
    axes.set_aspect("equal")
    axes.set_title("Tangent cut locus of the torus, p = (3, 0, 0)", fontsize=11)
    axes.legend(loc=(0.2, 0.55), frameon=False)
    figure.tight_layout()
    figure.savefig(path, dpi=160)
    plt.close(figure)
    return off


def write_small(path, to, width):
    """Narrower, and in 256 colours: small enough for a page."""
    from PIL import Image
    with Image.open(path) as whole:
        height = round(whole.height * width / whole.width)
        small = whole.convert("RGB").resize((width, height), Image.LANCZOS)
        small.quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(to, optimize=True)


# ---- tables --------------------------------------------------------------------------------------


def number(x, digits=6):
    return f"{x:.{digits}g}"


def distance_text(run):
    """Of the locus from the exact one."""
    s = run.score
    if run.name == "umbilic":
        return f"{s['max']:.3f}", ""
    return f"{s['out']:.3f}, {s['ref']:.3f}", f"{100 * s['missed']:.1f} %, {100 * s['false']:.1f} %"


def rows_of_runs(runs):
    yield ("| | triangles | processor seconds | in the paper | cost | (exact) | length | (exact) | "
           "ends (exact) | branch points (exact) | distance, edges | missed, false |")
    yield "|---|--:|--:|--:|---|--:|--:|--:|---|---|---|---|"
    for run in runs:
        _, _, _, seconds, cost, length, ends, branches = EXPERIMENTS[run.name]
        r, s = run.report, run.score
        near, shares = distance_text(run)
        yield "| " + " | ".join([
            LABELS[run.name], f"{len(run.mu):,}", f"{run.seconds:.2f}",
            f"{seconds.get(run.refine, '')}",
            f"{r['cost_lower']:.6g} to {r['cost_upper']:.6g}", number(cost),
            number(r["locus"]["length"]), number(length),
            f"{s.get('ends', r['locus']['endpoints'])} ({ends})",
            f"{s.get('branches', r['locus']['branch_points'])} ({branches})", near, shares]) + " |"


def rows_of_bounds(torus):
    yield "| triangles | eps | triangles below | share of the area | exact locus missed | false |"
    yield "|--:|--:|--:|--:|--:|--:|"
    shown = [(run, f"{bound:.0e}", run.mu <= bound) for bound, runs in
             ((1e-3, torus), (1e-4, torus[-1:])) for run in runs]
    for run, bound, chosen in shown + [(run, "by size", run.acl) for run in torus]:
        b = run.cover(chosen)
        yield (f"| {len(run.mu):,} | {bound} | {b['triangles']:,} | {100 * b['area']:.2f} % | "
               f"{100 * b['missed']:.1f} % | {100 * b['false']:.1f} % |")


def rows_of_tables(runs, off):
    device = runs["torus"][0].report["device"]
    seconds = sum(run.seconds for name in runs for run in runs[name])
    yield "# The experiments of the paper"
    yield ""
    yield (f"`make paper`, {time.strftime('%Y-%m-%d', time.gmtime())}, {os.cpu_count()} cores, "
           f"{device['name']} (driver {device['driver']}); {seconds:.0f} processor seconds.")
    yield ""
    yield "## Cost and cut locus"
    yield ""
    yield from rows_of_runs([run for name in runs for run in runs[name]])
    yield ""
    yield TEXT_RUNS
    yield ""
    yield "## The paper's approximate cut locus on the torus, {mu <= eps}"
    yield ""
    yield from rows_of_bounds(runs["torus"])
    yield ""
    yield TEXT_BOUNDS
    yield ""
    yield "## Tangent cut locus of the torus"
    yield ""
    finest = runs["torus"][-1]
    yield (f"{len(off):,} points on {len(finest.mu):,} triangles lie {off.mean() / finest.h:.3f} mean "
           f"edges from the exact curve in the mean, {np.quantile(off, 0.99) / finest.h:.2f} at most for "
           "99 of 100, in the tangent plane.")
    yield TEXT_TANGENT


TEXT_RUNS = """\
The meshes are those of `dmkcl mesh` and have as many triangles as the paper's. Processor seconds:
of all threads, whole runs from file to files; the paper's are seconds of a laptop of 2014 with an Intel
Core i5. The cost is the integral of the distance: bounds for the problem on the mesh, and its value on the smooth surface. Distance: of the
computed cut locus from the exact one, and back, in mean edge lengths; missed and false: shares of their
lengths farther than three from each other. Ends and branch points nearer than three edges count once:
of the quartic's four branch points two pairs lie 0.007 and 0.010 apart."""

TEXT_BOUNDS = """\
Missed: the share of the exact locus' length with no such triangle within three mean edges; false: the
share of their area farther than three from it. At the optimum mu in a triangle that the cut locus crosses
is of the order of its size, and below a fixed eps in some only; `by size` is the default of `dmkcl`, an
eps that follows the size of each triangle. The graph in the first table needs no eps."""

TEXT_TANGENT = """\
Exact: geodesics of the torus until they meet the inner equator, the opposite meridian or the outer
equator again."""


# ---- all of it -----------------------------------------------------------------------------------


def main():
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("--program", default="build/release/dmkcl")
    ask.add_argument("--out", default="build/paper")
    ask.add_argument("--small", help="folder for the table and small figures")
    ask.add_argument("--quick", action="store_true", help="coarsest meshes only")
    o = ask.parse_args()
    begin = time.perf_counter()
    os.makedirs(o.out, exist_ok=True)
    vtk.vtkLogger.SetStderrVerbosity(vtk.vtkLogger.VERBOSITY_ERROR)  # no words on missing displays
    runs = {}
    for name, experiment in EXPERIMENTS.items():
        runs[name] = []
        for refine in experiment[2][:1] if o.quick else experiment[2]:
            run = Run(o.program, o.out, name, refine)
            runs[name].append(run)
            print(f"{LABELS[name]}: {len(run.mu):,} triangles in {run.seconds:.2f} processor seconds", flush=True)
    figures = {"torus": 900, "tangent": 640, "ellipsoid": 700, "quartic": 800}
    paths = {name: os.path.join(o.out, name + ".png") for name in figures}
    figure_torus(runs["torus"], paths["torus"])
    off = figure_tangent(runs["torus"][-1], paths["tangent"])
    figure_ellipsoid([runs["umbilic"], runs["ellipsoid"]], paths["ellipsoid"])
    figure_quartic(runs["quartic"], paths["quartic"])
    text = "\n".join(rows_of_tables(runs, off)) + "\n"
    for folder in filter(None, (o.out, o.small)):
        os.makedirs(folder, exist_ok=True)
        with open(os.path.join(folder, "table.md"), "w") as file:
            file.write(text)
    if o.small:
        for name, width in figures.items():
            write_small(paths[name], os.path.join(o.small, name + ".png"), width)
    print(f"{o.out}: {', '.join(sorted(os.path.basename(p) for p in paths.values()))}, table.md; "
          f"{time.perf_counter() - begin:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
