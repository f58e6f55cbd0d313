"""Messages between the run's process and a worker: pickles over two anonymous pipes."""

from __future__ import annotations

import os
import pickle
import threading
from contextlib import suppress
from typing import Any, NamedTuple, Protocol, Self

from volery.base.position import Position
from volery.model.system import System


class WorkerOrder(NamedTuple):
    """First message to a worker: the model, its component, the graph and the seed."""

    system: System
    name: str
    graph: str
    seed: int


class Begin(NamedTuple):
    """To a worker: all processes are ready, start the component."""


class Stop(NamedTuple):
    """To a worker: end, and land the vehicles that the component commands."""

    why: str


class TruthRequest(NamedTuple):
    """From a worker: request the true position of a vehicle, to judge a finished operation."""

    vehicle: str


class TruthReply(NamedTuple):
    """To a worker: the requested true position."""

    position: Position


class Ready(NamedTuple):
    """From a worker: the component is on the graph and can be called."""


class StartFailed(NamedTuple):
    """From a worker: the component cannot start."""

    why: str


class EndingBegun(NamedTuple):
    """From a worker: the component has begun to end, by itself (``failed``) or after ``Stop``."""

    status: str
    why: str


class RunSide(Protocol):
    """The run, as a component's process sees it."""

    def send(self, thing: object) -> bool:
        """Send a message or an event. Return False if the run is gone."""

    def receive(self) -> Any:
        """Block until the next message. Raises ``EOFError`` if the run is gone."""


class Pipe:
    """One end of a connection. Any thread may send, one thread receives."""

    def __init__(self, inward: int, outward: int) -> None:
        self.ends = inward, outward
        self._in, self._out = os.fdopen(inward, "rb"), os.fdopen(outward, "wb")
        self._guard = threading.Lock()

    @classmethod
    def pair(cls) -> tuple[Self, tuple[int, int]]:
        """Return the pipe of this process and the descriptors (in, out) of the other."""
        there_in, here_out = os.pipe()
        here_in, there_out = os.pipe()
        return cls(here_in, here_out), (there_in, there_out)

    def send(self, thing: object) -> bool:
        """Send a message. Return False if the other process is gone."""
        data = pickle.dumps(thing, pickle.HIGHEST_PROTOCOL)
        with self._guard:
            try:
                self._out.write(data)
                self._out.flush()
            except (OSError, ValueError):
                return False
        return True

    def receive(self) -> Any:
        """Block until the next message. Raises ``EOFError`` if the other process is gone."""
        try:
            return pickle.load(self._in)
        except (pickle.UnpicklingError, OSError, ValueError) as error:
            raise EOFError from error

    def close(self) -> None:
        """Close the sending side."""
        with self._guard, suppress(OSError):  # unsent data is lost
            self._out.close()
