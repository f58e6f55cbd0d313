"""A link within one process: frames travel as values, not as bytes, and arrive after a delay.

The values are quantised as on a wire (``Codec.quantised``): 32-bit floats, strings cut to length, all fields
present, and a field that does not fit is refused. This costs a few microseconds per frame and keeps a
simulation from depending on digits that no radio carries.
"""

from __future__ import annotations

from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.links.link import Codec, Frame, Receiver
from volery.links.mavlink_codec import MAVLINK


class InProcessLink:
    """One end. Frames keep their order; frames sent before the other end receives are lost, as on a wire."""

    def __init__(self, kernel: Kernel, name: str, delay: Ns, codec: Codec = MAVLINK) -> None:
        self.name = name
        self._kernel = kernel
        self._delay = delay
        self._codec = codec
        self._receiver: Receiver | None = None
        self._closed = False
        self.peer: InProcessLink = self

    def send(self, frame: Frame) -> None:
        """Deliver *frame* to the peer after the delay."""
        if self._closed:
            return
        arriving = self._codec.quantised(frame)
        peer = self.peer
        self._kernel.call_at(self._kernel.now() + self._delay, lambda: peer.deliver(arriving))

    def receive(self, receiver: Receiver) -> None:
        """Call *receiver* with every frame that arrives from now on."""
        self._receiver = receiver

    def deliver(self, frame: Frame) -> None:
        """Hand a frame that has arrived to the receiver. Framework callback."""
        if self._receiver is not None and not self._closed:
            self._receiver(frame)

    def problem(self) -> str:
        """Return ``""``, or that the link was closed."""
        return "the link was closed" if self._closed else ""

    def close(self) -> None:
        """Send and receive nothing from now on."""
        self._closed = True


def in_process_pair(
    kernel: Kernel, delay: Ns = MS, name: str = "link", codec: Codec = MAVLINK
) -> tuple[InProcessLink, InProcessLink]:
    """Return the vehicle's end and the autopilot's end of a link called *name*."""
    ours = InProcessLink(kernel, name, delay, codec)
    theirs = InProcessLink(kernel, f"{name} (autopilot)", delay, codec)
    ours.peer, theirs.peer = theirs, ours
    return ours, theirs
