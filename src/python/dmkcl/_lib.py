"""The C library: handles, contexts, errors, views on its arrays."""

from __future__ import annotations

import errno
import operator
import os
import sys
import warnings
from functools import partial
from typing import Any, Callable, Optional, Sequence, SupportsIndex, Union

import numpy as np
from numpy.typing import NDArray

from ._dmkcl import ffi as ffi
from ._dmkcl import lib as lib


#: Numbers of vertices or triangles; each may be an int of NumPy.
Indices = Union[Sequence[SupportsIndex], "NDArray[np.integer[Any]]"]


class Error(Exception):
    """Something the library refused or could not do; the text says what and the way out.

    All errors of this package that are not Python's own kinds are of this class. ``code`` is the
    library's status (``DMK_E_...`` of dmkcl.h), 0 where Python found the error.
    """

    code: int = 0


class ArgumentError(Error, ValueError):
    """An argument is out of its range."""


class FileError(Error, OSError):
    """A file cannot be opened, read or written.

    Where the system said why, ``errno`` is its number, and the error is also what Python has for
    that: FileNotFoundError, PermissionError and so on.
    """

    def __str__(self) -> str:  # OSError would join the arguments in its own way
        return str(self.args[0]) if self.args else ""

    def __reduce__(self) -> Any:
        return file_error, (str(self), self.errno), {"code": self.code}


_FILE_ERRORS: "dict[type[OSError], Any]" = {
    kind: type("FileError", (FileError, kind), {"__module__": FileError.__module__})
    for kind in (FileNotFoundError, FileExistsError, IsADirectoryError, NotADirectoryError, PermissionError)
}


def file_error(message: str, number: Optional[int]) -> FileError:
    """A FileError of the kind that Python has for this errno."""
    kind = OSError if number is None else type(OSError(number, ""))
    error: FileError = _FILE_ERRORS.get(kind, FileError)(message)
    error.errno = number
    return error


def _errno_in(message: str) -> Optional[int]:
    """Of the library's messages, which end with the system's words where it failed; names of files come before."""
    found = [(message.rfind(": " + os.strerror(number)), number) for number in errno.errorcode]
    at, number = max(found)
    return number if at >= 0 else None


class FormatError(Error, ValueError):
    """A file is malformed, or of a format that is not read."""


class MeshError(Error, ValueError):
    """The mesh is not a surface this method can treat; the text names the first offender."""


class DeviceError(Error, RuntimeError):
    """No OpenCL device, or it failed, or a kernel did not compile."""


class DivergedError(Error, ArithmeticError):
    """The iteration diverged; there is no result."""


class StepLimitError(Error, ArithmeticError):
    """The step limit was reached before the tolerance; there is no result."""


class OutOfMemoryError(Error, MemoryError):
    """Out of memory on the host or the device."""


_CLASSES = {
    lib.DMK_E_ARG: ArgumentError,
    lib.DMK_E_NOMEM: OutOfMemoryError,
    lib.DMK_E_FORMAT: FormatError,
    lib.DMK_E_MESH: MeshError,
    lib.DMK_E_DEVICE: DeviceError,
    lib.DMK_E_BUILD: DeviceError,
    lib.DMK_E_DIVERGED: DivergedError,
    lib.DMK_E_LIMIT: StepLimitError,
}


def text(chars: Any) -> str:
    """A C string; names of files and devices may hold any bytes."""
    found: bytes = ffi.string(chars)
    return found.decode("utf-8", "surrogateescape")


def path_bytes(path: "os.PathLike[str] | str") -> bytes:
    """As the library takes it. A C string ends at a NUL: what follows would be cut off."""
    try:
        name = os.fsencode(path)
    except (TypeError, UnicodeEncodeError):
        raise ArgumentError(f"{path!r}: expected the name of a file") from None
    if b"\0" in name:
        raise ArgumentError(f"{path!r}: the name of a file holds no NUL")
    return name


def path_text(path: "os.PathLike[str] | str") -> str:
    """The same as text, for Python's own functions and messages."""
    return os.fsdecode(path_bytes(path))


def whole(name: str, value: Any) -> int:
    """A whole number as it is; nothing is rounded, and no truth value or text taken for one."""
    try:
        if isinstance(value, (bool, np.bool_)):
            raise TypeError
        number = operator.index(value)
    except TypeError:
        raise ArgumentError(f"{name} = {value!r}: expected a whole number") from None
    if not -(2**31) <= number < 2**31:
        raise ArgumentError(f"{name} = {value!r}: expected a number of 32 bits")
    return number


def amount(name: str, value: Any, most: float = float("inf"), *, above: bool = False) -> float:
    """A finite number from 0, or above it, to `most`; no truth value or text is taken for one."""
    try:
        number = float("nan" if isinstance(value, (str, bytes, bool, np.bool_)) else value)
    except (TypeError, ValueError, OverflowError):
        number = float("nan")
    if above and not 0 < number < float("inf"):
        raise ArgumentError(f"{name} = {value!r}: expected a finite number above 0")
    if not (0 <= number < float("inf") and number <= most):
        wanted = "a finite number from 0" if most == float("inf") else f"a number from 0 to {most:g}"
        raise ArgumentError(f"{name} = {value!r}: expected {wanted}")
    return number


def numbers(name: str, values: Any) -> "np.ndarray":
    """An array of doubles, row by row, of real numbers of any type."""
    try:
        array = np.asarray(values)
    except ValueError:
        raise ArgumentError(f"{name} have rows of different lengths") from None
    if np.ma.is_masked(values):
        raise ArgumentError(f"{name} are masked in places; expected numbers everywhere")
    if array.dtype.kind not in "fiub":
        raise ArgumentError(f"{name} are of type {array.dtype}; expected real numbers")
    return np.ascontiguousarray(array, dtype=np.float64)


def is_single(value: Any) -> bool:
    """Whether it is one value, and no list of any kind."""
    try:
        return np.ndim(value) == 0
    except ValueError:  # rows of different lengths
        return False


def several(name: str, values: Any) -> Any:
    """Values that can be gone through one by one."""
    try:
        iter(values)
    except TypeError:
        raise ArgumentError(f"{name} = {values!r}: expected several, as in a list") from None
    return values


def switch(name: str, value: Any) -> bool:
    """True or False; no text is taken for either."""
    if not isinstance(value, (bool, np.bool_)):
        raise ArgumentError(f"{name} = {value!r}: expected True or False")
    return bool(value)


def count(n: int, name: str) -> str:
    """Of text: "1 end", "2 ends"."""
    return f"{n} {name}{'' if n == 1 else 's'}"


def warn(words: str) -> None:
    """A warning at that line of the user's program that called the package."""
    frame, level = sys._getframe(), 1
    while frame.f_back and str(frame.f_globals.get("__name__")).partition(".")[0] == __package__:
        frame, level = frame.f_back, level + 1
    warnings.warn(words, stacklevel=level)


# ---- handles ----------------------------------------------------------------------------------


def _destroy(destroy: Callable[[Any], None], keep: "tuple[Any, ...]", box: Any) -> None:
    destroy(box)


class Handle:
    """An object of the library, destroyed with its last reference; ``keep`` must outlive it."""

    __slots__ = ("box",)

    def __init__(self, type_name: str, *keep: Any):
        # Owned before the call that fills it: an interruption in between loses nothing.
        destroy = getattr(lib, type_name + "_destroy")
        self.box = ffi.gc(ffi.new(type_name + " **"), partial(_destroy, destroy, keep))

    @property
    def pointer(self) -> Any:
        return self.box[0]


def _hold(owner: Any, pointer: Any) -> None:
    """Does nothing; as a destructor it makes the pointer hold its owner."""


def view(owner: Any, pointer: Any, shape: "tuple[int, ...] | int", dtype: Any) -> np.ndarray:
    """A read-only array on memory of the library, which lives as long as the array."""
    dtype = np.dtype(dtype)
    shape = shape if isinstance(shape, tuple) else (shape,)
    count = int(np.prod(shape))
    if count == 0:
        return np.zeros(shape, dtype)
    held = ffi.gc(pointer, partial(_hold, owner))
    array = np.frombuffer(ffi.buffer(held, count * dtype.itemsize), dtype).reshape(shape)
    array.flags.writeable = False
    return array


def copy_struct(struct: Any) -> "dict[str, Any]":
    """The plain fields of a C struct by name; char arrays as text, other arrays as tuples."""
    fields = {}
    for name, field in ffi.typeof(struct).fields:
        value = getattr(struct, name)
        if field.type.kind == "array":
            is_text = field.type.item.cname == "char"
            value = text(value) if is_text else tuple(value)
        fields[name] = value
    return fields


STAGES = {
    "setup": lib.DMK_STAGE_SETUP,
    "distance": lib.DMK_STAGE_DISTANCE,
    "start": lib.DMK_STAGE_START,
    "solve": lib.DMK_STAGE_SOLVE,
    "certify": lib.DMK_STAGE_CERTIFY,
}


def named_seconds(stats: "dict[str, Any]") -> "dict[str, Any]":
    """The fields of dmk_stats, with the seconds by the names of the stages."""
    return {**stats, "seconds": {name: stats["seconds"][stage] for name, stage in STAGES.items()}}


# ---- contexts: errors and progress ------------------------------------------------------------


@ffi.def_extern(error=1, onerror=lambda kind, value, trace: None)  # type: ignore[untyped-decorator]
def dmkcl_python_progress(progress: Any, user: Any) -> int:
    """Called between steps, with the GIL: the place where Ctrl-C and exceptions end a call."""
    context = ffi.from_handle(user)
    try:
        context.report(progress)
    except BaseException as error:
        context.error = error
        return 1
    return 0


#: What the library says for every language has names here.
_PHRASES = (
    ("a repair does", "dmkcl.repair does"),
    ("the list of devices shows", "dmkcl.devices() lists"),
    ("ask for the second to be scaled (normalise)", "have the second scaled by normalise=True"),
    (" measure: atom ", " measure: point "),
    (" measure: triangle ", " measure: face "),
    ("one point or line at least", "one point, curve or border at least"),
    ("give a point or line", "give a point or curve"),
    ("the cut locus of lines and", "the cut locus of curves and"),
    ("do not ask for exact distances", "leave out exact=True"),
    ("do not ask for that", "leave out exact=True"),
)


class Context:
    """The library's error record for one call (contexts belong to one thread at a time).

    ``report`` is called with each dmk_progress; what it raises ends the running call. ``threads``:
    of the host's stages; 0: one per processor.
    """

    def __init__(self, report: Optional[Callable[[Any], None]] = None, threads: int = 0):
        self.error: Optional[BaseException] = None
        self.report = report or (lambda progress: None)
        self._handle = Handle("dmk_context")
        if lib.dmk_context_create(self._handle.box) != lib.DMK_OK:
            raise OutOfMemoryError("out of memory")
        self.pointer = self._handle.pointer
        self.check(lib.dmk_context_set_threads(self.pointer, threads))
        self._user = ffi.new_handle(self)
        lib.dmk_context_set_progress(self.pointer, lib.dmkcl_python_progress, self._user)

    def close(self) -> None:
        """Break the ring of references between the context and its handle."""
        lib.dmk_context_set_progress(self.pointer, ffi.NULL, ffi.NULL)
        self._user = None

    def __enter__(self) -> "Context":
        return self

    def __exit__(self, *error: Any) -> None:
        self.close()

    def check(self, status: int) -> None:
        """Raise what the status says, with the library's message."""
        if status == lib.DMK_OK:
            return
        if status == lib.DMK_E_CANCELLED:
            raise self.error if self.error is not None else KeyboardInterrupt()
        message = text(lib.dmk_context_message(self.pointer)) or text(lib.dmk_status_text(status))
        for words, python in _PHRASES:
            message = message.replace(words, python)
        if status == lib.DMK_E_IO:
            error: Error = file_error(message, _errno_in(message))
        else:
            error = _CLASSES.get(status, Error)(message)
        error.code = status
        raise error


def version() -> str:
    """Version of the library, for instance "0.2.0"."""
    return text(lib.dmk_version())
