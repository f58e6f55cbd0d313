"""A link with a hand on it: what passes, in either direction, and who else is heard on it."""

from __future__ import annotations

from volery.links.link import Frame, Link, Receiver


class Tap:
    """Stands between a driver and its link, simulated or real. ``hears`` and ``speaks`` say what passes."""

    def __init__(self, link: Link) -> None:
        self.name = link.name
        self.hears = True
        self.speaks = True
        self._link = link
        self._others: list[Link] = []
        self._receiver: Receiver | None = None
        link.receive(self._arrived)

    def cut(self) -> None:
        """Nothing passes any more, in either direction."""
        self.hears = self.speaks = False

    def mend(self) -> None:
        """All passes again."""
        self.hears = self.speaks = True

    def share(self, other: Link) -> None:
        """The same air: what is said goes to *other*, too, and what *other* says is heard here."""
        self._others.append(other)
        other.receive(self._arrived)

    def send(self, frame: Frame) -> None:
        """Send, unless it is cut."""
        if self.speaks:
            for link in (self._link, *self._others):
                link.send(frame)

    def receive(self, receiver: Receiver) -> None:
        """From now on hand every frame that arrives to *receiver*, unless it is cut."""
        self._receiver = receiver

    def _arrived(self, frame: Frame) -> None:
        if self.hears and self._receiver is not None:
            self._receiver(frame)

    def problem(self) -> str:
        """What is wrong with the wire below."""
        return self._link.problem()

    @property
    def heard(self) -> object:
        """What the link below has heard, if it counts that."""
        return getattr(self._link, "heard", None)

    def close(self) -> None:
        """Close all links."""
        for link in (self._link, *self._others):
            link.close()
