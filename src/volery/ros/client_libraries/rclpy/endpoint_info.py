"""``rclpy.topic_endpoint_info``: who publishes and subscribes to a topic, and how."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from hashlib import sha256
from typing import Any

from volery.ros.client_libraries.rclpy.qos import QoSProfile, profile_on_graph
from volery.ros.graph import QoS, RosGraph
from volery.ros.graph.embedded_graph import EmbeddedGraph
from volery.ros.messages import type_hash


class TopicEndpointTypeEnum(IntEnum):
    """Kinds of endpoints."""

    INVALID = 0
    PUBLISHER = 1
    SUBSCRIPTION = 2


@dataclass(frozen=True)
class TypeHash:
    """Hash of a type's definition, by REP 2011."""

    version: int
    value: bytes

    def __str__(self) -> str:
        return f"RIHS{self.version:02}_{self.value.hex()}"


@dataclass(frozen=True)
class TopicEndpointInfo:
    """A publisher or a subscription. Its gid is made of names, so that it is the same in each run."""

    node_name: str
    node_namespace: str
    topic_type: str
    topic_type_hash: TypeHash
    endpoint_type: TopicEndpointTypeEnum
    endpoint_gid: list[int]
    qos_profile: QoSProfile

    def __str__(self) -> str:
        profile = self.qos_profile
        depth = f" ({profile.depth})" if profile.history.name == "KEEP_LAST" else ""
        gid = ".".join(format(byte, "02x") for byte in self.endpoint_gid)
        return (
            f"Node name: {self.node_name}\nNode namespace: {self.node_namespace}\n"
            f"Topic type: {self.topic_type}\nTopic type hash: {self.topic_type_hash}\n"
            f"Endpoint type: {self.endpoint_type.name}\nGID: {gid}\nQoS profile:\n"
            f"  Reliability: {profile.reliability.name}\n  History (Depth): {profile.history.name}{depth}\n"
            f"  Durability: {profile.durability.name}\n  Lifespan: {profile.lifespan}\n"
            f"  Deadline: {profile.deadline}\n  Liveliness: {profile.liveliness.name}\n"
            f"  Liveliness lease duration: {profile.liveliness_lease_duration}"
        )


def endpoint_infos(graph: RosGraph, topic: str, *, publishers: bool) -> list[TopicEndpointInfo]:
    """Return the publishers of a topic, or its subscriptions.

    Real ROS shows what publishers offer; of its subscriptions only the nodes are known.
    """
    found = next((one for one in graph.topics() if one.name == topic), None)
    if found is None:
        return []
    nodes = found.publishers if publishers else found.subscribers
    if publishers:
        profiles = graph.offered(topic)
    else:
        profiles = graph.requested(topic) if isinstance(graph, EmbeddedGraph) else ()
    used = [*profiles, *[QoS()] * len(nodes)]
    kind = TopicEndpointTypeEnum.PUBLISHER if publishers else TopicEndpointTypeEnum.SUBSCRIPTION
    infos = []
    for number, (node, qos) in enumerate(zip(nodes, used, strict=False)):
        above, _, name = node.rpartition("/")
        gid = sha256(f"{kind.name} {topic} {node} {number}".encode()).digest()[:16]
        infos.append(
            TopicEndpointInfo(
                name, above or "/", found.type, _hash(found.type), kind, list(gid), profile_on_graph(qos)
            )
        )
    return infos


def _hash(name: str) -> TypeHash:
    return TypeHash(1, type_hash(name))


ENDPOINT_INFO: dict[str, Any] = {
    "TopicEndpointInfo": TopicEndpointInfo,
    "TopicEndpointTypeEnum": TopicEndpointTypeEnum,
}
"""Content of ``rclpy.topic_endpoint_info``."""
