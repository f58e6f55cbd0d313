"""Links over UDP: to one peer, or a server for several peers at one port."""

from __future__ import annotations

import ipaddress
import socket
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

from volery.base.errors import UsageError
from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.links.coded_link import CONNECTION_FAULTS, CodedLink, ReaderThread
from volery.links.link import FrameParser, WireFormat
from volery.links.mavlink_codec import MAVLINK

PEER_TIMEOUT: Ns = 10 * S
"""After this time without a datagram another sender replaces the peer: an autopilot that was restarted."""

MAX_PEERS = 64
"""Peers of one server. While there are so many, no further sender is received."""
ANY_HOST = "0.0.0.0"
LOOPBACK = "127.0.0.1"

_DATAGRAM = 65_536
Endpoint = tuple[str, int]


class UdpLink(CodedLink):
    """Datagrams to and from one peer.

    Args:
        kernel: Delivers what the thread receives.
        host: Local address to bind; empty for all addresses, or for loopback if the peer is on loopback.
        port: Local port to bind; 0 chooses a free one. ``self.port`` holds the port in use.
        peer: Address to send to. Only what comes from this address and port is received. None waits for a
            peer: the first sender becomes the peer.
        name: Name of the link in messages and in the trace.
        codec: Protocol of the link.
        answers_to: Port of the peer to send to, instead of the port that the peer sends from.

    Raises:
        UsageError: The address cannot be bound, or the host does not exist.
    """

    def __init__(
        self,
        kernel: Kernel,
        host: str,
        port: int,
        peer: Endpoint | None = None,
        name: str = "",
        *,
        codec: WireFormat = MAVLINK,
        answers_to: int | None = None,
    ) -> None:
        self._answers_to = answers_to
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._fixed = None if peer is None else (socket.gethostbyname(peer[0]), peer[1])
            if not host and self._fixed is not None and ipaddress.ip_address(self._fixed[0]).is_loopback:
                host = LOOPBACK
            self._socket.bind((host or ANY_HOST, port))
        except CONNECTION_FAULTS as error:
            self._socket.close()
            where = f"{host}:{port}" if peer is None else f"{peer[0]}:{peer[1]}"
            reason = getattr(error, "strerror", None) or error
            raise UsageError(f"cannot use udp {where}: {reason}") from None
        self._socket.setblocking(False)
        self.port: int = self._socket.getsockname()[1]
        where = f"udp://{host}:{self.port}" if peer is None else f"udp://{peer[0]}:{peer[1]}"
        super().__init__(kernel, name or where, codec)
        self._peer = self._fixed
        self._last_received: Ns = -1
        self._reader = ReaderThread(self.name, self._read)
        self._reader.start()

    def _read(self, reader: ReaderThread) -> None:
        while reader.readable(self._socket.fileno()):
            with suppress(OSError):
                data, (sender_host, sender_port) = self._socket.recvfrom(_DATAGRAM)
                sender = sender_host, sender_port
                if self._may_send(sender):
                    reader.post(self._kernel, partial(self._on_datagram, sender), data)

    def _may_send(self, sender: Endpoint) -> bool:
        """Return whether *sender* is the stated peer, if one is stated. Runs in the reader thread."""
        return self._fixed is None or sender == self._fixed

    def _on_datagram(self, sender: Endpoint, data: bytes) -> None:
        if self._closed or not self._accepts(sender):
            return
        if self._last_received < 0:
            self._record("up", f"first datagram from {sender[0]}:{sender[1]}")
        self._last_received = self._kernel.now()
        self.arrived(data)

    def _accepts(self, sender: Endpoint) -> bool:
        if self._fixed is not None:
            return True  # others were dropped in the reader thread
        if self._peer is None or self._kernel.now() - self._last_received > PEER_TIMEOUT:
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

    def _connection_problem(self) -> str:
        if self._closed or self._last_received >= 0:
            return super()._connection_problem()
        if self._fixed is not None:
            return f"no answer from udp {self._fixed[0]}:{self._fixed[1]}"
        return f"nothing arrives at udp port {self.port}"

    def close(self) -> None:
        """Close the socket and stop the thread."""
        super().close()
        self._reader.stop()
        self._socket.close()


@dataclass
class _Peer:
    """A peer of a server: its half-received frame, and the time of its last datagram."""

    parser: FrameParser
    last_received: Ns


class UdpServer(UdpLink):
    """A link to all peers that have sent a datagram within ``PEER_TIMEOUT``.

    The frames of one system and component are received from one peer only: while that peer is there, frames
    with the same sender's ids from another address are dropped.

    Raises:
        UsageError: ``host:port`` cannot be bound.
    """

    def __init__(
        self, kernel: Kernel, host: str, port: int, name: str = "", *, codec: WireFormat = MAVLINK
    ) -> None:
        self._peers: dict[Endpoint, _Peer] = {}
        self._sources: dict[tuple[int, int], Endpoint] = {}  # of the frames of a system and component
        super().__init__(kernel, host, port, None, name, codec=codec)

    @property
    def peers(self) -> int:
        """Number of peers that have sent a datagram lately."""
        return len(self._peers)

    def _on_datagram(self, sender: Endpoint, data: bytes) -> None:
        if self._closed:
            return
        now = self._kernel.now()
        peer = self._peers.get(sender)
        if peer is None:
            self._forget_silent_peers(now)
            if len(self._peers) >= MAX_PEERS:
                return
            peer = self._peers[sender] = _Peer(self._codec.parser(), now)
            self._record("up", f"first datagram from {sender[0]}:{sender[1]}")
        self._last_received = peer.last_received = now
        for frame in peer.parser.feed(data):
            source = self._sources.setdefault((frame.system, frame.component), sender)
            if source != sender and self._is_there(source, now):
                continue
            self._sources[frame.system, frame.component] = sender
            if self._receiver is not None:
                self._receiver(frame)

    def _is_there(self, endpoint: Endpoint, now: Ns) -> bool:
        peer = self._peers.get(endpoint)
        return peer is not None and now - peer.last_received <= PEER_TIMEOUT

    def _forget_silent_peers(self, now: Ns) -> None:
        for endpoint in tuple(self._peers):
            if not self._is_there(endpoint, now):
                del self._peers[endpoint]
                self._record("lost", f"{endpoint[0]}:{endpoint[1]} is silent")

    def _transmit(self, data: bytes) -> None:
        self._forget_silent_peers(self._kernel.now())
        for endpoint in self._peers:
            with suppress(OSError):
                self._socket.sendto(data, endpoint)

    def problem(self) -> str:
        """Return what is wrong with the socket, else with the bytes of a peer; ``""`` if nothing is."""
        problems = (peer.parser.problem() for peer in self._peers.values())
        return self._connection_problem() or next(filter(None, problems), "")
