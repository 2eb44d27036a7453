"""The built-in surfaces, meshed evenly. Each call gives a `Mesh`: ``V, F = surfaces.torus()``.

``n_triangles`` is about the number of triangles before refinement (None: the surface's default);
``refine`` the number of times each triangle is split into four, new points lifted to the surface
(where that would fold it over a sharp rim, as many triangles are made at once);
``source``, if given, is lifted to the surface and becomes vertex 0, so that a mesh node lies there, with a
UserWarning if it was more than an edge away.
ArgumentError if a size is not positive or there would be too many triangles.
"""

from __future__ import annotations

from typing import Optional, Sequence, SupportsIndex

import numpy as np

from ._lib import ArgumentError, Context, Handle, amount, ffi, lib, numbers, warn, whole
from ._mesh import Mesh

__all__ = ["torus", "ellipsoid", "quartic", "sphere"]


def _make(
    name: str,
    sizes: "dict[str, float]",
    n_triangles: Optional[SupportsIndex],
    refine: SupportsIndex,
    source: Optional[Sequence[float]],
) -> Mesh:
    text = ffi.new("char[]", name.encode())
    options = ffi.new("dmk_surface_options *")
    lib.dmk_surface_options_init(options, ffi.sizeof(options[0]))
    options.name = text
    for i, (size, value) in enumerate(sizes.items()):
        options.size[i] = amount(size, value, above=True)  # of 0 the library makes its default
    if n_triangles is not None:
        if not whole("n_triangles", n_triangles) > 0:
            raise ArgumentError(f"n_triangles = {n_triangles!r}: expected a number above 0")
        options.n_triangles = int(n_triangles)
    options.refine = whole("refine", refine)
    if source is not None:
        place = numbers("coordinates of the source", source)
        if place.shape != (3,):
            raise ArgumentError(f"source has the shape {place.shape}; expected three coordinates")
        options.has_source, options.source = 1, place.tolist()
    handle = Handle("dmk_mesh")
    with Context() as context:
        status = lib.dmk_mesh_surface(context.pointer, options, handle.box)
        try:
            context.check(status)
        except ArgumentError as error:  # the library's sizes are a, b, c
            error.args = (_by_names(str(error), list(sizes)),)
            raise
    mesh = Mesh._adopt(handle)
    if source is not None:
        _warn_of_lift(mesh, place)
    return mesh


def _warn_of_lift(mesh: Mesh, wanted: "np.ndarray") -> None:
    """The source is lifted to the surface from wherever it was asked for."""
    made = mesh.vertices[0]
    away = float(np.linalg.norm(made - wanted))
    if away > mesh.info["mean_edge"]:
        a, b = (", ".join(f"{x:.6g}" for x in xyz) for xyz in (wanted, made))
        warn(f"({a}) is away from the surface; the source, ({b}), is {away:.3g} from it")


def _by_names(message: str, names: Sequence[str]) -> str:
    """The library's message, in which sizes are a, b, c, with their names."""
    for letter, name in zip("abc", names):
        for words in ("size {} of", "radius {} must", "smaller than {},"):
            message = message.replace(words.format(letter), words.format(name))
    return message


def torus(
    R: float = 2,
    r: float = 1,
    *,
    n_triangles: Optional[SupportsIndex] = None,
    refine: SupportsIndex = 0,
    source: Optional[Sequence[float]] = None,
) -> Mesh:
    """Torus (sqrt(x^2 + y^2) - R)^2 + z^2 = r^2 around the z axis."""
    return _make("torus", {"R": R, "r": r}, n_triangles, refine, source)


def ellipsoid(
    a: float = 0.2,
    b: float = 0.6,
    c: float = 1,
    *,
    n_triangles: Optional[SupportsIndex] = None,
    refine: SupportsIndex = 0,
    source: Optional[Sequence[float]] = None,
) -> Mesh:
    """Ellipsoid (x/a)^2 + (y/b)^2 + (z/c)^2 = 1."""
    return _make("ellipsoid", {"a": a, "b": b, "c": c}, n_triangles, refine, source)


def quartic(
    a: float = 1,
    b: float = 1,
    c: float = 1,
    *,
    n_triangles: Optional[SupportsIndex] = None,
    refine: SupportsIndex = 0,
    source: Optional[Sequence[float]] = None,
) -> Mesh:
    """Quartic (x/a)^4 + (y/b)^4 + (z/c)^4 = 1."""
    return _make("quartic", {"a": a, "b": b, "c": c}, n_triangles, refine, source)


def sphere(
    radius: float = 1,
    *,
    n_triangles: Optional[SupportsIndex] = None,
    refine: SupportsIndex = 0,
    source: Optional[Sequence[float]] = None,
) -> Mesh:
    """Sphere of the given radius around the origin."""
    return _make("sphere", {"radius": radius}, n_triangles, refine, source)
