"""Links over TCP: a client that reconnects, and a server that several clients share."""

from __future__ import annotations

import socket
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from volery.base.errors import UsageError
from volery.kernel.api import Kernel
from volery.links.coded_link import MAX_UNSENT, ByteStream, CodedLink, ReaderThread, StreamLink
from volery.links.link import Codec, FrameParser
from volery.links.mavlink_codec import MAVLINK

_CONNECT_S = 3.0
_READ_SIZE = 65_536


class _SocketStream:
    """A connected socket as a ``ByteStream``."""

    def __init__(self, connected: socket.socket) -> None:
        connected.setblocking(False)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
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

    def __init__(self, kernel: Kernel, host: str, port: int, name: str = "", codec: Codec = MAVLINK) -> None:
        self._host, self._port = host, port
        super().__init__(kernel, name or f"tcp://{host}:{port}", codec)

    def _open(self) -> ByteStream:
        return _SocketStream(socket.create_connection((self._host, self._port), _CONNECT_S))

    def _explain(self, error: OSError) -> str:
        where = f"{self._host}:{self._port}"
        if isinstance(error, ConnectionRefusedError):
            return f"nothing listens at tcp {where} (connection refused)"
        if isinstance(error, socket.gaierror):
            return f"there is no host {self._host!r} ({error.strerror})"
        if isinstance(error, TimeoutError):
            return f"tcp {where} does not answer"
        return f"tcp {where}: {error.strerror or error}"


class _Client:
    """One client of a server, with its own reader thread and its own half-received frame."""

    def __init__(
        self, server: TcpServer, kernel: Kernel, connected: socket.socket, peer: str, parser: FrameParser
    ) -> None:
        self.peer = peer
        self._server = server
        self._kernel = kernel
        self._stream = _SocketStream(connected)
        self._parser = parser
        self._unsent = bytearray()
        self._reader = ReaderThread(f"tcp {peer}", self._read)
        self._reader.start()

    def _read(self, reader: ReaderThread) -> None:
        with suppress(OSError):
            while reader.readable(self._stream.fileno()):
                data = self._stream.read()
                if not data:
                    break
                self._kernel.post(partial(self._server.received, self._parser, data))
        self._kernel.post(partial(self._server.disconnected, self))

    def transmit(self, data: bytes) -> None:
        """Send *data* without waiting. A client that does not read loses what does not fit."""
        if len(self._unsent) + len(data) > MAX_UNSENT:
            return
        self._unsent += data
        with suppress(OSError):
            taken = self._stream.write(bytes(self._unsent))
            del self._unsent[:taken]

    def close(self) -> None:
        self._reader.stop()
        self._stream.close()


class TcpServer(CodedLink):
    """Listens at ``host:port``. Frames are sent to all clients, and frames of all clients are received.

    Args:
        kernel: Delivers what the threads receive.
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
        codec: Codec = MAVLINK,
    ) -> None:
        try:
            self._listener = socket.create_server((host, port))
        except OSError as error:
            raise UsageError(f"cannot listen at tcp {host}:{port}: {error.strerror or error}") from None
        self.port: int = self._listener.getsockname()[1]
        super().__init__(kernel, name or f"tcp://{host}:{self.port}", codec)
        self._on_connect = on_connect
        self._clients: list[_Client] = []
        self._reader = ReaderThread(self.name, self._accept)
        self._reader.start()

    @property
    def clients(self) -> int:
        """Number of connected clients."""
        return len(self._clients)

    def _accept(self, reader: ReaderThread) -> None:
        while reader.readable(self._listener.fileno()):
            with suppress(OSError):
                connected, address = self._listener.accept()
                self._kernel.post(partial(self._connected, connected, f"{address[0]}:{address[1]}"))

    def _connected(self, connected: socket.socket, peer: str) -> None:
        if self._closed:
            connected.close()
            return
        self._clients.append(_Client(self, self._kernel, connected, peer, self._codec.parser()))
        self._record("up", f"{peer} has connected")
        if self._on_connect is not None:
            self._on_connect()

    def received(self, parser: FrameParser, data: bytes) -> None:
        """Decode bytes of the client that *parser* belongs to. Framework callback."""
        if self._closed:
            return
        frames = parser.feed(data)
        if self._receiver is not None:
            for frame in frames:
                self._receiver(frame)

    def disconnected(self, client: _Client) -> None:
        """Remove a client whose connection has ended. Framework callback."""
        if client in self._clients:
            self._clients.remove(client)
            client.close()
            self._record("lost", f"{client.peer} has disconnected")

    def _connection_problem(self) -> str:
        if self._clients or self._closed:
            return super()._connection_problem()
        return f"no client has connected to {self.name}"

    def _transmit(self, data: bytes) -> None:
        for client in self._clients:
            client.transmit(data)

    def close(self) -> None:
        """Close all sockets and stop all threads."""
        super().close()
        self._reader.stop()
        self._listener.close()
        for client in self._clients:
            client.close()
        self._clients.clear()
