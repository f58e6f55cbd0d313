"""UDP: bind and answer the first who speaks, or send to a stated peer and hear its answers.

UDP for several peers at one port: all who have spoken lately hear what is sent.
"""

from __future__ import annotations

import socket
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

from volery.base.errors import UsageError
from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.links.coded_link import CodedLink, ReaderThread
from volery.links.link import Codec, FrameParser
from volery.links.mavlink_codec import MAVLINK

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
        self._pump = ReaderThread(self.name, self._read)
        self._pump.start()

    def _read(self, pump: ReaderThread) -> None:
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


@dataclass
class _Peer:
    """One who has spoken: when, and its own half-received frame."""

    parser: FrameParser
    heard_at: Ns


class UdpServer(UdpLink):
    """Binds ``host:port``. What any peer says arrives; a peer that is silent for ``PEER_GONE`` is forgotten.

    Raises ``UsageError`` if one cannot bind there.
    """

    def __init__(
        self, kernel: Kernel, host: str, port: int, name: str = "", *, codec: Codec = MAVLINK
    ) -> None:
        self._peers: dict[Endpoint, _Peer] = {}
        super().__init__(kernel, host, port, None, name, codec=codec)

    @property
    def peers(self) -> int:
        """How many have spoken lately."""
        return len(self._peers)

    def _came(self, data: bytes, sender: Endpoint) -> None:
        if self._closed:
            return
        self._heard_at = now = self._kernel.now()
        peer = self._peers.get(sender)
        if peer is None:
            peer = self._peers[sender] = _Peer(self._codec.parser(), now)
            self._tell("up", f"{sender[0]}:{sender[1]} speaks")
        peer.heard_at = now
        for frame in peer.parser.feed(data):
            if self._receiver is not None:
                self._receiver(frame)

    def _transmit(self, data: bytes) -> None:
        now = self._kernel.now()
        for endpoint, peer in tuple(self._peers.items()):
            if now - peer.heard_at > PEER_GONE:
                del self._peers[endpoint]
                self._tell("lost", f"{endpoint[0]}:{endpoint[1]} is silent")
                continue
            with suppress(OSError):
                self._socket.sendto(data, endpoint)

    def problem(self) -> str:
        """What is wrong with the socket, else with what one of the peers says."""
        wrong = (peer.parser.problem() for peer in self._peers.values())
        return self._trouble() or next(filter(None, wrong), "")
