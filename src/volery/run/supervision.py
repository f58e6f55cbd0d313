"""A run in a process of its own, so that C++ code that crashes ends that process and nothing else.

The child does what ``simulate`` does and sends its ``Run``. If a component of it crashes, the child tells
which one and is gone; the parent then closes the books: the trace as far as it was written, the failure, the
verdicts, the documents.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import FrameType

from volery.base.errors import VoleryError
from volery.components.cpp.crash import Crash, read_crash
from volery.components.cpp.framework import framework_runtime
from volery.run.progress import Progress, Show
from volery.run.result import Run

Work = Callable[[Show | None], Run]
"""The run itself, given what it is to show its progress with."""

RecoverRun = Callable[[VoleryError, str], Run]
"""Closes the books of a run that has died of an error, blamed on a component or on ``run``."""

_PR_SET_PDEATHSIG = 1


@dataclass(frozen=True)
class Supervision:
    """What a supervisor needs to know: the runtime of C++ components, and how long one may compute."""

    framework: Path
    libraries: dict[str, Path]
    patience_s: float


def run_supervised(work: Work, show: Show | None, supervision: Supervision, salvage: RecoverRun) -> Run:
    """Do *work* in a child process; what it raises is raised here.

    SIGINT and SIGTERM are passed on. If the child dies, *salvage* says what is left of the run.
    """
    context = get_context("fork")  # the model is there already, as it is
    ours, theirs = context.Pipe(duplex=False)
    report, told = os.pipe()
    child = context.Process(
        target=_child_main, args=(work, show is not None, supervision, theirs, told), name="run"
    )
    sys.stdout.flush()
    sys.stderr.flush()
    child.start()
    theirs.close()
    os.close(told)
    try:
        with _signals_passed_on(child):
            result = _listen(ours, show)
            child.join()
        return result or _recover(child, read_crash(report, supervision.libraries), salvage)
    finally:
        child.kill()  # only if it is still there: what broke off was the listening
        child.join()
        ours.close()
        os.close(report)


def _listen(ours: Connection, show: Show | None) -> Run | None:
    """Show what the child sends until it sends its result, or ends without one."""
    while True:
        try:
            kind, content = ours.recv()
        except EOFError:
            return None
        if kind == "show" and show is not None:
            show(content)
        elif kind == "raised":
            raise content
        elif kind == "run":
            run: Run = content
            return run


def _recover(child: BaseProcess, crash: Crash | None, salvage: RecoverRun) -> Run:
    if crash is not None:
        return salvage(crash.error(), crash.component)
    code = child.exitcode or 0
    how = signal.Signals(-code).name if code < 0 else f"exit status {code}"
    return salvage(VoleryError(f"the process that ran the components was ended: {how}"), "run")


@contextmanager
def _signals_passed_on(child: BaseProcess) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def pass_on(number: int, frame: FrameType | None) -> None:
        if child.pid is not None and child.is_alive():
            os.kill(child.pid, number)

    before = {number: signal.signal(number, pass_on) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


# -- in the child


def _child_main(work: Work, shown: bool, supervision: Supervision, to: Connection, told: int) -> None:
    os.setpgid(0, 0)  # Ctrl-C reaches the parent, which passes it on
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    framework_runtime(supervision.framework).supervise(told, supervision.patience_s)

    def show(progress: Progress) -> None:
        to.send(("show", progress))

    try:
        to.send(("run", work(show if shown else None)))
    except BaseException as error:
        to.send(("raised", error))
    finally:
        to.close()
