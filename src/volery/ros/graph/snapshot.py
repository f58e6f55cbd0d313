"""Who is on a graph, what is said there, and how often."""

from __future__ import annotations

from collections import Counter
from functools import partial
from typing import Any, NamedTuple

from volery.base.errors import UsageError
from volery.base.time import MS, Ns, to_seconds
from volery.ros.graph.interface import AS_OFFERED, QoS, RosGraph, ServiceState

_LISTENING = QoS(1000, AS_OFFERED.reliability, AS_OFFERED.durability)
_PORTION: Ns = 100 * MS


class TopicSnapshot(NamedTuple):
    """A topic: who publishes and who subscribes, and messages per second (``None``: not measured)."""

    name: str
    type: str
    publishers: tuple[str, ...]
    subscribers: tuple[str, ...]
    rate: float | None


class GraphSnapshot(NamedTuple):
    """A graph at one moment. Everything is sorted by name."""

    nodes: tuple[str, ...]
    topics: tuple[TopicSnapshot, ...]
    services: tuple[ServiceState, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "nodes": list(self.nodes),
            "topics": [topic._asdict() for topic in self.topics],
            "services": [service._asdict() for service in self.services],
        }


def snapshot(graph: RosGraph, within: Ns = 0) -> GraphSnapshot:
    """What is there now; with *within*, each topic is listened to for so long and its rate counted.

    Blocks for that long. The node that listens is not in the picture.
    """
    topics, nodes, services = graph.topics(), graph.node_names(), graph.services()
    rates = _rates(graph, within) if within > 0 else {}
    lines = (TopicSnapshot(*topic, rates.get(topic.name)) for topic in topics)
    return GraphSnapshot(tuple(sorted(nodes)), tuple(sorted(lines)), tuple(sorted(services)))


def _rates(graph: RosGraph, within: Ns) -> dict[str, float]:
    """Messages per second of each topic that could be listened to."""
    counts: Counter[str] = Counter()
    heard: list[str] = []
    node = graph.node("volery_graph", anonymous=True)
    try:
        for topic in graph.topics():
            if topic.publishers:
                try:
                    node.subscribe(topic.name, topic.type, partial(_count, counts, topic.name), _LISTENING)
                except UsageError:
                    continue  # a type that is not known here: it has no rate
                heard.append(topic.name)
        began = node.now()
        while node.now() - began < within:
            node.spin_once(_PORTION)
        lasted = to_seconds(node.now() - began)
    finally:
        node.close()
    return {name: counts[name] / lasted for name in heard}


def _count(counts: Counter[str], topic: str, _message: object) -> None:
    counts[topic] += 1
