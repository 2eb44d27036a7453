"""The cut locus of a point on a triangulated surface, by optimal transport, on OpenCL.

>>> import dmkcl
>>> result = dmkcl.CutLocus(dmkcl.surfaces.torus()).solve(point=(3, 0, 0))
>>> result.density.shape, result.distance.shape, result.locus.loops
((5424,), (2712,), 2)
>>> result.export_html("torus.html")
"""

from . import surfaces
from ._cut import Cut
from ._device import devices
from ._geodesics import Geodesics, Path, distance
from ._lib import (
    ArgumentError,
    DeviceError,
    DivergedError,
    Error,
    FileError,
    FormatError,
    MeshError,
    OutOfMemoryError,
    StepLimitError,
    version,
)
from ._locus import Locus
from ._mesh import Mesh, Point
from ._progress import Progress
from ._read import Repaired, read, repair
from ._result import Certificate, Result, Tangent
from ._solver import CutLocus, cut_open, shortest_path, solve_meshes, transport
from ._transport import Measure, Transport

__version__ = version()

__all__ = [
    "ArgumentError",
    "Certificate",
    "Cut",
    "CutLocus",
    "DeviceError",
    "DivergedError",
    "Error",
    "FileError",
    "FormatError",
    "Geodesics",
    "Locus",
    "Measure",
    "Mesh",
    "MeshError",
    "OutOfMemoryError",
    "Path",
    "Point",
    "Progress",
    "Repaired",
    "Result",
    "StepLimitError",
    "Tangent",
    "Transport",
    "cut_open",
    "devices",
    "distance",
    "read",
    "repair",
    "shortest_path",
    "solve_meshes",
    "surfaces",
    "transport",
    "version",
]
