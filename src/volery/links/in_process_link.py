"""Two ends of a link within one process: frames travel as values, not as bytes, and arrive after a delay.

The values are those of the wire nevertheless (``Codec.quantised``): 32-bit floats, strings cut to length,
all fields present, a field that does not fit refused. That costs a few microseconds per frame and keeps a
simulation from depending on digits that no radio carries.
"""

from __future__ import annotations

from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.links.link import Codec, Frame, Receiver
from volery.links.mavlink_codec import MAVLINK


class InProcessLink:
    """One end. Frames keep their order; those sent before the other end listens are lost, as on a wire."""

    def __init__(self, kernel: Kernel, name: str, delay: Ns, codec: Codec = MAVLINK) -> None:
        self.name = name
        self._kernel = kernel
        self._delay = delay
        self._codec = codec
        self._receiver: Receiver | None = None
        self._closed = False
        self.peer: InProcessLink = self

    def send(self, frame: Frame) -> None:
        """To the peer, which gets it a delay later."""
        if self._closed:
            return
        arriving = self._codec.quantised(frame)
        peer = self.peer
        self._kernel.call_at(self._kernel.now() + self._delay, lambda: peer.deliver(arriving))

    def receive(self, receiver: Receiver) -> None:
        """From now on hand what arrives to *receiver*."""
        self._receiver = receiver

    def deliver(self, frame: Frame) -> None:
        """A frame has arrived here."""
        if self._receiver is not None and not self._closed:
            self._receiver(frame)

    def problem(self) -> str:
        """Nothing can be wrong with it, except that it was closed."""
        return "the link was closed" if self._closed else ""

    def close(self) -> None:
        """Nothing goes out or comes in any more."""
        self._closed = True


def in_process_pair(
    kernel: Kernel, delay: Ns = MS, name: str = "link", codec: Codec = MAVLINK
) -> tuple[InProcessLink, InProcessLink]:
    """The vehicle's side and the autopilot's side of a link called *name*."""
    ours = InProcessLink(kernel, name, delay, codec)
    theirs = InProcessLink(kernel, f"{name} (autopilot)", delay, codec)
    ours.peer, theirs.peer = theirs, ours
    return ours, theirs
