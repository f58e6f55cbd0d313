"""Recording a graph: every topic, as it appears, or those that are named."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import partial

from volery.base.errors import UsageError
from volery.base.time import MS, Ns
from volery.ros.graph.node import AS_OFFERED, Node, QoS, RosGraph
from volery.ros.messages import Message
from volery.ros.messages.bag_writing import BagWriter

_LOOK: Ns = 500 * MS
"""How often new topics are looked for."""
_KEPT: QoS = QoS(1000, AS_OFFERED.reliability, AS_OFFERED.durability)


class Recorder:
    """Writes what is said on a graph. ``run`` it in a task; ``stop`` it from anywhere.

    *topics*: only these; ``None``: all, each from when it is first seen. ``counts`` says how many messages
    were recorded, ``problems`` why a topic cannot be, both by topic. *told* is told each message's topic.
    """

    def __init__(
        self,
        graph: RosGraph,
        node: Node,
        writer: BagWriter,
        *,
        topics: Collection[str] | None = None,
        told: Callable[[str], None] = lambda topic: None,
    ) -> None:
        self._graph, self._node, self._writer = graph, node, writer
        self._topics = None if topics is None else frozenset(node.resolve(topic) for topic in topics)
        self._told = told
        self._seen: set[str] = set()
        self._stopped = False
        self.counts: dict[str, int] = {}
        self.problems: dict[str, str] = {}

    def run(self) -> None:
        """Record until it is stopped."""
        looked: Ns | None = None
        while not self._stopped and not self._node.closed:
            now = self._node.now()
            if looked is None or now - looked >= _LOOK:
                looked = now
                self._look()
            self._node.spin_once(_LOOK)

    def stop(self) -> None:
        """Record no more; ``run`` returns within half a second."""
        self._stopped = True

    def _look(self) -> None:
        for topic in self._graph.topics():
            wanted = topic.publishers and (self._topics is None or topic.name in self._topics)
            if not wanted or topic.name in self._seen:
                continue
            self._seen.add(topic.name)
            try:
                self._node.subscribe(topic.name, topic.type, partial(self._hear, topic.name), _KEPT)
            except UsageError as error:
                self.problems[topic.name] = str(error)

    def _hear(self, topic: str, message: Message) -> None:
        if topic in self.problems:
            return
        try:
            self._writer.write(topic, self._node.now(), message)
        except UsageError as error:
            self.problems[topic] = str(error)
            return
        self.counts[topic] = self.counts.get(topic, 0) + 1
        self._told(topic)
