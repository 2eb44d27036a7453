"""OpenCL devices, opened once for each choice and shared by all that ask for the same."""

from __future__ import annotations

import os
import threading
from contextlib import contextmanager
from functools import lru_cache
from typing import Any, Iterator, Optional, SupportsIndex, Union

from ._lib import ArgumentError, Context, DeviceError, Error, Handle, copy_struct, ffi, lib, path_bytes, switch, whole

# The process that first used OpenCL: its drivers have threads, which a fork does not take along.
_first_process: "list[int]" = []


def _check_process() -> None:
    """DeviceError in a forked child, where the driver would wait for its lost threads for ever."""
    if not _first_process:
        _first_process.append(os.getpid())
    if _first_process[0] != os.getpid():
        raise DeviceError(
            "OpenCL was in use before this process was forked, and does not survive that; "
            "start workers with multiprocessing.get_context('spawn')"
        )


def devices() -> "list[dict[str, Any]]":
    """The OpenCL devices: name, platform, driver, type ("CPU", "GPU", ...), compute_units, fp64,
    memory in bytes. The position in the list is the number that `device=` takes."""
    _check_process()
    count = ffi.new("size_t *")
    with Context() as context:
        context.check(lib.dmk_device_list(context.pointer, ffi.NULL, 0, count))
        infos = ffi.new("dmk_device_info[]", max(1, count[0]))
        context.check(lib.dmk_device_list(context.pointer, infos, count[0], count))
    return [copy_struct(infos[i]) for i in range(count[0])]


class Device:
    """An open device; one thread at a time launches work on it."""

    def __init__(self, select: Optional[bytes], single: bool, threads: int, cache: Optional[bytes]):
        names = [ffi.NULL if name is None else ffi.new("char[]", name) for name in (select, cache)]
        options = ffi.new("dmk_device_options *")
        lib.dmk_device_options_init(options, ffi.sizeof(options[0]))
        options.select, options.cache = names
        options.single_precision = single
        options.threads = threads
        self.handle = Handle("dmk_device")
        self._lock = threading.Lock()
        self._holder: Optional[int] = None  # the thread that has the lock
        with Context() as context:
            context.check(lib.dmk_device_open(context.pointer, options, self.handle.box))

    @contextmanager
    def use(self) -> Iterator[None]:
        """Hold the device for one call. Error if this thread holds it already: waiting would not end."""
        _check_process()
        if self._holder == threading.get_ident():
            raise Error(
                "the device works for a call of this thread, which waits for the function given as `progress`; "
                "start the next call when that one has ended"
            )
        with self._lock:
            self._holder = threading.get_ident()
            try:
                yield
            finally:
                self._holder = None

    @property
    def info(self) -> "dict[str, Any]":
        info = ffi.new("dmk_device_info *")
        lib.dmk_device_get_info(self.handle.pointer, info)
        return copy_struct(info[0])


_opening = threading.Lock()
_open = lru_cache(maxsize=8)(Device)


def _selected(device: Union[SupportsIndex, str]) -> bytes:
    """The number or the part of a name, as the library takes it."""
    try:
        chosen = device if isinstance(device, str) else str(whole("device", device))
        name = chosen.encode()
    except (ArgumentError, UnicodeEncodeError):
        name = b"\0"
    if not name or b"\0" in name:
        raise ArgumentError(f"device = {device!r}: expected a number of devices() or part of a name")
    return name


def open_device(
    device: Union[None, SupportsIndex, str],
    single: bool,
    threads: SupportsIndex,
    cache: "Union[None, str, os.PathLike[str]]",
) -> Device:
    """The device for these options (see CutLocus). DeviceError if there is none."""
    _check_process()
    select = None if device is None else _selected(device)
    folder = None if cache is None else path_bytes(cache)
    with _opening:
        return _open(select, switch("single", single), whole("threads", threads), folder)
