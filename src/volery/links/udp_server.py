"""UDP for several peers at one port: all who have spoken lately hear what is sent."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.links.codec import Codec, FrameParser
from volery.links.parser import MAVLINK
from volery.links.udp import PEER_GONE, Endpoint, UdpLink


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
