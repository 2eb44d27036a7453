"""The surface cut open along its cut locus."""

from __future__ import annotations

from typing import Any, Callable, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._lib import Context, Handle, count, ffi, lib
from ._locus import locus_options
from ._mesh import Mesh


class _CutArrays(NamedTuple):
    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    origin: NDArray[np.int32]


class Cut(_CutArrays):
    """A surface cut open. vertices: (n, 3); faces: (m, 3); origin: (n,) the vertex of the input at
    the same place, -1 for points of the cut locus. The input's vertices keep their order.

    plane: (n, 2) the logarithmic map, distance times direction at the source (a full turn is 2 pi, as
    in `Tangent`), on the two sides of the cut each its own: texture coordinates. Around triangles that would turn over or be flat in
    the plane directions are averaged, or such that these lie the right way round, and vertices that their paths reach across the cut
    have the direction of their side. Distances are exact at the input's vertices; at others they are those of the nearest
    corner's family on that side, which is some 0.1 mean edges short where another saddle vertex keeps it from the point."""

    plane: NDArray[np.float64]

    def __repr__(self) -> str:
        return f"<dmkcl.Cut: {len(self.vertices)} vertices, {count(len(self.faces), 'triangle')}>"


def cut_by(strength: float, call: "Callable[..., int]") -> Cut:
    """What the call makes of a context, options of the locus, and room for a mesh, origin and plane."""
    handle = Handle("dmk_mesh")
    origin, plane = ffi.new("int32_t **"), ffi.new("double **")
    with Context() as context:
        context.check(call(context.pointer, locus_options(strength), handle.box, origin, plane))
    owned = ffi.gc(origin[0], lib.free), ffi.gc(plane[0], lib.free)
    vertices, faces = Mesh._adopt(handle)
    n = len(vertices)
    cut = Cut(vertices, faces, np.frombuffer(ffi.buffer(owned[0], 4 * n), np.int32).copy())
    cut.plane = np.frombuffer(ffi.buffer(owned[1], 16 * n), np.float64).reshape(n, 2).copy()
    return cut
