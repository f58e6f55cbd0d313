"""The module ``message_filters`` of one run."""

from __future__ import annotations

from types import ModuleType

from volery.ros.client_libraries.message_filters.filters import Cache, SimpleFilter, Subscriber
from volery.ros.client_libraries.message_filters.synchronizers import (
    ApproximateTimeSynchronizer,
    TimeSynchronizer,
)
from volery.ros.client_libraries.module import face_module

_FILTERS = (SimpleFilter, Subscriber, Cache, TimeSynchronizer, ApproximateTimeSynchronizer)


def modules(rospy: ModuleType, times: ModuleType) -> dict[str, ModuleType]:
    """By name. They talk through *rospy* where no node is given; *times* is ``rclpy.time``."""
    members = {"rospy": rospy, "rclpy_time": times.Time}
    names = {kind.__name__: type(kind.__name__, (kind,), members) for kind in _FILTERS}
    return {"message_filters": face_module("message_filters", names)}
