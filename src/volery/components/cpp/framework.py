"""What can go wrong at the border to C++ code.

Flows of control of C++ code, seen from Python: let one go on, do what it asks, let it go on.

A component's compiled code in this process: each instance has a copy, and so globals, of its own.

What C++ code has computed, by its own counters.

A library that counts itself exports an array (``library.COUNTERS``). What a count costs is a law's to say:
whoever builds the run gives a function from the array to an amount, for instance cycles on the target.
"""

from __future__ import annotations

import ctypes
import shutil
import tempfile
from collections.abc import Callable, Iterable
from functools import cache, partial
from pathlib import Path

from volery.base.errors import ComponentError, UsageError, choices, did_you_mean
from volery.components.instance import ForeignError
from volery.ros.client_libraries.abi_codec import Reader, RequestHandlers


class ProcessExit(BaseException):
    """The code called ``exit``. Its flow is left as it is, as a process would be."""

    def __init__(self, status: int) -> None:
        self.status = status
        super().__init__(f"exit({status})")


class CppException(ForeignError):
    """A C++ exception that the code did not catch."""

    def __init__(self, kind: str, what: str) -> None:
        super().__init__(f"{kind}: {what}" if what else kind)


def unknown_request(question: str, known: Iterable[str]) -> UsageError:
    """What C++ code is told that asks for something that is not offered where it runs."""
    return UsageError(f"{question!r} is not offered here{did_you_mean(question, known)}: {choices(known)}")


_CALL, _ANSWER, _FAIL, _END = range(4)
STACK_BYTES = 8 * 1024 * 1024
"""As a process's main thread has. Memory is taken as it is used."""

OnOutput = Callable[[str], None]
"""Told what the code has printed."""

MAX_REQUESTS_AFTER_CANCEL = 1000
"""So often may code ask something after it was ended before it is left where it stands."""

_NO = bytes(64)
"""Zeros, false, empty text: an answer to any question."""

_RETURNED, _FAILED, _THREW, _ENDED = b"returned", b"failed", b"threw", b"ended"


class _Shared(ctypes.Structure):
    """``volery_flow`` of ``<volery/house.h>``."""

    _fields_ = (
        ("question", ctypes.c_char_p),
        ("data", ctypes.c_void_p),
        ("size", ctypes.c_uint64),
        ("cannot_throw", ctypes.c_int32),
        ("directive", ctypes.c_int32),
        ("reply", ctypes.c_char_p),
        ("reply_size", ctypes.c_uint64),
        ("callable", ctypes.c_int64),
        ("said", ctypes.c_void_p),
        ("said_size", ctypes.c_uint64),
    )


class FrameworkRuntime:
    """The runtime, loaded once a process. Its functions keep Python's lock: one flow runs at a time."""

    def __init__(self, path: Path) -> None:
        library = ctypes.PyDLL(str(path), mode=ctypes.RTLD_GLOBAL)
        self._new = library.volery_flow_new
        self._new.argtypes = (ctypes.c_char_p, ctypes.c_void_p, ctypes.c_uint64)
        self._new.restype = ctypes.POINTER(_Shared)
        self.resume = library.volery_resume
        self.resume.argtypes = (ctypes.POINTER(_Shared),)
        self.resume.restype = None
        self._supervise = library.volery_supervise
        self._supervise.argtypes = (ctypes.c_int32, ctypes.c_double)

    def flow(self, component: str, dispatch: int) -> ctypes._Pointer[_Shared]:
        """A new flow of *component*, whose library runs callables with the function at *dispatch*."""
        made: ctypes._Pointer[_Shared] = self._new(component.encode(), dispatch, STACK_BYTES)
        if not made:
            raise MemoryError(f"{component}: no memory for another stack of {STACK_BYTES} bytes")
        return made

    def supervise(self, report: int, patience_s: float) -> None:
        """From now on a crash in a component is told to the file descriptor *report* and ends the process.

        So does code that asks nothing for *patience_s* seconds on the wall. What components print is taken.
        """
        self._supervise(report, patience_s)


@cache
def framework_runtime(path: Path) -> FrameworkRuntime:
    """The runtime at *path*."""
    return FrameworkRuntime(path)


class Fiber:
    """One flow of control. See ``volery.ros.client_libraries.abi_codec.CppFlow``."""

    def __init__(
        self, owner: FrameworkRuntime, component: str, dispatch: int, answers: RequestHandlers, hear: OnOutput
    ) -> None:
        self._hear = hear
        self._owner = owner
        self._handle = owner.flow(component, dispatch)
        self._shared = self._handle.contents
        self._answers = answers
        self._error: Exception | None = None  # why its last question failed
        self._end: BaseException | None = None  # why it is ended
        self._refusals = 0
        self._depth = 0
        self.lost = False  # it was left where it stands and never runs again

    def call(self, callable_number: int, argument: bytes = b"") -> bytes:
        """Run a callable to its end, doing what it asks on the way."""
        if not self._depth:
            self._end, self._refusals = None, 0
        self._depth += 1
        try:
            return self._run(callable_number, argument)
        finally:
            self._depth -= 1

    def _run(self, callable_number: int, argument: bytes) -> bytes:
        shared, handle, resume = self._shared, self._handle, self._owner.resume
        shared.callable = callable_number
        directive, reply = _CALL, argument
        while True:
            shared.directive, shared.reply, shared.reply_size = directive, reply, len(reply)
            resume(handle)
            if shared.said_size:
                self._hear(ctypes.string_at(shared.said, shared.said_size).decode(errors="replace"))
            question = shared.question
            data = ctypes.string_at(shared.data, shared.size) if shared.size else b""
            if question == _RETURNED:
                return data
            if question in _WAYS_OUT:
                raise self._what_came_out(question, data)
            directive, reply = self._do(question.decode(), data)

    def _do(self, question: str, data: bytes) -> tuple[int, bytes]:
        """Answer a question: how to go on, and the reply. Raises where there is no going on."""
        if self._end is not None:
            return self._put_off(self._end)
        cannot_throw = self._shared.cannot_throw
        answer = self._answers.get(question)
        try:
            if answer is None:
                raise unknown_request(question, self._answers)
            return _ANSWER, answer(self, Reader(data))
        except Exception as error:
            self.lost = self.lost or (cannot_throw and isinstance(error, ComponentError))
            if self.lost:
                raise
            self._error = error
            return _FAIL, str(error).encode()
        except BaseException as end:
            self.lost = self.lost or bool(cannot_throw) or isinstance(end, ProcessExit)
            if self.lost:
                raise
            self._end = end
            return _END, b""

    def _put_off(self, end: BaseException) -> tuple[int, bytes]:
        """It asks although it was ended, as destructors do, or as code that swallows everything: nothing is
        done, all answers are no.
        """
        self._refusals += 1
        if self._refusals > MAX_REQUESTS_AFTER_CANCEL:
            self.lost = True
            raise end
        return _ANSWER, _NO

    def _what_came_out(self, how: bytes, data: bytes) -> BaseException:
        if how == _ENDED and self._end is not None:
            return self._end
        if how == _ENDED:
            return CppException("volery::Ended", "")
        told = Reader(data)
        kind, what = told.text(), told.text()
        if how == _FAILED and self._error is not None and str(self._error) == what:
            return self._error
        return CppException(kind, what)


_WAYS_OUT = (_FAILED, _THREW, _ENDED)


class FiberPool:
    """The flows of one component: each of its callers has one to itself for as long as its call lasts."""

    def __init__(
        self, owner: FrameworkRuntime, component: str, dispatch: int, answers: RequestHandlers, hear: OnOutput
    ) -> None:
        self._make = partial(Fiber, owner, component, dispatch, answers, hear)
        self._idle: list[Fiber] = []

    def call(self, callable_number: int, argument: bytes = b"") -> bytes:
        """Run a callable on a stack of its own."""
        flow = self._idle.pop() if self._idle else self._make()
        try:
            return flow.call(callable_number, argument)
        finally:
            if not flow.lost:
                self._idle.append(flow)


COUNTERS, COUNTERS_LENGTH = "volery_counters", "volery_counters_length"
"""What a library exports if its code counts itself: an array of ``uint64_t`` and its length."""


class LoadedLibrary:
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


Counters = ctypes.Array[ctypes.c_uint64]
ToSteps = Callable[[Counters], int]
"""What all that was counted since the start amounts to, in the steps that a ``Pricing`` prices."""


class StepMeter:
    """A ``StepCounter`` for code that is loaded later: nothing until ``read_from`` was called."""

    def __init__(self) -> None:
        self._counters: Counters | None = None
        self._worth: ToSteps = lambda counters: 0
        self._taken = 0

    def read_from(self, counters: Counters, worth: ToSteps) -> None:
        """From now on *worth* of *counters* is what there is."""
        self._counters, self._worth = counters, worth
        self._taken = worth(counters)

    def __call__(self) -> int:
        """Steps since it was last asked. It is asked at each interaction point."""
        if self._counters is None:
            return 0
        total = self._worth(self._counters)
        steps, self._taken = total - self._taken, total
        return steps
