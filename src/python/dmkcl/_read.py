"""Reading files: the library's own formats first, then what meshio and trimesh read."""

from __future__ import annotations

import os
from typing import Any, Callable, Optional, Sequence, Union

from numpy.typing import ArrayLike

from ._foreign import from_meshio, from_object
from ._lib import ArgumentError, Error, FileError, FormatError
from ._mesh import Mesh


def _by_meshio(path: str) -> Mesh:
    import meshio

    return from_meshio(meshio.read(path))


def _by_trimesh(path: str) -> Mesh:
    import trimesh

    # Formats for pictures double the vertices along seams of texture; there the surface is whole.
    loaded = trimesh.load_mesh(path)
    if isinstance(loaded, trimesh.Scene):
        loaded = loaded.to_mesh()
    loaded.merge_vertices(merge_tex=True, merge_norm=True)
    return Mesh(loaded.vertices, loaded.faces)


def _named(error: Error, path: str) -> Error:
    """The error with the user's file in its text."""
    named = type(error)(f"{path}: {error}")
    named.code = error.code
    return named


def _try(reader: Callable[[str], Mesh], name: str, path: str) -> "Mesh | str":
    """The mesh, or why this reader has none. What is read and is no surface is an error."""
    try:
        return reader(path)
    except ImportError as missing:
        return f"{missing.name or name} is not installed"
    except Error as error:
        raise _named(error, path) from None
    except (Exception, SystemExit) as error:  # meshio ends the program on some files
        words = str(error).strip() or type(error).__name__
        return words.splitlines()[0]


def read(path: "os.PathLike[str] | str") -> Mesh:
    """Read a mesh from a file.

    The library reads its own formats (recognised by content, packed by gzip or not), with every
    bit of a double; others are given to meshio, then to trimesh, where these are installed
    (``pip install dmkcl[meshes]``).

    Raises FileError if the file cannot be read, FormatError if nobody knows the format, MeshError
    if it holds no surface that the method can treat.
    """
    path = os.fspath(path)
    try:
        return Mesh._read(path)
    except FormatError as error:
        own = error
    except FileError:
        raise
    said = [str(own)]
    for name, reader in (("meshio", _by_meshio), ("trimesh", _by_trimesh)):
        found = _try(reader, name, path)
        if isinstance(found, Mesh):
            return found
        said.append(f"{name}: {found}")
    raise FormatError("; ".join(said)) from own


MeshLike = Union[Mesh, "os.PathLike[str]", str, Sequence[Any], Any]


def as_mesh(mesh: MeshLike, faces: Optional[ArrayLike] = None) -> Mesh:
    """A Mesh of: a Mesh; vertices and faces; a mesh of another package; a file name."""
    if faces is not None:
        vertices: Any = mesh
        return Mesh(vertices, faces)
    if isinstance(mesh, Mesh):
        return mesh
    if isinstance(mesh, (str, os.PathLike)):
        return read(mesh)
    if isinstance(mesh, (tuple, list)) and len(mesh) == 2:
        return Mesh(mesh[0], mesh[1])
    found = from_object(mesh)
    if found is None:
        raise ArgumentError(
            "a mesh is wanted: vertices and faces, a file name, or a mesh of trimesh, meshio, "
            f"PyVista or Open3D, not {type(mesh).__name__}"
        )
    return found
