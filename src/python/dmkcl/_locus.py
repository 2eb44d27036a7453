"""The cut locus as a graph of lines."""

from __future__ import annotations

import os
from copy import copy, deepcopy
from functools import cached_property
from typing import Any, Optional

import numpy as np
from numpy.typing import NDArray

from ._lib import Context, Error, Handle, amount, copy_struct, count, ffi, lib, path_bytes
from ._mesh import Mesh
from ._optional import optional


def _dtype(name: str, formats: "dict[str, Any]") -> np.dtype:
    """Chosen fields of a C struct, at the offsets that the compiler gave them."""
    return np.dtype(
        {
            "names": list(formats),
            "formats": list(formats.values()),
            "offsets": [ffi.offsetof(name, *field.split(".")) for field in formats],
            "itemsize": ffi.sizeof(name),
        }
    )


_VERTEX = _dtype(
    "dmk_locus_vertex",
    {
        "xyz": ("f8", 3),
        "place.triangle": "i8",
        "place.weight": ("f8", 3),
        "distance": "f8",
        "mu": "f8",
        "strength": "f8",
        "meeting_angle": "f8",
        "source_angle": "f8",
        "angle": ("f8", 2),
        "kind": "i4",
        "degree": "i4",
        "source": ("i4", 2),
    },
)
_EDGE = _dtype("dmk_locus_edge", {"vertex": ("i4", 2), "strength": "f8"})


def _rows(pointer: Any, n: int, dtype: np.dtype) -> NDArray[Any]:
    """A view, whose fields are to be copied."""
    if n == 0:
        return np.zeros(0, dtype)
    return np.frombuffer(ffi.buffer(pointer, n * dtype.itemsize), dtype)


def locus_options(strength: float) -> Any:
    """The library's, with what is wrong said of `strength`."""
    options = ffi.new("dmk_locus_options *")
    lib.dmk_locus_options_init(options, ffi.sizeof(options[0]))
    options.strength = amount("strength", strength)
    return options


class Locus:
    """The cut locus: k vertices on the surface, joined by edges.

    Attributes
    ----------
    vertices : (k, 3) places, in the unit of the coordinates
    edges : (j, 2) vertices of each edge
    edge_strength : (j,) strength of the branch that each edge belongs to, a length, infinite on
        loops and between borders: by how much a path must grow to be moved around the branch's end from one of the two
        shortest to the other. With a larger `strength` given to `solve` the edges with less go.
    strength : (k,) that of the strongest edge at each vertex, a length
    meeting_angle : (k,) between the minimal geodesics where they meet here, radians
    source_angle : (k,) between them at the source, radians, a full turn being 2 pi, at a source on the border
        up to the angle there; pi between two sources
    sources : (k, 2) numbers of the sources that they come from; of a set they differ on the borders
        of its Voronoi cells
    angle : (k, 2) directions at the source of the two outermost of them, radians; of one source
        scaled so that a full turn is 2 pi, which at a vertex `Geodesics.direction` is not
    distance : (k,) to the source, of a set to the nearest
    mu : (k,) density of the triangle the vertex lies in
    faces, bary : (k,), (k, 3) the triangle it lies in, and the weights of its corners
    degree : (k,) number of edges
    kind : (k,) 0 ordinary, 1 end, 2 branch point, 3 the whole locus is this point
    length : total length
    least_strength : the strength asked for, or the default: a length
    loops, components, endpoints, branch_points : counts; loops is the first Betti number
    """

    def __init__(self, mesh: Optional[Mesh], of: Handle, strength: float = 0):
        """Of a result on a mesh, or, where that is None, of geodesics."""
        options = locus_options(strength)
        self._handle: Optional[Handle] = Handle("dmk_locus")
        with Context() as context:
            if mesh is None:
                status = lib.dmk_geodesics_locus(
                    context.pointer, of.pointer, options, self._handle.box
                )
            else:
                status = lib.dmk_locus_compute(
                    context.pointer, mesh._pointer, of.pointer, options, self._handle.box
                )
            context.check(status)
        self._read_info()
        self._read_vertices()
        self._read_edges()

    @property
    def _pointer(self) -> Any:
        assert self._handle is not None
        return self._handle.pointer

    def _read_info(self) -> None:
        info = ffi.new("dmk_locus_info *")
        lib.dmk_locus_get_info(self._pointer, info)
        fields = copy_struct(info[0])
        self.length: float = fields["length"]
        self.least_strength: float = fields["strength"]
        self.loops: int = fields["loops"]
        self.components: int = fields["components"]
        self.endpoints: int = fields["endpoints"]
        self.branch_points: int = fields["branch_points"]

    def _read_vertices(self) -> None:
        n = ffi.new("size_t *")
        pointer = lib.dmk_locus_vertices(self._pointer, n)
        raw = _rows(pointer, n[0], _VERTEX)
        self.vertices: NDArray[np.float64] = raw["xyz"].copy()
        self.faces: NDArray[np.int64] = raw["place.triangle"].copy()
        self.bary: NDArray[np.float64] = raw["place.weight"].copy()
        self.distance: NDArray[np.float64] = raw["distance"].copy()
        self.mu: NDArray[np.float64] = raw["mu"].copy()
        self.strength: NDArray[np.float64] = raw["strength"].copy()
        self.meeting_angle: NDArray[np.float64] = raw["meeting_angle"].copy()
        self.source_angle: NDArray[np.float64] = raw["source_angle"].copy()
        self.angle: NDArray[np.float64] = raw["angle"].copy()
        self.kind: NDArray[np.int32] = raw["kind"].copy()
        self.degree: NDArray[np.int32] = raw["degree"].copy()
        self.sources: NDArray[np.int32] = raw["source"].copy()

    def _read_edges(self) -> None:
        n = ffi.new("size_t *")
        pointer = lib.dmk_locus_edges(self._pointer, n)
        raw = _rows(pointer, n[0], _EDGE)
        self.edges: NDArray[np.int32] = raw["vertex"].copy()
        self.edge_strength: NDArray[np.float64] = raw["strength"].copy()

    @cached_property
    def polylines(self) -> "list[NDArray[np.int32]]":
        """Vertex numbers along each line between branch points and ends; of a loop the first comes again at the end."""
        n, offset = ffi.new("size_t *"), ffi.new("int32_t **")
        index = lib.dmk_locus_polylines(self._pointer, offset, n)
        if n[0] == 0:
            return []
        offsets = _rows(offset[0], n[0] + 1, np.dtype(np.int32))
        indices = _rows(index, int(offsets[-1]), np.dtype(np.int32))
        return [indices[a:b].copy() for a, b in zip(offsets[:-1], offsets[1:])]

    def __getstate__(self) -> "dict[str, Any]":
        """All but the library's object, which nothing makes again."""
        self.polylines
        return {**self.__dict__, "_handle": None}

    def __copy__(self) -> "Locus":
        """The arrays may be changed, so that it is another one; the library's object cannot, and is shared."""
        other = type(self).__new__(type(self))
        other.__dict__.update(self.__dict__)
        return other

    def __deepcopy__(self, memo: Any) -> "Locus":
        other = copy(self)
        other.__dict__.update(deepcopy(self.__getstate__(), memo), _handle=self._handle)
        return other

    def __repr__(self) -> str:
        return (
            f"<dmkcl.Locus: length {self.length:.6g}, {count(self.components, 'component')}, "
            f"{count(self.loops, 'loop')}, {count(self.endpoints, 'end')}, "
            f"{count(self.branch_points, 'branch point')}>"
        )

    def write(self, path: "os.PathLike[str] | str") -> None:
        """Write as OBJ with l lines, VTP with point data, or CSV, by the suffix."""
        if self._handle is None:
            raise Error("a cut locus pickled by itself cannot be written; pickle its Result or Geodesics")
        with Context() as context:
            context.check(
                lib.dmk_locus_write(context.pointer, self._pointer, path_bytes(path))
            )

    def to_pyvista(self) -> Any:
        """A pyvista.PolyData of lines (one vertex for a locus that is a point), with the point
        arrays distance, mu, strength, meeting_angle and kind."""
        pyvista = optional("pyvista")

        lines = [np.concatenate([[len(line)], line]) for line in self.polylines if len(line) > 1]
        data = pyvista.PolyData(self.vertices, lines=np.concatenate(lines) if lines else None)
        for name in ("distance", "mu", "strength", "meeting_angle", "kind"):
            data.point_data[name] = getattr(self, name)
        return data
