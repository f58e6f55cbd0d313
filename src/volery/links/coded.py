"""A link whose peer is reached by bytes: the codec on top of whatever moves them."""

from __future__ import annotations

from abc import ABC, abstractmethod

from volery.kernel.api import Kernel
from volery.links.codec import Codec, Heard
from volery.links.link import Frame, Receiver
from volery.links.parser import MAVLINK
from volery.trace.events import LinkState


class CodedLink(ABC):
    """Frames out as bytes, bytes in as frames. A subclass moves the bytes and calls ``arrived``."""

    def __init__(self, kernel: Kernel, name: str, codec: Codec = MAVLINK) -> None:
        self.name = name
        self._kernel = kernel
        self._codec = codec
        self._parser = codec.parser()
        self._receiver: Receiver | None = None
        self._sequence = 0
        self._closed = False

    @property
    def heard(self) -> Heard:
        """What has arrived so far: frames, text, garbage."""
        return self._parser.heard

    def send(self, frame: Frame) -> None:
        """Send at once; a link that is down or full drops it."""
        if self._closed:
            return
        data = self._codec.encode(frame, self._sequence)
        self._sequence = (self._sequence + 1) % 256
        self._transmit(data)

    def send_bytes(self, data: bytes) -> None:
        """Put *data* on the wire as it is, such as the plain text that an autopilot writes while it boots."""
        if not self._closed:
            self._transmit(data)

    def receive(self, receiver: Receiver) -> None:
        """From now on hand every frame that arrives to *receiver*."""
        self._receiver = receiver

    def arrived(self, data: bytes) -> None:
        """House code: these bytes have come in."""
        if self._closed:
            return
        for frame in self._parser.feed(data):
            if self._receiver is not None:
                self._receiver(frame)

    def problem(self) -> str:
        """What is wrong with the carrier, else with what it carries; empty if nothing is."""
        return self._trouble() or self._parser.problem()

    def close(self) -> None:
        """Nothing goes out or comes in any more."""
        self._closed = True

    @abstractmethod
    def _transmit(self, data: bytes) -> None:
        """Send bytes without waiting."""

    def _trouble(self) -> str:
        """What is wrong with the carrier, in words."""
        return "the link was closed" if self._closed else ""

    def _tell(self, state: str, detail: str) -> None:
        self._kernel.record(LinkState(self._kernel.now(), self.name, state, detail))
