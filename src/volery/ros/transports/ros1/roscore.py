"""``roscore`` as a process of ours: own port, own pid, loopback, stopped at the end."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Self
from urllib.parse import urlsplit

from volery.base.errors import LinkError, LinkSilent, UsageError
from volery.ros.transports.ros1.master import DEFAULT_URI, Master

READY_S, GONE_S, GLANCE_S = 20.0, 5.0, 0.05


def master_answers(uri: str) -> bool:
    """Whether a ROS master answers at *uri*."""
    try:
        Master(uri, "/volery").value("getPid")
    except LinkError:
        return False
    return True


def environment(uri: str) -> dict[str, str]:
    """Of a ROS program that talks to the master at *uri* on this machine: without our virtual environment."""
    kept = {key: value for key, value in os.environ.items() if key not in ("VIRTUAL_ENV", "PYTHONPATH")}
    ours = str(Path(sys.executable).parent)
    path = [one for one in kept.get("PATH", "").split(os.pathsep) if one and one != ours]
    return {**kept, "PATH": os.pathsep.join(path), "ROS_MASTER_URI": uri, "ROS_IP": "127.0.0.1"}


class Roscore:
    """A master and rosout at *uri*; ``with`` starts and stops it.

    ``UsageError`` where no roscore is installed, ``LinkSilent`` if it does not come up in time, with the end
    of its log.
    """

    def __init__(self, uri: str = DEFAULT_URI, extra: Mapping[str, str] | None = None) -> None:
        self.uri = uri
        self._port = urlsplit(uri).port or 11311
        self._extra = dict(extra or {})
        self._logs: TemporaryDirectory[str] | None = None
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int:
        """Its process; 0 while it does not run."""
        return self._process.pid if self._process is not None else 0

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.stop()

    def start(self) -> None:
        """Start it and wait until it answers."""
        program = shutil.which("roscore")
        if program is None:
            raise UsageError("no roscore on this machine: on Debian install python3-roslaunch and rosout")
        self._logs = TemporaryDirectory(prefix="roscore-")
        log = Path(self._logs.name) / "output.txt"
        with log.open("wb") as output:
            self._process = subprocess.Popen(
                [program, "-p", str(self._port)],
                env={**environment(self.uri), "ROS_LOG_DIR": self._logs.name, **self._extra},
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        try:
            self._wait(log)
        except BaseException:  # Ctrl-C as well: nobody else knows of it yet
            self.stop()
            raise

    def _wait(self, log: Path) -> None:
        assert self._process is not None
        end = time.monotonic() + READY_S
        while not self._ready():
            over = self._process.poll() is not None
            if over or time.monotonic() > end:
                said = log.read_text(errors="replace")[-1000:]
                what = "ended" if over else f"did not answer within {READY_S:g} s"
                raise LinkSilent(f"roscore at {self.uri} {what}; it said: {said}")
            time.sleep(GLANCE_S)

    def _ready(self) -> bool:
        """With rosout, which is the last to come."""
        try:
            return Master(self.uri, "/volery").find("lookupNode", "/rosout") is not None
        except LinkError:
            return False

    def stop(self, how: int = signal.SIGINT) -> None:
        """Stop it (roscpp's rosout says good-bye at SIGINT only), harder if it takes long."""
        process, self._process = self._process, None
        if process is not None:
            _end(process, how)
        if self._logs is not None:
            self._logs.cleanup()
            self._logs = None


def _end(process: subprocess.Popen[bytes], how: int) -> None:
    """End the process and what it has started: each in a session of its own, so they are looked up first."""
    started = _descendants(process.pid)
    with suppress(ProcessLookupError):
        process.send_signal(how)
    with suppress(subprocess.TimeoutExpired):
        process.wait(GONE_S)
    for pid in (process.pid, *started):
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    process.wait()


def _descendants(pid: int) -> list[int]:
    """The processes that *pid* has started, and those that they have started."""
    children: list[int] = []
    for listed in Path(f"/proc/{pid}/task").glob("*/children"):
        with suppress(OSError):
            children += [int(one) for one in listed.read_text().split()]
    return [*children, *(deeper for child in children for deeper in _descendants(child))]
