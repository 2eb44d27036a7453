"""Exact geodesic distances from any number of sources; they need no device."""

from __future__ import annotations

import os
import re
from functools import cached_property
from typing import Any, NamedTuple, Optional, Sequence, SupportsIndex, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._cut import Cut, cut_by
from ._lib import (
    ArgumentError, Context, Handle, Indices, amount, copy_struct, count, ffi, is_single, lib, numbers, path_bytes,
    switch, view, warn, whole,
)  # fmt: skip
from ._locus import Locus
from ._mesh import Mesh, Point, PointsLike, each_place, pack_points
from ._read import MeshLike, as_mesh

_ARRIVAL = np.dtype(
    [("direction", "f8"), ("back", "f8"), ("pseudo_source", "i4"), ("source", "i4")]
)


def _points(
    mesh: Mesh,
    source: Union[None, SupportsIndex, Point],
    sources: Union[None, Indices, Sequence[Union[SupportsIndex, Point]]],
    vertex: Optional[SupportsIndex],
    vertices: Optional[Indices],
    point: Optional[ArrayLike],
    points: Optional[PointsLike],
) -> "list[Point]":
    """The sources, however they are given."""
    listed: "list[Union[SupportsIndex, Point]]" = []
    asked: "list[tuple[Any, Any, tuple[str, str]]]" = [
        (source, sources, ("source", "sources")),
        (vertex, vertices, ("vertex", "vertices")),
    ]
    for one, several, names in asked:
        if several is not None and is_single(several):
            raise ArgumentError(
                f"{names[1]} = {several!r}: expected several; one is given as {names[0]}={several!r}"
            )
        listed += [] if one is None else [one]
        listed += [] if several is None else list(several)
    places: "list[Point]" = []
    for given in listed:
        if isinstance(given, Point):
            places.append(given)
        elif is_single(given) and np.asarray(given).dtype.kind in "iu":
            places.append(mesh.at_vertex(given))
        else:
            raise ArgumentError(
                f"{given!r} is no vertex number; several are given as sources=[...], points in space "
                "as point=(x, y, z) or points=[...]"
            )
    if point is not None:
        places.append(mesh._take(point))
    if points is not None:
        places.extend(mesh._take_all(points))
    return places


class Path(NamedTuple):
    """A minimal geodesic, from the source on.

    points: (k, 3) the source, a point on each edge crossed, the end; faces: (k,) and bary: (k, 3)
    the same on the mesh; length in the unit of the coordinates; angle: its direction at the
    source in radians, as `Geodesics.direction`.
    """

    points: NDArray[np.float64]
    faces: NDArray[np.int64]
    bary: NDArray[np.float64]
    length: float
    angle: float

    def __repr__(self) -> str:
        return f"<dmkcl.Path: {count(len(self.points), 'point')}, length {self.length:.6g}>"


_POINT = np.dtype([("triangle", np.int64), ("weight", np.float64, 3)])


class traced:
    """Room for n paths of the library, which on leaving become `found` and are given back."""

    def __init__(self, mesh: Mesh, n: int):
        self._mesh, self._n = mesh, n
        self.pointer = ffi.new("dmk_path[]", n)
        self.found: "list[Path]" = []

    def __enter__(self) -> "traced":
        return self

    def __exit__(self, kind: Any, *error: Any) -> None:
        for i in range(self._n):
            if kind is None:
                self.found.append(self._read(self.pointer[i]))
            lib.dmk_path_free(self.pointer + i)

    def _read(self, path: Any) -> Path:
        raw = np.frombuffer(ffi.buffer(path.point, path.n * _POINT.itemsize), _POINT).copy()
        faces, bary = raw["triangle"].copy(), raw["weight"].copy()
        points = np.einsum("ij,ijk->ik", bary, self._mesh.vertices[self._mesh.faces[faces]])
        return Path(points, faces, bary, path.length, path.angle)


class Geodesics:
    """Shortest paths from a set of sources to every vertex, exact on the polyhedron.

    Parameters
    ----------
    mesh : what `CutLocus` takes as a mesh without faces
    source, sources : vertex number, or a `Point` of `Mesh`; several of them
    vertex, vertices : vertex number; several of them
    point, points : (3,), (k, 3) the points of the surface nearest to these; a `Point` is taken as it is
    curve : (k,) two vertices or more joined by edges, one after another: every point of these edges is a source
    border : the border of the mesh is a source as a whole, too
    offsets : (k,) distance at each of the sources, 0 or more
    tolerance : error allowed, over the distance, 0.01 at most; 0: none up to 450,000 triangles, 1e-6 beyond
    exact : no error, whatever the size
    threads : of the host; 0: one per core

    Notes
    -----
    Sources are numbered in the order source, sources, vertex, vertices, point, points; curve and border
    come last, as one. Distance, direction and nearest are arrays over the vertices. It can be pickled.

    Windows of Mitchell, Mount and Papadimitriou, "The discrete geodesic problem" (SIAM J. Comput.
    16(4), 1987), depth first, or with a tolerance merged. No OpenCL device is needed.
    """

    def __init__(
        self,
        mesh: MeshLike,
        source: Union[None, SupportsIndex, Point] = None,
        *,
        sources: Union[None, Indices, Sequence[Union[SupportsIndex, Point]]] = None,
        vertex: Optional[SupportsIndex] = None,
        vertices: Optional[Indices] = None,
        point: Optional[ArrayLike] = None,
        points: Optional[PointsLike] = None,
        curve: Optional[Indices] = None,
        border: bool = False,
        offsets: Optional[ArrayLike] = None,
        tolerance: float = 0,
        exact: bool = False,
        threads: SupportsIndex = 0,
    ):
        self.mesh: Mesh = as_mesh(mesh)
        #: The sources that are points.
        self.sources: "list[Point]" = _points(
            self.mesh, source, sources, vertex, vertices, point, points
        )
        if curve is not None and is_single(curve):
            raise ArgumentError(f"curve = {curve!r}: expected several vertices")
        along = None if curve is None else [whole("curve", v) for v in curve]
        if along is not None and len(along) < 2:
            raise ArgumentError(f"curve = {along}: expected two vertices or more; one is given as vertex")
        apart = None if offsets is None else numbers("offsets", offsets)
        if apart is not None and apart.ndim != 1:
            raise ArgumentError(f"offsets have the shape {apart.shape}; expected (k,)")
        if apart is not None and len(apart) != len(self.sources):
            raise ArgumentError(f"{count(len(apart), 'offset')} for {count(len(self.sources), 'source')}")
        allowed = amount("tolerance", tolerance)
        if switch("exact", exact) and allowed > 0:
            raise ArgumentError(f"tolerance = {tolerance!r}, but exact=True allows no error: leave out one of them")
        self._asked = (along, switch("border", border), None if apart is None else apart.tolist(), allowed, bool(exact))
        self._made: Optional[Handle] = self._compute(whole("threads", threads))
        if border and self.mesh.info["n_border_edges"] == 0:  # beside other sources
            warn("the mesh is closed, and has no border that border=True could take")

    def _compute(self, threads: int = 0) -> Handle:
        curve, border, offsets, tolerance, exact = self._asked
        options = ffi.new("dmk_geodesics_options *")
        lib.dmk_geodesics_options_init(options, ffi.sizeof(options[0]))
        options.border, options.tolerance, options.exact = border, tolerance, exact
        keep: "list[Any]" = []  # what the options point to, until the call is over
        if offsets is not None:
            keep.append(ffi.new("double[]", offsets))
            options.offset = keep[-1]
        if curve is not None:
            line = [v for pair in zip(curve[:-1], curve[1:]) for v in pair]
            keep.append(ffi.new("int32_t[]", line))
            options.line, options.n_lines = keep[-1], len(line) // 2
        places = pack_points(self.sources)
        handle = Handle("dmk_geodesics", self.mesh._handle)
        with Context(threads=threads) as context:
            status = lib.dmk_geodesics_create(
                context.pointer, self.mesh._pointer, len(self.sources), places, options, handle.box
            )
            try:
                context.check(status)
            except ArgumentError as error:  # the library's lines are the curve's edges
                error.args = (re.sub(r"^line (\d+):", lambda of: f"curve[{of[1]}:{int(of[1]) + 2}]:", str(error)),)
                raise
        return handle

    # ---- copies ----------------------------------------------------------------------------------

    @property
    def _handle(self) -> Handle:
        """The library's object; after unpickling it is computed anew when first needed, bit for bit."""
        if self._made is None:
            self._made = self._compute()
        return self._made

    def __getstate__(self) -> "dict[str, Any]":
        """The arrays, and what was asked."""
        kept = ("mesh", "sources", "_asked", "info", "distance", "_arrivals")
        return {name: getattr(self, name) for name in kept}

    def __setstate__(self, state: "dict[str, Any]") -> None:
        self.__dict__.update(state, _made=None)
        self.distance.flags.writeable = self._arrivals.flags.writeable = False

    def __copy__(self) -> "Geodesics":
        return self  # nothing of it can be changed

    def __deepcopy__(self, memo: Any) -> "Geodesics":
        return self

    def __repr__(self) -> str:
        return (
            f"<dmkcl.Geodesics: {count(len(self.mesh.faces), 'triangle')}, {count(len(self.sources), 'source')}, "
            f"farthest {self.info['farthest']:.6g}>"
        )

    @cached_property
    def info(self) -> "dict[str, Any]":
        """n_reached, farthest, error (the largest estimate, over its distance; no bound), tolerance (asked for, or
        the usual one), n_beyond (vertices whose estimate is above it), n_windows."""
        info = ffi.new("dmk_geodesics_info *")
        lib.dmk_geodesics_get_info(self._handle.pointer, info)
        return copy_struct(info[0])

    @cached_property
    def distance(self) -> NDArray[np.float64]:
        """(n,) distance of each vertex to the nearest source; infinite where none reaches it."""
        n = ffi.new("size_t *")
        pointer = lib.dmk_geodesics_distance(self._handle.pointer, n)
        return view(self._handle, pointer, n[0], np.float64)

    @cached_property
    def _arrivals(self) -> NDArray[Any]:
        n = ffi.new("size_t *")
        pointer = lib.dmk_geodesics_arrivals(self._handle.pointer, n)
        return view(self._handle, pointer, n[0], _ARRIVAL)

    @property
    def nearest(self) -> NDArray[np.int32]:
        """(n,) number of the nearest source (the vertices' Voronoi cells); -1: none."""
        return self._arrivals["source"]

    @property
    def direction(self) -> NDArray[np.float64]:
        """(n,) angle at the nearest source in which the shortest path leaves it, in radians, counterclockwise.

        At a vertex it goes up to its total angle, from the edge to the next corner of the first triangle that has
        the vertex, at a border from the clockwise-most edge; inside a triangle it counts from the first
        corner; on the edge opposite corner k of the source's triangle from corner k + 2, cyclically.
        """
        return self._arrivals["direction"]

    @cached_property
    def log_map(self) -> NDArray[np.float64]:
        """(n, 2) logarithmic map: distance times the unit vector of the direction. At a vertex whose
        total angle is not 2 pi directions keep their radians."""
        turn = self.direction
        flat: NDArray[np.float64] = self.distance[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
        return flat

    def at(self, points: PointsLike) -> "tuple[NDArray[np.float64], NDArray[np.float64]]":
        """Distance and direction, (k,) each, at the points of the surface nearest to (k, 3), with a UserWarning
        if any is more than an edge away."""

        def nearest(given: ArrayLike) -> "list[Point]":
            xyz = numbers("points", given)
            return self.mesh._take_all(xyz[None] if xyz.shape == (3,) else xyz)

        places = [points] if isinstance(points, Point) else each_place(points, nearest)
        given = pack_points(places)
        values = ffi.new("dmk_value[]", max(1, len(places)))
        with Context() as context:
            context.check(
                lib.dmk_geodesics_at(
                    context.pointer, self._handle.pointer, len(places), given, values
                )
            )
        found = [(values[i].distance, values[i].direction) for i in range(len(places))]
        distance, direction = np.array(found, np.float64).reshape(-1, 2).T
        return distance, direction

    def path(
        self,
        *,
        point: Union[None, ArrayLike, Point] = None,
        vertex: Optional[SupportsIndex] = None,
        face: Optional[SupportsIndex] = None,
        bary: Optional[ArrayLike] = None,
    ) -> Path:
        """A minimal geodesic from the nearest source to a point. Where several are minimal, one of
        them. ArgumentError if no source is joined to it."""
        end = self.mesh._take(point, vertex, face, bary)
        place = pack_points([end])
        with Context() as context, traced(self.mesh, 1) as paths:
            context.check(
                lib.dmk_geodesics_paths(
                    context.pointer, self._handle.pointer, 1, place, paths.pointer
                )
            )
        return paths.found[0]

    def locus(self, *, strength: float = 0) -> Locus:
        """The cut locus of the sources as one set: the borders of their Voronoi cells, of infinite
        strength, and what each cell has inside; branches of less strength (a length) are left out,
        0 being the default of `CutLocus.solve`. Of the component with the sources, all on one; not of a
        curve or a border."""
        return Locus(None, self._handle, strength)

    def cut_open(self, *, strength: float = 0) -> Cut:
        """The component of the source, which is to be one, cut open along its cut locus: a disk with one border loop.

        Triangles that the locus crosses are split, so that it runs along edges, and its points are
        vertices once for each side. Edges are bisected before where the locus is traced on finer
        triangles, as on meshes of fewer than 5,000, which have some 2,000 to 5,000 then. A locus
        that is one point becomes a slit of two edges.
        MeshError if cutting did not produce a disk; a finer mesh may help.
        """
        return cut_by(
            strength,
            lambda context, *out: lib.dmk_geodesics_cut(context, self._handle.pointer, *out, ffi.NULL),
        )

    def write(self, path: "os.PathLike[str] | str") -> None:
        """Write mesh, distance, direction and nearest; the suffix chooses VTP, PVTP, VTU or PLY."""
        with Context() as context:
            context.check(
                lib.dmk_geodesics_write(context.pointer, self._handle.pointer, path_bytes(path))
            )


def distance(
    mesh: Union[ArrayLike, MeshLike],
    faces: Optional[ArrayLike] = None,
    source: Union[None, SupportsIndex, Point] = None,
    *,
    sources: Union[None, Indices, Sequence[Union[SupportsIndex, Point]]] = None,
    vertex: Optional[SupportsIndex] = None,
    vertices: Optional[Indices] = None,
    point: Optional[ArrayLike] = None,
    points: Optional[PointsLike] = None,
    curve: Optional[Indices] = None,
    border: bool = False,
) -> NDArray[np.float64]:
    """Exact geodesic distance of every vertex to the nearest source: ``distance(V, F, 17)``, or of a
    mesh ``distance(mesh, vertex=17)``.

    Sources as in `Geodesics`, which also gives directions and the nearest source.
    """
    return Geodesics(
        as_mesh(mesh, faces),
        source,
        sources=sources,
        vertex=vertex,
        vertices=vertices,
        point=point,
        points=points,
        curve=curve,
        border=border,
    ).distance
