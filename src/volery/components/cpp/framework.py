"""The C++ framework library in this process: fibers, component libraries, their counters and crash reports.

ctypes with ``PyDLL`` keeps Python's lock during a call, so exactly one fiber runs at a time. A thread per
caller was rejected: a switch between threads takes fifty times as long and its order is not deterministic.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

from volery import components
from volery.base.errors import ComponentError, UsageError, choices, did_you_mean
from volery.components.instance import ForeignError
from volery.ros import client_libraries
from volery.ros.client_libraries.abi_codec import Reader, RequestHandlers

STACK_BYTES = 8 * 1024 * 1024
"""Stack of a fiber, as large as that of a process's main thread. Memory is committed as it is used."""

MAX_REQUESTS_AFTER_CANCEL = 1000
"""Requests that cancelled code may make in destructors before its fiber is abandoned."""

COUNTERS, COUNTERS_LENGTH = "volery_counters", "volery_counters_length"
"""Symbols of an instrumented library: an array of ``uint64_t``, one counter a basic block, and its length."""

_CALL, _REPLY, _FAIL, _CANCEL = range(4)
_ZEROS = bytes(64)  # reads as zero, false or an empty text
_RETURNED, _FAILED, _THREW, _CANCELLED = b"returned", b"failed", b"threw", b"cancelled"

OnOutput = Callable[[str], None]
"""Receives what the code has printed."""

Counters = ctypes.Array[ctypes.c_uint64]
ToSteps = Callable[[Counters], int]
"""Converts all counts since the start into the steps that a ``Pricing`` prices."""


class ProcessExit(BaseException):
    """The code called ``exit``. Its fiber is abandoned, as the stack of an exiting process is."""

    def __init__(self, status: int) -> None:
        self.status = status
        super().__init__(f"exit({status})")


class _FiberState(ctypes.Structure):
    """``volery_fiber`` of ``<volery/framework.h>``."""

    _fields_ = (
        ("request", ctypes.c_char_p),
        ("data", ctypes.c_void_p),
        ("size", ctypes.c_uint64),
        ("cannot_throw", ctypes.c_int32),
        ("directive", ctypes.c_int32),
        ("reply", ctypes.c_char_p),
        ("reply_size", ctypes.c_uint64),
        ("callable", ctypes.c_int64),
        ("output", ctypes.c_void_p),
        ("output_size", ctypes.c_uint64),
    )


class FrameworkRuntime:
    """The functions of the framework library at ``path``."""

    def __init__(self, path: Path) -> None:
        library = ctypes.PyDLL(str(path), mode=ctypes.RTLD_GLOBAL)
        self._new = library.volery_fiber_new
        self._new.argtypes = (ctypes.c_char_p, ctypes.c_void_p, ctypes.c_uint64)
        self._new.restype = ctypes.POINTER(_FiberState)
        self.resume = library.volery_resume
        self.resume.argtypes = (ctypes.POINTER(_FiberState),)
        self.resume.restype = None
        self._supervise = library.volery_supervise
        self._supervise.argtypes = (ctypes.c_int32, ctypes.c_double)

    def new_fiber(self, component: str, dispatch: int) -> ctypes._Pointer[_FiberState]:
        """Create a fiber of ``component``, whose library runs callables with the function at ``dispatch``."""
        made: ctypes._Pointer[_FiberState] = self._new(component.encode(), dispatch, STACK_BYTES)
        if not made:
            raise MemoryError(f"{component}: no memory for another stack of {STACK_BYTES} bytes")
        return made

    def supervise(self, report: int, patience_s: float) -> None:
        """Capture what components print, and report fatal errors.

        A crash, or code that makes no request for ``patience_s`` seconds on the wall clock, ends the process.

        Args:
            report: File descriptor that receives one line about a fatal error.
            patience_s: Longest time between two requests, s.
        """
        self._supervise(report, patience_s)


@cache
def framework_runtime(path: Path) -> FrameworkRuntime:
    """Load the framework library at ``path``, once a process."""
    return FrameworkRuntime(path)


class Fiber:
    """One flow of control of a component. See ``abi_codec.CppFiber``."""

    def __init__(
        self,
        runtime: FrameworkRuntime,
        component: str,
        dispatch: int,
        handlers: RequestHandlers,
        on_output: OnOutput,
        call_beside: Callable[[int], bytes],
    ) -> None:
        self._call_beside = call_beside
        self._runtime = runtime
        self._handle = runtime.new_fiber(component, dispatch)
        self._state = self._handle.contents
        self._handlers = handlers
        self._on_output = on_output
        self._error: Exception | None = None  # why its last request failed
        self._cancellation: BaseException | None = None
        self._requests_after_cancel = 0
        self._depth = 0
        self.abandoned = False  # its stack is left as it is; it never runs again

    def call(self, callable_number: int, argument: bytes = b"") -> bytes:
        """Run a callable to its end and serve its requests; return its result."""
        if not self._depth:
            self._cancellation, self._requests_after_cancel = None, 0
        self._depth += 1
        try:
            return self._run(callable_number, argument)
        finally:
            self._depth -= 1

    def call_beside(self, callable_number: int) -> bytes:
        """See ``abi_codec.CppFiber``."""
        return self._call_beside(callable_number)

    def _run(self, callable_number: int, argument: bytes) -> bytes:
        state, handle, resume = self._state, self._handle, self._runtime.resume
        state.callable = callable_number
        directive, reply = _CALL, argument
        while True:
            state.directive, state.reply, state.reply_size = directive, reply, len(reply)
            resume(handle)
            if state.output_size:
                self._on_output(ctypes.string_at(state.output, state.output_size).decode(errors="replace"))
            request = state.request
            data = ctypes.string_at(state.data, state.size) if state.size else b""
            if request == _RETURNED:
                return data
            if request in (_FAILED, _THREW, _CANCELLED):
                raise self._exception(request, data)
            directive, reply = self._serve(request.decode(), data)

    def _serve(self, request: str, data: bytes) -> tuple[int, bytes]:
        """Serve a request; return the directive and the reply. Raises where the fiber cannot continue."""
        if self._cancellation is not None:
            return self._serve_after_cancel(self._cancellation)
        cannot_throw = self._state.cannot_throw
        handler = self._handlers.get(request)
        try:
            if handler is None:
                known = self._handlers
                raise UsageError(
                    f"{request!r} is not offered here{did_you_mean(request, known)}: {choices(known)}"
                )
            return _REPLY, handler(self, Reader(data))
        except Exception as error:
            self.abandoned = self.abandoned or (cannot_throw and isinstance(error, ComponentError))
            if self.abandoned:
                raise
            self._error = error
            return _FAIL, str(error).encode()
        except BaseException as end:
            self.abandoned = self.abandoned or bool(cannot_throw) or isinstance(end, ProcessExit)
            if self.abandoned:
                raise
            self._cancellation = end
            return _CANCEL, b""

    def _serve_after_cancel(self, cancellation: BaseException) -> tuple[int, bytes]:
        """Reply with zeros to a request of cancelled code: of a destructor, or after a ``catch (...)``."""
        self._requests_after_cancel += 1
        if self._requests_after_cancel > MAX_REQUESTS_AFTER_CANCEL:
            self.abandoned = True
            raise cancellation
        return _REPLY, _ZEROS

    def _exception(self, outcome: bytes, data: bytes) -> BaseException:
        """Return the exception that a callable ended with, the original one where it came from Python."""
        if outcome == _CANCELLED:
            return self._cancellation or ForeignError("volery::Cancelled", "")
        reader = Reader(data)
        kind, what = reader.text(), reader.text()
        if outcome == _FAILED and self._error is not None and str(self._error) == what:
            return self._error
        return ForeignError(kind, what)


class FiberPool:
    """The fibers of one component: each concurrent caller has one for the duration of its call."""

    def __init__(
        self,
        runtime: FrameworkRuntime,
        component: str,
        dispatch: int,
        handlers: RequestHandlers,
        on_output: OnOutput,
    ) -> None:
        self._new_fiber = partial(Fiber, runtime, component, dispatch, handlers, on_output, self.call)
        self._idle: list[Fiber] = []

    def call(self, callable_number: int, argument: bytes = b"") -> bytes:
        """Run a callable on a fiber of its own; return its result."""
        fiber = self._idle.pop() if self._idle else self._new_fiber()
        try:
            return fiber.call(callable_number, argument)
        finally:
            if not fiber.abandoned:
                self._idle.append(fiber)


class LoadedLibrary:
    """The library at ``path``, loaded for the instance ``name``.

    Each instance loads a copy of the file and so has globals of its own. ``dispatch`` is the address of the
    function that runs callables. ``counters`` is empty unless the library is instrumented.
    """

    def __init__(self, path: Path, name: str) -> None:
        self.path = path
        with tempfile.TemporaryDirectory(prefix="volery-") as folder:
            copy = Path(folder, f"{name.replace('/', '_')}.so")
            shutil.copyfile(path, copy)
            try:
                self._library = ctypes.PyDLL(str(copy))
            except OSError as error:
                raise ComponentError(name, f"its compiled code cannot be loaded: {error}") from error
        entry = self._library.volery_component_dispatch
        self.dispatch: int = ctypes.cast(entry, ctypes.c_void_p).value or 0
        self.counters = self._counters()

    def function(self, name: str) -> Callable[..., object]:
        """Return an exported function by its C name."""
        found: Callable[..., object] = getattr(self._library, name)
        return found

    def _counters(self) -> Counters:
        try:
            length = ctypes.c_uint64.in_dll(self._library, COUNTERS_LENGTH).value
            return (ctypes.c_uint64 * length).in_dll(self._library, COUNTERS)
        except ValueError:
            return (ctypes.c_uint64 * 0)()


class StepMeter:
    """Reads the steps of an instrumented library; 0 until ``read_from`` has been called.

    The kernel reads the meter at each interaction point.
    """

    def __init__(self) -> None:
        self._counters: Counters | None = None
        self._to_steps: ToSteps = lambda counters: 0
        self._read = 0

    def read_from(self, counters: Counters, to_steps: ToSteps) -> None:
        """Read the steps of ``counters`` from now on."""
        self._counters, self._to_steps = counters, to_steps
        self._read = to_steps(counters)

    def __call__(self) -> int:
        """Return the steps since the last reading."""
        if self._counters is None:
            return 0
        total = self._to_steps(self._counters)
        steps, self._read = total - self._read, total
        return steps


_LINE_BYTES = 4096
_FRAMEWORK_FOLDERS = tuple(
    f"{Path(package.__file__).parent}/" for package in (components, client_libraries) if package.__file__
)
_DESCRIPTIONS = {
    "stack": "its stack is full: it recurses without end, or keeps too much in local variables",
    "frozen": "virtual time is frozen: it computes and makes no request any more",
    str(int(signal.SIGSEGV)): "segmentation fault",
    str(int(signal.SIGBUS)): "bus error",
    str(int(signal.SIGFPE)): "arithmetic fault, such as a division of whole numbers by zero",
    str(int(signal.SIGILL)): "illegal instruction",
    str(int(signal.SIGABRT)): "aborted: abort(), a failed assertion or an exception that nothing catches",
}


@dataclass(frozen=True)
class Crash:
    """A crash: the component, what happened, the source line and the last output (empty: not known)."""

    component: str
    what: str
    source_line: str = ""
    last_output: str = ""

    def error(self) -> ComponentError:
        """Return the crash as an error of the component."""
        where = f", in {self.source_line}" if self.source_line else ""
        output = f"; it said: {self.last_output}" if self.last_output else ""
        return ComponentError(self.component, f"{self.what}{where}{output}")


def read_crash(report: int, libraries: Mapping[str, Path]) -> Crash | None:
    """Read the crash report, or return None if there is none.

    Args:
        report: File descriptor of the report; its other end must be closed.
        libraries: Library of each instance by its name, to look source lines up in.
    """
    line = os.read(report, _LINE_BYTES).decode(errors="replace").removesuffix("\n")
    if not line:
        return None
    component, what, address, frames, output = line.split("\t", 4)
    description = _DESCRIPTIONS.get(what, f"signal {what}")
    if what == str(int(signal.SIGSEGV)):
        description = f"{description} at address {'0' if address == '(nil)' else address}"
    library = libraries.get(component)
    source_line = _source_line(library, frames.split()) if library else ""
    return Crash(component, description, source_line, " ".join(output.split()))


def _source_line(library: Path, frames: list[str]) -> str:
    """Return ``Pilot::run() (pilot.cpp:12)`` for the innermost frame in the component's own files.

    Empty without ``addr2line`` or without debug information.
    """
    program = shutil.which("addr2line")
    if program is None or not frames:
        return ""
    command = [program, "-C", "-f", "-i", "-e", str(library), *(f"0x{frame}" for frame in frames)]
    lines = subprocess.run(command, capture_output=True, text=True, check=False).stdout.splitlines()
    for function, place in zip(lines[::2], lines[1::2], strict=False):
        file, _, line = place.partition(" ")[0].rpartition(":")
        if not file.startswith(("?", "/usr/", *_FRAMEWORK_FOLDERS)):
            return f"{function} ({Path(file).name}:{line})"
    return ""
