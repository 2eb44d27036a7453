"""Pictures of a result, with PyVista and Matplotlib (``pip install './src/python[plot]'``)."""

from __future__ import annotations

import os
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Iterator, Literal, Optional, Sequence, SupportsIndex

import numpy as np

from ._colour import density_map
from ._lib import ArgumentError, file_error, path_text, switch, whole
from ._optional import optional

if TYPE_CHECKING:
    from ._result import Result

LOCUS_COLOUR = "#cc1c21"
SOURCE_COLOUR = "#ffbf1a"


@contextmanager
def _handing_on(**given: Any) -> Iterator[None]:
    """What PyVista or Matplotlib refuse names the arguments of ours that they were given, if any."""
    try:
        yield
    except Exception as error:
        theirs = [f"{name} = {value!r}" for name, value in given.items() if value is not None]
        if not theirs:
            raise
        raise ArgumentError(f"{', '.join(theirs)}: {error}") from error


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
    contours: SupportsIndex = 20,
    locus: bool = True,
    source: bool = True,
    cmap: Any = None,
    clim: Optional[Sequence[float]] = None,
    scalars: str = "mu",
    views: Literal[1, 2] = 2,
    plotter: Any = None,
    show: bool = True,
    screenshot: "None | str | os.PathLike[str]" = None,
    mesh_options: "Optional[dict[str, Any]]" = None,
) -> Any:
    """Show a result with PyVista: from the source's side, and from the other one, where the cut locus is.

    Parameters
    ----------
    log : colours by the logarithm of the density.
    contours : number of lines of equal distance; 0: none.
    locus, source : draw the cut locus as tubes, the source as a ball.
    cmap, clim : colour map (None: the package's own, perceptual), values at its ends.
    scalars : "mu", or another array of `Result.to_pyvista`.
    views : 2: both sides beside each other; 1: that of the cut locus.
    plotter : add to this pyvista.Plotter, in its active subplot, instead of a new one; one view.
    show : open a window (or, in a notebook, a view); False: only hand the plotter back.
    screenshot : write a picture to this file, without a window.
    mesh_options : more of pyvista.Plotter.add_mesh for the surface, as {"show_edges": True}.

    Returns
    -------
    the plotter, to which more can be added when `show` is False
    """
    if whole("views", views) not in (1, 2):
        raise ArgumentError(f"views = {views!r}: expected 1 or 2")
    lines = whole("contours", contours)
    if lines < 0:
        raise ArgumentError(f"contours = {contours!r}: expected a number from 0")
    picture = None if screenshot is None else path_text(screenshot)
    if picture is not None and not os.path.splitext(picture)[1]:  # to which PyVista would add one
        raise ArgumentError(f"screenshot = {screenshot!r}: expected a name with a suffix, as .png")
    for name, value in dict(log=log, locus=locus, source=source, show=show).items():
        switch(name, value)
    if plotter is not None and not isinstance(plotter, optional("pyvista").BasePlotter):
        raise ArgumentError(f"plotter = {plotter!r}: expected a pyvista.Plotter")
    more = _dictionary("mesh_options", mesh_options, {"show_edges": True})
    _refuse_own(more)
    data = result.to_pyvista()
    settings = _colour_settings(data, scalars, log, cmap, clim)
    own = plotter is None
    if own:
        plotter = _new_plotter(views, True if picture else None)
    sides = (1, -1) if own and views == 2 else (-1,)
    for number, side in enumerate(sides):
        if own:
            plotter.subplot(0, number)
        last = number + 1 == len(sides)
        with _handing_on(cmap=cmap, mesh_options=mesh_options):
            _add_surface(plotter, data, {**settings, "show_scalar_bar": last, **more})
        if lines > 0:
            _add_contours(plotter, data, result, lines)
        if locus:
            _add_locus(plotter, result, 0.004 * data.length)
        if source:
            _add_ball(plotter, result.source.xyz, 0.013 * data.length, SOURCE_COLOUR)
        plotter.view_vector(*_viewpoint(result, side))
        plotter.camera.zoom(1.15)
    if picture:
        _take_picture(plotter, picture)
    elif show:
        plotter.show()
    return plotter


#: Options of pyvista.Plotter.add_mesh for which `plot` has arguments of its own, that scale, labels and title follow.
_OWN = {"scalars": "scalars", "cmap": "cmap", "clim": "clim", "log_scale": "log"}


def _dictionary(name: str, given: Any, example: "dict[str, Any]") -> "dict[str, Any]":
    if given is None:
        return {}
    if not isinstance(given, dict) or not all(isinstance(word, str) for word in given):
        raise ArgumentError(f"{name} = {given!r}: expected a dict, as {example}")
    return given


def _refuse_own(options: "dict[str, Any]") -> None:
    for name, own in _OWN.items():
        if options.get(name) is not None:
            raise ArgumentError(f'mesh_options has "{name}": give {own}=..., which sets scale and labels, too')


def _take_picture(plotter: Any, name: str) -> None:
    try:
        plotter.screenshot(name)
    except OSError as error:
        raise file_error(f"{name}: cannot write: {error.strerror or error}", error.errno) from None
    except ValueError as error:  # of a suffix that PyVista does not write
        raise ArgumentError(f"screenshot = {name!r}: {error}") from None


def _new_plotter(views: int, off_screen: Optional[bool]) -> Any:
    return optional("pyvista").Plotter(
        # Of no light VTK makes a headlight.
        shape=(1, views), border=False, lighting="none", window_size=[700 * views, 700], off_screen=off_screen,
    )  # fmt: skip


def round_scale(low: float, high: float, log: bool) -> "tuple[float, float, int]":
    """A scale that takes in low to high, ends at round numbers, and its number of labels, all of them round."""
    if log:
        first, last = int(np.floor(np.log10(low) + 1e-9)), int(np.ceil(np.log10(high) - 1e-9))
        return float(f"1e{first}"), float(f"1e{last}"), last - first + 1
    power = 10.0 ** np.floor(np.log10((high - low) / 6))
    step = next(k * power for k in (1, 2, 5, 10) if k * power >= 0.999 * (high - low) / 6)
    first, last = int(np.floor(low / step + 1e-9)), int(np.ceil(high / step - 1e-9))
    return float(f"{first * step:.12g}"), float(f"{last * step:.12g}"), last - first + 1


def _values(data: Any, scalars: str) -> np.ndarray:
    """What the colours tell of that array: of vectors their lengths."""
    names = data.array_names
    if not isinstance(scalars, str) or scalars not in names:
        raise ArgumentError(f"scalars = {scalars!r}: expected one of {', '.join(sorted(names))}")
    values = np.asarray(data[scalars], float)
    return values if values.ndim == 1 else np.linalg.norm(values, axis=1)


def _scale(clim: Sequence[float], log: bool) -> "tuple[float, float]":
    """The ends that were asked for."""
    wanted = "two numbers above 0" if log else "two finite numbers"
    try:
        low, high = map(float, clim)
        good = -np.inf < low < high < np.inf and (low > 0 or not log)
    except (TypeError, ValueError):
        good = False
    if not good:
        raise ArgumentError(f"clim = {clim!r}: expected {wanted}, the smaller one first")
    return low, high


def _colour_settings(
    data: Any, scalars: str, log: bool, cmap: Any, clim: Optional[Sequence[float]]
) -> "dict[str, Any]":
    """For Plotter.add_mesh: colours, light, and a bar whose labels are round numbers."""
    log = log and scalars == "mu"
    bar = {
        "title": scalars, "color": "black", "vertical": True, "fmt": "%g",
        "position_x": 0.89, "position_y": 0.04, "height": 0.4, "width": 0.06,
    }  # fmt: skip
    values = _values(data, scalars)
    if clim is not None:
        clim = _scale(clim, log)
    else:
        values = values[np.isfinite(values)]
        clim = density_range(values) if scalars == "mu" else (values.min(initial=0), values.max(initial=0))
        if clim[1] > clim[0]:
            *clim, bar["n_labels"] = round_scale(float(clim[0]), float(clim[1]), log)
    return dict(
        scalars=scalars,
        cmap=optional("matplotlib.colors").ListedColormap(density_map()) if cmap is None else cmap,
        clim=clim,
        log_scale=log,
        smooth_shading=False,
        ambient=0.35,
        diffuse=0.65,
        scalar_bar_args=bar,
    )


def _viewpoint(result: "Result", side: int) -> "tuple[tuple[float, ...], tuple[float, ...]]":
    """Where the camera stands, outwards, and what is up there: on the side of the source (1), a little beside
    and above it, or on the other one (-1). Up is z, or y where the source's side faces z."""
    a, b, c = result.mesh.vertices[result.mesh.faces[result.source.face]]
    front = np.cross(b - a, c - a)
    front = side * front / (np.linalg.norm(front) or 1)
    up = np.array([0.0, 1.0, 0.0] if abs(front[2]) > 0.8 else [0.0, 0.0, 1.0])
    across = np.cross(up, front)
    eye = front + 0.4 * across / np.linalg.norm(across) + 0.7 * up
    return tuple(map(float, eye)), tuple(map(float, up))


def _add_surface(plotter: Any, data: Any, settings: "dict[str, Any]") -> None:
    """The surface, which steps back behind the lines that lie on it."""
    plotter.set_background("white")
    surface = plotter.add_mesh(data.copy(deep=False), **settings)
    surface.mapper.SetResolveCoincidentTopologyToPolygonOffset()
    surface.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(2, 2)


def _add_ball(plotter: Any, centre: Sequence[float], radius: float, colour: str) -> None:
    plotter.add_mesh(optional("pyvista").Sphere(radius=radius, center=centre), color=colour)


def _add_contours(plotter: Any, data: Any, result: "Result", contours: int) -> None:
    """Lines of equal distance, on the component of the source."""
    reached = np.isfinite(result.distance)
    part = data.extract_points(reached, adjacent_cells=False) if not reached.all() else data
    levels = np.linspace(0, result.distance[reached].max(), contours + 2)[1:-1]
    lines = part.contour(levels, scalars="distance")
    if lines.n_points:
        plotter.add_mesh(lines, color="#404040", line_width=1.5, opacity=0.6)


def _add_locus(plotter: Any, result: "Result", radius: float) -> None:
    lines = result.locus.to_pyvista()
    if lines.n_lines:
        plotter.add_mesh(lines.tube(radius=radius), color=LOCUS_COLOUR)
    elif lines.n_points:
        _add_ball(plotter, lines.points[0], 2 * radius, LOCUS_COLOUR)


def _axes(given: Any, projection: str) -> Any:
    """These axes, or of None new ones."""
    if given is None:
        return optional("matplotlib.pyplot").figure().add_subplot(projection=projection)
    if not isinstance(given, optional("matplotlib.axes").Axes):
        raise ArgumentError(f"ax = {given!r}: expected axes of Matplotlib")
    if given.name != projection:
        raise ArgumentError(f'ax = {given!r}: expected axes with projection="{projection}", not "{given.name}"')
    return given


def plot_tangent(
    result: "Result", *, ax: Any = None, line_options: "Optional[dict[str, Any]]" = None
) -> Any:
    """Draw the tangent cut locus with Matplotlib: directions and lengths at the source.

    The disk inside is the part of the tangent plane that the exponential map lays on the surface
    once. Polar axes, new ones or `ax`: angle at the source, scaled to a full turn, radius in the unit of the
    coordinates. With a border, where geodesics end at it, the line has gaps. line_options: of Axes.plot, as
    {"lw": 2}. Returns the axes.
    """
    more = _dictionary("line_options", line_options, {"lw": 2})
    ax = _axes(ax, "polar")
    angle, time, _ = result.tangent
    if len(angle) == 0:
        return ax
    closed = result.mesh.info["n_border_edges"] == 0
    if closed:
        angle, time = np.append(angle, angle[0] + 2 * np.pi), np.append(time, time[0])
    else:
        wide = np.flatnonzero(np.diff(angle) > 12 * np.pi / len(angle)) + 1
        angle, time = np.insert(angle, wide, np.nan), np.insert(time, wide, np.nan)
    with _handing_on(line_options=line_options):
        ax.plot(angle, time, **{"color": LOCUS_COLOUR, **more})
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
    ax = _axes(ax, "rectilinear")
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
    steps = ax.xaxis.get_major_locator()
    if isinstance(steps, optional("matplotlib.ticker").MaxNLocator):  # and no choice of the user's own
        steps.set_params(integer=True)
    ax.legend()
    return ax
