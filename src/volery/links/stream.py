"""A link over a stream of bytes that may break and return: a TCP connection or a serial line.

A thread opens it and reads; everything else is house code. After a break it is opened again, first after half
a second and then at growing intervals.
"""

from __future__ import annotations

from abc import abstractmethod
from functools import partial
from typing import Protocol

from volery.base.time import MS, Ns, S
from volery.kernel.api import Kernel
from volery.links.codec import Codec
from volery.links.coded import CodedLink
from volery.links.parser import MAVLINK
from volery.links.pump import Pump

FIRST_RETRY: Ns = 500 * MS
LONGEST_RETRY: Ns = 5 * S
MOST_UNSENT = 65_536
"""Bytes that wait for a slow carrier; what comes on top is dropped, as a radio does."""


class Pipe(Protocol):
    """An open stream. All calls but ``read`` return at once; ``OSError`` says that it broke."""

    def fileno(self) -> int:
        """The descriptor to wait on."""

    def read(self) -> bytes:
        """What has arrived; empty if the other side has ended it."""

    def write(self, data: bytes) -> int:
        """How many bytes were taken."""

    def close(self) -> None:
        """Let go of it."""


class StreamLink(CodedLink):
    """Keeps one stream open."""

    def __init__(self, kernel: Kernel, name: str, codec: Codec = MAVLINK) -> None:
        super().__init__(kernel, name, codec)
        self._pipe: Pipe | None = None
        self._unsent = bytearray()
        self._wrong = "not connected yet"
        self._retry = FIRST_RETRY
        self._was_up = False
        self._pump = Pump(name, self._live)
        self._pump.start()

    @abstractmethod
    def _open(self) -> Pipe:
        """Open the stream, in the reader's thread. Raises ``OSError``."""

    @abstractmethod
    def _explain(self, error: OSError) -> str:
        """Why it could not be opened or broke, and what to do."""

    def _trouble(self) -> str:
        return super()._trouble() or self._wrong

    # -- the reader's thread

    def _live(self, pump: Pump) -> None:
        try:
            pipe = self._open()
        except OSError as error:
            wrong = self._explain(error)
            self._kernel.post(lambda: self._down(pump, None, wrong))
            return
        self._kernel.post(lambda: self._up(pump, pipe))
        wrong = self._read(pump, pipe)
        self._kernel.post(lambda: self._down(pump, pipe, wrong))

    def _read(self, pump: Pump, pipe: Pipe) -> str:
        try:
            while pump.readable(pipe.fileno()):
                data = pipe.read()
                if not data:
                    return "the other side closed the connection"
                self._kernel.post(partial(self.arrived, data))
        except OSError as error:
            return self._explain(error)
        return "closed"

    # -- house code

    def _up(self, pump: Pump, pipe: Pipe) -> None:
        if self._closed or pump is not self._pump:
            return
        self._pipe = pipe
        self._wrong = ""
        self._retry = FIRST_RETRY
        self._tell("back" if self._was_up else "up", self.name)
        self._was_up = True

    def _down(self, pump: Pump, pipe: Pipe | None, wrong: str) -> None:
        if pipe is not None:
            pipe.close()
        if self._closed or pump is not self._pump:
            return
        if self._pipe is not None:
            self._tell("lost", wrong)
        self._pipe = None
        self._wrong = wrong
        self._unsent.clear()
        self._parser.reset()
        pump.stop()
        self._kernel.call_at(self._kernel.now() + self._retry, self._again)
        self._retry = min(2 * self._retry, LONGEST_RETRY)

    def _again(self) -> None:
        if not self._closed:
            self._pump = Pump(self.name, self._live)
            self._pump.start()

    def _transmit(self, data: bytes) -> None:
        if self._pipe is None or len(self._unsent) + len(data) > MOST_UNSENT:
            return
        self._unsent += data
        try:
            taken = self._pipe.write(bytes(self._unsent))
        except OSError:
            return  # full: later; broken: the reader sees it, too, and says so
        del self._unsent[:taken]

    def close(self) -> None:
        """Let go of the stream and the thread."""
        super().close()
        self._pump.stop()
        if self._pipe is not None:
            self._pipe.close()
            self._pipe = None
