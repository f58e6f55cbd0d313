"""One link, several vehicles behind it: a radio, or a port to which more than one autopilot speaks."""

from __future__ import annotations

from volery.links.link import Frame, Link, Receiver


class SharedLink:
    """Hands every frame that arrives to all who share it: whose it is they see by the sender's system id."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._shares: list[Share] = []
        link.receive(self._arrived)

    def share(self) -> Share:
        """A link of one's own to what is behind it."""
        made = Share(self, self._link)
        self._shares.append(made)
        return made

    def _arrived(self, frame: Frame) -> None:
        for share in tuple(self._shares):
            share.deliver(frame)

    def left(self, share: Share) -> None:
        """One of those who share it has closed; the last one closes it."""
        if share in self._shares:
            self._shares.remove(share)
            if not self._shares:
                self._link.close()


class Share:
    """One vehicle's part of a shared link."""

    def __init__(self, owner: SharedLink, link: Link) -> None:
        self.name = link.name
        self._owner = owner
        self._link = link
        self._receiver: Receiver | None = None
        self._closed = False

    def send(self, frame: Frame) -> None:
        """Over the shared link; everybody behind it hears it."""
        if not self._closed:
            self._link.send(frame)

    def receive(self, receiver: Receiver) -> None:
        """From now on hand every frame that arrives to *receiver*."""
        self._receiver = receiver

    def deliver(self, frame: Frame) -> None:
        """A frame has arrived."""
        if self._receiver is not None and not self._closed:
            self._receiver(frame)

    def problem(self) -> str:
        """What is wrong with the shared link."""
        return "the link was closed" if self._closed else self._link.problem()

    @property
    def heard(self) -> object:
        """What the shared link has heard, if it counts that."""
        return getattr(self._link, "heard", None)

    def close(self) -> None:
        """Let go of it."""
        self._closed = True
        self._owner.left(self)
