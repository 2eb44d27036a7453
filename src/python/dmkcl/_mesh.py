"""Meshes: arrays to the library and back, and what other packages call a mesh."""

from __future__ import annotations

import operator
import os
from functools import cached_property
from typing import Any, Callable, Iterator, NamedTuple, Optional, Protocol, Sequence, SupportsIndex, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._lib import (
    ArgumentError, Context, Handle, MeshError, copy_struct, count, ffi, lib, numbers, path_bytes, view, warn, whole,
)  # fmt: skip
from ._optional import optional


class Point(NamedTuple):
    """A point of a surface: weights on the corners of a triangle.

    face: number of the triangle; bary: its three weights (>= 0, sum 1); xyz: the place in space.
    """

    face: int
    bary: "tuple[float, float, float]"
    xyz: "tuple[float, float, float]"


class _Array(Protocol):
    """What NumPy takes for an array."""

    def __array__(self) -> "NDArray[Any]": ...


#: (k, 3) points x, y, z; or a list of these and of `Point`.
PointsLike = Union[_Array, Sequence[Union[ArrayLike, Point]]]


def each_place(points: PointsLike, nearest: "Callable[[Any], list[Point]]") -> "list[Point]":
    """`nearest` of the points in space; a `Point` of a list is a place already."""
    if isinstance(points, Point):
        raise ArgumentError("one point; expected several, as in a list: [point]")
    if not isinstance(points, (list, tuple)) or not any(isinstance(p, Point) for p in points):
        return nearest(points)
    given: "list[Any]" = list(points)
    found = iter(nearest([p for p in given if not isinstance(p, Point)]))
    return [p if isinstance(p, Point) else next(found) for p in given]


def pack_points(points: "Sequence[Point]") -> Any:
    """Points as the library takes them, which checks their numbers."""
    given = ffi.new("dmk_point[]", len(points))
    for i, at in enumerate(points):
        try:
            a, b, c = map(float, at.bary)
            given[i] = (operator.index(at.face), (a, b, c))
        except (TypeError, ValueError, OverflowError):
            raise ArgumentError(f"{at!r}: expected a triangle's number and three weights") from None
    return given


def _vertex_array(vertices: ArrayLike) -> NDArray[np.float64]:
    xyz = numbers("vertices", vertices)
    if xyz.ndim != 2 or xyz.shape[1] not in (2, 3):
        raise ArgumentError(
            f"vertices have the shape {xyz.shape}; expected (n, 3), or (n, 2) for a plane surface"
        )
    if xyz.shape[1] == 2:
        xyz = np.column_stack([xyz, np.zeros(len(xyz))])
    return xyz


def _face_array(faces: ArrayLike, n_vertices: int) -> NDArray[np.int32]:
    try:
        index = np.asarray(faces)
    except ValueError:
        raise ArgumentError("faces have rows of different lengths; expected triangles only") from None
    if index.ndim != 2 or index.shape[1] != 3:
        raise ArgumentError(f"faces have the shape {index.shape}; expected (m, 3): triangles only")
    return _index_array(faces, n_vertices, "triangle")


def _index_array(faces: ArrayLike, n_vertices: int, name: str) -> NDArray[np.int32]:
    """Faces of any number of corners."""
    index = np.asarray(faces)
    if np.ma.is_masked(faces):
        raise ArgumentError("faces are masked in places; leave those rows out")
    if index.dtype.kind not in "iu":
        raise ArgumentError(f"faces are of type {index.dtype}; expected integers")
    outside = np.flatnonzero(((index < 0) | (index >= n_vertices)).any(axis=1))
    if outside.size:
        row = outside[0]
        raise MeshError(
            f"{name} {row} names the vertices {index[row].tolist()}; vertices "
            f"are numbered from 0, and there are {n_vertices}"
        )
    return np.ascontiguousarray(index, dtype=np.int32)


class Mesh:
    """A triangulated surface, checked: borders, several components and unused vertices are fine.

    A mesh unpacks to its arrays: ``V, F = mesh``.

    Parameters
    ----------
    vertices : (n, 3) or (n, 2) array of float
        Coordinates. Any unit: all lengths in results are in the same one.
    faces : (m, 3) array of int
        Three vertices of each triangle, counted from 0, all turned the same way.

    Raises
    ------
    MeshError
        An edge has more than two triangles, two vertex stars meet in a vertex, neighbours are turned
        against each other, a triangle has no area, a coordinate is not finite. The text names the
        first offender.
    """

    def __init__(self, vertices: ArrayLike, faces: ArrayLike):
        xyz = _vertex_array(vertices)
        index = _face_array(faces, len(xyz))
        handle = Handle("dmk_mesh")
        with Context() as context:
            context.check(
                lib.dmk_mesh_create(
                    context.pointer,
                    len(xyz),
                    ffi.from_buffer("double[]", xyz),
                    len(index),
                    ffi.from_buffer("int32_t[]", index),
                    handle.box,
                )
            )
        self._handle = handle

    @classmethod
    def _adopt(cls, handle: Handle) -> "Mesh":
        mesh = cls.__new__(cls)
        mesh._handle = handle
        return mesh

    @classmethod
    def _read(cls, path: "os.PathLike[str] | str") -> "Mesh":
        handle = Handle("dmk_mesh")
        with Context() as context:
            context.check(lib.dmk_mesh_read(context.pointer, path_bytes(path), handle.box))
        return cls._adopt(handle)

    @property
    def _pointer(self) -> Any:
        return self._handle.pointer

    @cached_property
    def info(self) -> "dict[str, Any]":
        """Counts, Euler characteristic, area, edge lengths, angles in degrees, bounding box: the
        fields of dmk_mesh_info."""
        info = ffi.new("dmk_mesh_info *")
        lib.dmk_mesh_get_info(self._pointer, info)
        return copy_struct(info[0])

    @cached_property
    def vertices(self) -> NDArray[np.float64]:
        """(n, 3) coordinates, read-only."""
        n = self.info["n_vertices"]
        return view(self._handle, lib.dmk_mesh_vertices(self._pointer), (n, 3), np.float64)

    @cached_property
    def faces(self) -> NDArray[np.int32]:
        """(m, 3) vertices of each triangle, read-only."""
        n = self.info["n_triangles"]
        return view(self._handle, lib.dmk_mesh_triangles(self._pointer), (n, 3), np.int32)

    @cached_property
    def edges(self) -> NDArray[np.int32]:
        """(e, 2) ends of each edge, the smaller first, read-only."""
        n = self.info["n_edges"]
        return view(self._handle, lib.dmk_mesh_edges(self._pointer), (n, 2), np.int32)

    @cached_property
    def face_edges(self) -> NDArray[np.int64]:
        """(m, 3) edges of each triangle, read-only: edge k lies opposite corner k."""
        n = len(self.vertices)
        key = self.edges[:, 0].astype(np.int64) * n + self.edges[:, 1]
        order = np.argsort(key)
        ends = np.sort(self.faces[:, [[1, 2], [2, 0], [0, 1]]].astype(np.int64), axis=2)
        found: NDArray[np.int64] = order[np.searchsorted(key, ends[..., 0] * n + ends[..., 1], sorter=order)]
        found.flags.writeable = False
        return found

    def __reduce__(self) -> Any:
        return Mesh, (np.array(self.vertices), np.array(self.faces))

    def __iter__(self) -> Iterator[np.ndarray]:
        yield self.vertices
        yield self.faces

    def __repr__(self) -> str:
        return f"<dmkcl.Mesh: {self._describe()}>"

    def _describe(self) -> str:
        info = self.info
        parts = [f"{info['n_vertices']} vertices", count(info["n_triangles"], "triangle")]
        pieces, borders = info["n_components"], info["n_border_loops"]
        if pieces == 1:
            genus = (2 - info["euler"] - borders) // 2
            parts += ["1 component", f"genus {genus}"]
        else:
            parts.append(f"{pieces} components")
        parts.append(count(borders, "border") if borders else "closed")
        return ", ".join(parts)

    # ---- points -------------------------------------------------------------------------------

    def nearest(self, point: ArrayLike) -> Point:
        """The point of the surface nearest (in space) to x, y, z. ArgumentError if not finite."""
        xyz = numbers("coordinates of a point", point)
        if xyz.shape != (3,):
            raise ArgumentError(f"point has the shape {xyz.shape}; expected three coordinates")
        found = ffi.new("dmk_point *")
        with Context() as context:
            context.check(
                lib.dmk_mesh_project(
                    context.pointer, self._pointer, ffi.from_buffer("double[]", xyz), found
                )
            )
        return self._place(found)

    def nearest_all(self, points: ArrayLike) -> "list[Point]":
        """`nearest` of each of (k, 3) points, in far less time for many."""
        xyz = numbers("points", points)
        if xyz.shape == (0,):  # an empty list
            xyz = xyz.reshape(0, 3)
        if xyz.ndim != 2 or xyz.shape[1] != 3:
            raise ArgumentError(f"points have the shape {xyz.shape}; expected (k, 3)")
        found = ffi.new("dmk_point[]", len(xyz))
        with Context() as context:
            context.check(
                lib.dmk_mesh_project_all(
                    context.pointer, self._pointer, len(xyz), ffi.from_buffer("double[]", xyz), found
                )
            )
        return self._places(found, len(xyz))

    def at_vertex(self, vertex: SupportsIndex) -> Point:
        """Vertex number `vertex` as a point. ArgumentError if no triangle has it."""
        found = ffi.new("dmk_point *")
        with Context() as context:
            context.check(
                lib.dmk_mesh_vertex_point(
                    context.pointer, self._pointer, whole("vertex", vertex), found
                )
            )
        return self._place(found)

    def at_face(self, face: SupportsIndex, bary: Optional[ArrayLike] = None) -> Point:
        """The point of triangle `face` with the weights `bary` (None: its centre).

        Weights are scaled to sum 1. ArgumentError if one is negative or the triangle is not there.
        """
        weight = np.full(3, 1 / 3) if bary is None else numbers("weights", bary)
        if not 0 <= whole("face", face) < len(self.faces):
            raise ArgumentError(f"triangle {face}: expected 0 to {len(self.faces) - 1}")
        if weight.shape != (3,) or not (weight >= 0).all() or not 0 < weight.sum() < np.inf:
            raise ArgumentError(f"bary = {bary!r}: expected three finite weights, none negative, not all 0")
        found = ffi.new("dmk_point *", (int(face), (weight / weight.sum()).tolist()))
        return self._place(found)

    def place(
        self,
        *,
        point: Union[None, ArrayLike, Point] = None,
        vertex: Optional[SupportsIndex] = None,
        face: Optional[SupportsIndex] = None,
        bary: Optional[ArrayLike] = None,
    ) -> Point:
        """A point by one of: nearest to x, y, z (a `Point` is that already); a vertex; a triangle with
        weights."""
        given = [
            name
            for name, value in (("point", point), ("vertex", vertex), ("face", face))
            if value is not None
        ]
        if len(given) != 1 or (bary is not None and face is None):
            raise ArgumentError(
                "say where by one of: point=(x, y, z), vertex=i, face=i with bary=(a, b, c)"
            )
        if point is not None:
            return point if isinstance(point, Point) else self.nearest(point)
        if vertex is not None:
            return self.at_vertex(vertex)
        assert face is not None
        return self.at_face(face, bary)

    def _place(self, found: Any) -> Point:
        return self._places(found, 1)[0]

    def _places(self, found: Any, n: int) -> "list[Point]":
        """n points of the library."""
        places = []
        xyz = ffi.new("double[3]")
        with Context() as context:
            for i in range(n):
                context.check(lib.dmk_mesh_point_xyz(context.pointer, self._pointer, found + i, xyz))
                places.append(Point(int(found[i].triangle), tuple(found[i].weight), tuple(xyz)))
        return places

    # Sources, atoms and ends of paths; the warning is the tool's.

    def _take(
        self,
        point: Union[None, ArrayLike, Point] = None,
        vertex: Optional[SupportsIndex] = None,
        face: Optional[SupportsIndex] = None,
        bary: Optional[ArrayLike] = None,
    ) -> Point:
        """`place`, with a warning if the point is more than an edge off the surface."""
        place = self.place(point=point, vertex=vertex, face=face, bary=bary)
        if point is not None and not isinstance(point, Point):
            self._warn_away(numbers("point", point)[None], [place])
        return place

    def _take_all(self, points: PointsLike) -> "list[Point]":
        """`nearest_all` with the same warning; a `Point` among them is that already."""

        def nearest(given: ArrayLike) -> "list[Point]":
            places = self.nearest_all(given)
            self._warn_away(numbers("points", given), places)
            return places

        return each_place(points, nearest)

    def _warn_away(self, points: NDArray[np.float64], places: "list[Point]") -> None:
        away = np.linalg.norm(points.reshape(-1, 3) - np.reshape([place.xyz for place in places], (-1, 3)), axis=1)
        far = np.flatnonzero(away > self.info["mean_edge"])
        if len(far) == 0:
            return
        wanted, found = (
            ", ".join(f"{x:.6g}" for x in xyz) for xyz in (points[far[0]], places[far[0]].xyz)
        )
        others = f", and so are those of {len(far) - 1} more such points" if len(far) > 1 else ""
        warn(
            f"({wanted}) is {away[far[0]]:.3g} away from the surface; its nearest point ({found}) is taken"
            + others
        )

    # ---- out ----------------------------------------------------------------------------------

    def write(self, path: "os.PathLike[str] | str") -> None:
        """Write the bare mesh; the suffix chooses the format (OFF, OBJ, PLY, VTP, PVTP, VTU)."""
        with Context() as context:
            context.check(lib.dmk_mesh_write(context.pointer, self._pointer, path_bytes(path)))

    def to_trimesh(self) -> Any:
        """A trimesh.Trimesh with the same vertices in the same order."""
        trimesh = optional("trimesh")

        return trimesh.Trimesh(np.array(self.vertices), np.array(self.faces), process=False)

    def to_pyvista(self) -> Any:
        """A pyvista.PolyData."""
        pyvista = optional("pyvista")

        faces = np.column_stack([np.full(len(self.faces), 3), self.faces]).ravel()
        return pyvista.PolyData(np.array(self.vertices), faces)
