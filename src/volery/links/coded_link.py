"""Base classes of links over bytes: a codec on top of a connection, and streams that reconnect.

A connection waits for bytes in a thread of its own (``ReaderThread``), which posts them to the kernel. All
other code of these classes runs as framework callbacks and needs no locks.
"""

from __future__ import annotations

import os
import select
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

from volery.base.time import MS, Ns, S
from volery.kernel.api import Kernel
from volery.links.frame import Frame
from volery.links.link import Receiver, ReceiveStatistics, WireFormat
from volery.links.mavlink_codec import MAVLINK
from volery.trace.events import LinkState

FIRST_RETRY: Ns = 500 * MS
LONGEST_RETRY: Ns = 5 * S
MAX_UNSENT = 65_536
"""Bytes that wait for a slow connection. Data beyond this is dropped, as a radio drops it."""
ROOM = MAX_UNSENT // 4
"""While fewer bytes wait, there is room for a long answer beside telemetry."""
MAX_UNHANDLED = 262_144
"""Received bytes of one connection that wait for the kernel. What exceeds this stays in the socket, so that a
TCP sender is slowed down and datagrams are dropped."""
_OVERHEAD = 256
"""Bytes that a waiting callback itself takes, about."""
_JOIN_S = 5.0
CONNECTION_FAULTS = (OSError, ValueError, OverflowError)
"""What opening a connection raises; the last two for a name or a number that the system refuses."""


class CodedLink(ABC):
    """A link that encodes frames to bytes. A subclass moves the bytes and calls ``arrived``."""

    def __init__(self, kernel: Kernel, name: str, codec: WireFormat = MAVLINK) -> None:
        self.name = name
        self._kernel = kernel
        self._codec = codec
        self._parser = codec.parser()
        self._receiver: Receiver | None = None
        self._sequence = 0
        self._closed = False

    @property
    def statistics(self) -> ReceiveStatistics:
        """Counts of the frames, text and garbage received so far."""
        return self._parser.statistics

    def send(self, frame: Frame) -> None:
        """Send *frame* at once. A link that is down or full drops the frame."""
        if self._closed:
            return
        data = self._codec.encode(frame, self._sequence)
        self._sequence = (self._sequence + 1) % 256
        self._transmit(data)

    def send_bytes(self, data: bytes) -> None:
        """Send *data* as it is, for example the plain text that an autopilot writes while it boots."""
        if not self._closed:
            self._transmit(data)

    def receive(self, receiver: Receiver) -> None:
        """Call *receiver* with every frame that arrives from now on."""
        self._receiver = receiver

    def arrived(self, data: bytes) -> None:
        """Decode received bytes. Framework callback."""
        if self._closed:
            return
        for frame in self._parser.feed(data):
            if self._receiver is not None:
                self._receiver(frame)

    def problem(self) -> str:
        """Return what is wrong with the connection, else with the received bytes; ``""`` if nothing is."""
        return self._connection_problem() or self._parser.problem()

    def close(self) -> None:
        """Send and receive nothing from now on."""
        self._closed = True

    @abstractmethod
    def _transmit(self, data: bytes) -> None:
        """Send bytes without waiting."""

    def _connection_problem(self) -> str:
        return "the link was closed" if self._closed else ""

    def _record(self, state: str, detail: str) -> None:
        self._kernel.record(LinkState(self._kernel.now(), self.name, state, detail))


class ReaderThread:
    """A thread that runs *body* from ``start`` to ``stop``. *body* may block only in this class's methods.

    *body* may post to the kernel before ``start`` has returned, so start the thread when its owner is
    complete.
    """

    def __init__(self, name: str, body: Callable[[ReaderThread], None]) -> None:
        self._wake_read, self._wake_write = os.pipe()
        self._stopped = threading.Event()
        self._handled = threading.Condition()
        self._unhandled = 0
        self._thread = threading.Thread(target=body, args=(self,), name=name, daemon=True)

    def start(self) -> None:
        """Start the thread; call once."""
        self._thread.start()

    def readable(self, file: int) -> bool:
        """Wait until descriptor *file* can be read or has ended; return False if the thread must stop."""
        poll = select.poll()  # select() refuses descriptors above 1023
        poll.register(file, select.POLLIN)
        poll.register(self._wake_read, select.POLLIN)
        ready = [descriptor for descriptor, _ in poll.poll()]
        return not self._stopped.is_set() and file in ready

    def post(self, kernel: Kernel, handle: Callable[[bytes], None], data: bytes) -> None:
        """Let *kernel* call *handle* with *data*; wait first while ``MAX_UNHANDLED`` bytes wait."""
        size = len(data) + _OVERHEAD
        with self._handled:
            self._handled.wait_for(lambda: self._unhandled < MAX_UNHANDLED or self._stopped.is_set())
            self._unhandled += size

        def handle_and_count() -> None:
            with self._handled:
                self._unhandled -= size
                self._handled.notify()
            handle(data)

        kernel.post(handle_and_count)

    def stop(self) -> None:
        """Stop the thread and wait for its end. Must not be called from the thread itself."""
        if self._stopped.is_set():
            return
        self._stopped.set()
        with self._handled:
            self._handled.notify()
        os.write(self._wake_write, b"!")
        self._thread.join(_JOIN_S)
        if not self._thread.is_alive():
            os.close(self._wake_read)
            os.close(self._wake_write)


class ByteStream(Protocol):
    """An open stream of bytes. All methods but ``read`` return at once; ``OSError`` means that it broke."""

    def fileno(self) -> int:
        """Return the descriptor to wait on."""

    def read(self) -> bytes:
        """Return the received bytes; ``b""`` if the other side has closed the stream."""

    def write(self, data: bytes) -> int:
        """Return how many bytes were accepted."""

    def close(self) -> None:
        """Close the stream."""


class StreamLink(CodedLink):
    """A link over a stream that may break and return: a TCP connection or a serial line.

    The stream is opened in the reader thread. After a break it is opened again, first after ``FIRST_RETRY``
    and then at intervals that double up to ``LONGEST_RETRY``.
    """

    def __init__(self, kernel: Kernel, name: str, codec: WireFormat = MAVLINK) -> None:
        super().__init__(kernel, name, codec)
        self._stream: ByteStream | None = None
        self._unsent = bytearray()
        self._stream_problem = "not connected yet"
        self._retry = FIRST_RETRY
        self._was_up = False
        self._reader = ReaderThread(name, self._open_and_read)
        self._reader.start()

    @abstractmethod
    def _open(self) -> ByteStream:
        """Open the stream. Runs in the reader thread and raises one of ``CONNECTION_FAULTS``."""

    @abstractmethod
    def _explain(self, error: Exception) -> str:
        """Return why the stream could not be opened or broke, and the remedy."""

    def _connection_problem(self) -> str:
        return super()._connection_problem() or self._stream_problem

    # -- reader thread

    def _open_and_read(self, reader: ReaderThread) -> None:
        try:
            stream = self._open()
        except CONNECTION_FAULTS as error:
            problem = self._explain(error)
            self._kernel.post(lambda: self._on_down(reader, None, problem))
            return
        self._kernel.post(lambda: self._on_up(reader, stream))
        problem = self._read(reader, stream)
        self._kernel.post(lambda: self._on_down(reader, stream, problem))

    def _read(self, reader: ReaderThread, stream: ByteStream) -> str:
        try:
            while reader.readable(stream.fileno()):
                data = stream.read()
                if not data:
                    return "the other side closed the connection"
                reader.post(self._kernel, self.arrived, data)
        except OSError as error:
            return self._explain(error)
        return "closed"

    # -- framework callbacks

    def _on_up(self, reader: ReaderThread, stream: ByteStream) -> None:
        if self._closed or reader is not self._reader:
            return
        self._stream = stream
        self._stream_problem = ""
        self._retry = FIRST_RETRY
        self._record("back" if self._was_up else "up", self.name)
        self._was_up = True

    def _on_down(self, reader: ReaderThread, stream: ByteStream | None, problem: str) -> None:
        if stream is not None:
            stream.close()
        if self._closed or reader is not self._reader:
            return
        if self._stream is not None:
            self._record("lost", problem)
        self._stream = None
        self._stream_problem = problem
        self._unsent.clear()
        self._parser.reset()
        reader.stop()
        self._kernel.call_at(self._kernel.now() + self._retry, self._reconnect)
        self._retry = min(2 * self._retry, LONGEST_RETRY)

    def _reconnect(self) -> None:
        if not self._closed:
            self._reader = ReaderThread(self.name, self._open_and_read)
            self._reader.start()

    def has_room(self) -> bool:
        """See ``FillingLink``."""
        if self._stream is not None and len(self._unsent) >= ROOM:
            self._flush(self._stream)
        return len(self._unsent) < ROOM

    def _transmit(self, data: bytes) -> None:
        if self._stream is None or len(self._unsent) + len(data) > MAX_UNSENT:
            return
        self._unsent += data
        self._flush(self._stream)

    def _flush(self, stream: ByteStream) -> None:
        with suppress(OSError):  # the buffer is full, or the stream broke, which the reader thread reports
            taken = stream.write(bytes(self._unsent))
            del self._unsent[:taken]

    def close(self) -> None:
        """Close the stream and stop the thread."""
        super().close()
        self._reader.stop()
        if self._stream is not None:
            self._stream.close()
            self._stream = None
