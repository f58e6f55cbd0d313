"""What the run's process and a component's say to each other: pickles over two pipes that nobody else has."""

from __future__ import annotations

import os
import pickle
import threading
from contextlib import suppress
from typing import Any, NamedTuple, Self

from volery.base.position import Position
from volery.model.system import System


class WorkerOrder(NamedTuple):
    """The first thing that a component's process hears: who it is, and on which graph."""

    system: System
    name: str
    graph: str
    seed: int


class Begin(NamedTuple):
    """All are ready: begin."""


class Stop(NamedTuple):
    """Come to an end, and bring down the vehicles that you command."""

    why: str


class TruthRequest(NamedTuple):
    """Where is that vehicle really? For the judgement of an operation that has ended."""

    vehicle: str


class TruthReply(NamedTuple):
    """The answer."""

    position: Position


class Ready(NamedTuple):
    """It is on the graph and can be called."""


class StartFailed(NamedTuple):
    """It cannot begin."""

    why: str


class EndingBegun(NamedTuple):
    """It has begun to end, by itself (``failed``) or since it was told so."""

    status: str
    why: str


class Pipe:
    """Two ends: what is said comes from any thread, what is heard goes to one."""

    def __init__(self, inward: int, outward: int) -> None:
        self.ends = inward, outward
        self._in, self._out = os.fdopen(inward, "rb"), os.fdopen(outward, "wb")
        self._guard = threading.Lock()

    @classmethod
    def pair(cls) -> tuple[Self, tuple[int, int]]:
        """This process's pipe, and the two descriptors (in, out) of the other's."""
        there_in, here_out = os.pipe()
        here_in, there_out = os.pipe()
        return cls(here_in, here_out), (there_in, there_out)

    def say(self, thing: object) -> bool:
        """Tell the other side; False if there is nobody any more."""
        data = pickle.dumps(thing, pickle.HIGHEST_PROTOCOL)
        with self._guard:
            try:
                self._out.write(data)
                self._out.flush()
            except (OSError, ValueError):
                return False
        return True

    def hear(self) -> Any:
        """The next thing. ``EOFError`` if the other side is gone."""
        try:
            return pickle.load(self._in)
        except (pickle.UnpicklingError, OSError, ValueError) as error:
            raise EOFError from error

    def close(self) -> None:
        """Say no more."""
        with self._guard, suppress(OSError):  # what could not be said any more
            self._out.close()
