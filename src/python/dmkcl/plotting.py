"""Pictures of a result, with PyVista and Matplotlib (``pip install dmkcl[plot]``)."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Optional, Sequence

import numpy as np

from ._colour import density_map

if TYPE_CHECKING:
    from ._result import Result

LOCUS_COLOUR = "#cc1c21"
SOURCE_COLOUR = "#ffbf1a"


def density_range(density: np.ndarray) -> "tuple[float, float]":
    """Ends of a logarithmic colour scale: all but the last percent, four decades at most.

    Below lies the floor of the iteration on the cut locus, above the peak at the source; both
    change with the mesh and would eat the scale.
    """
    positive = density[density > 0]
    if positive.size == 0:
        return 1e-3, 1.0
    low, high = np.percentile(positive, [1, 99])
    return float(max(low, 1e-4 * high)), float(max(high, 1.001 * low))


def plot(
    result: "Result",
    *,
    log: bool = True,
    contours: int = 20,
    locus: bool = True,
    source: bool = True,
    cmap: Any = None,
    clim: Optional[Sequence[float]] = None,
    scalars: str = "mu",
    plotter: Any = None,
    show: bool = True,
    screenshot: "None | str | os.PathLike[str]" = None,
    **mesh_options: Any,
) -> Any:
    """Show a result with PyVista.

    Parameters
    ----------
    log : colours by the logarithm of the density.
    contours : number of lines of equal distance; 0: none.
    locus, source : draw the cut locus as tubes, the source as a ball.
    cmap, clim : colour map (None: the package's own, perceptual), values at its ends.
    scalars : "mu", or another array of `Result.to_pyvista`.
    plotter : add to this pyvista.Plotter instead of a new one.
    show : open a window (or, in a notebook, a view); False: only hand the plotter back.
    screenshot : write a picture to this file, without a window.
    mesh_options : passed on to pyvista.Plotter.add_mesh of the surface.

    Returns the plotter, to which more can be added when `show` is False.
    """
    import pyvista
    from matplotlib.colors import ListedColormap

    data = result.to_pyvista()
    scale = data.length
    if plotter is None:
        plotter = pyvista.Plotter(off_screen=True if screenshot else None)
    if clim is None and scalars == "mu":
        clim = density_range(result.density)
    settings = dict(
        scalars=scalars,
        cmap=cmap or ListedColormap(density_map()),
        clim=clim,
        log_scale=log and scalars == "mu",
        smooth_shading=False,
        ambient=0.3,
        diffuse=0.8,
        scalar_bar_args={"title": scalars, "color": "black", "vertical": True},
    )
    plotter.set_background("white")
    surface = plotter.add_mesh(data, **{**settings, **mesh_options})
    # The surface steps back behind the lines that lie on it.
    surface.mapper.SetResolveCoincidentTopologyToPolygonOffset()
    surface.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(2, 2)
    if contours > 0:
        _add_contours(plotter, data, result, contours)
    if locus:
        _add_locus(plotter, result, 0.004 * scale)
    if source:
        plotter.add_mesh(
            pyvista.Sphere(radius=0.013 * scale, center=result.source.xyz), color=SOURCE_COLOUR
        )
    plotter.view_vector(_viewpoint(result), viewup=(0, 0, 1))
    plotter.camera.zoom(1.2)
    if screenshot:
        plotter.screenshot(os.fspath(screenshot))
    elif show:
        plotter.show()
    return plotter


def _viewpoint(result: "Result") -> "tuple[float, float, float]":
    """From where the source lies behind one side: its locus is mostly on the other half."""
    low, high = (np.array(result.mesh.info[name]) for name in ("box_min", "box_max"))
    x, y, _ = np.array(result.source.xyz) - (low + high) / 2
    around = np.arctan2(y, x) - 2
    return float(np.cos(around)), float(np.sin(around)), 0.75


def _add_contours(plotter: Any, data: Any, result: "Result", contours: int) -> None:
    """Lines of equal distance, on the component of the source."""
    reached = np.isfinite(result.distance)
    part = data.extract_points(reached, adjacent_cells=False) if not reached.all() else data
    levels = np.linspace(0, result.distance[reached].max(), contours + 2)[1:-1]
    lines = part.contour(levels, scalars="distance")
    if lines.n_points:
        plotter.add_mesh(lines, color="#404040", line_width=1, opacity=0.55)


def _add_locus(plotter: Any, result: "Result", radius: float) -> None:
    lines = result.locus.to_pyvista()
    if lines.n_lines:
        plotter.add_mesh(lines.tube(radius=radius), color=LOCUS_COLOUR)
    elif lines.n_points:
        import pyvista

        plotter.add_mesh(
            pyvista.Sphere(radius=2 * radius, center=lines.points[0]), color=LOCUS_COLOUR
        )


def plot_tangent(result: "Result", *, ax: Any = None, **line_options: Any) -> Any:
    """Draw the tangent cut locus with Matplotlib: directions and lengths at the source.

    The disk inside is the part of the tangent plane that the exponential map lays on the surface
    once. Polar axes: angle in turns of the source, radius in the unit of the coordinates. With a
    border, where geodesics end at it, the line has gaps. Returns the axes.
    """
    import matplotlib.pyplot as plt

    if ax is None:
        ax = plt.figure().add_subplot(projection="polar")
    angle, time, _ = result.tangent
    if len(angle) == 0:
        return ax
    closed = result.mesh.info["n_border_edges"] == 0
    if closed:
        angle, time = np.append(angle, angle[0] + 2 * np.pi), np.append(time, time[0])
    else:
        wide = np.flatnonzero(np.diff(angle) > 12 * np.pi / len(angle)) + 1
        angle, time = np.insert(angle, wide, np.nan), np.insert(time, wide, np.nan)
    ax.plot(angle, time, **{"color": LOCUS_COLOUR, **line_options})
    if closed:
        ax.fill(angle, time, color=SOURCE_COLOUR, alpha=0.15, linewidth=0)
    ax.plot(0, 0, "o", color=SOURCE_COLOUR)
    ax.set_ylim(0, None)
    ax.set_title("tangent cut locus")
    return ax


def plot_history(result: "Result", *, ax: Any = None) -> Any:
    """Draw the convergence with Matplotlib: relative change of mu and gap by step.

    The gap is known after the last step, and after each one if `gap` was given to solve. Returns
    the axes.
    """
    import matplotlib.pyplot as plt

    if ax is None:
        ax = plt.figure().add_subplot()
    history, certificate = result.history, result.certificate
    ax.semilogy(
        history["step"], history["change"], "o-", color="#1f5a96", label="relative change of mu"
    )
    if len(history):
        ax.axhline(
            history["tolerance"][-1],
            color="#1f5a96",
            linewidth=0.8,
            linestyle=":",
            label="change at which it ends",
        )
    known = np.isfinite(history["gap"]) & (history["gap"] > 0)
    ax.semilogy(
        history["step"][known],
        history["gap"][known],
        "s-",
        color=LOCUS_COLOUR,
        label="gap of the certificate",
    )
    ax.set_xlabel("step")
    ax.set_title(
        f"cost between {certificate.lower:.7g} and {certificate.upper:.7g} "
        f"(gap {100 * certificate.gap:.2g} %)"
    )
    ax.xaxis.get_major_locator().set_params(integer=True)
    ax.legend()
    return ax
