"""A run in a child process, so that a crash of C++ code ends that process and nothing else.

The child executes the run and sends its ``Run``. If a component crashes, the child reports which one and
dies. The parent then finishes the recording: the trace as far as it was written, the failure, the verdicts,
the documents.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import FrameType

from volery.base.errors import UsageError, VoleryError
from volery.base.process import ending_signals, on_ending_signals
from volery.components.cpp.framework import Crash, framework_runtime, read_crash
from volery.kernel.virtual import VirtualKernel
from volery.model.system import System
from volery.requirements.verdicts import Observers
from volery.run.assembly.computers import Platform
from volery.run.recording import Recording
from volery.run.result import Progress, Run, Show, Tell
from volery.run.trace_setup import attachments_of, setup_of
from volery.trace.events import Event, Failure, Verdict
from volery.trace.mcap_writer import TRACE_FILE
from volery.trace.reader import Reading

Work = Callable[[Show | None, Tell | None], Run]
"""Executes the run, given the functions that show its progress and its lines."""

RecoverRun = Callable[[VoleryError, str], Run]
"""Finishes the recording of a run that died of an error, blamed on a component or on ``run``."""

_PR_SET_PDEATHSIG = 1


@dataclass(frozen=True)
class Supervision:
    """Runtime and libraries of the C++ components, and the wall seconds that one may compute at a time."""

    framework: Path
    libraries: dict[str, Path]
    patience_s: float


def run_supervised(
    work: Work, show: Show | None, tell: Tell | None, supervision: Supervision, recover: RecoverRun
) -> Run:
    """Execute a run in a child process and return its result. An exception of the child is raised here.

    Args:
        work: The run.
        show: Receives the progress.
        tell: Receives the lines that the user should read at once.
        supervision: What the child watches.
        recover: Makes the result if the child dies.
    """
    context = get_context("fork")  # the child inherits the model
    ours, theirs = context.Pipe(duplex=False)
    report, crash_pipe = os.pipe()
    child = context.Process(
        target=_child_main,
        args=(work, show is not None, tell is not None, supervision, theirs, crash_pipe),
        name="run",
    )
    sys.stdout.flush()
    sys.stderr.flush()
    try:
        with _started(child):
            theirs.close()
            os.close(crash_pipe)
            result = _listen(ours, show, tell)
            child.join()
        return result or _recover(child, read_crash(report, supervision.libraries), recover)
    finally:
        if child.pid is not None:
            child.kill()  # still running only after an exception above
            child.join()
        ours.close()
        os.close(report)


def _listen(ours: Connection, show: Show | None, tell: Tell | None) -> Run | None:
    """Show the progress and lines that the child sends until its result; None if it ends without one."""
    while True:
        try:
            kind, content = ours.recv()
        except EOFError:
            return None
        if kind == "show" and show is not None:
            show(content)
        elif kind == "tell" and tell is not None:
            tell(content)
        elif kind == "raised":
            raise content
        elif kind == "run":
            run: Run = content
            return run


def _recover(child: BaseProcess, crash: Crash | None, recover: RecoverRun) -> Run:
    if crash is not None:
        return recover(crash.error(), crash.component)
    code = child.exitcode or 0
    how = signal.Signals(-code).name if code < 0 else f"exit status {code}"
    return recover(VoleryError(f"the process that ran the components was ended: {how}"), "run")


@contextmanager
def _started(child: BaseProcess) -> Iterator[None]:
    """Start the child and pass the signals that end a run on to it until the block ends.

    The handlers are in place before the fork, and the child begins with these signals blocked: Python drops
    an exception that a signal raises during a fork, and the child must have its own handlers first.
    """
    early: list[int] = []

    def forward(number: int, frame: FrameType | None) -> None:
        if child.pid is None:
            early.append(number)
        elif child.is_alive():
            os.kill(child.pid, number)

    with on_ending_signals(forward):
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, ending_signals())
        try:
            child.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for number in early:
            forward(number, None)
        yield


# -- in the child


def _child_main(
    work: Work, shown: bool, tells: bool, supervision: Supervision, to: Connection, crash_pipe: int
) -> None:
    os.setpgid(0, 0)  # Ctrl-C reaches the parent, which forwards it
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    stopping = ending_signals()
    for number in stopping:
        signal.signal(number, signal.default_int_handler)
    framework_runtime(supervision.framework).supervise(crash_pipe, supervision.patience_s)

    def show(progress: Progress) -> None:
        to.send(("show", progress))

    def tell(line: str) -> None:
        to.send(("tell", line))

    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, stopping)  # may raise KeyboardInterrupt at once
        to.send(("run", work(show if shown else None, tell if tells else None)))
    except BaseException as error:
        to.send(("raised", error))
    finally:
        to.close()


CUT_FILE = "trace-cut.mcap"
"""Name of the truncated trace while the trace is written again."""


def recover_run(
    system: System, out: Path | None, seed: int, fidelity: str, error: VoleryError, blamed: str
) -> Run:
    """Return a failed ``Run`` from what its process has recorded.

    The trace is written again up to its truncation, followed by the failure, the verdicts and the usual
    documents.

    Args:
        system: The model.
        out: Run folder; None if nothing was kept.
        seed: Seed of the run.
        fidelity: Fidelity of the run.
        error: What ended the process.
        blamed: Component that failed, or ``run``.
    """
    cut = _set_aside(out) if out is not None else None
    platform = Platform(system, VirtualKernel(), seed, fidelity)
    platform.look_up_prices()
    setup = setup_of(system, platform, seed, fidelity)
    recording = Recording(setup, out, attachments_of(system))
    observers = Observers(system.requirements, setup)
    recording.stream.tap(observers)
    for event in _events(cut):
        recording.stream(event)
    ended = recording.accounts.last
    what = str(error).removeprefix(f"{blamed}: ")
    recording.stream(Failure(ended, blamed, what))
    record = recording.finish("failed", str(error), ended, observers.verdicts(ended))
    if cut is not None:
        cut.unlink()
    return Run(
        record,
        recording.folder,
        error,
        (),
        tuple(recording.problems),
        tuple(recording.notes),
        recording.accounts.observables(ended),
    )


def _set_aside(out: Path) -> Path | None:
    trace = out / TRACE_FILE
    return trace.replace(out / CUT_FILE) if trace.exists() else None


def _events(cut: Path | None) -> Iterator[Event]:
    """Yield the events of the truncated trace; none if it ends before its header."""
    if cut is None:
        return
    try:
        with Reading(cut) as reading:
            yield from (event for event in reading.events() if not isinstance(event, Verdict))
    except UsageError:
        return
