"""Asking the master. Every answer comes within seconds or is a ``LinkError``: rospy itself waits for ever."""

from __future__ import annotations

import http.client
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from xmlrpc.client import Error as RpcError
from xmlrpc.client import Fault, ServerProxy, Transport

from volery.base.errors import LinkError, LinkSilent

DEFAULT_URI = "http://localhost:11311"
URI_VARIABLE = "ROS_MASTER_URI"
PATIENCE_S = 3.0
FOUND = 1
FRESH_S = 0.5


class _Impatient(Transport):
    """HTTP that gives up."""

    def __init__(self, patience_s: float) -> None:
        super().__init__()
        self._patience_s = patience_s

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """A connection with a time-out."""
        connection = super().make_connection(host)
        connection.timeout = self._patience_s
        return connection


def uri_of_master() -> str:
    """The master's address: ``ROS_MASTER_URI``, or ROS's default."""
    return os.environ.get(URI_VARIABLE) or DEFAULT_URI


class Master:
    """The master at *uri*, asked in the name of *caller*."""

    def __init__(self, uri: str, caller: str, patience_s: float = PATIENCE_S) -> None:
        self.uri, self.caller = uri, caller
        self._patience_s = patience_s

    def ask(self, method: str, *arguments: Any) -> tuple[int, str, Any]:
        """Status code (1: well), its text, and the value. ``LinkError`` if nobody answers."""
        with self._errors():
            proxy = ServerProxy(self.uri, transport=_Impatient(self._patience_s))
            answer: Any = getattr(proxy, method)(self.caller, *arguments)
        code, text, value = answer
        return code, text, value

    def value(self, method: str, *arguments: Any) -> Any:
        """The value. ``LinkError`` if the master says no."""
        code, text, value = self.ask(method, *arguments)
        if code != FOUND:
            raise LinkError(f"ROS master {self.uri}: {method}: {text}")
        return value

    def find(self, method: str, *arguments: Any) -> Any:
        """The value, ``None`` if the master knows none."""
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
    """What type each topic carries, asked for as a whole: so it is kept for a moment."""

    def __init__(self, master: Master) -> None:
        self.master = master
        self._guard = threading.Lock()
        self._known: dict[str, str] = {}
        self._asked = -FRESH_S

    def of(self, topic: str) -> str:
        """Its type, empty for a topic that nobody has."""
        with self._guard:
            if time.monotonic() - self._asked > FRESH_S:
                self._known = dict(self.master.value("getTopicTypes"))
                self._asked = time.monotonic()
            return self._known.get(topic, "")

    def note(self, topic: str, kind: str) -> None:
        """Somebody here carries *kind* on it from now on."""
        with self._guard:
            self._known.setdefault(topic, kind)


def is_alive(node_uri: str) -> bool:
    """Whether a node answers at its own address."""
    try:
        return Master(node_uri, "/volery").ask("getPid")[0] == FOUND
    except LinkError:
        return False
