"""The process of one firmware: started in a folder of its own, watched, and ended by its pid."""

from __future__ import annotations

import json
import os
import re
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence, Set
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from volery.base.errors import VoleryError

CONSOLE_FILE = "console.txt"
"""What a firmware prints, in its folder."""
ISOLATE = True
"""Whether a firmware gets a network of its own where the system allows that."""
_LAST_LINES = 4
_LAST_OCTETS = 65_536
_START_LIMIT_S = 20.0
_END_LIMIT_S = 1.0
_REST_LIMIT_S = 1.0
_STEP_PAUSE_S, _START_PAUSE_S = 5e-5, 2e-3
"""Pause between two looks whether a firmware is at rest."""
_START_LOOKS = 10
"""Looks in a row that must find the programs of a start script at rest: some of them sleep for a moment."""
_CPUCLOCK_SCHED = 2
"""Of a clock id: processor time of a process, to the nanosecond; see ``clock_getcpuclockid``."""
_PARTING_S = 0.5
"""Time from the end of a process's connections to its own."""


class FirmwareError(VoleryError):
    """A firmware or an FMU does not start, has died, hangs, or does not fit; the text names the vehicle."""


def lacks(whose: str, parameters: Set[str]) -> FirmwareError:
    """Return the error that a firmware has no such *parameters*; *whose*: vehicle and program."""
    names = ", ".join(sorted(parameters))
    return FirmwareError(f"{whose} has no parameter {names}; leave it out, or name it as this version does")


class LoopbackPort(NamedTuple):
    """A port of loopback: of instance i it is *number* + i *stride*."""

    kind: str
    """``tcp`` or ``udp``."""
    number: int
    stride: int

    def of(self, instance: int) -> int:
        """Return the port of an instance."""
        return self.number + self.stride * instance


class FirmwareProcess:
    """A firmware, or another program of a vehicle, that runs.

    Args:
        name: The vehicle, for messages.
        command: Program and arguments; ``{instance}`` in them is replaced by the instance number.
        folder: Folder in which it runs, created if need be; it keeps its console, its logs and its memory.
        sockets: Ports at which this program has sockets: they listen (``tcp``) or are bound (``udp``).
        inherited: Descriptors of this program that it has, too, by the same numbers.
        listens: Ports that the firmware opens itself.
        environment: Environment variables to add.
        lock: File that an instance locks while it runs, with ``{instance}`` in its name; empty: none.
        core: Number of the processor core that it runs on alone, modulo those that there are; None: on all.
        program: What it is called in messages; empty: the name of the program.

    Raises:
        FirmwareError: It cannot be started.
    """

    def __init__(  # noqa: PLR0913  # each is an option
        self,
        name: str,
        command: Sequence[str],
        folder: Path,
        *,
        sockets: Sequence[LoopbackPort] = (),
        inherited: Sequence[int] = (),
        listens: Sequence[LoopbackPort] = (),
        environment: Mapping[str, str] | None = None,
        lock: str = "",
        core: int | None = None,
        program: str = "",
    ) -> None:
        self.name = name
        self.program = program or Path(command[0]).name
        self.console = folder / CONSOLE_FILE
        self.instance = 0
        """Number from which it derives its ports."""
        self.isolated = False
        """Whether it has a network of its own, in which nothing else is reached or reaches it."""
        self.sockets: list[socket.socket] = []
        self._ended = False
        self._threads = 0
        self._states: list[int] = []  # the file ``stat`` of each thread
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with self.console.open("wb") as console:
                asked = {
                    "command": list(command),
                    "environment": dict(environment or {}),
                    "sockets": sockets,
                    "listen": listens,
                    "lock": lock,
                    "core": core,
                    "isolate": ISOLATE,
                    "parent": os.getpid(),
                }
                self._start(asked, folder, console.fileno(), inherited)
        except OSError as error:
            raise FirmwareError(f"{name}: {self.program} cannot be started in {folder}: {error}") from error

    def _start(self, asked: dict[str, Any], folder: Path, console: int, inherited: Sequence[int]) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        launcher = [sys.executable, "-I", "-S", str(Path(__file__).with_name("launcher.py"))]
        with ours, theirs:
            self._process = subprocess.Popen(
                [*launcher, str(theirs.fileno()), json.dumps(asked)],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=console,
                stderr=subprocess.STDOUT,
                pass_fds=[theirs.fileno(), *inherited],
                start_new_session=True,  # Ctrl-C is this program's to answer
            )
            self._task_folder = Path(f"/proc/{self.pid}/task")
            self._processor_time = ~self.pid << 3 | _CPUCLOCK_SCHED
            theirs.close()
            ours.settimeout(_START_LIMIT_S)
            try:
                self._take(ours, len(asked["sockets"]))
            except BaseException:
                self.end()
                raise

    def _take(self, launcher: socket.socket, count: int) -> None:
        octets, descriptors, _, _ = socket.recv_fds(launcher, 65_536, count)
        self.sockets = [socket.socket(fileno=number) for number in descriptors]
        answer: dict[str, Any] = json.loads(octets) if octets else {"error": "the launcher ended at once"}
        problem = answer.get("error")
        if problem is None:
            octets = launcher.recv(65_536)  # none: the firmware runs
            problem = json.loads(octets)["error"] if octets else None
        if problem is not None:
            raise FirmwareError(f"{self.name}: {self.program} cannot be started: {problem}")
        self.instance, self.isolated = answer["instance"], answer["isolated"]

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def rest(self, *, started: bool) -> bool:
        """Wait until no thread of it has anything to do; return whether that is so within a second.

        Threads that do not follow its clock may still be at work when it has answered.

        Args:
            started: Whether its start script has ended; else the programs that run it are waited for, too.
        """
        quiet = 0
        pause, looks = (_STEP_PAUSE_S, 1) if started else (_START_PAUSE_S, _START_LOOKS)
        for _ in range(int(_REST_LIMIT_S / pause)):
            quiet = quiet + 1 if self._rests() and (started or not self._script_runs()) else 0
            if quiet == looks:
                return True
            select.select((), (), (), pause)
        return False

    def _rests(self) -> bool:
        """Return whether all threads sleep, and none has run while they were looked at one by one."""
        try:
            used = time.clock_gettime_ns(self._processor_time)
            threads = self._task_folder.stat().st_nlink
            if threads != self._threads:
                self._close_states()
                for thread in self._task_folder.iterdir():
                    self._states.append(os.open(thread / "stat", os.O_RDONLY))
                self._threads = threads
            sleep = not any(_runs(os.pread(file, 256, 0)) for file in self._states)
            return sleep and time.clock_gettime_ns(self._processor_time) == used
        except OSError:  # a thread, or the process, has ended
            self._threads = 0
            return self._process.poll() is not None

    def _script_runs(self) -> bool:
        """Return whether a program of its start script has something to do."""
        parents = [str(self.pid)]
        with suppress(OSError):  # one has ended
            while parents:
                parent = parents.pop()
                for child in Path("/proc", parent, "task", parent, "children").read_text().split():
                    if _runs(Path("/proc", child, "stat").read_bytes()):
                        return True
                    parents.append(child)
            return False
        # without that file, which not every kernel has, only the firmware itself is waited for
        return Path("/proc/self/task", str(os.getpid()), "children").exists()

    def _close_states(self) -> None:
        for file in self._states:
            os.close(file)
        self._states = []

    def last_words(self) -> str:
        """Return the last lines that it has printed, on one line; empty: none."""
        with suppress(OSError):
            with self.console.open("rb") as file:
                file.seek(max(0, self.console.stat().st_size - _LAST_OCTETS))
                lines = file.read().decode(errors="replace").splitlines()
            lines = _without_repeats([line.strip() for line in lines if line.strip()])
            return " · ".join(lines[-_LAST_LINES:])
        return ""

    def refuse_absent(self, parameters: Set[str], complaint: str) -> None:
        """Refuse parameters that it lacks, as its console says.

        Args:
            parameters: Names of those that it must have.
            complaint: Regular expression of a line about one that it lacks, with a group that is the name.

        Raises:
            FirmwareError: It lacks one; the text names it.
        """
        absent = parameters & set(re.findall(complaint, self.console.read_text(errors="replace")))
        if absent:
            raise lacks(f"{self.name}: {self.program}", absent)

    def ending(self) -> str:
        """Return how it has ended, with its last words; empty: it runs."""
        code = self._process.poll()
        if code is None:
            return ""
        how = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"
        return self._with_words(how)

    def error(self, what: str) -> FirmwareError:
        """Return the error that it has ended, else that *what* is wrong with it."""
        return FirmwareError(f"{self.name}: {self.program} {self.ending() or self._with_words(what)}")

    def parting(self, what: str) -> FirmwareError:
        """Return the error that it has ended, also if it does so within a moment, else *what*."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_PARTING_S)
        return self.error(what)

    def _with_words(self, what: str) -> str:
        words = self.last_words()
        return f"{what}; its last words: {words}" if words else what

    def end(self) -> None:
        """End it and what it has started, and close the sockets; at once where it does not end when asked."""
        self._close_states()
        for held in self.sockets:
            held.close()
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(_END_LIMIT_S)
            except subprocess.TimeoutExpired:  # it waits for its world, and hears no signal
                self._process.kill()
        self._process.wait()
        if not self._ended:  # later on the number may be that of others
            self._ended = True
            with suppress(ProcessLookupError):
                os.killpg(self.pid, signal.SIGKILL)
            self._shorten_console()

    def _shorten_console(self) -> None:
        """Count repeated lines: a firmware that waits for its world may print one every second."""
        with suppress(OSError):
            lines = self.console.read_text(errors="replace").splitlines()
            shorter = _without_repeats(lines)
            if len(shorter) < len(lines):
                self.console.write_text("".join(f"{line}\n" for line in shorter))


def _without_repeats(lines: Sequence[str]) -> list[str]:
    """Return *lines* with those that follow each other and are equal as one, with their number."""
    counted = [(line, len([*group])) for line, group in groupby(lines)]
    return [line if count == 1 else f"{line} ({count} times)" for line, count in counted]


def _runs(state: bytes) -> bool:
    """Return whether a thread has something to do, by the text of its file ``stat``."""
    return state[state.rindex(b")") + 2 : state.rindex(b")") + 3] in b"RD"
