"""A component's compiled code in this process: each instance has a copy, and so globals, of its own."""

from __future__ import annotations

import ctypes
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from volery.base.errors import ComponentError

COUNTERS, COUNTERS_LENGTH = "volery_counters", "volery_counters_length"
"""What a library exports if its code counts itself: an array of ``uint64_t`` and its length."""


class Library:
    """The library at *path*, loaded for the instance called *name*.

    ``dispatch`` is the address of what runs its callables. ``counters`` is the array that its code counts in,
    empty if it does not.
    """

    def __init__(self, path: Path, name: str) -> None:
        self.path = path
        with tempfile.TemporaryDirectory(prefix="volery-") as folder:
            copy = Path(folder, f"{name.replace('/', '_')}.so")
            shutil.copyfile(path, copy)
            try:
                self._loaded = ctypes.PyDLL(str(copy))
            except OSError as error:
                raise ComponentError(name, f"its compiled code cannot be loaded: {error}") from error
        entry = self._loaded.volery_component_dispatch
        self.dispatch: int = ctypes.cast(entry, ctypes.c_void_p).value or 0
        self.counters = self._counters()

    def function(self, name: str) -> Callable[..., object]:
        """A function of its own runtime, by its C name."""
        found: Callable[..., object] = getattr(self._loaded, name)
        return found

    def _counters(self) -> ctypes.Array[ctypes.c_uint64]:
        try:
            length = ctypes.c_uint64.in_dll(self._loaded, COUNTERS_LENGTH).value
            return (ctypes.c_uint64 * length).in_dll(self._loaded, COUNTERS)
        except ValueError:
            return (ctypes.c_uint64 * 0)()
