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
from dataclasses import dataclass, replace
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import FrameType

from volery.base.errors import UsageError, VoleryError
from volery.base.process import ending_signals, on_ending_signals
from volery.base.time import Ns
from volery.components.cpp.build import build_framework
from volery.components.cpp.framework import Crash, framework_runtime, read_crash
from volery.kernel.virtual import VirtualKernel
from volery.model.system import System
from volery.requirements.verdicts import Observers
from volery.run.assembly.computers import ComputingPlatform
from volery.run.assembly.cpp import compile_all, has_cpp
from volery.run.recording import Recording
from volery.run.result import Options, Run, RunProgress, Show, Tell
from volery.run.run_session import PATIENCE_S
from volery.run.trace_setup import attachments_of, setup_of
from volery.trace.events import Event, Failure, Verdict
from volery.trace.mcap_writer import TRACE_FILE
from volery.trace.reader import OpenTrace

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

    def begin(self, crash_pipe: int) -> None:
        """Watch the components in this process; a crash is reported to *crash_pipe*, for ``read_crash``."""
        framework_runtime(self.framework).supervise(crash_pipe, self.patience_s)


def supervision_of(system: System, options: Options) -> Supervision | None:
    """Compile the C++ components of a model, and return what watches them; None if there are none."""
    if not has_cpp(system):
        return None
    traced = options.traces is not None
    ready = compile_all(system, system.instances, options.fidelity, options.tell, traced=traced)
    libraries = {name: one.compiled.library for name, one in ready.items()}
    return Supervision(build_framework(), libraries, PATIENCE_S) if ready else None


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
        return result or recover_by(recover, child.exitcode or 0, read_crash(report, supervision.libraries))
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


def recover_by(recover: RecoverRun, status: int, crash: Crash | None, when: str = "") -> Run:
    """Return the run of a process that died.

    Args:
        recover: Makes the run.
        status: Exit status of the process.
        crash: What it has reported of a crash.
        when: For the message, if it is known: when it died.
    """
    if crash is not None:
        return recover(replace(crash, what=f"{crash.what}{when}").error(), crash.component)
    how = f"the process that ran the components was ended{when}: {how_ended(status)}"
    return recover(VoleryError(how), "run")


def how_ended(status: int) -> str:
    """Return how a process ended in words, from its exit status: below 0 it is that of a signal."""
    return signal.Signals(-status).name if status < 0 else f"exit status {status}"


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
    supervision.begin(crash_pipe)

    def show(progress: RunProgress) -> None:
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


def recover_run(system: System, options: Options, reached: Ns, error: VoleryError, blamed: str) -> Run:
    """Return a failed ``Run`` from what its process has recorded.

    The trace is written again up to its truncation, followed by the failure, the verdicts and the usual
    documents.

    Args:
        system: The model.
        options: Options of the run.
        reached: Virtual time that the run is known to have reached, ns; the trace may be cut before it.
        error: What ended the process.
        blamed: Component that failed, or ``run``.
    """
    cut = _set_aside(options.folder) if options.folder is not None else None
    platform = ComputingPlatform(system, VirtualKernel(), options.seed, options.fidelity)
    platform.look_up_prices()
    setup = setup_of(system, platform, options.seed, options.fidelity)
    recording = Recording(setup, options.folder, attachments_of(system), traced=options.traced)
    observers = Observers(system.requirements, setup)
    recording.stream.tap(observers)
    for event in _events(cut):
        recording.stream(event)
    ended = max(reached, recording.accounts.last)
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
        with OpenTrace(cut) as reading:
            yield from (event for event in reading.events() if not isinstance(event, Verdict))
    except UsageError:
        return
