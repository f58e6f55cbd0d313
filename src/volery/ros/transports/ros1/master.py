"""Requests to a ROS master with a time-out, and ``roscore`` as a child process.

rospy itself waits for a master without limit; here every request ends within seconds, or with a
``LinkError``. A roscore of this process has its own port, listens on the loopback interface, and is stopped
at the end.
"""

from __future__ import annotations

import http.client
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, Self
from urllib.parse import urlsplit
from xmlrpc.client import Error as RpcError
from xmlrpc.client import Fault, ServerProxy, Transport

from volery.base.errors import LinkError, LinkSilent, UsageError

DEFAULT_URI = "http://localhost:11311"
URI_VARIABLE = "ROS_MASTER_URI"
PATIENCE_S = 10.0
FOUND = 1
FRESH_S = 0.5


class _Impatient(Transport):
    """HTTP transport with a time-out."""

    def __init__(self, patience_s: float) -> None:
        super().__init__()
        self._patience_s = patience_s

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """Return a connection with the time-out."""
        connection = super().make_connection(host)
        connection.timeout = self._patience_s
        return connection


def uri_of_master() -> str:
    """Return the master's URI: ``ROS_MASTER_URI``, or ROS's default."""
    return os.environ.get(URI_VARIABLE) or DEFAULT_URI


class Master:
    """The master at `uri`; requests are made in the name of the node `caller`."""

    def __init__(self, uri: str, caller: str, patience_s: float = PATIENCE_S) -> None:
        self.uri, self.caller = uri, caller
        self._patience_s = patience_s

    def ask(self, method: str, *arguments: Any) -> tuple[int, str, Any]:
        """Return status code (1: success), its text, and the value; ``LinkError`` if there is no answer."""
        with self._errors():
            proxy = ServerProxy(self.uri, transport=_Impatient(self._patience_s))
            answer: Any = getattr(proxy, method)(self.caller, *arguments)
        code, text, value = answer
        return code, text, value

    def value(self, method: str, *arguments: Any) -> Any:
        """Return the value of a request; ``LinkError`` if the master reports a failure."""
        code, text, value = self.ask(method, *arguments)
        if code != FOUND:
            raise LinkError(f"ROS master {self.uri}: {method}: {text}")
        return value

    def find(self, method: str, *arguments: Any) -> Any:
        """Return the value of a request; None if the master reports a failure."""
        code, _, value = self.ask(method, *arguments)
        return value if code == FOUND else None

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except (OSError, http.client.HTTPException) as error:
            raise LinkSilent(
                f"no ROS master answers at {self.uri} ({error}): start roscore or set {URI_VARIABLE}"
            ) from error
        except (Fault, RpcError, ValueError, TypeError) as error:
            raise LinkError(f"what answers at {self.uri} is no ROS master: {error}") from error


class TopicTypes:
    """Types of all topics, requested together and cached for `FRESH_S`."""

    def __init__(self, master: Master) -> None:
        self.master = master
        self._guard = threading.Lock()
        self._known: dict[str, str] = {}
        self._asked = -FRESH_S

    def of(self, topic: str) -> str:
        """Return the type of `topic`; empty for a topic without registrations."""
        with self._guard:
            if time.monotonic() - self._asked > FRESH_S:
                self._known = dict(self.master.value("getTopicTypes"))
                self._asked = time.monotonic()
            return self._known.get(topic, "")

    def note(self, topic: str, kind: str) -> None:
        """Store that a node of this process uses `topic` with type `kind`."""
        with self._guard:
            self._known.setdefault(topic, kind)


def is_alive(node_uri: str) -> bool:
    """Return whether a node answers at its URI."""
    try:
        return Master(node_uri, "/volery").ask("getPid")[0] == FOUND
    except LinkError:
        return False


READY_S, GONE_S, GLANCE_S = 60.0, 5.0, 0.05
PORTS_TRIED = 3


def master_answers(uri: str) -> bool:
    """Return whether a ROS master answers at `uri`."""
    try:
        Master(uri, "/volery").value("getPid")
    except LinkError:
        return False
    return True


def environment(uri: str) -> dict[str, str]:
    """Return the environment of a ROS program of the master at `uri`, without this virtual environment."""
    kept = {key: value for key, value in os.environ.items() if key not in ("VIRTUAL_ENV", "PYTHONPATH")}
    ours = str(Path(sys.executable).parent)
    path = [word for word in kept.get("PATH", "").split(os.pathsep) if word and word != ours]
    return {**kept, "PATH": os.pathsep.join(path), "ROS_MASTER_URI": uri, "ROS_IP": "127.0.0.1"}


class Roscore:
    """A master and rosout at `uri`; ``with`` starts and stops them.

    Raises:
        UsageError: roscore is not installed.
        LinkSilent: it is not ready in time; the message has the end of its log.
    """

    def __init__(self, uri: str = DEFAULT_URI, extra: Mapping[str, str] | None = None) -> None:
        self.uri = uri
        self._port = urlsplit(uri).port or 11311
        self._extra = dict(extra or {})
        self._logs: TemporaryDirectory[str] | None = None
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int:
        """Process id; 0 while it does not run."""
        return self._process.pid if self._process is not None else 0

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.stop()

    def start(self) -> None:
        """Start roscore and wait until it answers."""
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
        except BaseException:  # Ctrl-C as well: no other code can stop it yet
            self.stop()
            raise

    def _wait(self, log: Path) -> None:
        assert self._process is not None
        end = time.monotonic() + READY_S
        while not self._ready():
            over = self._process.poll() is not None
            if over or time.monotonic() > end:
                output = log.read_text(errors="replace")[-1000:]
                what = "ended" if over else f"did not answer within {READY_S:g} s"
                raise LinkSilent(f"roscore at {self.uri} {what}; its output: {output}")
            time.sleep(GLANCE_S)

    def _ready(self) -> bool:
        """Return whether rosout, which starts last, is registered."""
        try:
            return Master(self.uri, "/volery").find("lookupNode", "/rosout") is not None
        except LinkError:
            return False

    def stop(self, how: int = signal.SIGINT) -> None:
        """Stop roscore with a signal (rosout unregisters at SIGINT only), then by force."""
        process, self._process = self._process, None
        if process is not None:
            _end(process, how)
        if self._logs is not None:
            self._logs.cleanup()
            self._logs = None


@contextmanager
def own_roscore() -> Iterator[Roscore]:
    """Run roscore at a free port of loopback for the duration of the context.

    Another process may take the port before roscore has bound it; then another one is tried.

    Raises:
        UsageError: roscore is not installed.
        LinkSilent: it is not ready in time, or no port was to be had.
    """
    for left in reversed(range(PORTS_TRIED)):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            core = Roscore(f"http://127.0.0.1:{free.getsockname()[1]}")
        try:
            core.start()
            break
        except LinkSilent:
            if not left:
                raise
    try:
        yield core
    finally:
        core.stop()


def _end(process: subprocess.Popen[bytes], how: int) -> None:
    """End a process and its descendants, which have sessions of their own and are looked up first."""
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
    """Return the process ids of the descendants of `pid`."""
    children: list[int] = []
    for listed in Path(f"/proc/{pid}/task").glob("*/children"):
        with suppress(OSError):
            children += [int(word) for word in listed.read_text().split()]
    return [*children, *(deeper for child in children for deeper in _descendants(child))]
