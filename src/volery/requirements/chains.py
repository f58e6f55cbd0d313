"""How old what arrives at the end of a chain of topics is.

A chain is a row of topics: a node hears the first and says the second, and so on. The latency of a message on
the last topic is counted from when the message on the first topic was sent that it may have been made from:
at each node on the way, the latest one that had arrived there when it spoke. (Feiertag et al., *A
Compositional Framework for End-to-End Path Delay Calculation*, CRTS 2008, call it the data age.)
"""

from __future__ import annotations

from collections import deque

from volery.base.time import Ns
from volery.requirements.distribution import Distribution
from volery.requirements.record import ChainRecord, LatencyRecord
from volery.trace.events import NONE, Message
from volery.trace.setup import ChainSetup

_REMEMBERED = 256
"""Messages that a node may have heard since it sent the one that arrives now."""

Heard = deque[tuple[Ns, Ns]]


class ChainLedger:
    """Give it all messages of a run."""

    def __init__(self, setup: ChainSetup) -> None:
        self.setup = setup
        self.latencies = Distribution()
        self._heard: list[dict[str, Heard]] = [
            {} for _ in setup.topics
        ]  # by topic and node: when, since when

    def message(self, event: Message) -> None:
        """A message arrived, or was lost."""
        if event.received == NONE:
            return
        for place, topic in enumerate(self.setup.topics):
            if topic == event.topic:
                since = self._since(place, event)
                if since is not None:
                    self._arrived(place, event, since)

    def _since(self, place: int, event: Message) -> Ns | None:
        """When the chain began that led to *event*; ``None`` if it was made from nothing."""
        if place == 0:
            return event.sent
        heard = self._heard[place - 1].get(_bare(event.publisher), ())
        return next((since for at, since in reversed(heard) if at <= event.sent), None)

    def _arrived(self, place: int, event: Message, since: Ns) -> None:
        if place == len(self.setup.topics) - 1:
            self.latencies.add(event.received - since)
        else:
            heard = self._heard[place].setdefault(_bare(event.subscriber), deque(maxlen=_REMEMBERED))
            heard.append((event.received, since))

    def record(self) -> ChainRecord:
        """Its row."""
        spread = self.latencies
        mean, p95 = spread.mean(), spread.quantile(0.95)
        if mean is None or p95 is None:
            return ChainRecord(topics=list(self.setup.topics), latency_s=LatencyRecord())
        latency = LatencyRecord(
            count=spread.count, mean=mean * 1e-9, p95=p95 * 1e-9, max=spread.largest * 1e-9
        )
        return ChainRecord(topics=list(self.setup.topics), latency_s=latency)


def _bare(node: str) -> str:
    return node.strip("/")
