"""TCP: a client that connects and reconnects, a server that several clients share."""

from __future__ import annotations

import socket
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from volery.base.errors import UsageError
from volery.kernel.api import Kernel
from volery.links.coded_link import MOST_UNSENT, ByteStream, CodedLink, ReaderThread, StreamLink
from volery.links.link import Codec, FrameParser
from volery.links.mavlink_codec import MAVLINK

_CONNECT_S = 3.0
_PORTION = 65_536


class _SocketPipe:
    """A connected socket."""

    def __init__(self, connected: socket.socket) -> None:
        connected.setblocking(False)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = connected

    def fileno(self) -> int:
        return self._socket.fileno()

    def read(self) -> bytes:
        return self._socket.recv(_PORTION)

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
        return _SocketPipe(socket.create_connection((self._host, self._port), _CONNECT_S))

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
    """One of those who are connected to a server: its own thread, its own half-received frame."""

    def __init__(
        self, server: TcpServer, kernel: Kernel, connected: socket.socket, who: str, parser: FrameParser
    ) -> None:
        self.who = who
        self._server = server
        self._kernel = kernel
        self._pipe = _SocketPipe(connected)
        self._parser = parser
        self._unsent = bytearray()
        self._pump = ReaderThread(f"tcp {who}", self._read)
        self._pump.start()

    def _read(self, pump: ReaderThread) -> None:
        with suppress(OSError):
            while pump.readable(self._pipe.fileno()):
                data = self._pipe.read()
                if not data:
                    break
                self._kernel.post(partial(self._server.said, self._parser, data))
        self._kernel.post(partial(self._server.left, self))

    def transmit(self, data: bytes) -> None:
        """Send without waiting; one who does not read loses what does not fit."""
        if len(self._unsent) + len(data) > MOST_UNSENT:
            return
        self._unsent += data
        with suppress(OSError):
            taken = self._pipe.write(bytes(self._unsent))
            del self._unsent[:taken]

    def close(self) -> None:
        self._pump.stop()
        self._pipe.close()


class TcpServer(CodedLink):
    """Listens at ``host:port``. All clients hear what is sent; what any of them says arrives.

    ``port`` 0 takes a free one, which ``self.port`` then names. *joined* is called, as house code, for each
    client that connects. Raises ``UsageError`` if one cannot listen there.
    """

    def __init__(
        self,
        kernel: Kernel,
        host: str,
        port: int,
        name: str = "",
        *,
        joined: Callable[[], None] | None = None,
        codec: Codec = MAVLINK,
    ) -> None:
        try:
            self._listener = socket.create_server((host, port))
        except OSError as error:
            raise UsageError(f"cannot listen at tcp {host}:{port}: {error.strerror or error}") from None
        self.port: int = self._listener.getsockname()[1]
        super().__init__(kernel, name or f"tcp://{host}:{self.port}", codec)
        self._joined = joined
        self._clients: list[_Client] = []
        self._pump = ReaderThread(self.name, self._accept)
        self._pump.start()

    @property
    def clients(self) -> int:
        """How many are connected."""
        return len(self._clients)

    def _accept(self, pump: ReaderThread) -> None:
        while pump.readable(self._listener.fileno()):
            with suppress(OSError):
                connected, address = self._listener.accept()
                self._kernel.post(partial(self._join, connected, f"{address[0]}:{address[1]}"))

    def _join(self, connected: socket.socket, who: str) -> None:
        if self._closed:
            connected.close()
            return
        self._clients.append(_Client(self, self._kernel, connected, who, self._codec.parser()))
        self._tell("up", f"{who} has connected")
        if self._joined is not None:
            self._joined()

    def _trouble(self) -> str:
        if self._clients or self._closed:
            return super()._trouble()
        return f"nobody has connected to {self.name}"

    def _transmit(self, data: bytes) -> None:
        for client in self._clients:
            client.transmit(data)

    def close(self) -> None:
        """Let go of all sockets and threads."""
        super().close()
        self._pump.stop()
        self._listener.close()
        for client in self._clients:
            client.close()
        self._clients.clear()

    def said(self, parser: FrameParser, data: bytes) -> None:
        """House code: one of the clients, whose parser this is, has said something."""
        if self._closed:
            return
        frames = parser.feed(data)
        if self._receiver is not None:
            for frame in frames:
                self._receiver(frame)

    def left(self, client: _Client) -> None:
        """House code: a client has gone."""
        if client in self._clients:
            self._clients.remove(client)
            client.close()
            self._tell("lost", f"{client.who} has gone")
