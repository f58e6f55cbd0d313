"""One link shared by several vehicles: a radio, or a port at which more than one autopilot sends."""

from __future__ import annotations

from volery.links.link import Frame, Link, Receiver


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
