"""Results: what a solve found, as arrays."""

from __future__ import annotations

import os
from functools import cached_property
from typing import Any, Literal, NamedTuple, Optional, Sequence, SupportsIndex, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._cut import Cut, cut_by
from ._geodesics import Path, traced
from ._lib import ArgumentError, Context, Handle, copy_struct, count, ffi, lib, named_seconds, path_bytes, view, whole
from ._locus import Locus
from ._mesh import Mesh, Point, pack_points

_ARRAYS = {
    "density": np.float64,
    "potential": np.float64,
    "potential_mid": np.float64,
    "distance": np.float64,
    "acl": np.uint8,
}
_DISTANCE_ARRAYS = ("distance", "acl")  # those that density_only leaves out
_C_NAMES: "dict[Any, str]" = {np.float64: "double", np.uint8: "uint8_t"}


def _gaps(rows: NDArray[np.void], last: float) -> NDArray[np.void]:
    """The steps; a report has the gap after the step before, so the gaps move up by one."""
    if len(rows):
        rows["gap"] = np.append(rows["gap"][1:], last)
    rows.flags.writeable = False
    return rows


def _limit_caps(x: NDArray[np.float64], gradient: NDArray[np.float64]) -> None:
    """Bound in place what no length shows: u is that of a thicker triangle where one of corners x (m, 3, 3) is a cap."""
    side = np.roll(x, -1, axis=1) - x
    length = np.linalg.norm(side, axis=2)
    longest = length.max(axis=1)
    caps = np.flatnonzero(length.sum(axis=1) - 2 * longest < lib.DMK_MOLLIFICATION * longest)
    along = side[caps, length[caps].argmax(axis=1)] / longest[caps, None]
    part = (gradient[caps] * along).sum(axis=1, keepdims=True) * along
    rest = gradient[caps] - part
    most = np.sqrt(np.clip(1 - (part**2).sum(axis=1), 0, None))
    steep = np.linalg.norm(rest, axis=1)
    gradient[caps] = part + rest * np.minimum(1, most / np.maximum(steep, np.finfo(float).tiny))[:, None]


class Certificate(NamedTuple):
    """Bounds of the optimal cost of the discrete problem, the transport on this mesh.

    lower <= optimal cost <= upper; gap = (upper - lower) / upper. For a point source the cost is
    the integral of the distance, up to the discretisation: the discrete source is blunt by a part
    of an edge, and this falls with the mesh size.
    """

    lower: float
    upper: float
    gap: float


class Tangent(NamedTuple):
    """The tangent cut locus: in the direction angle[i] (radians, [0, 2 pi), ascending; a full turn is
    2 pi at a vertex, too) from the source, geodesics stay minimal up to the length time[i]. vertex[i]: number in `Locus.vertices`
    of the point reached."""

    angle: NDArray[np.float64]
    time: NDArray[np.float64]
    vertex: NDArray[np.int64]

    def __repr__(self) -> str:
        return f"<dmkcl.Tangent: {count(len(self.angle), 'direction')}>"


class Result:
    """What `CutLocus.solve` found for one source.

    Arrays are read-only views of the library's memory; copy to change. On components of the mesh
    without the source mu is 0, the distance infinite, u minus infinity and the gradient NaN. A result can be pickled,
    as multiprocessing does.
    """

    def __init__(
        self,
        mesh: Mesh,
        handle: Handle,
        source: Point,
        history: NDArray[np.void],
        strength: float,
        density_only: bool,
    ):
        self.mesh: Mesh = mesh
        #: The source on the mesh.
        self.source: Point = source
        self._made: Optional[Handle] = handle
        self._strength = strength
        self._density_only = density_only
        #: (steps,) with the fields step, cg_iterations, change, tolerance, gap, seconds.
        self.history: NDArray[np.void] = _gaps(history, self.certificate.gap)

    def __repr__(self) -> str:
        c, xyz = self.certificate, ", ".join(f"{x:.6g}" for x in self.source.xyz)
        return (
            f"<dmkcl.Result: {count(len(self.mesh.faces), 'triangle')}, source ({xyz}), "
            f"cost {c.upper:.6g} within {100 * c.gap:.2g} %>"
        )

    # ---- the library's object, and copies --------------------------------------------------------

    @property
    def _handle(self) -> Handle:
        """The library's object; of a result that was unpickled it is made when first needed."""
        if self._made is None:
            self._made = self._restore()
        return self._made

    @property
    def _pointer(self) -> Any:
        return self._handle.pointer

    def _restore(self) -> Handle:
        data = ffi.new("dmk_result_data *")
        for name in self._arrays():
            dtype = _ARRAYS[name]
            array = getattr(self, name).view(dtype)
            setattr(data, name, ffi.from_buffer(_C_NAMES[dtype] + "[]", array))
        data.source = (self.source.face, self.source.bary)
        for name, value in self._fields.items():
            setattr(data.stats, name, value)
        handle = Handle("dmk_result")
        with Context() as context:
            context.check(
                lib.dmk_result_restore(context.pointer, self.mesh._pointer, data, handle.box)
            )
        return handle

    def __getstate__(self) -> "dict[str, Any]":
        """Arrays, numbers and the mesh; the library's object is made again where it is needed."""
        kept = ("mesh", "source", "_strength", "_density_only", "history", "_fields", *self._arrays())
        return {name: getattr(self, name) for name in kept}

    def __setstate__(self, state: "dict[str, Any]") -> None:
        self.__dict__.update(state, _made=None)
        for name in (*self._arrays(), "history"):
            getattr(self, name).flags.writeable = False

    def __copy__(self) -> "Result":
        return self  # nothing of it can be changed

    def __deepcopy__(self, memo: Any) -> "Result":
        return self

    # ---- arrays ----------------------------------------------------------------------------------

    def _arrays(self) -> "list[str]":
        """The names of those that the result has."""
        return [name for name in _ARRAYS if not (self._density_only and name in _DISTANCE_ARRAYS)]

    def _array(self, name: str, dtype: Any = np.float64) -> NDArray[Any]:
        if self._density_only and name in _DISTANCE_ARRAYS:
            raise ArgumentError(f"a result of density_only has no {name}: solve without density_only")
        n = ffi.new("size_t *")
        pointer = getattr(lib, "dmk_result_" + name)(self._pointer, n)
        return view(self._handle, pointer, n[0], dtype)

    @cached_property
    def density(self) -> NDArray[np.float64]:
        """(m,) transport density mu of each triangle: how much mass crosses a unit of length."""
        return self._array("density")

    @cached_property
    def acl(self) -> NDArray[np.bool_]:
        """(m,) True in the approximate cut locus: mu <= threshold, or without one by a rule from u."""
        return self._array("acl", np.uint8).view(np.bool_)

    @cached_property
    def potential(self) -> NDArray[np.float64]:
        """(n,) u of each vertex, 0 at the source and negative elsewhere."""
        return self._array("potential")

    @cached_property
    def distance(self) -> NDArray[np.float64]:
        """(n,) geodesic distance of each vertex to the source, exact on the polyhedron."""
        return self._array("distance")

    @cached_property
    def potential_mid(self) -> NDArray[np.float64]:
        """(e,) u at the midpoint of each edge of `Mesh.edges`."""
        return self._array("potential_mid")

    @cached_property
    def gradient(self) -> NDArray[np.float64]:
        """(m, 3) -grad u, its mean over each triangle: the way away from the source.

        d = -u, the distance up to a constant, is linear on each of the four triangles that the
        edges' midpoints make, so by the divergence theorem
        ``mean grad d = (1/A) sum_e (e x N) (d_a + 2 d_mid + d_b) / 4`` over the edges e = b - a of
        the triangle with area A and unit normal N. Its length is nearly 1, and less
        on the cut locus, where gradients of two sides are averaged. Where the solver takes a cap
        to be thicker, its part across the longest side is no more than makes the length 1.
        """
        x = self.mesh.vertices[self.mesh.faces]
        normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        size = np.linalg.norm(normal, axis=1, keepdims=True)  # twice the area
        d = -self.potential[self.mesh.faces]
        middle = -self.potential_mid[self.mesh.face_edges]
        total = np.zeros_like(normal)
        with np.errstate(invalid="ignore"):
            for k in range(3):
                a, b = (k + 1) % 3, (k + 2) % 3
                mean = (d[:, a] + 2 * middle[:, k] + d[:, b]) / 4
                total += np.cross(x[:, b] - x[:, a], normal) * mean[:, None]
            gradient: NDArray[np.float64] = 2 * total / size**2
            _limit_caps(x, gradient)
        gradient[~np.isfinite(gradient).all(axis=1)] = np.nan
        gradient.flags.writeable = False
        return gradient

    @cached_property
    def stats(self) -> "dict[str, Any]":
        """steps, cg_iterations, v_cycles, change, cost_upper, cost_lower, cost_exact, cost_exact_error,
        gap, sweeps, n_steep, steep, area, levels, double_precision, and seconds of setup, distance,
        start, solve and certify: see dmk_stats."""
        return named_seconds(self._fields)

    @cached_property
    def _fields(self) -> "dict[str, Any]":
        stats = ffi.new("dmk_stats *")
        lib.dmk_result_get_stats(self._pointer, stats)
        return copy_struct(stats[0])

    @cached_property
    def certificate(self) -> Certificate:
        """Bounds of the cost of the discrete problem. The integral of the distance itself is
        ``stats["cost_exact"]``, within ``stats["cost_exact_error"]``."""
        stats = self.stats
        return Certificate(stats["cost_lower"], stats["cost_upper"], stats["gap"])

    # ---- geometry -----------------------------------------------------------------------------

    @cached_property
    def locus(self) -> Locus:
        """The cut locus as a graph of lines on the surface, traced when it is first asked for."""
        return Locus(self.mesh, self._handle, self._strength)

    @cached_property
    def tangent(self) -> Tangent:
        """The tangent cut locus: how far geodesics stay minimal, by direction."""
        angle = np.mod(self.locus.angle, 2 * np.pi)
        angle[angle >= 2 * np.pi] = 0  # of -1e-17 the sum is rounded to a turn
        order = np.argsort(angle, axis=None, kind="stable")
        vertex = order // 2
        return Tangent(angle.ravel()[order], self.locus.distance[vertex], vertex)

    def path(
        self,
        *,
        point: Union[None, ArrayLike, Point] = None,
        vertex: Optional[SupportsIndex] = None,
        face: Optional[SupportsIndex] = None,
        bary: Optional[ArrayLike] = None,
    ) -> Path:
        """A minimal geodesic from the source to a point of its component, given as in `solve`.

        Where several are minimal, one of them. ArgumentError if the point lies on another component.
        """
        end = self.mesh._take(point, vertex, face, bary)
        place = pack_points([end])
        with Context() as context, traced(self.mesh, 1) as paths:
            context.check(
                lib.dmk_path_compute(
                    context.pointer, self.mesh._pointer, self._pointer, 1, place, paths.pointer
                )
            )
        return paths.found[0]

    def cut_open(self) -> Cut:
        """The source's component cut open along its cut locus, a disk with one border loop: `Geodesics.cut_open`."""
        return cut_by(
            self._strength,
            lambda context, *out: lib.dmk_cut(context, self.mesh._pointer, self._pointer, *out),
        )

    # ---- out ----------------------------------------------------------------------------------

    def write(self, path: "os.PathLike[str] | str") -> None:
        """Write mesh, mu, acl, u and distance for ParaView; the suffix chooses VTP, PVTP, VTU or PLY."""
        with Context() as context:
            context.check(
                lib.dmk_result_write(
                    context.pointer, self.mesh._pointer, self._pointer, path_bytes(path)
                )
            )

    def to_pyvista(self) -> Any:
        """A pyvista.PolyData with the cell arrays mu, acl and gradient, the point arrays distance
        and u. The locus: `Locus.to_pyvista`."""
        data = self.mesh.to_pyvista()
        data.cell_data["gradient"] = self.gradient
        data.cell_data["mu"] = self.density
        data.point_data["u"] = self.potential
        if not self._density_only:
            data.cell_data["acl"] = self.acl.astype(np.uint8)
            data.point_data["distance"] = self.distance
        data.set_active_scalars("mu")
        return data

    def to_trimesh(self) -> Any:
        """A trimesh.Trimesh; face_attributes mu, acl, gradient; vertex_attributes distance, u."""
        mesh = self.mesh.to_trimesh()
        mesh.face_attributes.update(mu=self.density, gradient=self.gradient)
        mesh.vertex_attributes.update(u=self.potential)
        if not self._density_only:
            mesh.face_attributes["acl"] = self.acl.astype(np.uint8)  # trimesh writes no truth values to PLY
            mesh.vertex_attributes["distance"] = self.distance
        return mesh

    # ---- pictures -----------------------------------------------------------------------------

    def plot(
        self,
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
        """Show the surface with PyVista: the density in colour, lines of equal distance, the cut
        locus as tubes, the source as a ball. Options: see `dmkcl.plotting.plot`."""
        from .plotting import plot

        return plot(
            self, log=log, contours=contours, locus=locus, source=source, cmap=cmap, clim=clim, scalars=scalars,
            views=views, plotter=plotter, show=show, screenshot=screenshot, mesh_options=mesh_options,
        )  # fmt: skip

    def plot_tangent(self, *, ax: Any = None, line_options: "Optional[dict[str, Any]]" = None) -> Any:
        """Draw the tangent cut locus with Matplotlib; see `dmkcl.plotting.plot_tangent`."""
        from .plotting import plot_tangent

        return plot_tangent(self, ax=ax, line_options=line_options)

    def plot_history(self, *, ax: Any = None) -> Any:
        """Draw the convergence with Matplotlib; see `dmkcl.plotting.plot_history`."""
        from .plotting import plot_history

        return plot_history(self, ax=ax)

    def view(self, *, height: SupportsIndex = 500, title: Optional[str] = None) -> Any:
        """The page of `export_html` for the output of a notebook's cell, `height` pixels high."""
        from ._html import View, page

        pixels = whole("height", height)
        if pixels < 1:
            raise ArgumentError(f"height = {height!r}: expected a number above 0")
        return View(page(self, title), pixels)

    def export_html(self, path: "os.PathLike[str] | str", *, title: Optional[str] = None) -> None:
        """Write a page that shows the surface in any browser, to be turned by mouse or finger; one file
        that needs no network. Errors: OSError."""
        from ._html import export_html

        export_html(self, path, title)
