"""One run of a campaign, in a process of its own that takes many runs.

``execute`` is what an engine carries to a worker: it takes a task and returns its row. The run is made in a
warm child process, which keeps what it has read and compiled. A run that crashes, hangs or takes too much
memory ends that process and becomes a row with its reason; the next run gets a new process, and the worker of
the engine never notices. So every engine has the same limits and the same rows.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
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
from multiprocessing.reduction import recv_handle, send_handle
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
    CampaignRow,
    Value,
    VariantPoint,
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
class CampaignSetting:
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
class PlannedRun:
    """A run to be made."""

    setting: CampaignSetting
    run: int
    point: VariantPoint
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
    files = {
        component.path: system.file_of(component)
        for component in system.components.values()
        if component.path
    }
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


def execute(task: PlannedRun) -> CampaignRow:
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
        with _processes.taken(task) as process:
            row = process.make(task)
        if row is not None:
            return replace(row, attempt=task.attempt + attempt)
    reason = "its process was killed twice (SIGKILL); the system does so when memory is short"
    return _ended(task, CRASHED, reason, 0.0, task.attempt + ATTEMPTS - 1)


def stop_processes() -> None:
    """End the processes of runs, and with them the runs in progress. The next run starts a new one."""
    _processes.stop()


def _ended(task: PlannedRun, status: str, reason: str, wall_s: float, attempt: int = 1) -> CampaignRow:
    return CampaignRow(
        task.run, task.point, status, reason, wall_s=wall_s, host=socket.gethostname(), attempt=attempt
    )


class _Template:
    """A process that has read and compiled what runs need, and forks those that make them.

    So nothing is compiled twice, and what replaces a process that died begins at once. It has no threads. It
    dies with the thread that has started it, and those that it has forked die with it.
    """

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            script = (
                f"import sys; sys.path[:] = {sys.path!r}; from volery.explore.run_process import main; "
                f"main({theirs.fileno()}, {os.getpid()})"
            )
            self._process = subprocess.Popen(
                [sys.executable, "-c", script],
                env={"OPENBLAS_NUM_THREADS": "1", **os.environ},  # more threads, other last bits
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C reaches the coordinator, which ends the campaign in order
            )
        self._link = Connection(ours.detach())
        self._guard = threading.Lock()

    @property
    def alive(self) -> bool:
        """Whether it can fork."""
        return self._process.poll() is None

    def fork(self, task: PlannedRun) -> tuple[int, Connection]:
        """Return number and link of a new process for runs such as *task*. Raises ``OSError`` if it died."""
        ours, theirs = socket.socketpair()
        with self._guard, theirs:
            self._link.send((_FORK, task))
            send_handle(self._link, theirs.fileno(), self._process.pid)
            if not self._link.poll(BEGIN_S):
                self.kill()
                raise TimeoutError("it does not answer")
            return self._link.recv(), Connection(ours.detach())

    def exit_status(self, pid: int) -> int | None:
        """Return how a process ended, None if it has not; as if killed where that cannot be known."""
        try:
            with self._guard:
                self._link.send((_WAIT, pid))
                status: int | None = self._link.recv()
                return status
        except (EOFError, OSError):
            return -signal.SIGKILL

    def kill(self) -> None:
        """End it and what it has forked."""
        self._process.kill()
        self._process.wait()


_FORK, _WAIT = "fork", "wait"


class RunProcess:
    """A process that makes one run after another.

    Args:
        template: What forks it.
        task: Its first run.
    """

    def __init__(self, template: _Template, task: PlannedRun) -> None:
        self._template = template
        self._status: int | None = None
        self._pid, self._link = template.fork(task)

    @property
    def alive(self) -> bool:
        """Whether it can take a run."""
        if self._status is None:
            self._status = self._template.exit_status(self._pid)
        return self._status is None

    def make(self, task: PlannedRun) -> CampaignRow | None:
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
        if isinstance(answer, CampaignRow):
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
            if memory_mb and _resident_mb(self._pid) > memory_mb:
                return OVER_MEMORY
            if left <= 0.0:
                return OVER_TIME

    def kill(self) -> None:
        """End the process, whatever it does."""
        if self.alive:  # and until its status has been asked for, no other gets its number
            os.kill(self._pid, signal.SIGKILL)

    def _exit_status(self) -> int:
        """Return how a process ended that has closed its end of the link."""
        until = time.monotonic() + DEATH_S
        while self.alive:
            if time.monotonic() > until:
                self.kill()
            time.sleep(LOOK_EVERY_S)
        assert self._status is not None, "it has ended"
        return self._status


def _resident_mb(pid: int) -> float:
    """Return the resident memory of a process and of its children, in megabytes."""
    pages = 0
    with suppress(OSError, ValueError):
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        for one in (pid, *map(int, children)):
            pages += int(Path(f"/proc/{one}/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


class _Processes:
    """The processes of this process: one for each run at a time, kept for the next runs."""

    def __init__(self) -> None:
        self._guard = threading.Lock()
        self._idle: list[RunProcess] = []
        self._stops = 0
        self._template: _Template | None = None
        self._starter: ThreadPoolExecutor | None = None

    @contextmanager
    def taken(self, task: PlannedRun) -> Iterator[RunProcess]:
        """Return a process for a run."""
        stops = self._stops
        with self._guard:
            process = self._idle.pop() if self._idle else None
            if process is None or not process.alive:
                process = self._new(task, stops)
        try:
            yield process
        finally:
            with self._guard:
                if stops == self._stops and process.alive:
                    self._idle.append(process)
        self._check(stops)

    def _new(self, task: PlannedRun, stops: int) -> RunProcess:
        """Return a new process; its template is started anew if it died."""
        for _ in range(ATTEMPTS):
            self._check(stops)
            if self._template is None or not self._template.alive:
                if self._starter is None:
                    self._starter = ThreadPoolExecutor(1, "starts-templates")  # a thread that stays
                    atexit.register(self.stop)
                self._template = self._starter.submit(_Template).result()
                if stops != self._stops:
                    self._template.kill()
                    continue
            with suppress(EOFError, OSError):  # it was killed meanwhile
                return RunProcess(self._template, task)
        self._check(stops)
        raise VoleryError("the process that reads the model was killed twice, as when memory is short")

    def _check(self, stops: int) -> None:
        """Raise ``StoppedError`` if the processes have been stopped since."""
        if stops != self._stops:
            raise StoppedError("the campaign was stopped during this run")

    def stop(self) -> None:
        """See ``stop_processes``. It does not wait for what is being read or compiled."""
        self._stops += 1
        if self._template is not None:
            self._template.kill()
        with self._guard:
            self._idle = []
            self._template = None


_processes = _Processes()


# -- in the child


def main(descriptor: int, parent: int) -> None:
    """Be a template: fork processes, and say how they ended, until the link is closed."""
    _die_with(parent)
    link, maker = Connection(descriptor), _Maker()
    with suppress(EOFError, OSError):
        while True:
            what, argument = link.recv()
            if what == _WAIT:
                pid, status = os.waitpid(argument, os.WNOHANG)
                link.send(os.waitstatus_to_exitcode(status) if pid else None)
                continue
            handle = recv_handle(link)
            maker.prepare(argument)
            template = os.getpid()
            pid = os.fork()
            if not pid:
                _die_with(template)
                link.close()
                maker.serve(Connection(handle))
                os._exit(0)
            os.close(handle)
            link.send(pid)


def _die_with(parent: int) -> None:
    """End this process when its parent ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it died before the call above
        os._exit(0)


_PR_SET_PDEATHSIG = 1


class _Maker:
    """Makes runs, and keeps what it has read and compiled from run to run."""

    def __init__(self) -> None:
        self._systems: OrderedDict[tuple[bytes, str], System] = OrderedDict()
        self._compiled: set[bytes] = set()

    def prepare(self, task: PlannedRun) -> None:
        """Read and compile what runs such as *task* need. What is wrong is said when the run is made."""
        with suppress(Exception):
            self._system(task)
        gc.collect()
        gc.freeze()  # what all processes share is not looked at again, and so not copied

    def serve(self, link: Connection) -> None:
        """Make runs as they come over a link, until it is closed."""
        with suppress(EOFError, OSError):
            while True:
                task = link.recv()
                link.send(self.made(task, lambda: link.send(BEGINS)))

    def made(self, task: PlannedRun, begins: Callable[[], None]) -> CampaignRow | VoleryError:
        """Make a run and return its row, or the error that ends the campaign.

        *begins* is called when all that it needs has been read and compiled.
        """
        began, used = time.monotonic(), _used_s()
        try:
            system = self._system(task)
            begins()
            began, used = time.monotonic(), _used_s()
            row = run_row(task, system)
        except VersionMismatchError as error:
            return error
        except (ModelError, UsageError) as error:
            row = CampaignRow(task.run, task.point, INVALID, str(error))
        except MemoryError:
            row = CampaignRow(task.run, task.point, OVER_MEMORY, "no memory was left")
        except Exception as error:
            row = CampaignRow(task.run, task.point, FAILED, f"{type(error).__name__}: {error}")
        wall_s, cpu_s = time.monotonic() - began, _used_s() - used
        return replace(row, wall_s=wall_s, cpu_s=cpu_s, host=socket.gethostname())

    def _system(self, task: PlannedRun) -> System:
        setting = pickle.dumps(task.setting)
        key = (setting, task.point.variant)
        if key not in self._systems:
            if setting not in self._compiled:
                _check_digest(task.setting)
            system = read_variant(task.setting.model, task.point.values)
            if setting not in self._compiled:
                _compile(system, task.setting.fidelity)
                self._compiled.add(setting)
            self._systems[key] = system
            if len(self._systems) > SYSTEMS_KEPT:
                self._systems.popitem(last=False)
        self._systems.move_to_end(key)
        return self._systems[key]


def _check_digest(setting: CampaignSetting) -> None:
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


def run_row(task: PlannedRun, system: System, out: Path | None = None) -> CampaignRow:
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
    return CampaignRow(
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
