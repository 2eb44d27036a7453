"""Optimal transport between two measures on a surface, at the cost of the distance."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Literal, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._lib import (
    ArgumentError, Context, Handle, amount, copy_struct, ffi, is_single, lib, named_seconds, numbers, path_bytes, view,
)  # fmt: skip
from ._mesh import Mesh, PointsLike, pack_points


def _same(a: Any, b: Any) -> bool:
    """Of two fields of measures: numbers, arrays, lists that may hold arrays and `Point`."""
    a, b = (np.asarray(x) if hasattr(x, "__array__") else x for x in (a, b))
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return np.array_equal(a, b)
    a, b = (x.tolist() if isinstance(x, np.ndarray) else x for x in (a, b))
    if isinstance(a, (list, tuple)) and isinstance(b, (list, tuple)):
        return len(a) == len(b) and all(map(_same, a, b))
    return bool(a == b)


def _how_many(name: str, values: Any) -> str:
    """Of printed text; what is no list, a mistake that is told when the measure is used, as it is."""
    return f"{name} {values!r}" if is_single(values) else f"{name} of {len(values)}"


@dataclass(frozen=True, eq=False)
class Measure:
    """A measure on a surface: the sum of the parts that are given, in any unit of mass.

    vertex_mass: (n,) a mass at each vertex, spread over the triangles around it; face_density: (m,)
    mass per area; points with masses: (k, 3), or a list with `Point` in it, and (k,) (None: 1 each; "free": each
    takes what the other measure has nearest to it, see `Transport.atom_mass`); uniform: a mass spread evenly over
    the component of the others.
    """

    vertex_mass: Optional[ArrayLike] = None
    face_density: Optional[ArrayLike] = None
    points: Optional[PointsLike] = None
    masses: Union[None, Literal["free"], ArrayLike] = None
    uniform: float = 0.0

    def __eq__(self, other: object) -> bool:
        """Whether all parts are the same, number by number."""
        if not isinstance(other, Measure):
            return NotImplemented
        return all(_same(getattr(self, part.name), getattr(other, part.name)) for part in fields(self))

    def __hash__(self) -> int:
        return hash(self.uniform)  # of the parts the only one that cannot change

    def __repr__(self) -> str:
        given = {name: getattr(self, name) for name in ("vertex_mass", "face_density", "points")}
        parts = [_how_many(name, values) for name, values in given.items() if values is not None]
        parts += ["masses free"] if isinstance(self.masses, str) else []
        parts += [f"uniform {self.uniform:.6g}"] if self.uniform else []
        return f"<dmkcl.Measure: {', '.join(parts) or 'nothing'}>"


#: A `Measure`, or an array of masses at the vertices.
MeasureLike = Union[Measure, ArrayLike]


def _column(name: str, values: ArrayLike, n: int) -> NDArray[np.float64]:
    array = numbers(name, values)
    if array.shape != (n,):
        raise ArgumentError(f"{name} has the shape {array.shape}; expected ({n},)")
    return array


def pack(mesh: Mesh, measure: MeasureLike, keep: "list[Any]") -> Any:
    """The C struct, which goes to `keep` with what it points to."""
    m = measure if isinstance(measure, Measure) else Measure(vertex_mass=measure)
    packed = ffi.new("dmk_measure *")

    def lend(name: str, array: NDArray[np.float64]) -> None:
        keep.append(array)
        setattr(packed, name, ffi.from_buffer("double[]", array))

    if m.vertex_mass is not None:
        lend("vertex_mass", _column("vertex_mass", m.vertex_mass, len(mesh.vertices)))
    if m.face_density is not None:
        lend("triangle_density", _column("face_density", m.face_density, len(mesh.faces)))
    if m.points is not None:
        places = mesh._take_all(m.points)
        atoms = pack_points(places)
        keep.append(atoms)
        packed.atoms, packed.n_atoms = atoms, len(places)
        if isinstance(m.masses, str):
            if m.masses != "free":
                raise ArgumentError(f"masses = {m.masses!r}: expected numbers or 'free'")
        else:
            masses = np.ones(len(places)) if m.masses is None else m.masses
            lend("atom_mass", _column("masses", masses, len(places)))
    elif m.masses is not None:
        raise ArgumentError("masses are given, but no points that have them")
    packed.uniform = amount("uniform", m.uniform)
    keep.append(packed)
    return packed


_ARRAYS = ("density", "flux", "potential", "atom_mass", "acl")


class Transport:
    """What `CutLocus.transport` found. Arrays are read-only views of the library's memory.

    Solved is ``-div(mu grad u) = a - b`` with ``|grad u| <= 1``, equal to 1 where ``mu > 0``. It can be
    pickled, with all but `write`.
    """

    def __init__(self, mesh: Mesh, handle: Handle):
        self.mesh: Mesh = mesh
        self._made: Optional[Handle] = handle

    @property
    def _handle(self) -> Handle:
        if self._made is None:
            raise ArgumentError("a transport that was pickled cannot be written; write it before")
        return self._made

    def __getstate__(self) -> "dict[str, Any]":
        """Arrays, numbers and the mesh."""
        return {name: getattr(self, name) for name in ("mesh", "stats", "_info", *_ARRAYS)}

    def __setstate__(self, state: "dict[str, Any]") -> None:
        self.__dict__.update(state, _made=None)
        for name in _ARRAYS:
            getattr(self, name).flags.writeable = False

    def __copy__(self) -> "Transport":
        return self  # nothing of it can be changed

    def __deepcopy__(self, memo: Any) -> "Transport":
        return self

    def __repr__(self) -> str:
        return f"<dmkcl.Transport: mass {self.mass:.6g}, discrete W1 from {self.lower:.6g} to {self.upper:.6g}>"

    @cached_property
    def stats(self) -> "dict[str, Any]":
        """Steps, iterations, bounds, and seconds by stage: the names of `Result.stats`."""
        stats = ffi.new("dmk_stats *")
        lib.dmk_transport_get_stats(self._handle.pointer, stats)
        return named_seconds(copy_struct(stats[0]))

    @property
    def lower(self) -> float:
        """Lower bound of the discrete W1."""
        return float(self.stats["cost_lower"])

    @property
    def upper(self) -> float:
        """Upper bound of the discrete W1, the cost of the flux: the better value of the two."""
        return float(self.stats["cost_upper"])

    @property
    def w1(self) -> float:
        """The earth mover's distance W1, in mass times length: the mean of its bounds.

        These are bounds of the discrete problem, in which a point with a mass is blunt by a part of an
        edge: from one such point to another the value is too large, for neighbouring vertices by a
        quarter, 16 edges apart by 2 %.
        """
        return (self.lower + self.upper) / 2

    @cached_property
    def _info(self) -> "dict[str, Any]":
        info = ffi.new("dmk_transport_info *")
        lib.dmk_transport_get_info(self._handle.pointer, info)
        return copy_struct(info[0])

    @property
    def mass(self) -> float:
        """That is moved."""
        return float(self._info["mass"])

    @property
    def balance(self) -> float:
        """Largest relative defect of the flux at a node: rounding."""
        return float(self._info["balance"])

    def _array(self, name: str, columns: int = 1) -> NDArray[np.float64]:
        n = ffi.new("size_t *")
        pointer = getattr(lib, "dmk_transport_" + name)(self._handle.pointer, n)
        shape = (len(self.mesh.faces), columns) if columns > 1 else (n[0],)
        return view(self._handle, pointer, shape, np.float64)

    @cached_property
    def density(self) -> NDArray[np.float64]:
        """(m,) mu, the length of the flux: mass per length, in each triangle."""
        return self._array("density")

    @cached_property
    def flux(self) -> NDArray[np.float64]:
        """(m, 3) mean of -mu grad u in each triangle: where the mass goes."""
        return self._array("flux", 3)

    @cached_property
    def potential(self) -> NDArray[np.float64]:
        """(n,) Kantorovich potential u at the vertices, 0 at its largest."""
        return self._array("potential")

    @cached_property
    def atom_mass(self) -> NDArray[np.float64]:
        """(k,) what the points with "free" masses take: the mass of their Voronoi cells; else empty."""
        return self._array("atom_mass")

    @cached_property
    def acl(self) -> NDArray[np.bool_]:
        """(m,) of points with "free" masses: the approximate cut locus of their set; else empty."""
        n = ffi.new("size_t *")
        pointer = lib.dmk_transport_acl(self._handle.pointer, n)
        return view(self._handle, pointer, (n[0],), np.uint8).view(np.bool_)

    def write(self, path: "os.PathLike[str] | str") -> None:
        """Write mesh, mu, flux, u and acl; the suffix chooses VTP, PVTP, VTU or PLY."""
        with Context() as context:
            context.check(
                lib.dmk_transport_write(
                    context.pointer, self.mesh._pointer, self._handle.pointer, path_bytes(path)
                )
            )


def check_measures(mesh: Mesh, first: Any, second: Any) -> None:
    """Of packed ones: whether they can be transported, but for masses that differ."""
    with Context() as context:
        context.check(lib.dmk_measures_check(context.pointer, mesh._pointer, first, second))


def solve_measures(
    mesh: Mesh, solver: Handle, context: Context, first: Any, second: Any, options: Any
) -> Transport:
    """From one packed measure to another, or NULL."""
    handle = Handle("dmk_transport")
    context.check(
        lib.dmk_solve_measures(context.pointer, solver.pointer, first, second, options, handle.box)
    )
    return Transport(mesh, handle)
