"""One page that shows a result in any browser: the viewer with the data inside."""

from __future__ import annotations

import base64
import html
import json
import os
import re
import secrets
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from ._colour import density_map
from ._geodesics import Geodesics
from ._lib import ArgumentError, count, file_error, path_text
from ._locus import Locus
from .plotting import density_range

if TYPE_CHECKING:
    from ._result import Result


def _pack(array: Any, dtype: str) -> str:
    """An array as little-endian bytes in base64; numbers beyond single precision become 0."""
    with np.errstate(over="ignore"):
        flat = np.asarray(array).astype(dtype).ravel()
    if flat.dtype.kind == "f":
        flat[~np.isfinite(flat)] = 0
    return base64.b64encode(flat.tobytes()).decode()


def _caption(result: "Result") -> str:
    c, locus, stats = result.certificate, result.locus, result.stats
    return (
        f"{len(result.mesh.faces):,} triangles. Cut locus: length {locus.length:.6g}, "
        f"{count(locus.loops, 'loop')}, {count(locus.endpoints, 'end')}, "
        f"{count(locus.branch_points, 'branch point')}. "
        f"Cost of the discrete problem between {c.lower:.7g} and {c.upper:.7g}; "
        f"integral of the distance {stats['cost_exact']:.7g}, within {stats['cost_exact_error']:.1g}."
    )


def _finest(result: "Result") -> "tuple[Locus, tuple[float, float]]":
    """The locus with its weak branches, too, for the slider; the slider's ends."""
    low = min(0.02 * result.mesh.info["mean_edge"], result.locus.least_strength)
    locus = Locus(result.mesh, result._handle, low)
    finite = locus.edge_strength[np.isfinite(locus.edge_strength)]
    return locus, (low, max(10 * low, 1.01 * float(finite.max(initial=0))))


def _turn(result: "Result") -> float:
    """The total angle at the source: 2 pi but at vertices. At one of the border directions do not go round: huge."""
    corners = np.flatnonzero(np.asarray(result.source.bary) >= 1e-12)  # as the library sees it
    at = result.mesh.faces[result.source.face][corners]
    if len(corners) > 1:
        around = np.isin(result.mesh.faces, at).sum(axis=1) == len(corners)
        return 1e30 if len(corners) == 2 and around.sum() == 1 else 2 * np.pi
    vertex = at[0]
    face, k = np.nonzero(result.mesh.faces == vertex)
    after, before = (result.mesh.faces[face, (k + i) % 3] for i in (1, 2))
    if set(after) != set(before):
        return 1e30
    x = result.mesh.vertices
    a, b = x[after] - x[vertex], x[before] - x[vertex]
    return float(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1)).sum())


def _data(result: "Result") -> "dict[str, Any]":
    """What the viewer draws: in single precision, moved to the box's centre, its size 1, as the unit of all lengths in
    arrays, mu and u among them."""
    mesh = result.mesh
    low, high = (np.array(mesh.info[name]) for name in ("box_min", "box_max"))
    centre, size = (low + high) / 2, float(np.linalg.norm(high - low)) or 1.0
    locus, strengths = _finest(result)
    strength = np.where(np.isfinite(locus.edge_strength), locus.edge_strength / size, -1)  # -1: infinite
    reached = np.isfinite(result.distance)
    geodesics = Geodesics(mesh, result.source)
    arrivals = geodesics._arrivals
    a, b, c = mesh.vertices[mesh.faces[result.source.face]] / size
    normal = np.cross(b - a, c - a)
    return {
        "xyz": _pack((mesh.vertices - centre) / size, "<f4"),
        "faces": _pack(mesh.faces, "<u4"),
        "mu": _pack(result.density / size, "<f4"),
        "distance": _pack(result.distance / size, "<f4"),
        "potential": _pack(result.potential / size, "<f4"),
        "back": _pack(arrivals["back"], "<f4"),
        "pseudo_source": _pack(arrivals["pseudo_source"], "<i4"),
        "leaving": _pack(arrivals["direction"], "<f4"),
        "turn": _turn(result),
        "locus": _pack((locus.vertices - centre) / size, "<f4"),
        "locus_faces": _pack(locus.faces, "<u4"),
        "edges": _pack(locus.edges, "<u4"),
        "strength": _pack(strength, "<f4"),
        "strengths": strengths,
        "least": result.locus.least_strength,
        "source": ((np.array(result.source.xyz) - centre) / size).tolist(),
        "normal": (normal / (np.linalg.norm(normal) or 1)).tolist(),
        "size": size,
        "colours": _pack(np.round(255 * density_map()), "<u1"),
        "range": density_range(result.density),
        "top": float(result.distance[reached].max()),
        "depths": [float(result.potential[reached].min()), float(result.potential[reached].max())],
        "all": bool(reached.all()),
    }


def _heading(title: Optional[str]) -> str:
    """Text that a page can hold: half of a surrogate pair, as in names of files that are no UTF-8, becomes "?"."""
    if not (title is None or isinstance(title, str)):
        raise ArgumentError(f"title = {title!r}: expected text")
    return html.escape("Cut locus" if title is None else title.encode("utf-8", "replace").decode())


def page(result: "Result", title: Optional[str]) -> str:
    """The whole page as text."""
    folder = Path(__file__).parent
    parts = {
        "@TITLE@": _heading(title),
        "@CAPTION@": html.escape(_caption(result)),
        "@SCRIPT@": (folder / "viewer.js").read_text(encoding="utf-8"),
        "@DATA@": json.dumps(_data(result), allow_nan=False),
    }
    text = (folder / "viewer.html").read_text(encoding="utf-8")
    return re.sub("|".join(parts), lambda mark: parts[mark[0]], text)


class View:
    """A page inside a notebook."""

    def __init__(self, text: str, height: int):
        self._text, self._height = text, height

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self._text)}" width="100%" height="{self._height}" '
            'style="border: 0" allowfullscreen></iframe>'
        )


def _write(path: str, text: str) -> None:
    """Write where the path's links lead: under another name first, so that the file is whole or not there. What is
    there and no regular file, as a pipe, is written as it comes."""
    if path.startswith(("/dev/", "/proc/")) or (os.path.exists(path) and not os.path.isfile(path)):
        with open(path, "w", encoding="utf-8") as stream:
            stream.write(text)
        return
    target = os.path.realpath(path) if path else path
    unfinished = Path(os.path.dirname(target), f".dmkcl-{secrets.token_hex(8)}.tmp")
    try:
        with open(unfinished, "x", encoding="utf-8") as file:
            file.write(text)
        if os.path.exists(target):
            shutil.copymode(target, unfinished)
        os.replace(unfinished, target)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise


def export_html(result: "Result", path: "os.PathLike[str] | str", title: Optional[str]) -> None:
    """Write the page."""
    name, text = path_text(path), page(result, title)
    try:
        _write(name, text)
    except OSError as error:
        raise file_error(f"{name or repr(name)}: cannot write: {error.strerror}", error.errno) from None
