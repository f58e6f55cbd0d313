"""Flows of control of C++ code, seen from Python: let one go on, do what it asks, let it go on."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

from volery.base.errors import ComponentError
from volery.components.cpp.errors import CppError, Exited, no_answer
from volery.ros.client_libraries.wire import Answers, Reader

_CALL, _ANSWER, _FAIL, _END = range(4)
STACK_BYTES = 8 * 1024 * 1024
"""As a process's main thread has. Memory is taken as it is used."""

Hear = Callable[[str], None]
"""Told what the code has printed."""

MOST_REFUSALS = 1000
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


class House:
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
def house(path: Path) -> House:
    """The runtime at *path*."""
    return House(path)


class Flow:
    """One flow of control. See ``volery.ros.client_libraries.wire.CppFlow``."""

    def __init__(self, owner: House, component: str, dispatch: int, answers: Answers, hear: Hear) -> None:
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
                raise no_answer(question, self._answers)
            return _ANSWER, answer(self, Reader(data))
        except Exception as error:
            self.lost = self.lost or (cannot_throw and isinstance(error, ComponentError))
            if self.lost:
                raise
            self._error = error
            return _FAIL, str(error).encode()
        except BaseException as end:
            self.lost = self.lost or bool(cannot_throw) or isinstance(end, Exited)
            if self.lost:
                raise
            self._end = end
            return _END, b""

    def _put_off(self, end: BaseException) -> tuple[int, bytes]:
        """It asks although it was ended, as destructors do, or as code that swallows everything: nothing is
        done, all answers are no.
        """
        self._refusals += 1
        if self._refusals > MOST_REFUSALS:
            self.lost = True
            raise end
        return _ANSWER, _NO

    def _what_came_out(self, how: bytes, data: bytes) -> BaseException:
        if how == _ENDED and self._end is not None:
            return self._end
        if how == _ENDED:
            return CppError("volery::Ended", "")
        told = Reader(data)
        kind, what = told.text(), told.text()
        if how == _FAILED and self._error is not None and str(self._error) == what:
            return self._error
        return CppError(kind, what)


_WAYS_OUT = (_FAILED, _THREW, _ENDED)


class Flows:
    """The flows of one component: each of its callers has one to itself for as long as its call lasts."""

    def __init__(self, owner: House, component: str, dispatch: int, answers: Answers, hear: Hear) -> None:
        self._make = partial(Flow, owner, component, dispatch, answers, hear)
        self._idle: list[Flow] = []

    def call(self, callable_number: int, argument: bytes = b"") -> bytes:
        """Run a callable on a stack of its own."""
        flow = self._idle.pop() if self._idle else self._make()
        try:
            return flow.call(callable_number, argument)
        finally:
            if not flow.lost:
                self._idle.append(flow)
