"""One page that shows a result in any browser: the viewer with the data inside."""

from __future__ import annotations

import base64
import html
import json
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from ._colour import density_map
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
    c, locus = result.certificate, result.locus
    return (
        f"{len(result.mesh.faces):,} triangles. Cut locus: length {locus.length:.6g}, "
        f"{locus.loops} loops, {locus.endpoints} ends, {locus.branch_points} branch points. "
        f"Integral of the distance between {c.lower:.7g} and {c.upper:.7g}."
    )


def _data(result: "Result") -> "dict[str, Any]":
    """What the viewer draws: in single precision, moved to the box's centre, its size 1."""
    low, high = (np.array(result.mesh.info[name]) for name in ("box_min", "box_max"))
    centre, size = (low + high) / 2, float(np.linalg.norm(high - low)) or 1.0
    locus = result.locus
    reached = result.distance[np.isfinite(result.distance)]
    return {
        "xyz": _pack((result.mesh.vertices - centre) / size, "<f4"),
        "faces": _pack(result.mesh.faces, "<u4"),
        "mu": _pack(result.density, "<f4"),
        "distance": _pack(result.distance, "<f4"),
        "locus": _pack((locus.vertices - centre) / size, "<f4"),
        "edges": _pack(locus.edges, "<u4"),
        "source": ((np.array(result.source.xyz) - centre) / size).tolist(),
        "colours": _pack(np.round(255 * density_map()), "<u1"),
        "range": density_range(result.density),
        "top": float(reached.max()),
    }


def page(result: "Result", title: Optional[str]) -> str:
    """The whole page as text."""
    folder = Path(__file__).parent
    parts = {
        "@TITLE@": html.escape(title if title is not None else "Cut locus"),
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


def export_html(result: "Result", path: "os.PathLike[str] | str", title: Optional[str]) -> None:
    """Write the page: under another name first, so that it is whole or not there."""
    path = Path(path)
    unfinished = path.with_name(path.name + ".part")
    try:
        unfinished.write_text(page(result, title), encoding="utf-8")
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)
