"""Links between parts of one process: a link without a wire, and shares of one link.

On a link without a wire frames travel as values, not as bytes, and arrive after a delay. The values are
quantised as on a wire (``WireFormat.quantised``): 32-bit floats, strings cut to length, all fields present,
and a field that does not fit is refused. This costs a few microseconds per frame and keeps a simulation from
depending on digits that no radio carries. Frames of one end that arrive at one instant are one event of the
kernel.

A link is shared by several vehicles when one radio, or one port, carries more than one autopilot.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.links.frame import Frame
from volery.links.link import Link, Receiver, WireFormat
from volery.links.mavlink_codec import MAVLINK


class InProcessLink:
    """One end. Frames keep their order; frames sent before the other end receives are lost, as on a wire."""

    def __init__(self, kernel: Kernel, name: str, delay: Ns, codec: WireFormat = MAVLINK) -> None:
        self.name = name
        self._kernel = kernel
        self._delay = delay
        self._codec = codec
        self._receiver: Receiver | None = None
        self._closed = False
        self._arrival: Ns = 0
        self._under_way: list[Frame] = []
        self.wanted: Callable[[str], bool] | None = None
        """Which messages this end uses; ``None``: all."""
        self.peer: InProcessLink = self

    def send(self, frame: Frame) -> None:
        """Deliver *frame* to the peer after the delay."""
        if self._closed:
            return
        arriving = self._codec.quantised(frame)
        arrival = self._kernel.now() + self._delay
        if self._under_way and arrival == self._arrival:
            self._under_way.append(arriving)
            return
        self._arrival, self._under_way = arrival, [arriving]
        self._kernel.call_at(arrival, partial(self.peer.deliver, self._under_way))

    def receive(self, receiver: Receiver) -> None:
        """Call *receiver* with every frame that arrives from now on."""
        self._receiver = receiver

    def select(self, wanted: Callable[[str], bool]) -> None:
        """State which messages this end uses, by name."""
        self.wanted = wanted

    def is_wanted(self, name: str) -> bool:
        """Return whether the other end uses the message called *name*."""
        wanted = self.peer.wanted
        return wanted is None or wanted(name)

    def deliver(self, frames: list[Frame]) -> None:
        """Hand frames that have arrived to the receiver, and empty the list. Framework callback."""
        for frame in frames:
            if self._receiver is not None and not self._closed:
                self._receiver(frame)
        frames.clear()

    def problem(self) -> str:
        """Return ``""``, or that the link was closed."""
        return "the link was closed" if self._closed else ""

    def close(self) -> None:
        """Send and receive nothing from now on."""
        self._closed = True


def in_process_pair(
    kernel: Kernel, delay: Ns = MS, name: str = "link", codec: WireFormat = MAVLINK
) -> tuple[InProcessLink, InProcessLink]:
    """Return the vehicle's end and the autopilot's end of a link called *name*."""
    ours = InProcessLink(kernel, name, delay, codec)
    theirs = InProcessLink(kernel, f"{name} (autopilot)", delay, codec)
    ours.peer, theirs.peer = theirs, ours
    return ours, theirs


class SharedLink:
    """Delivers every frame to all shares. Vehicles recognise their frames by the sender's system id."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._shares: list[LinkShare] = []
        link.receive(self._on_frame)

    def share(self) -> LinkShare:
        """Return a new link to the vehicles behind the shared link."""
        made = LinkShare(self, self._link)
        self._shares.append(made)
        return made

    def _on_frame(self, frame: Frame) -> None:
        for share in tuple(self._shares):
            share.deliver(frame)

    def leave(self, share: LinkShare) -> None:
        """Remove a share that was closed; the last one closes the shared link."""
        if share in self._shares:
            self._shares.remove(share)
            if not self._shares:
                self._link.close()


class LinkShare:
    """One vehicle's share of a shared link."""

    def __init__(self, owner: SharedLink, link: Link) -> None:
        self.name = link.name
        self._owner = owner
        self._link = link
        self._receiver: Receiver | None = None
        self._closed = False

    def send(self, frame: Frame) -> None:
        """Send *frame* over the shared link; every vehicle behind the link receives it."""
        if not self._closed:
            self._link.send(frame)

    def receive(self, receiver: Receiver) -> None:
        """Call *receiver* with every frame that arrives from now on."""
        self._receiver = receiver

    def deliver(self, frame: Frame) -> None:
        """Hand a frame that has arrived to the receiver. Framework callback."""
        if self._receiver is not None and not self._closed:
            self._receiver(frame)

    def problem(self) -> str:
        """Return what is wrong with the shared link, or ``""``."""
        return "the link was closed" if self._closed else self._link.problem()

    @property
    def statistics(self) -> object:
        """Receive statistics of the shared link, or None if it keeps none."""
        return getattr(self._link, "statistics", None)

    def close(self) -> None:
        """Leave the shared link."""
        self._closed = True
        self._owner.leave(self)
