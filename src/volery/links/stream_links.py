"""Links over byte streams: TCP, as client or server, and serial ports."""

from __future__ import annotations

import errno
import os
import selectors
import socket
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial

import serial

from volery.base.errors import UsageError
from volery.base.time import MS, Ns, S
from volery.kernel.api import Kernel
from volery.links.coded_link import CONNECTION_FAULTS, MAX_UNSENT, ROOM, ByteStream, CodedLink, StreamLink
from volery.links.link import FrameParser, WireFormat
from volery.links.mavlink_codec import MAVLINK

MAX_CLIENTS = 64
"""Clients of one server. One more takes the place of another: of clients that have sent a frame, the one that
has been silent longest, but first of those that only listen, the one that has connected last."""
ACCEPT_RETRY: Ns = S
"""Time after which connections are accepted again when the process had no descriptor left."""
NOTICE_PERIOD: Ns = 10 * S
"""At most one notice about connections that were closed for want of room in this time."""
_SEND_BUFFER = 32_768
"""Bytes of a connection that wait in the system, which doubles it. By itself Linux lets megabytes wait: who
reads slowly would receive what is old by many seconds, and answers to requests only after that."""
_CONNECT_S = 3.0
_JOIN_S = 5.0
_READ_SIZE = 65_536
_CLIENT_READ_SIZE = 4096
"""Bytes of one client that are handled before the other clients have their turn."""
_READ_PERIOD: Ns = 10 * MS
"""Time between two such portions of a client that sends faster than they are handled: its socket fills."""
_NO_ROOM = frozenset((errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM))


class _SocketStream:
    """A connected socket as a ``ByteStream``."""

    def __init__(self, connected: socket.socket) -> None:
        connected.setblocking(False)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        self._socket = connected

    def fileno(self) -> int:
        return self._socket.fileno()

    def read(self) -> bytes:
        return self._socket.recv(_READ_SIZE)

    def write(self, data: bytes) -> int:
        return self._socket.send(data)

    def close(self) -> None:
        self._socket.close()


class TcpClient(StreamLink):
    """Connects to ``host:port``, and again whenever the connection breaks."""

    def __init__(
        self, kernel: Kernel, host: str, port: int, name: str = "", codec: WireFormat = MAVLINK
    ) -> None:
        self._host, self._port = host, port
        super().__init__(kernel, name or f"tcp://{host}:{port}", codec)

    def _open(self) -> ByteStream:
        return _SocketStream(socket.create_connection((self._host, self._port), _CONNECT_S))

    def _explain(self, error: Exception) -> str:
        where = f"{self._host}:{self._port}"
        if not isinstance(error, OSError):
            return f"{self._host!r} is no name of a host ({error})"
        if isinstance(error, ConnectionRefusedError):
            return f"nothing listens at tcp {where} (connection refused)"
        if isinstance(error, socket.gaierror):
            return f"there is no host {self._host!r} ({error.strerror})"
        if isinstance(error, TimeoutError):
            return f"tcp {where} does not answer"
        return f"tcp {where}: {error.strerror or error}"


class _SocketWatcher:
    """A thread that watches sockets and has the kernel handle those that are readable.

    A socket that has become readable is not watched until ``watch`` is called again. So each socket has at
    most one callback that waits for the kernel, and what its sender sends beyond that stays in the socket.

    Args:
        kernel: Calls *on_readable*.
        name: Name of the thread.
        on_readable: Framework callback with a socket that can be read or has ended.
    """

    def __init__(self, kernel: Kernel, name: str, on_readable: Callable[[socket.socket], None]) -> None:
        self._kernel = kernel
        self._on_readable = on_readable
        self._selector = selectors.DefaultSelector()
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_write, False)
        self._selector.register(self._wake_read, selectors.EVENT_READ)
        self._requests: deque[Callable[[], object]] = deque()
        self._stopped = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def watch(self, watched: socket.socket) -> None:
        """Report once when *watched* can be read or has ended."""
        self._request(lambda: self._selector.register(watched, selectors.EVENT_READ))

    def release(self, watched: socket.socket) -> None:
        """Close a socket, watched or not."""
        with suppress(OSError):
            watched.shutdown(socket.SHUT_RDWR)
        self._request(lambda: self._close(watched))

    def stop(self) -> None:
        """Stop the thread and close the sockets that it watches."""
        if self._stopped:
            return
        self._stopped = True
        self._wake()
        self._thread.join(_JOIN_S)
        if self._thread.is_alive():
            return
        while self._requests:
            self._requests.popleft()()
        for key in tuple(self._selector.get_map().values()):
            if isinstance(key.fileobj, socket.socket):
                self._close(key.fileobj)
        self._selector.close()
        os.close(self._wake_read)
        os.close(self._wake_write)

    def _request(self, action: Callable[[], object]) -> None:
        self._requests.append(action)
        self._wake()

    def _wake(self) -> None:
        with suppress(BlockingIOError):  # a full pipe wakes as well
            os.write(self._wake_write, b"!")

    def _run(self) -> None:
        while not self._stopped:
            for key, _ in self._selector.select():
                if isinstance(key.fileobj, socket.socket):
                    self._selector.unregister(key.fileobj)
                    self._kernel.post(partial(self._on_readable, key.fileobj))
                else:
                    os.read(self._wake_read, 4096)
            while self._requests:
                self._requests.popleft()()

    def _close(self, watched: socket.socket) -> None:
        with suppress(KeyError, ValueError):
            self._selector.unregister(watched)
        watched.close()


@dataclass(eq=False)
class _Client:
    """A client of a server: its half-received frame, unsent bytes, and when it last sent something."""

    stream: _SocketStream
    peer: str
    parser: FrameParser
    connected_at: Ns
    last_received: Ns
    unsent: bytearray = field(default_factory=bytearray)

    def transmit(self, data: bytes) -> None:
        """Send *data* without waiting. A client that does not read loses what does not fit."""
        if len(self.unsent) + len(data) > MAX_UNSENT:
            return
        self.unsent += data
        self.flush()

    def flush(self) -> None:
        """Send what waits, as far as the connection takes it now."""
        with suppress(OSError):
            taken = self.stream.write(bytes(self.unsent))
            del self.unsent[:taken]

    def has_room(self) -> bool:
        """Return whether little waits."""
        if len(self.unsent) >= ROOM:
            self.flush()
        return len(self.unsent) < ROOM

    def precedence(self) -> tuple[bool, Ns]:
        """Return what decides who is kept when there is no room; the least is closed."""
        sends = self.parser.statistics.frames > 0
        return sends, self.last_received if sends else -self.connected_at


class TcpServer(CodedLink):
    """Listens at ``host:port``. Frames are sent to all clients, and frames of all clients are received.

    At most ``MAX_CLIENTS`` are connected. When there is no room, or the process has no descriptor left, the
    state ``full`` is recorded and the server goes on.

    Args:
        kernel: Delivers what the thread receives.
        host: Address to listen at.
        port: Port to listen at; 0 chooses a free one, which ``self.port`` then holds.
        name: Name of the link in messages and in the trace.
        on_connect: Framework callback for each client that connects.
        codec: Protocol of the link.

    Raises:
        UsageError: The address cannot be used.
    """

    def __init__(
        self,
        kernel: Kernel,
        host: str,
        port: int,
        name: str = "",
        *,
        on_connect: Callable[[], None] | None = None,
        codec: WireFormat = MAVLINK,
    ) -> None:
        try:
            self._listener = socket.create_server((host, port))
        except CONNECTION_FAULTS as error:
            reason = getattr(error, "strerror", None) or error
            raise UsageError(f"cannot listen at tcp {host}:{port}: {reason}") from None
        self._listener.setblocking(False)
        self.port: int = self._listener.getsockname()[1]
        super().__init__(kernel, name or f"tcp://{host}:{self.port}", codec)
        self._on_connect = on_connect
        self._clients: dict[socket.socket, _Client] = {}
        self._next_notice: Ns = 0
        self._turned_away = 0
        self._watcher = _SocketWatcher(kernel, self.name, self._on_readable)
        self._watcher.watch(self._listener)

    @property
    def clients(self) -> int:
        """Number of connected clients."""
        return len(self._clients)

    def _on_readable(self, readable: socket.socket) -> None:
        if self._closed:
            readable.close()
        elif readable is self._listener:
            self._accept()
        elif readable in self._clients:
            self._read(readable, self._clients[readable])

    def _accept(self) -> None:
        try:
            connected, address = self._listener.accept()
        except OSError as error:
            if error.errno in _NO_ROOM:
                self._make_room(f"no connection can be accepted ({error.strerror})")
                self._kernel.call_at(self._kernel.now() + ACCEPT_RETRY, self._accept_again)
                return
        else:
            if len(self._clients) >= MAX_CLIENTS:
                self._make_room(f"{MAX_CLIENTS} clients are connected")
            self._admit(connected, f"{address[0]}:{address[1]}")
        self._accept_again()

    def _accept_again(self) -> None:
        if not self._closed:
            self._watcher.watch(self._listener)

    def _admit(self, connected: socket.socket, peer: str) -> None:
        try:
            stream = _SocketStream(connected)
        except OSError:  # it has gone already
            connected.close()
            return
        now = self._kernel.now()
        self._clients[connected] = _Client(stream, peer, self._codec.parser(), now, now)
        self._record("up", f"{peer} has connected")
        self._watcher.watch(connected)
        if self._on_connect is not None:
            self._on_connect()

    def _make_room(self, reason: str) -> None:
        self._turned_away += 1
        if self._clients:
            least = min(self._clients, key=lambda one: self._clients[one].precedence())
            self._disconnect(least, "was closed to make room for another client")
        now = self._kernel.now()
        if now >= self._next_notice:
            self._next_notice = now + NOTICE_PERIOD
            self._record("full", f"{reason}; connections that were closed so far: {self._turned_away}")

    def _read(self, readable: socket.socket, client: _Client) -> None:
        try:
            data = readable.recv(_CLIENT_READ_SIZE)
        except BlockingIOError:
            data = None
        except OSError:
            data = b""
        if data == b"":
            self._disconnect(readable, "has disconnected")
            return
        if data is not None and len(data) == _CLIENT_READ_SIZE:
            self._kernel.call_at(self._kernel.now() + _READ_PERIOD, partial(self._read_on, readable))
        else:
            self._watcher.watch(readable)
        if data is None:
            return
        client.last_received = self._kernel.now()
        for frame in client.parser.feed(data):
            if self._receiver is not None:
                self._receiver(frame)

    def _read_on(self, readable: socket.socket) -> None:
        if readable in self._clients:
            self._watcher.watch(readable)

    def _disconnect(self, connected: socket.socket, how: str) -> None:
        client = self._clients.pop(connected)
        self._watcher.release(connected)
        self._record("lost", f"{client.peer} {how}")

    def _connection_problem(self) -> str:
        if self._clients or self._closed:
            return super()._connection_problem()
        return f"no client has connected to {self.name}"

    def has_room(self) -> bool:
        """Return whether a client has room; who does not read must not hold up the others."""
        return not self._clients or any(client.has_room() for client in self._clients.values())

    def _transmit(self, data: bytes) -> None:
        for client in self._clients.values():
            client.transmit(data)

    def close(self) -> None:
        """Close all sockets and stop the thread."""
        super().close()
        self._watcher.stop()
        self._listener.close()
        for connected in self._clients:
            connected.close()
        self._clients.clear()


_SERIAL_READ_SIZE = 4096


class _SerialStream:
    """An open serial port as a ``ByteStream``; pyserial's errors are ``OSError``s."""

    def __init__(self, port: serial.Serial) -> None:
        self._port = port

    def fileno(self) -> int:
        return int(self._port.fileno())

    def read(self) -> bytes:
        return bytes(self._port.read(_SERIAL_READ_SIZE))

    def write(self, data: bytes) -> int:
        return int(self._port.write(data) or 0)

    def close(self) -> None:
        self._port.close()


class SerialLink(StreamLink):
    """Opens *device* at *baud*, and again whenever the device returns (a replugged adapter)."""

    def __init__(
        self, kernel: Kernel, device: str, baud: int, name: str = "", codec: WireFormat = MAVLINK
    ) -> None:
        self._device, self._baud = device, baud
        super().__init__(kernel, name or f"serial://{device}", codec)

    def _open(self) -> ByteStream:
        return _SerialStream(serial.Serial(self._device, self._baud, timeout=0, write_timeout=0))

    def _explain(self, error: Exception) -> str:
        if not isinstance(error, OSError):
            return f"{self._device}: {error}"
        if isinstance(error, serial.SerialException) and error.errno is None:
            return f"{self._device}: {error}"
        if error.errno == 2:
            return f"there is no device {self._device}; list them with: python -m serial.tools.list_ports"
        if error.errno == 13:
            return f"no permission to open {self._device}; add yourself to its group, usually dialout"
        return f"{self._device}: {error.strerror or error}"

    def _connection_problem(self) -> str:
        problem = super()._connection_problem()
        if not problem and not self.statistics.octets:
            return f"{self._device} is open at {self._baud} baud, but nothing arrives"
        return problem
