"""Meshes from files and from other packages; the library's own formats first, then what meshio and
trimesh read."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Callable, NamedTuple, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._foreign import from_meshio, from_object
from ._lib import ArgumentError, Context, Error, FormatError, Handle, ffi, lib, path_bytes, path_text, warn
from ._mesh import Mesh, _face_array, _vertex_array

MeshLike = Union[Mesh, "os.PathLike[str]", str, Sequence[Any], Any]


# ---- repair -----------------------------------------------------------------------------------


class Repaired(NamedTuple):
    """A repaired mesh, and what was done.

    mesh: a `Mesh`. Counts: merged_vertices, flipped_triangles and degenerate_triangles (zero area:
    mended, dropped), duplicate_triangles, split_edges (of more than two triangles), turned_triangles,
    split_vertices (added), seam_edges (of two triangles, cut open where the surface has one side only).
    vertex_new: (old n,) the new number of each old vertex, -1 where it has gone; vertex_old: (n,) and
    face_old: (m,) old numbers, the first of several.
    """

    mesh: Mesh
    merged_vertices: int
    flipped_triangles: int
    degenerate_triangles: int
    duplicate_triangles: int
    split_edges: int
    turned_triangles: int
    split_vertices: int
    seam_edges: int
    vertex_new: NDArray[np.int32]
    vertex_old: NDArray[np.int32]
    face_old: NDArray[np.int32]

    def __repr__(self) -> str:
        done = [f"{getattr(self, name)} {name}" for name in _COUNTS if getattr(self, name)]
        return f"<dmkcl.Repaired: {self.mesh!r}; {', '.join(done) or 'nothing needed repair'}>"


_COUNTS = Repaired._fields[1:9]


def _warn_of_seam(n: int) -> None:
    if n > 0:
        warn(
            f"the mesh was cut open along {n} edge{'s' if n > 1 else ''}, for it has one side only: "
            "distances across this seam are not those of the surface"
        )


def _repaired(call: Callable[[Any, Any, Any], int]) -> Repaired:
    """What call(context, repairs, mesh) gives."""
    handle = Handle("dmk_mesh")
    did = ffi.gc(ffi.new("dmk_repairs *"), lib.dmk_repairs_free)
    with Context() as context:
        context.check(call(context.pointer, did, handle.box))

    def taken(pointer: Any, n: int) -> NDArray[np.int32]:
        return np.frombuffer(ffi.buffer(pointer, 4 * n), np.int32, count=n).copy()

    counts = {name: int(getattr(did, name)) for name in _COUNTS}
    return Repaired(
        mesh=Mesh._adopt(handle),
        vertex_new=taken(did.vertex_new, did.n_old_vertices),
        vertex_old=taken(did.vertex_old, did.n_vertices),
        face_old=taken(did.triangle_old, did.n_triangles),
        **counts,
    )


def _repair_arrays(vertices: ArrayLike, faces: ArrayLike) -> Repaired:
    xyz = _vertex_array(vertices)
    index = _face_array(faces, len(xyz))
    return _repaired(
        lambda context, did, box: lib.dmk_mesh_repair(
            context,
            len(xyz),
            ffi.from_buffer("double[]", xyz),
            len(index),
            ffi.from_buffer("int32_t[]", index),
            did,
            box,
        )
    )


def _repair_file(path: str) -> Repaired:
    name = path_bytes(path)
    return _repaired(lambda context, did, box: lib.dmk_mesh_read_repaired(context, name, did, box))


def repair(vertices: "Union[ArrayLike, MeshLike]", faces: Optional[ArrayLike] = None) -> Repaired:
    """Mend a mesh that is refused, or one that falls into pieces: ``repair(V, F).mesh``.

    Coincident vertices become one; zero-area triangles are flipped away or dropped, duplicates
    dropped; at edges of more than two triangles pairs that fit stay joined; triangles are oriented
    consistently (a surface with one side is cut open along a seam, with a UserWarning, for distances
    across it are not those of the surface); a vertex whose triangles are not joined by
    edges becomes several. Takes what `CutLocus` takes: arrays, a file name, another package's
    mesh. MeshError if a triangle names a vertex that does not exist, or nothing is left.
    """
    _refuse_second_faces(vertices, faces)
    if isinstance(vertices, (str, os.PathLike)):
        done: Repaired = _load(path_text(vertices), _repair_file, _repair_arrays)
    else:
        arrays: "tuple[Any, Any]" = (vertices, faces) if faces is not None else _arrays(vertices)
        done = _repair_arrays(*arrays)
    _warn_of_seam(done.seam_edges)
    return done


# ---- files ------------------------------------------------------------------------------------


def _by_meshio(path: str) -> "tuple[Any, Any]":
    import meshio

    # Not by meshio.read, which prints why a reader failed, and ends the program.
    known = meshio.extension_to_filetypes.items()
    for kind in [kind for suffix, kinds in known if path.lower().endswith(suffix) for kind in kinds]:
        try:
            mesh = getattr(meshio, kind.partition("-")[0]).read(path)
        except meshio.ReadError:
            continue
        return from_meshio(mesh)
    raise meshio.ReadError(path)


def _by_trimesh(path: str) -> "tuple[Any, Any]":
    import trimesh
    from trimesh.exchange.load import mesh_loaders

    # What trimesh leaves to meshio has been there, and is read by meshio.read.
    if getattr(mesh_loaders.get(Path(path).suffix[1:].lower()), "__name__", "") == "load_meshio":
        raise ValueError(path)
    # Formats for pictures double the vertices along seams of texture; there the surface is whole.
    loaded = trimesh.load_mesh(path)
    if isinstance(loaded, trimesh.Scene):
        loaded = loaded.to_mesh()
    loaded.merge_vertices(merge_tex=True, merge_norm=True)
    return loaded.vertices, loaded.faces


def named(error: Error, path: str) -> Error:
    """The error with the user's file in its text, where that is not there."""
    if path in str(error):
        return error
    again = type(error)(f"{path}: {error}")
    again.code = error.code
    return again


def _try(reader: Callable[[str], Any], name: str, path: str) -> Any:
    """Vertices and faces, or why this reader has none."""
    try:
        return reader(path)
    except ImportError as missing:
        return f"{missing.name or name} is not installed"
    except Error as error:
        raise named(error, path) from None
    except Exception:
        return f"{name} cannot read it"


def _is_unknown(path: str, error: FormatError) -> bool:
    """Whether the library knows no such format: another than a known one that is broken."""
    if path.lower().endswith(".msh"):  # Gmsh's begin with $; ANSYS has files of this name, too
        with open(path, "rb") as file:
            return file.read(1) != b"$"
    return "neither its content nor its suffix" in str(error)


def _load(path: str, own: Callable[[str], Any], make: Callable[[Any, Any], Any]) -> Any:
    """The library's own reader, or, of a format that it does not know, what `make` makes of what another
    package reads."""
    if not path:
        raise ArgumentError(f"{path!r}: expected the name of a file")
    try:
        return own(path)
    except FormatError as error:
        if not _is_unknown(path, error):
            raise
        refused = error
    said = [str(refused)]
    for name, reader in (("meshio", _by_meshio), ("trimesh", _by_trimesh)):
        found = _try(reader, name, path)
        if isinstance(found, tuple):
            try:
                return make(*found)
            except Error as error:
                raise named(error, path) from None
        said.append(found)
    raise FormatError("; ".join(said)) from None


def read(path: "os.PathLike[str] | str") -> Mesh:
    """Read a mesh from a file.

    The library reads its own formats (recognised by content, packed by gzip or not), with every
    bit of a double; others are given to meshio, then to trimesh, where these are installed
    (``pip install './src/python[meshes]'``).

    Raises FileError if the file cannot be read, FormatError if it is broken or nobody knows its format,
    MeshError if it holds no surface that the method can treat (`repair` mends most).
    """
    mesh: Mesh = _load(path_text(path), Mesh._read, Mesh)
    return mesh


# ---- anything that is a mesh ------------------------------------------------------------------


def _arrays(mesh: Any) -> "tuple[Any, Any]":
    if isinstance(mesh, Mesh):
        return mesh.vertices, mesh.faces
    if isinstance(mesh, (tuple, list)) and len(mesh) == 2:
        return mesh[0], mesh[1]
    found = from_object(mesh)
    if found is None:
        raise ArgumentError(
            "expected a mesh: vertices and faces, a file name, or a mesh of trimesh, meshio, "
            f"PyVista or Open3D, not {type(mesh).__name__}"
        )
    return found


def _refuse_second_faces(mesh: Any, faces: Optional[ArrayLike]) -> None:
    if faces is not None and (isinstance(mesh, (Mesh, str, os.PathLike)) or from_object(mesh) is not None):
        raise ArgumentError("a mesh has its faces; give what follows by name: source=17, not 17")


def as_mesh(mesh: MeshLike, faces: Optional[ArrayLike] = None) -> Mesh:
    """A Mesh of: a Mesh; vertices and faces; a mesh of another package; a file name."""
    _refuse_second_faces(mesh, faces)
    if faces is not None:
        vertices: Any = mesh
        return Mesh(vertices, faces)
    if isinstance(mesh, Mesh):
        return mesh
    if isinstance(mesh, (str, os.PathLike)):
        return read(mesh)
    return Mesh(*_arrays(mesh))


def warn_of_pieces(mesh: Mesh) -> None:
    """Most often its triangles share no vertices."""
    pieces = mesh.info["n_components"]
    if pieces < 2:
        return
    whole = _repair_arrays(mesh.vertices, mesh.faces).mesh.info["n_components"]
    warn(
        f"the mesh is in {pieces} pieces, and only the one with the source takes part"
        + (
            f"; dmkcl.repair(mesh).mesh, which merges coincident vertices, leaves {whole}"
            if whole < pieces
            else ""
        )
    )
