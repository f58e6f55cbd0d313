"""A graph that joins one simulated vehicle and those who command it, and what can happen to its messages.

It stands for the wire of a vehicle that is reached over a graph: its calls cost nothing and nothing of it is
recorded. With faults, messages travel as frames of a transport do: numbered, with a checksum. So

* a frame of which any bit is turned, or that ends too early, is dropped, as is one within a cut;
* a frame that comes twice is taken once; one that is overtaken comes late;
* a request or an answer that is lost is given up after ``GIVEN_UP``: its caller is told.
"""

from __future__ import annotations

from functools import partial
from random import Random

from volery.base.time import MS, Ns
from volery.kernel.api import Action, Kernel
from volery.links.wire import OVERTAKEN, WireFaults
from volery.ros.graph import Graph
from volery.ros.graph.node import NodeId, Way
from volery.run.simulated import LINK_DELAY

FRAME = 30
"""Bytes that a transport adds to a message."""
GIVEN_UP: Ns = 500 * MS
WHOLE = WireFaults()
"""Nothing happens to what passes."""


class GraphWire:
    """The way of messages between two nodes. Faults are drawn from *random* in the order of sending."""

    def __init__(self, kernel: Kernel, random: Random, faults: WireFaults | None = None) -> None:
        self._kernel = kernel
        self._random = random
        self._faults = faults or WHOLE
        self._latest: dict[tuple[str, str], Ns] = {}
        self._together: list[Action] = []  # what was sent at this instant
        self._sent: Ns = -1

    def suffer(self, faults: WireFaults) -> None:
        """From now on this happens to what passes, in both directions."""
        self._faults = faults

    def between(self, sender: NodeId, receiver: NodeId) -> Way:
        """See ``volery.ros.graph.Between``. Messages of a pair keep their order, unless faults say so."""
        return partial(self._carry, sender.name, receiver.name)

    def _carry(
        self, sender: str, receiver: str, size: int, _sure: bool, deliver: Action, lost: Action
    ) -> None:
        now = self._kernel.now()
        if self._faults is WHOLE and not self._latest:
            self._carry_whole(now, deliver)
            return
        if self._is_lost(size + FRAME):
            self._kernel.call_at(now + GIVEN_UP, lost)
            return
        faults, random = self._faults, self._random
        late = int(random.random() * faults.jitter) if faults.jitter else 0
        way = sender, receiver
        self._latest[way] = arrives = max(self._latest.get(way, 0), now + LINK_DELAY + late)
        if faults.reorder and random.random() < faults.reorder:
            arrives += OVERTAKEN
        self._kernel.call_at(arrives, deliver)

    def _carry_whole(self, now: Ns, deliver: Action) -> None:
        """Without faults all that is sent at one instant arrives at one instant."""
        if self._sent != now:
            self._sent, self._together = now, []
            together = self._together
            self._kernel.call_at(now + LINK_DELAY, lambda: _all(together))
        self._together.append(deliver)

    def _is_lost(self, octets: int) -> bool:
        faults, random = self._faults, self._random
        chances = [faults.drop, faults.burst, faults.truncate]
        if faults.flip:
            chances.append(1.0 - (1.0 - faults.flip) ** octets)
        drawn = [random.random() < chance for chance in chances if chance]
        return any(drawn) or faults.cut_at(self._kernel.now())


def _all(actions: list[Action]) -> None:
    for action in actions:
        action()


def private_graph(kernel: Kernel, wire: GraphWire, *, as_bytes: bool) -> Graph:
    """A graph whose messages go over *wire*: as values, or as what is left of them after their bytes."""
    return Graph(kernel, between=wire.between, unrecorded=True, as_bytes=as_bytes)
