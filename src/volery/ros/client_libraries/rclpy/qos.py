"""rclpy's quality of service: policies, profiles and presets."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

from volery.base.errors import UsageError
from volery.ros.client_libraries.rclpy.ros_time import Duration
from volery.ros.graph import QoS
from volery.ros.graph.interface import BEST_AVAILABLE, BEST_EFFORT, RELIABLE, TRANSIENT_LOCAL, VOLATILE


class InvalidQoSProfileException(Exception):  # noqa: N818 - rclpy's name
    """A profile that is contradictory or incomplete."""


class HistoryPolicy(IntEnum):
    """Which messages are kept."""

    SYSTEM_DEFAULT = 0
    KEEP_LAST = 1
    KEEP_ALL = 2
    UNKNOWN = 3


class ReliabilityPolicy(IntEnum):
    """Whether lost messages are sent again."""

    SYSTEM_DEFAULT = 0
    RELIABLE = 1
    BEST_EFFORT = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4


class DurabilityPolicy(IntEnum):
    """Whether late subscriptions receive earlier messages."""

    SYSTEM_DEFAULT = 0
    TRANSIENT_LOCAL = 1
    VOLATILE = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4


class LivelinessPolicy(IntEnum):
    """Liveliness policies, which are accepted without effect on the embedded graph."""

    SYSTEM_DEFAULT = 0
    AUTOMATIC = 1
    MANUAL_BY_TOPIC = 3
    UNKNOWN = 4
    BEST_AVAILABLE = 5


class QoSProfile:
    """A profile as in rclpy: ``QoSProfile(depth=10)``.

    Finite deadlines, lifespans and lease durations are refused, because the embedded graph does not monitor
    them.
    """

    def __init__(self, **policies: Any) -> None:
        if "history" not in policies and "depth" not in policies:
            raise InvalidQoSProfileException("History and/or depth settings are required.")
        self.history = HistoryPolicy(policies.pop("history", HistoryPolicy.KEEP_LAST))
        if self.history is HistoryPolicy.KEEP_LAST and "depth" not in policies:
            raise InvalidQoSProfileException("History set to KEEP_LAST without a depth setting.")
        self.depth = int(policies.pop("depth", 0))
        self.reliability = ReliabilityPolicy(policies.pop("reliability", ReliabilityPolicy.RELIABLE))
        self.durability = DurabilityPolicy(policies.pop("durability", DurabilityPolicy.VOLATILE))
        self.liveliness = LivelinessPolicy(policies.pop("liveliness", LivelinessPolicy.SYSTEM_DEFAULT))
        self.avoid_ros_namespace_conventions = policies.pop("avoid_ros_namespace_conventions", False)
        for name in ("deadline", "lifespan", "liveliness_lease_duration"):
            span = policies.pop(name, None)
            setattr(self, name, span or Duration())
            if span is not None and 0 < span.nanoseconds < (1 << 62):
                raise UsageError(f"QoSProfile: a {name} is not monitored on the embedded graph; leave it out")
        if policies:
            raise TypeError(f"QoSProfile has no {sorted(policies)[0]!r}")


def _preset(depth: int, **policies: Any) -> QoSProfile:
    return QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=depth, **policies)


qos_profile_default = _preset(10)
qos_profile_system_default = _preset(10)
qos_profile_sensor_data = _preset(5, reliability=ReliabilityPolicy.BEST_EFFORT)
qos_profile_services_default = _preset(10)
qos_profile_parameters = _preset(1000)
qos_profile_parameter_events = _preset(1000)
qos_profile_action_status_default = _preset(1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
qos_profile_best_available = _preset(
    10, reliability=ReliabilityPolicy.BEST_AVAILABLE, durability=DurabilityPolicy.BEST_AVAILABLE
)

_RELIABILITY = {
    ReliabilityPolicy.BEST_EFFORT: BEST_EFFORT,
    ReliabilityPolicy.BEST_AVAILABLE: BEST_AVAILABLE,
}
_DURABILITY = {
    DurabilityPolicy.TRANSIENT_LOCAL: TRANSIENT_LOCAL,
    DurabilityPolicy.BEST_AVAILABLE: BEST_AVAILABLE,
}


def graph_qos(given: Any) -> QoS:
    """Return the quality of service of the graph for a profile or a depth."""
    if isinstance(given, bool) or not isinstance(given, (int, QoSProfile)):
        raise TypeError(f"Expected QoSProfile or int, but received {type(given)!r}")
    if isinstance(given, int):
        if given < 0:
            raise ValueError("history depth must be greater than or equal to zero")
        return QoS(max(1, given))
    depth = None if given.history is HistoryPolicy.KEEP_ALL else max(1, given.depth)
    reliability = _RELIABILITY.get(given.reliability, RELIABLE)
    return QoS(depth, reliability, _DURABILITY.get(given.durability, VOLATILE))


QOS = {
    "DurabilityPolicy": DurabilityPolicy,
    "HistoryPolicy": HistoryPolicy,
    "InvalidQoSProfileException": InvalidQoSProfileException,
    "LivelinessPolicy": LivelinessPolicy,
    "QoSDurabilityPolicy": DurabilityPolicy,
    "QoSHistoryPolicy": HistoryPolicy,
    "QoSLivelinessPolicy": LivelinessPolicy,
    "QoSProfile": QoSProfile,
    "QoSReliabilityPolicy": ReliabilityPolicy,
    "ReliabilityPolicy": ReliabilityPolicy,
    "qos_profile_action_status_default": qos_profile_action_status_default,
    "qos_profile_best_available": qos_profile_best_available,
    "qos_profile_default": qos_profile_default,
    "qos_profile_parameter_events": qos_profile_parameter_events,
    "qos_profile_parameters": qos_profile_parameters,
    "qos_profile_sensor_data": qos_profile_sensor_data,
    "qos_profile_services_default": qos_profile_services_default,
    "qos_profile_system_default": qos_profile_system_default,
}
"""Content of ``rclpy.qos``."""
