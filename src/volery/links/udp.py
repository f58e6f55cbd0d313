"""UDP: bind and answer the first who speaks, or send to a stated peer and hear its answers."""

from __future__ import annotations

import socket
from contextlib import suppress
from functools import partial

from volery.base.errors import UsageError
from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.links.codec import Codec
from volery.links.coded import CodedLink
from volery.links.parser import MAVLINK
from volery.links.pump import Pump

PEER_GONE: Ns = 10 * S
"""After so much silence of the peer, another who speaks takes its place: an autopilot that was restarted."""

_DATAGRAM = 65_536
Endpoint = tuple[str, int]


class UdpLink(CodedLink):
    """Datagrams to and from one peer.

    With *peer* ``None`` it binds ``host:port`` and waits: the first who speaks is the peer, and is answered
    where it speaks from, or at port *answers_to* there. Else it sends to *peer* from any free port (``port``
    0) and hears whoever answers from that host.
    ``self.port`` is the local port. Raises ``UsageError`` if one cannot bind there or there is no such host.
    """

    def __init__(
        self,
        kernel: Kernel,
        host: str,
        port: int,
        peer: Endpoint | None = None,
        name: str = "",
        *,
        codec: Codec = MAVLINK,
        answers_to: int | None = None,
    ) -> None:
        self._answers_to = answers_to
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
            self._fixed = None if peer is None else (socket.gethostbyname(peer[0]), peer[1])
        except OSError as error:
            self._socket.close()
            where = f"{host}:{port}" if peer is None else f"{peer[0]}:{peer[1]}"
            raise UsageError(f"cannot use udp {where}: {error.strerror or error}") from None
        self._socket.setblocking(False)
        self.port: int = self._socket.getsockname()[1]
        where = f"udp://{host}:{self.port}" if peer is None else f"udp://{peer[0]}:{peer[1]}"
        super().__init__(kernel, name or where, codec)
        self._peer = self._fixed
        self._heard_at: Ns = -1
        self._pump = Pump(self.name, self._read)
        self._pump.start()

    def _read(self, pump: Pump) -> None:
        while pump.readable(self._socket.fileno()):
            with suppress(OSError):
                data, sender = self._socket.recvfrom(_DATAGRAM)
                self._kernel.post(partial(self._came, data, (sender[0], sender[1])))

    def _came(self, data: bytes, sender: Endpoint) -> None:
        if self._closed or not self._belongs(sender):
            return
        if self._heard_at < 0:
            self._tell("up", f"{sender[0]}:{sender[1]} speaks")
        self._heard_at = self._kernel.now()
        self.arrived(data)

    def _belongs(self, sender: Endpoint) -> bool:
        if self._fixed is not None:
            return sender[0] == self._fixed[0]
        if self._peer is None or self._kernel.now() - self._heard_at > PEER_GONE:
            self._peer = sender
        return sender == self._peer

    def _transmit(self, data: bytes) -> None:
        if self._peer is None:
            return
        host, port = self._peer
        if self._fixed is None and self._answers_to is not None:
            port = self._answers_to
        with suppress(OSError):
            self._socket.sendto(data, (host, port))

    def _trouble(self) -> str:
        if self._closed or self._heard_at >= 0:
            return super()._trouble()
        if self._fixed is not None:
            return f"nobody at udp {self._fixed[0]}:{self._fixed[1]} answers"
        return f"nobody speaks to udp port {self.port}"

    def close(self) -> None:
        """Let go of the socket and the thread."""
        super().close()
        self._pump.stop()
        self._socket.close()
