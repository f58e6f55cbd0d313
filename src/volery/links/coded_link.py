"""A link whose peer is reached by bytes: the codec on top of whatever moves them.

The thread behind a carrier: it waits until a file can be read and hands what it reads to the house.

A link over a stream of bytes that may break and return: a TCP connection or a serial line.

A thread opens it and reads; everything else is house code. After a break it is opened again, first after half
a second and then at growing intervals.
"""

from __future__ import annotations

import os
import select
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Protocol

from volery.base.time import MS, Ns, S
from volery.kernel.api import Kernel
from volery.links.link import Codec, Frame, Receiver, ReceiveStatistics
from volery.links.mavlink_codec import MAVLINK
from volery.trace.events import LinkState


class CodedLink(ABC):
    """Frames out as bytes, bytes in as frames. A subclass moves the bytes and calls ``arrived``."""

    def __init__(self, kernel: Kernel, name: str, codec: Codec = MAVLINK) -> None:
        self.name = name
        self._kernel = kernel
        self._codec = codec
        self._parser = codec.parser()
        self._receiver: Receiver | None = None
        self._sequence = 0
        self._closed = False

    @property
    def heard(self) -> ReceiveStatistics:
        """What has arrived so far: frames, text, garbage."""
        return self._parser.heard

    def send(self, frame: Frame) -> None:
        """Send at once; a link that is down or full drops it."""
        if self._closed:
            return
        data = self._codec.encode(frame, self._sequence)
        self._sequence = (self._sequence + 1) % 256
        self._transmit(data)

    def send_bytes(self, data: bytes) -> None:
        """Put *data* on the wire as it is, such as the plain text that an autopilot writes while it boots."""
        if not self._closed:
            self._transmit(data)

    def receive(self, receiver: Receiver) -> None:
        """From now on hand every frame that arrives to *receiver*."""
        self._receiver = receiver

    def arrived(self, data: bytes) -> None:
        """House code: these bytes have come in."""
        if self._closed:
            return
        for frame in self._parser.feed(data):
            if self._receiver is not None:
                self._receiver(frame)

    def problem(self) -> str:
        """What is wrong with the carrier, else with what it carries; empty if nothing is."""
        return self._trouble() or self._parser.problem()

    def close(self) -> None:
        """Nothing goes out or comes in any more."""
        self._closed = True

    @abstractmethod
    def _transmit(self, data: bytes) -> None:
        """Send bytes without waiting."""

    def _trouble(self) -> str:
        """What is wrong with the carrier, in words."""
        return "the link was closed" if self._closed else ""

    def _tell(self, state: str, detail: str) -> None:
        self._kernel.record(LinkState(self._kernel.now(), self.name, state, detail))


_JOIN_S = 5.0


class ReaderThread:
    """Runs *body* in a thread of its own from ``start`` to ``stop``. *body* waits only in ``readable``.

    What *body* hands to the house may be looked at before ``start`` returns: let go of it when all is in
    place.
    """

    def __init__(self, name: str, body: Callable[[ReaderThread], None]) -> None:
        self._wake_read, self._wake_write = os.pipe()
        self._stopped = threading.Event()
        self._body = body
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    @property
    def stopped(self) -> bool:
        """It was told to stop."""
        return self._stopped.is_set()

    def start(self) -> None:
        """Let it go, once."""
        self._thread.start()

    def readable(self, file: int) -> bool:
        """Wait until *file* (a descriptor) can be read, or has ended; False: stop."""
        ready, _, _ = select.select([file, self._wake_read], [], [])
        return not self.stopped and file in ready

    def stop(self) -> None:
        """Ask it to end, and wait for that. From any thread but its own."""
        if self.stopped:
            return
        self._stopped.set()
        os.write(self._wake_write, b"!")
        self._thread.join(_JOIN_S)
        if not self._thread.is_alive():
            os.close(self._wake_read)
            os.close(self._wake_write)

    def _run(self) -> None:
        self._body(self)


FIRST_RETRY: Ns = 500 * MS
LONGEST_RETRY: Ns = 5 * S
MOST_UNSENT = 65_536
"""Bytes that wait for a slow carrier; what comes on top is dropped, as a radio does."""


class ByteStream(Protocol):
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
        self._pipe: ByteStream | None = None
        self._unsent = bytearray()
        self._wrong = "not connected yet"
        self._retry = FIRST_RETRY
        self._was_up = False
        self._pump = ReaderThread(name, self._live)
        self._pump.start()

    @abstractmethod
    def _open(self) -> ByteStream:
        """Open the stream, in the reader's thread. Raises ``OSError``."""

    @abstractmethod
    def _explain(self, error: OSError) -> str:
        """Why it could not be opened or broke, and what to do."""

    def _trouble(self) -> str:
        return super()._trouble() or self._wrong

    # -- the reader's thread

    def _live(self, pump: ReaderThread) -> None:
        try:
            pipe = self._open()
        except OSError as error:
            wrong = self._explain(error)
            self._kernel.post(lambda: self._down(pump, None, wrong))
            return
        self._kernel.post(lambda: self._up(pump, pipe))
        wrong = self._read(pump, pipe)
        self._kernel.post(lambda: self._down(pump, pipe, wrong))

    def _read(self, pump: ReaderThread, pipe: ByteStream) -> str:
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

    def _up(self, pump: ReaderThread, pipe: ByteStream) -> None:
        if self._closed or pump is not self._pump:
            return
        self._pipe = pipe
        self._wrong = ""
        self._retry = FIRST_RETRY
        self._tell("back" if self._was_up else "up", self.name)
        self._was_up = True

    def _down(self, pump: ReaderThread, pipe: ByteStream | None, wrong: str) -> None:
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
            self._pump = ReaderThread(self.name, self._live)
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
