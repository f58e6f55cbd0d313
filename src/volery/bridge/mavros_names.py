"""MAVROS's names.

Differences from MAVROS: publishers are reliable, as in ROS 1; it speaks as a ground station's system id,
which is the only one from which ArduPilot takes sticks; it asks for the streams it publishes, as roscopter
does; topics that few need are published while somebody subscribes to them.
"""

from __future__ import annotations

from collections.abc import Mapping

from volery.base.time import Ns
from volery.bridge.autopilot_link import EXTENDED_STATUS, EXTRA1, EXTRA2, POSITION, RAW_SENSORS, RC
from volery.bridge.command_services import CommandServices
from volery.bridge.mission_services import MISSION_TOPICS, MissionServices
from volery.bridge.motion_publishers import (
    IMU_TOPICS,
    POSE_TOPICS,
    TRANSFORM_TOPICS,
    ImuPublisher,
    PosePublisher,
    TransformPublisher,
)
from volery.bridge.node_interface import InterfaceContext, NamingScheme, NodeInterface, merge_translators
from volery.bridge.parameter_services import PARAMETER_TOPICS, ParameterServices
from volery.bridge.setpoint_topics import TARGET_TOPICS, TargetPublisher, subscriptions
from volery.bridge.status_publishers import (
    DIAGNOSTIC_TOPICS,
    STATUS_TOPICS,
    DiagnosticsPublisher,
    StatusPublisher,
)

STREAMS: Mapping[int, int] = {RAW_SENSORS: 1, EXTENDED_STATUS: 2, RC: 1, POSITION: 10, EXTRA1: 4, EXTRA2: 1}

TOPICS = (
    *STATUS_TOPICS,
    *POSE_TOPICS,
    *IMU_TOPICS,
    *TARGET_TOPICS,
    *MISSION_TOPICS,
    *PARAMETER_TOPICS,
    *TRANSFORM_TOPICS,
    *DIAGNOSTIC_TOPICS,
)


def offer(around: InterfaceContext) -> NodeInterface:
    """All that is served."""
    said, asked = StatusPublisher(around), CommandServices(around)
    stored, kept = MissionServices(around), ParameterServices(around)
    placed, health = PosePublisher(around), DiagnosticsPublisher(around)
    moving = (ImuPublisher(around), TargetPublisher(around), TransformPublisher(around))

    def disconnected(stamp: Ns) -> None:
        said.disconnected(stamp)
        health.disconnected(stamp)

    return NodeInterface(
        topics=TOPICS,
        translators=merge_translators(
            *(part.translators() for part in (said, placed, *moving, stored, kept, health))
        ),
        subscriptions=subscriptions(around.geoid),
        services={**asked.services(), **stored.services(), **kept.services()},
        disconnected=disconnected,
    )


MAVROS = NamingScheme("mavros", offer, STREAMS, home=True)
