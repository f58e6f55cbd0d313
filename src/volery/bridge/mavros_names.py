"""The naming scheme of MAVROS.

Differences from MAVROS: publishers are reliable, as in ROS 1; the node sends with the system id of a ground
station, which is the only one from which ArduPilot accepts manual control; the node requests the streams that
it publishes, as roscopter does; topics that few nodes need are published only while they have a subscription.
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


def mavros_interface(context: InterfaceContext) -> NodeInterface:
    """Return the interface of a node under MAVROS's names."""
    status, commands = StatusPublisher(context), CommandServices(context)
    missions, parameters = MissionServices(context), ParameterServices(context)
    poses, diagnostics = PosePublisher(context), DiagnosticsPublisher(context)
    others = (ImuPublisher(context), TargetPublisher(context), TransformPublisher(context))
    parts = (status, poses, *others, missions, parameters, diagnostics)

    def disconnected(stamp: Ns) -> None:
        status.disconnected(stamp)
        diagnostics.disconnected(stamp)

    return NodeInterface(
        topics=TOPICS,
        translators=merge_translators(*(part.translators() for part in parts)),
        subscriptions=subscriptions(context.geoid),
        services={**commands.services(), **missions.services(), **parameters.services()},
        disconnected=disconnected,
    )


MAVROS = NamingScheme("mavros", mavros_interface, STREAMS, home=True)
