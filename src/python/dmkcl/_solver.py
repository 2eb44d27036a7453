"""CutLocus: a mesh with its device and hierarchy, ready for any number of sources."""

from __future__ import annotations

import os
from contextlib import contextmanager
from typing import (
    Any,
    Callable,
    Iterable,
    Iterator,
    Literal,
    Optional,
    Sequence,
    SupportsIndex,
    Union,
)

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._cut import Cut
from ._device import open_device
from ._geodesics import Geodesics
from ._lib import (
    ArgumentError, Context, Error, Handle, Indices, amount, count, ffi, is_single, lib, numbers, several, switch, warn,
    whole,
)  # fmt: skip
from ._mesh import Mesh, Point, PointsLike, pack_points
from ._optional import optional
from ._progress import ProgressOption, Watch
from ._read import MeshLike, as_mesh, named, warn_of_pieces
from ._result import Result
from ._transport import Measure, MeasureLike, Transport, check_measures, pack, solve_measures

#: A vertex number, a point x, y, z, or a `Point`.
PlaceLike = Union[SupportsIndex, ArrayLike, Point]
Method = Literal["newton", "inertial", "euler"]
Start = Literal["distance", "uniform"]

_METHODS = {"newton": lib.DMK_NEWTON, "inertial": lib.DMK_INERTIAL, "euler": lib.DMK_EULER}
_STARTS = {"distance": lib.DMK_START_DISTANCE, "uniform": lib.DMK_START_UNIFORM}


def _choose(table: "dict[str, int]", name: str, value: str) -> int:
    if not isinstance(value, str) or value not in table:
        raise ArgumentError(f"{name} = {value!r}: expected one of {', '.join(table)}")
    return table[value]


def _options(
    *,
    method: Method = "newton",
    start: Start = "distance",
    tolerance: float = 0,
    gap: float = 0,
    max_steps: SupportsIndex = 0,
    threshold: float = 0,
    dt: float = 0,
    inertia: Optional[float] = None,
    cg_tolerance: float = 0,
    strength: float = 0,
    density_only: bool = False,
) -> Any:
    options = ffi.new("dmk_solve_options *")
    lib.dmk_solve_options_init(options, ffi.sizeof(options[0]))
    options.method = _choose(_METHODS, "method", method)
    options.start = _choose(_STARTS, "start", start)
    options.tolerance, options.gap_tolerance = amount("tolerance", tolerance, 1), amount("gap", gap, 1)
    options.max_steps, options.threshold = whole("max_steps", max_steps), amount("threshold", threshold)
    options.dt, options.cg_tolerance = amount("dt", dt), amount("cg_tolerance", cg_tolerance, 1)
    options.density_only = switch("density_only", density_only)
    if dt and method != "euler":
        raise ArgumentError(f'dt = {dt}: only method="euler" has a time step')
    if inertia is not None and method != "inertial":
        raise ArgumentError(f'inertia = {inertia}: only method="inertial" has inertia')
    if inertia is not None:
        options.inertia = amount("inertia", inertia)
    if (amount("strength", strength) > 0 or threshold) and density_only:
        raise ArgumentError("density_only makes no cut locus: leave out threshold and strength")
    return options


def _warn_of_gap(asked: float, found: float) -> None:
    if 0 < asked < found:
        warn(
            f"the gap is {found:.2g}, above the {asked:.2g} that was asked for; a smaller tolerance may "
            "bring it down"
        )


@contextmanager
def _naming(what: str) -> Iterator[None]:
    """Errors begin with what they are about."""
    try:
        yield
    except Error as error:
        error.args = (f"{what}: {error}",)
        raise


@contextmanager
def _naming_measures(first: int, second: int) -> Iterator[None]:
    """Of errors about two measures, or about one alone, twice: their numbers."""
    try:
        yield
    except Error as error:
        words = str(error).replace("the first measure", f"measure {first}")
        words = words.replace("the second measure", f"measure {second}")
        if first != second:
            words = f"measures {first} and {second}: {words}"
        elif not words.startswith("measure "):
            words = f"measure {first}: {words}"
        error.args = (words,)
        raise


class CutLocus:
    """A surface made ready on a device: solve for one source after another.

    Parameters
    ----------
    vertices : (n, 3) array of float, or a mesh
        Coordinates, in any unit; or, without `faces`, a `Mesh`, a file name, or what trimesh
        (also a Scene), meshio, PyVista (also a MultiBlock) or Open3D call a mesh.
    faces : (m, 3) array of int
        Vertices of each triangle, counted from 0.
    device : int or str, optional
        Number in `dmkcl.devices()`, part of a name, or "gpu" or "cpu"; None: the best there is, a
        GPU before a CPU.
    single : bool
        Single precision even where the device has double.
    threads : int
        Threads of the host, and compute units of a CPU that is the device; 0: one per core.
    cache : path, optional
        Folder for compiled kernels; None: the user's cache folder, "": none.

    Raises
    ------
    MeshError
        The mesh is not a surface the method can treat; the text names the first offender.
    DeviceError
        No OpenCL device is there, or it failed.

    Notes
    -----
    Solved is ``-div(mu grad u) = |M| delta_p - 1`` with ``|grad u| <= 1``, equal to 1 where
    ``mu > 0``; then u is minus the distance to p, and mu vanishes just on the cut locus (Facca,
    Berti, Fasso, Putti, "Computing the cut locus of a Riemannian manifold via optimal transport").

    Objects may be used from several threads; solves on one device wait for each other, and the GIL
    is free meanwhile. After a fork OpenCL does not work in the child, as a DeviceError says: let
    multiprocessing spawn.

    Examples
    --------
    >>> import dmkcl
    >>> result = dmkcl.CutLocus(dmkcl.surfaces.torus()).solve(point=(3, 0, 0))
    >>> result.locus.loops
    2
    """

    def __init__(
        self,
        vertices: Union[ArrayLike, MeshLike],
        faces: Optional[ArrayLike] = None,
        *,
        device: Union[None, SupportsIndex, str] = None,
        single: bool = False,
        threads: SupportsIndex = 0,
        cache: "Union[None, str, os.PathLike[str]]" = None,
    ):
        self.mesh: Mesh = as_mesh(vertices, faces)
        warn_of_pieces(self.mesh)
        self._choice = (device, single, whole("threads", threads), cache)
        self._device = open_device(*self._choice)
        self._handle = Handle("dmk_solver", self._device.handle, self.mesh._handle)
        with self._device.use(), Context() as context:
            context.check(
                lib.dmk_solver_create(
                    context.pointer,
                    self._device.handle.pointer,
                    self.mesh._pointer,
                    self._handle.box,
                )
            )

    def __reduce__(self) -> Any:
        """Pickled as its mesh and choice of device: made ready anew where it is unpickled."""
        return _make, (self.mesh, *self._choice)

    def __repr__(self) -> str:
        n = count(len(self.mesh.faces), "triangle")
        return f"<dmkcl.CutLocus: {n}, on {self.device['name']}>"

    @property
    def device(self) -> "dict[str, Any]":
        """The device in use, as in `dmkcl.devices()`."""
        return self._device.info

    # ---- solving ------------------------------------------------------------------------------

    def solve(
        self,
        *,
        point: Union[None, ArrayLike, Point] = None,
        vertex: Optional[SupportsIndex] = None,
        face: Optional[SupportsIndex] = None,
        bary: Optional[ArrayLike] = None,
        method: Method = "newton",
        start: Start = "distance",
        tolerance: float = 0,
        gap: float = 0,
        max_steps: SupportsIndex = 0,
        threshold: float = 0,
        dt: float = 0,
        inertia: Optional[float] = None,
        cg_tolerance: float = 0,
        strength: float = 0,
        density_only: bool = False,
        progress: ProgressOption = False,
    ) -> Result:
        """Density, potential, distance and cut locus of one source.

        Parameters
        ----------
        point : (3,) array or `Point`
            The source is the point of the surface nearest (in space) to this one, with a warning
            if that is more than an edge away, or this point of the mesh; or
        vertex : int
            it is this vertex; or
        face, bary : int, (3,) array
            it lies in this triangle, with these weights on its corners (None: the centre).
        progress : bool or callable
            True: a bar by tqdm. A function gets a `Progress` for each step; what it raises ends
            the solve and is passed on. It cannot use the device, which is busy.
        strength : float
            A length: branches of the cut locus with less strength than this are left out (see
            `Locus`); 0: 0.2 mean edges, or just above the mesh's own branches where these stand
            apart from the rest (spheres, cubes, noise). `Locus.least_strength` is the one used.
        method : "newton", "inertial" or "euler"
            Newton steps in (u, log mu); explicit steps with inertia; the explicit Euler steps of
            the paper.
        start : "distance" or "uniform"
            What mu and u begin with: the exact distance, or mu = 1, as meshes of needles always do.
        tolerance : float
            Ends when the relative change of mu per unit time is below, at most 1; 0: the method's
            default, 3e-3 of "newton", 2e-3 of "inertial", 5e-4 of "euler".
        gap : float
            Ends also when the certificate's relative gap is below; the gap is then computed, and
            in the history, at every step. One that is not reached is a warning. 0: not used.
        max_steps : int
            0: the method's default, 60 of "newton", and 240 more where steps must be solved
            better; 2000 of the others.
        threshold : float
            Bound of `Result.acl`, the triangles with mu <= threshold; 0: a rule from u that
            needs none.
        dt : float
            Time step of "euler", in (0, 1]; 0: 0.5.
        inertia : float
            Of "inertial", in [0, 1); None: 0.8, reached gradually.
        cg_tolerance : float
            Relative energy residual of the inner solves; 0: the method's default.
        density_only : bool
            Density, potential and bounds of the cost only, from mu = 1 (`start` is then not
            used): the distance, `acl`, the cut locus and paths are not computed, and asking the
            result for them is an ArgumentError.

        Returns
        -------
        Result

        Raises
        ------
        ArgumentError, DivergedError, StepLimitError, DeviceError, OutOfMemoryError
            With the library's words. There is no partial result.
        KeyboardInterrupt
            Ctrl-C ends the solve after the running step; the object can be used again.
        """
        settings = _options(
            method=method,
            start=start,
            tolerance=tolerance,
            gap=gap,
            max_steps=max_steps,
            threshold=threshold,
            dt=dt,
            inertia=inertia,
            cg_tolerance=cg_tolerance,
            strength=strength,
            density_only=density_only,
        )
        return self._solve(
            self.mesh._take(point, vertex, face, bary),
            settings,
            progress,
            amount("strength", strength),
        )

    def _solve(self, source: Point, options: Any, progress: ProgressOption, strength: float) -> Result:
        place = pack_points([source])
        handle = Handle("dmk_result")
        watch = Watch(progress)
        try:
            with self._device.use(), Context(watch, self._choice[2]) as context:
                context.check(
                    lib.dmk_solve(context.pointer, self._handle.pointer, place, options, handle.box)
                )
        finally:
            watch.close()
        found = Result(
            self.mesh, handle, source, watch.history(), strength, bool(options.density_only)
        )
        _warn_of_gap(options.gap_tolerance, found.stats["gap"])
        return found

    def solve_many(
        self,
        *,
        points: Optional[PointsLike] = None,
        vertices: Optional[Indices] = None,
        faces: Optional[Indices] = None,
        bary: Optional[ArrayLike] = None,
        method: Method = "newton",
        start: Start = "distance",
        tolerance: float = 0,
        gap: float = 0,
        max_steps: SupportsIndex = 0,
        threshold: float = 0,
        dt: float = 0,
        inertia: Optional[float] = None,
        cg_tolerance: float = 0,
        strength: float = 0,
        density_only: bool = False,
        progress: bool = False,
    ) -> Iterator[Result]:
        """Results for many sources, one after another, as an iterator.

        Sources are given by one of: points, (k, 3) or a list with `Point` in it; vertices, (k,); faces, (k,),
        with bary, (k, 3).
        Each result is computed when it is asked for, so that memory holds one at a time;
        ``list(...)`` keeps them all. progress=True: a bar by tqdm over the sources. Options and
        errors are those of `solve`; the sources are checked at once.
        """
        settings = _options(
            method=method,
            start=start,
            tolerance=tolerance,
            gap=gap,
            max_steps=max_steps,
            threshold=threshold,
            dt=dt,
            inertia=inertia,
            cg_tolerance=cg_tolerance,
            strength=strength,
            density_only=density_only,
        )
        given = {"points": points, "vertices": vertices, "faces": faces}
        chosen: "list[tuple[str, Any]]" = [(name, of) for name, of in given.items() if of is not None]
        if len(chosen) != 1:
            raise ArgumentError("say where by one of: points, vertices, faces with bary")
        asked, values = chosen[0]
        if is_single(values):
            raise ArgumentError(f"{asked} = {values!r}: expected several")
        name = {"points": "point", "vertices": "vertex", "faces": "face"}[asked]
        weights: "list[Any]" = [None] * len(values)
        if bary is not None:
            weights = list(numbers("weights", bary))
        if len(weights) != len(values):
            raise ArgumentError(f"{count(len(values), 'face')}, but {count(len(weights), 'row')} of bary")
        if points is not None and bary is None:
            sources = self.mesh._take_all(points)
        else:
            sources = [
                self.mesh.place(bary=weight, **{name: value}) for value, weight in zip(values, weights)
            ]
        shown = switch("progress", progress)
        return self._solve_each(sources, settings, shown, amount("strength", strength))

    def _solve_each(
        self, sources: "list[Point]", options: Any, progress: bool, strength: float
    ) -> Iterator[Result]:
        shown: Any = sources
        if progress:
            shown = optional("tqdm.auto").tqdm(sources, unit=" sources")
        for source in shown:
            yield self._solve(source, options, False, strength)

    # ---- transport ----------------------------------------------------------------------------

    def transport(
        self,
        a: MeasureLike,
        b: Optional[MeasureLike] = None,
        *,
        normalise: bool = False,
        tolerance: float = 0,
        gap: float = 0,
        max_steps: SupportsIndex = 0,
        progress: ProgressOption = False,
    ) -> Transport:
        """Optimal transport from the measure a to b at the cost of the distance (W1).

        a, b : a `Measure`, or (n,) masses at the vertices. Without b, a is signed: its positive part
        goes to its negative part. Both must have the same mass, unless normalise, which scales b
        to the mass of a. The other options are those of `solve`; a gap that is asked for and not
        reached is a warning.
        """
        settings = _options(tolerance=tolerance, gap=gap, max_steps=max_steps)
        settings.normalise = switch("normalise", normalise)
        if normalise and b is None:
            raise ArgumentError("normalise scales b, which is not given")
        keep: "list[Any]" = []
        first = pack(self.mesh, a, keep)
        second = ffi.NULL if b is None else pack(self.mesh, b, keep)
        found = self._transport(first, second, settings, progress)
        _warn_of_gap(gap, found.stats["gap"])
        return found

    def _transport(self, first: Any, second: Any, settings: Any, progress: ProgressOption) -> Transport:
        watch = Watch(progress)
        try:
            with self._device.use(), Context(watch, self._choice[2]) as context:
                return solve_measures(self.mesh, self._handle, context, first, second, settings)
        finally:
            watch.close()

    def w1_matrix(
        self, measures: Sequence[MeasureLike], *, normalise: bool = False, progress: bool = False
    ) -> NDArray[np.float64]:
        """(k, k) earth mover's distances between all pairs of k measures, symmetric. With normalise all are
        scaled to the mass of the first.

        An error names the measure, or the pair, by number; what can be found without a transport is
        found before the first one."""
        settings = _options()
        settings.normalise, shown = switch("normalise", normalise), switch("progress", progress)
        if isinstance(measures, Measure):
            raise ArgumentError("one measure; expected several, as in a list: [measure]")
        keep: "list[Any]" = []
        packed: "list[Any]" = []
        for i, measure in enumerate(several("measures", measures)):
            with _naming(f"measure {i}"):
                packed.append(pack(self.mesh, measure, keep))
        k = range(len(packed))
        pairs: Any = [(i, j) for i in k for j in range(i)]
        for i, j in pairs or [(i, i) for i in k]:  # one alone is checked, too
            with _naming_measures(i, j):
                check_measures(self.mesh, packed[i], packed[j])
        if shown:
            pairs = optional("tqdm.auto").tqdm(pairs, unit=" pairs")
        found = np.zeros((len(packed), len(packed)))
        mass = None  # of the first measure
        for i, j in pairs:
            a, b = (j, i) if normalise else (i, j)  # the first pair is to have the first measure's mass
            with _naming_measures(a, b):
                moved = self._transport(packed[a], packed[b], settings, False)
            mass = mass or moved.mass
            found[i, j] = found[j, i] = moved.w1 * (mass / moved.mass if normalise else 1)
        return found

    # ---- drop-ins -----------------------------------------------------------------------------

    def distance(
        self,
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
        """Exact distance of every vertex to the nearest source, (n,): see `Geodesics`. It needs no
        solve. Infinite on components without a source."""
        return Geodesics(
            self.mesh, source, sources=sources, vertex=vertex, vertices=vertices, point=point, points=points,
            curve=curve, border=border, threads=self._choice[2],
        ).distance  # fmt: skip

    def shortest_path(
        self, start: PlaceLike, end: PlaceLike
    ) -> NDArray[np.float64]:
        """Points of a minimal geodesic from start to end, (k, 3), straight in every triangle.

        start and end: vertex numbers, or points x, y, z. To many ends from one start, use
        `Geodesics` once and `Geodesics.path` for each.
        """
        where = self.mesh._take(**_one_place(start))
        return Geodesics(self.mesh, where).path(**_one_place(end)).points


OnError = Union[Literal["raise", "yield"], Callable[[Any, Error], None]]


def solve_meshes(
    meshes: "Iterable[MeshLike]",
    source: PlaceLike = 0,
    *,
    on_error: OnError = "raise",
    device: Union[None, SupportsIndex, str] = None,
    single: bool = False,
    threads: SupportsIndex = 0,
    cache: "Union[None, str, os.PathLike[str]]" = None,
    method: Method = "newton",
    start: Start = "distance",
    tolerance: float = 0,
    gap: float = 0,
    max_steps: SupportsIndex = 0,
    threshold: float = 0,
    dt: float = 0,
    inertia: Optional[float] = None,
    cg_tolerance: float = 0,
    strength: float = 0,
    density_only: bool = False,
) -> "Iterator[Union[Result, Error]]":
    """Results of many meshes, one for each and in their order, as an iterator.

    Parameters
    ----------
    meshes : iterable
        File names or meshes, as `CutLocus` takes them; a generator is read as it goes.
    source : int or (3,) array
        Of each mesh this vertex, or the point nearest to this one.
    on_error : "raise", "yield" or callable
        Of a mesh or solve that fails: "raise" ends the iteration; "yield" gives the `Error` in the
        place of the result and goes on; a function gets the mesh as it was given and the `Error`,
        and nothing is yielded for it.
    device, single, threads, cache
        As of `CutLocus`; the device is opened once.
    method, start, tolerance, gap, max_steps, threshold, dt, inertia, cg_tolerance, strength, density_only
        As of `CutLocus.solve`.

    Examples
    --------
    Each result is computed when it is asked for, so that memory holds one mesh at a time.

    >>> for found in dmkcl.solve_meshes(["a.off", "b.ply"], on_error="yield"):
    ...     print(found)
    """
    if not callable(on_error) and not (isinstance(on_error, str) and on_error in ("raise", "yield")):
        raise ArgumentError(f"on_error = {on_error!r}: expected 'raise', 'yield' or a function")
    if isinstance(meshes, (str, os.PathLike, Mesh)):
        raise ArgumentError("one mesh; expected several, as in a list: [mesh]")
    where = _one_place(source)
    least = amount("strength", strength)
    settings = _options(
        method=method,
        start=start,
        tolerance=tolerance,
        gap=gap,
        max_steps=max_steps,
        threshold=threshold,
        dt=dt,
        inertia=inertia,
        cg_tolerance=cg_tolerance,
        strength=strength,
        density_only=density_only,
    )

    def solve(mesh: Any) -> Result:
        solver = _make(as_mesh(mesh), device, single, threads, cache)
        return solver._solve(solver.mesh._take(**where), settings, False, least)

    return (found for mesh in several("meshes", meshes) for found in _solve_mesh(mesh, solve, on_error))


def _solve_mesh(
    mesh: Any, solve: Callable[[Any], Result], on_error: OnError
) -> "list[Union[Result, Error]]":
    try:
        return [solve(mesh)]
    except Error as said:
        error = named(said, os.fspath(mesh)) if isinstance(mesh, (str, os.PathLike)) else said
        if on_error == "raise":
            raise error from None
        if not callable(on_error):
            return [error]
        on_error(mesh, error)
        return []


def _make(mesh: Mesh, device: Any, single: bool, threads: SupportsIndex, cache: Any) -> CutLocus:
    return CutLocus(mesh, device=device, single=single, threads=threads, cache=cache)


def _one_place(place: PlaceLike) -> "dict[str, Any]":
    """Arguments of `solve`: a single number is a vertex, three are a point."""
    if isinstance(place, Point):
        return {"point": place}
    try:
        where = np.asarray(place)
    except ValueError:  # rows of different lengths
        where = np.empty(0)
    if where.ndim == 0 and where.dtype.kind in "iu":
        return {"vertex": int(where)}
    if where.shape == (3,) and where.dtype.kind in "iuf":
        return {"point": where}
    raise ArgumentError(f"{place!r}: expected a vertex number or a point x, y, z")


def _are_faces(value: Any) -> bool:
    try:
        return np.ndim(value) == 2
    except ValueError:  # rows of different lengths
        return False


def shortest_path(
    vertices: Union[ArrayLike, MeshLike],
    faces: Union[None, ArrayLike, PlaceLike] = None,
    start: Optional[PlaceLike] = None,
    end: Optional[PlaceLike] = None,
) -> NDArray[np.float64]:
    """Points of a minimal geodesic, (k, 3): ``shortest_path(V, F, 17, 99)``, of a mesh
    ``shortest_path(mesh, 17, 99)``; vertex numbers or points x, y, z. Needs no device; see also
    `Geodesics.path`."""
    own: Any = faces
    if (start is None or end is None) and not _are_faces(own):  # but an end: the mesh has faces of its own
        own, start, end = None, own, end if start is None else start
    if start is None or end is None:
        raise ArgumentError("a path has two ends: shortest_path(mesh, 17, 99), or shortest_path(V, F, 17, 99)")
    mesh = as_mesh(vertices, own)
    return Geodesics(mesh, mesh._take(**_one_place(start))).path(**_one_place(end)).points


def cut_open(
    vertices: Union[ArrayLike, MeshLike],
    faces: Optional[ArrayLike] = None,
    source: PlaceLike = 0,
    *,
    strength: float = 0,
) -> Cut:
    """The surface cut open along the cut locus of a source (vertex number or point): a disk. Needs no device; see
    `Geodesics.cut_open`, and `CutLocus.solve` for the strength."""
    mesh = as_mesh(vertices, faces)
    return Geodesics(mesh, mesh._take(**_one_place(source))).cut_open(strength=strength)


def transport(
    mesh: MeshLike,
    a: MeasureLike,
    b: Optional[MeasureLike] = None,
    *,
    normalise: bool = False,
) -> Transport:
    """Optimal transport between two measures on a mesh: see `CutLocus.transport`, which keeps what
    is made ready for the next pair."""
    return CutLocus(mesh).transport(a, b, normalise=normalise)
