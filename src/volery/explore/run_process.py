"""One run of a campaign, in a process of its own that takes many runs.

``execute`` is what an engine carries to a worker: it takes a task and returns its row. The run is made in a
warm child process, which keeps what it has read and compiled. A run that crashes, hangs or takes too much
memory ends that process and becomes a row with its reason; the next run gets a new process, and the worker of
the engine never notices. So every engine has the same limits and the same rows.
"""

from __future__ import annotations

import atexit
import ctypes
import hashlib
import os
import pickle
import resource
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

from volery.base.errors import ModelError, UsageError, VoleryError
from volery.explore.points import (
    ALLOCATION,
    COMPLETED,
    CRASHED,
    FAILED,
    INVALID,
    OVER_MEMORY,
    OVER_TIME,
    PATHS,
    SCENARIO,
    SELECTED,
    Point,
    Row,
    Value,
)
from volery.model.builder import ModelBuilder
from volery.model.system import System
from volery.model.writing import flow_text

SYSTEMS_KEPT: Final = 64
"""Variants of a model that a process keeps after it has read them."""

LOOK_EVERY_S: Final = 0.05
"""Wall seconds between two looks at the memory of a run that has a limit."""

BEGINS: Final = "begins"
"""Message of a child that has read and compiled what a run needs."""
BEGIN_S: Final = 600.0
"""Wall seconds within which it must come: a first use compiles for a minute, longer on a busy machine."""

DEATH_S: Final = 30.0
"""Wall seconds that a crashed process may take to end: it may write a core."""

ATTEMPTS: Final = 2
"""How often a run is begun whose process is killed from outside, as by the system when memory is short."""


class VersionMismatchError(VoleryError):
    """A worker has another version of volery than the coordinator, or other files of the model."""


class StoppedError(VoleryError):
    """The processes of runs were ended, for the campaign ends."""


@dataclass(frozen=True)
class Setting:
    """What all runs of a campaign share.

    Attributes:
        model: File or folder of the model, by its absolute path, or the model built in Python.
        fidelity: As of ``volery.Options``.
        limit_s: Wall seconds that a run may take.
        memory_mb: Resident memory that the process of a run may use, in megabytes; 0 for no limit.
        version: Version of volery of the coordinator.
        digest: Digest of the model's files as the coordinator has read them.
    """

    model: str | ModelBuilder
    fidelity: str = "code"
    limit_s: float = 3600.0
    memory_mb: float = 0.0
    version: str = ""
    digest: str = ""


@dataclass(frozen=True)
class Task:
    """A run to be made."""

    setting: Setting
    run: int
    point: Point
    attempt: int = 1


@cache
def installed_version() -> str:
    """Return the version of volery with a digest of its sources: what rows depend on."""
    try:
        number = version("volery")
    except PackageNotFoundError:  # run from a checkout
        number = "0"
    root = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return f"{number} (sources {digest.hexdigest()[:12]})"


def model_digest(system: System) -> str:
    """Return a digest of the files that a model was read from and of those of its components."""
    digest = hashlib.sha256()
    for source in system.sources:
        digest.update(f"{source.name}\0{source.text}\0".encode())
    files = {one.path: system.file_of(one) for one in system.components.values() if one.path}
    for name, path in sorted(files.items()):
        digest.update(f"{name}\0".encode())
        with suppress(OSError):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def overrides_of(values: Mapping[str, Value]) -> list[str]:
    """Return the values of a point as overrides ``path=value`` of a model."""
    return [
        f"{path}={flow_text(value)}"
        for key, value in values.items()
        if key not in SELECTED
        for path in key.split(PATHS)
    ]


def read_variant(model: str | ModelBuilder, values: Mapping[str, Value]) -> System:
    """Return the variant of a model. Raises ``ModelError`` or ``UsageError`` as ``volery.simulate`` does."""
    from volery.run.run_session import read_system  # noqa: PLC0415  # an engine's worker runs nothing itself

    return read_system(model, values.get(SCENARIO), values.get(ALLOCATION), overrides_of(values))


# -- in the process of a worker


def execute(task: Task) -> Row:
    """Make a run and return its row; whatever happens to the run is a row.

    Raises:
        VersionMismatchError: The worker has another version of volery, or other files of the model.
        StoppedError: The processes were ended meanwhile.
    """
    mine = installed_version()
    if task.setting.version not in ("", mine):
        raise VersionMismatchError(
            f"the worker on {socket.gethostname()} has volery {mine}, the coordinator "
            f"{task.setting.version}: install the same version on both"
        )
    for attempt in range(ATTEMPTS):
        with _processes.taken() as process:
            row = process.make(task)
        if row is not None:
            return replace(row, attempt=task.attempt + attempt)
    reason = "its process was killed twice (SIGKILL); the system does so when memory is short"
    return _ended(task, CRASHED, reason, 0.0, task.attempt + ATTEMPTS - 1)


def stop_processes() -> None:
    """End the processes of runs, and with them the runs in progress. The next run starts a new one."""
    _processes.stop()


def _ended(task: Task, status: str, reason: str, wall_s: float, attempt: int = 1) -> Row:
    return Row(
        task.run, task.point, status, reason, wall_s=wall_s, host=socket.gethostname(), attempt=attempt
    )


class RunProcess:
    """A child process that makes one run after another."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            script = (
                f"import sys; sys.path[:] = {sys.path!r}; from volery.explore.run_process import main; "
                f"main({theirs.fileno()}, {os.getpid()})"
            )
            self._child = subprocess.Popen(
                [sys.executable, "-c", script],
                env={"OPENBLAS_NUM_THREADS": "1", **os.environ},  # more threads, other last bits
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C reaches the coordinator, which ends the campaign in order
            )
        self._link = Connection(ours.detach())

    @property
    def alive(self) -> bool:
        """Whether it can take a run."""
        return self._child.poll() is None

    def make(self, task: Task) -> Row | None:
        """Return the row of a run; None if the process was killed from outside."""
        setting = task.setting
        wall_s = 0.0
        try:
            self._link.send(task)
            answer, late = self._answer(BEGIN_S, 0.0), f"it did not begin within {BEGIN_S:g} s"
            if answer == BEGINS:
                began = time.monotonic()
                late = f"it took more than its limit of {setting.limit_s:g} s"
                answer = self._answer(setting.limit_s, setting.memory_mb)
                wall_s = time.monotonic() - began
        except (EOFError, OSError):
            code = self._exit_status()
            if code == -signal.SIGKILL:
                return None
            how = f"by {signal.Signals(-code).name}" if code < 0 else f"with exit status {code}"
            return _ended(task, CRASHED, f"its process ended {how}", wall_s)
        if isinstance(answer, VoleryError):
            raise answer
        if isinstance(answer, Row):
            return answer
        self.kill()
        much = f"its process used more than its limit of {setting.memory_mb:g} MB"
        return _ended(task, answer, much if answer == OVER_MEMORY else late, wall_s)

    def _answer(self, limit_s: float, memory_mb: float) -> Any:
        """Return the next message, or ``OVER_MEMORY`` or ``OVER_TIME`` if there is none within a limit."""
        until = time.monotonic() + limit_s
        while True:
            left = max(0.0, until - time.monotonic())
            if self._link.poll(min(left, LOOK_EVERY_S) if memory_mb else left):
                return self._link.recv()
            if memory_mb and _resident_mb(self._child.pid) > memory_mb:
                return OVER_MEMORY
            if left <= 0.0:
                return OVER_TIME

    def kill(self) -> None:
        """End the process, whatever it does."""
        self._child.kill()
        self._child.wait()

    def _exit_status(self) -> int:
        """Return how a process ended that has closed its end of the link."""
        try:
            return self._child.wait(DEATH_S)
        except subprocess.TimeoutExpired:
            self._child.kill()
            return self._child.wait()


def _resident_mb(pid: int) -> float:
    """Return the resident memory of a process and of its children, in megabytes."""
    pages = 0
    with suppress(OSError, ValueError):
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        for one in (pid, *map(int, children)):
            pages += int(Path(f"/proc/{one}/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


class _Processes:
    """The child processes of this process: one for each run at a time, kept for the next runs.

    They are started by a thread that lives as long as this process: they die with the thread that has started
    them, so that no signal to this process leaves one behind.
    """

    def __init__(self) -> None:
        self._guard = threading.Lock()
        self._idle: list[RunProcess] = []
        self._busy: set[RunProcess] = set()
        self._stops = 0
        self._starter: ThreadPoolExecutor | None = None

    @contextmanager
    def taken(self) -> Iterator[RunProcess]:
        """Return a process for one run."""
        with self._guard:
            stops = self._stops
            process = self._idle.pop() if self._idle else None
            if process is None or not process.alive:
                if self._starter is None:
                    self._starter = ThreadPoolExecutor(1, "starts-run-processes")
                    atexit.register(self.stop)
                process = self._starter.submit(RunProcess).result()
            self._busy.add(process)
        try:
            yield process
        finally:
            with self._guard:
                self._busy.discard(process)
                if process.alive and stops == self._stops:
                    self._idle.append(process)
        if stops != self._stops:
            raise StoppedError("the campaign was stopped during this run")

    def stop(self) -> None:
        """See ``stop_processes``."""
        with self._guard:
            self._stops += 1
            idle, self._idle = self._idle, []
            for process in (*idle, *self._busy):
                process.kill()


_processes = _Processes()


# -- in the child


def main(descriptor: int, parent: int) -> None:
    """Make runs as they come over a connection, until it is closed."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it died before the call above
        return
    link = Connection(descriptor)
    child = _Child(lambda: link.send(BEGINS))
    with suppress(EOFError, OSError):
        while True:
            link.send(child.made(link.recv()))


_PR_SET_PDEATHSIG = 1


class _Child:
    """What a child process keeps from run to run.

    Args:
        begins: Called when a run begins: when all that it needs has been read and compiled.
    """

    def __init__(self, begins: Callable[[], None]) -> None:
        self._begins = begins
        self._systems: OrderedDict[tuple[bytes, str], System] = OrderedDict()

    def made(self, task: Task) -> Row | VoleryError:
        """Make a run and return its row, or the error that ends the campaign."""
        began, used = time.monotonic(), _used_s()
        try:
            system = self._system(task)
            self._begins()
            began, used = time.monotonic(), _used_s()
            row = run_row(task, system)
        except VersionMismatchError as error:
            return error
        except (ModelError, UsageError) as error:
            row = Row(task.run, task.point, INVALID, str(error))
        except MemoryError:
            row = Row(task.run, task.point, OVER_MEMORY, "no memory was left")
        except Exception as error:
            row = Row(task.run, task.point, FAILED, f"{type(error).__name__}: {error}")
        wall_s, cpu_s = time.monotonic() - began, _used_s() - used
        return replace(row, wall_s=wall_s, cpu_s=cpu_s, host=socket.gethostname())

    def _system(self, task: Task) -> System:
        key = (pickle.dumps(task.setting), task.point.variant)
        if key not in self._systems:
            first = not self._systems
            if first:
                _check_digest(task.setting)
            self._systems[key] = read_variant(task.setting.model, task.point.values)
            if first:
                _compile(self._systems[key], task.setting.fidelity)
            if len(self._systems) > SYSTEMS_KEPT:
                self._systems.popitem(last=False)
        self._systems.move_to_end(key)
        return self._systems[key]


def _check_digest(setting: Setting) -> None:
    if setting.digest and setting.digest != (mine := model_digest(read_variant(setting.model, {}))):
        raise VersionMismatchError(
            f"{setting.model} on {socket.gethostname()} differs from the coordinator's (digest {mine}, not "
            f"{setting.digest}): all workers must read the same files"
        )


def _compile(system: System, fidelity: str) -> None:
    """Import and compile what runs need: a session that is made, and not begun, does so."""
    from volery.run.assembly.cpp import compile_all, has_cpp  # noqa: PLC0415  # see read_variant
    from volery.run.result import Options  # noqa: PLC0415
    from volery.run.run_session import RunSession  # noqa: PLC0415

    if has_cpp(system):
        compile_all(system, system.instances, fidelity, None, traced=False)
    else:
        RunSession(system, Options(fidelity=fidelity)).leave()


def run_row(task: Task, system: System, out: Path | None = None) -> Row:
    """Run a variant and return its row, without what differs from machine to machine.

    Args:
        task: The run.
        system: The variant of its point.
        out: Run folder, which gets the trace and the report, or None.
    """
    from volery.run.result import Options  # noqa: PLC0415  # see read_variant
    from volery.run.simulate import simulate  # noqa: PLC0415

    run = simulate(system, Options(fidelity=task.setting.fidelity, seed=task.point.seed, out=out))
    outcome = run.record.outcome
    completed = outcome.status == COMPLETED
    return Row(
        task.run,
        task.point,
        COMPLETED if completed else FAILED,
        "" if completed else outcome.reason,
        {name: one.met for name, one in run.record.requirements.items()},
        run.observables,
        run.record.sim_s,
    )


def _used_s() -> float:
    """Return the processor seconds of this process and of its children that have ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime
