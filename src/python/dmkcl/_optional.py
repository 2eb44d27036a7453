"""Packages that only some functions need."""

from __future__ import annotations

import importlib
from typing import Any


def optional(name: str) -> Any:
    """The module `name`, or an ImportError that says how to install its package."""
    package = name.partition(".")[0]
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as missing:
        if (missing.name or "").partition(".")[0] != package:
            raise
        raise ImportError(
            f"this needs {package}, which is not installed: pip install {package}", name=package
        ) from None
