"""Vertices and faces of what other packages call a mesh: meshio, trimesh, PyVista, Open3D."""

from __future__ import annotations

from typing import Any, Optional

import numpy as np
from numpy.typing import NDArray

from ._lib import Context, MeshError, ffi, lib
from ._mesh import _index_array, _vertex_array


def _split(points: Any, polygons: NDArray[Any]) -> NDArray[Any]:
    """Polygons (m, k) to triangles, in order, as files of such are read."""
    if polygons.shape[1] == 3 or len(polygons) == 0:
        return polygons.reshape(-1, 3)
    xyz = _vertex_array(points)
    corners = _index_array(polygons, len(xyz), "polygon")
    triangles = np.empty((len(corners), corners.shape[1] - 2, 3), np.int32)
    with Context() as context:
        context.check(
            lib.dmk_polygons_split(
                context.pointer,
                len(xyz),
                ffi.from_buffer("double[]", xyz),
                *corners.shape,
                ffi.from_buffer("int32_t[]", corners),
                ffi.from_buffer("int32_t[]", triangles),
            )
        )
    return triangles.reshape(-1, 3)


# Corners of the plane cells among all their nodes (meshio puts the corners first).
_CORNERS = {"triangle": 3, "triangle6": 3, "triangle7": 3, "quad": 4, "quad8": 4, "quad9": 4}


def from_meshio(mesh: Any) -> "tuple[Any, Any]":
    parts, others = [], set()
    for block in mesh.cells:
        corners = _CORNERS.get(block.type)
        if corners:
            parts.append(_split(mesh.points, np.asarray(block.data)[:, :corners]))
        elif block.type == "polygon":
            # All at once, but where they differ in size and are objects.
            groups = block.data if block.data.dtype == object else [block.data]
            parts.extend(_split(mesh.points, np.atleast_2d(group)) for group in groups)
        else:
            others.add(block.type)
    if not parts:
        found = f", but cells of type {', '.join(sorted(others))}" if others else ""
        raise MeshError(f"no triangles{found}; expected a surface")
    return mesh.points, np.vstack(parts)


def from_trimesh(mesh: Any) -> "tuple[Any, Any]":
    """A Trimesh, or a Scene: all its bodies where the scene has put them."""
    if hasattr(mesh, "geometry"):
        mesh = mesh.to_mesh() if hasattr(mesh, "to_mesh") else mesh.dump(concatenate=True)
    return mesh.vertices, mesh.faces


def from_pyvista(data: Any) -> "tuple[Any, Any]":
    """Any data set, or a MultiBlock: all its blocks together. Only the surface of solids."""
    import pyvista

    if isinstance(data, pyvista.MultiBlock):
        data = data.combine()
    if not isinstance(data, pyvista.PolyData):
        data = data.extract_surface(algorithm=None)
    data = data.triangulate()
    return data.points, np.asarray(data.faces).reshape(-1, 4)[:, 1:]


def from_object(mesh: Any) -> "Optional[tuple[Any, Any]]":
    """Vertices and faces of another package's object, recognised by its attributes; None: it is none of them."""
    if hasattr(mesh, "geometry") and (hasattr(mesh, "to_mesh") or hasattr(mesh, "dump")):
        return from_trimesh(mesh)
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        return from_trimesh(mesh)
    if hasattr(mesh, "vertices") and hasattr(mesh, "triangles"):  # Open3D
        return np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):  # Open3D, its tensors
        legacy = mesh.to_legacy()
        return np.asarray(legacy.vertices), np.asarray(legacy.triangles)
    if hasattr(mesh, "points") and hasattr(mesh, "n_cells"):
        return from_pyvista(mesh)
    if hasattr(mesh, "n_blocks") and hasattr(mesh, "combine"):
        return from_pyvista(mesh)
    if hasattr(mesh, "points") and hasattr(mesh, "cells"):
        return from_meshio(mesh)
    return None
