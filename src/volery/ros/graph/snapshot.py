"""Snapshot of a graph: nodes, topics with their rates, services."""

from __future__ import annotations

from collections import Counter
from functools import partial
from typing import Any, NamedTuple

from volery.base.errors import UsageError
from volery.base.time import MS, Ns, S, to_seconds
from volery.ros.graph.interface import AS_OFFERED, QoS, RosGraph, ServiceState

_MEASURING = QoS(1000, AS_OFFERED.reliability, AS_OFFERED.durability)
_PORTION: Ns = 100 * MS
_DISCOVERY_LIMIT: Ns = 4 * S
"""Longest wait for the first node, ns; DDS repeats a lost announcement after 3 s."""


class TopicSnapshot(NamedTuple):
    """A topic with its publishers and subscribers, and messages per second (None if not measured)."""

    name: str
    type: str
    publishers: tuple[str, ...]
    subscribers: tuple[str, ...]
    rate: float | None


class GraphSnapshot(NamedTuple):
    """A graph at one instant, sorted by name."""

    nodes: tuple[str, ...]
    topics: tuple[TopicSnapshot, ...]
    services: tuple[ServiceState, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the snapshot as values for JSON."""
        return {
            "nodes": list(self.nodes),
            "topics": [topic._asdict() for topic in self.topics],
            "services": [service._asdict() for service in self.services],
        }


def snapshot(graph: RosGraph, within: Ns = 0) -> GraphSnapshot:
    """Return a snapshot of a graph; the node that measures is not in it.

    An empty graph is watched for 4 s, as the nodes of ROS 2 may be discovered late.

    Args:
        graph: The graph.
        within: Time for which each topic's messages are counted, ns; the call blocks for that time. 0 for no
            rates.
    """
    end = graph.kernel.now() + _DISCOVERY_LIMIT
    while not graph.node_names() and (now := graph.kernel.now()) < end:
        graph.kernel.sleep_until(now + _PORTION)
    topics, nodes, services = graph.topics(), graph.node_names(), graph.services()
    rates = _rates(graph, within) if within > 0 else {}
    lines = (TopicSnapshot(*topic, rates.get(topic.name)) for topic in topics)
    return GraphSnapshot(tuple(sorted(nodes)), tuple(sorted(lines)), tuple(sorted(services)))


def _rates(graph: RosGraph, within: Ns) -> dict[str, float]:
    """Return messages per second of each topic of a known type."""
    counts: Counter[str] = Counter()
    measured: list[str] = []
    node = graph.node("volery_graph", anonymous=True)
    try:
        for topic in graph.topics():
            if topic.publishers:
                try:
                    node.subscribe(topic.name, topic.type, partial(_count, counts, topic.name), _MEASURING)
                except UsageError:
                    continue  # of an unknown type: it has no rate
                measured.append(topic.name)
        began = node.now()
        while node.now() - began < within:
            node.spin_once(_PORTION)
        lasted = to_seconds(node.now() - began)
    finally:
        node.close()
    return {name: counts[name] / lasted for name in measured}


def _count(counts: Counter[str], topic: str, _message: object) -> None:
    counts[topic] += 1
