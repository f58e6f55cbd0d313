"""The ROS interface of a vehicle node under one naming scheme: topics, services and their translators."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from volery.base.frames import LocalFrame
from volery.base.geoid import EGM96, Geoid
from volery.base.time import Ns, S
from volery.bridge.autopilot_link import AutopilotLink
from volery.links.frame import Frame
from volery.ros.graph import DEFAULT, TRANSIENT_LOCAL, Handler, Node, QoS
from volery.ros.messages import message_class

BODY = "base_link"
"""The body frame of the vehicle: forward, left, up."""
LATCHED_STATE = QoS(10, durability=TRANSIENT_LOCAL)

Fields = dict[str, Any]
"""Fields of a MAVLink message by name."""
Publish = Callable[[str, Any], None]
"""``publish(topic, message)``."""
Translator = Callable[[Fields, Ns], None]
"""``translate(fields, stamp)`` publishes the content of a frame; the stamp is ROS time of its arrival."""
OutgoingMessage = tuple[str, Fields]
"""Name and fields of a MAVLink message, without addresses."""
Service = tuple[str, Handler]
"""Type of a service and its handler."""

_header = message_class("std_msgs/msg/Header")
_time = message_class("builtin_interfaces/msg/Time")


class PublishedByNode(NamedTuple):
    """A published topic. With *on_demand* it is published only while it has a subscription."""

    name: str
    type: str
    qos: QoS = DEFAULT
    on_demand: bool = False


class SubscribedTopic(NamedTuple):
    """A subscribed topic and the function that translates a message of it to those of MAVLink."""

    name: str
    type: str
    translate: Callable[[Any, Ns], OutgoingMessage | list[OutgoingMessage] | Frame]
    """A ``Frame`` is sent as it is."""


@dataclass(frozen=True, kw_only=True)
class NodeInterface:
    """All topics, translators, subscriptions and services of a vehicle node.

    ``disconnected`` publishes that the autopilot has stopped sending. ``due`` is asked in each cycle and
    returns what is to be done beside the loop.
    """

    topics: Sequence[PublishedByNode]
    translators: Mapping[str, Sequence[Translator]]
    subscriptions: Sequence[SubscribedTopic]
    services: Mapping[str, Service]
    disconnected: Callable[[Ns], None]
    due: Callable[[Ns], Callable[[], None] | None] = lambda now: None


@dataclass(frozen=True)
class InterfaceContext:
    """What the parts of an interface work with.

    Args:
        node: The node of the graph.
        link: Link to the autopilot.
        publish: Publishes a message on a topic.
        wanted: Returns whether a topic should be published.
        warn: Records a warning.
        geoid: Converts between ellipsoidal and AMSL altitudes.
        control: Whether roscopter's ``send_rc`` is offered.
        origin: Origin of the frame ``map``; None is the autopilot's own origin.
        parameter_services: Whether parameters are offered by the services of ROS 2, as MAVROS 2 does.
        pose_transform: Whether the pose is published on ``/tf``.
        epoch: ROS time at the kernel's zero, ns.
    """

    node: Node
    link: AutopilotLink
    publish: Publish
    wanted: Callable[[str], bool]
    warn: Callable[[str], None]
    geoid: Geoid = EGM96
    control: bool = False
    origin: LocalFrame | None = None
    parameter_services: bool = False
    pose_transform: bool = True
    epoch: Ns = 0


@dataclass(frozen=True)
class NamingScheme:
    """The names under which a vehicle is served.

    Args:
        node: Name of the node.
        make_interface: Returns the interface of a node.
        streams: Rates in Hz of the telemetry streams that the interface needs, by MAV_DATA_STREAM.
        home: Whether the interface needs the home position and the landed state.
        sensors: Beginnings of the topics that have the QoS of sensors in ROS 2.
        messages: Rates in Hz of single messages that the interface needs as well, by name.
        as_received: Whether frames are published as they arrive, whatever period a node is given.
        prepare: Called once before a node is made, in the order in which nodes are.
    """

    node: str
    make_interface: Callable[[InterfaceContext], NodeInterface]
    streams: Mapping[int, int]
    home: bool
    sensors: tuple[str, ...] = ()
    messages: Mapping[str, float] = field(default_factory=dict)
    as_received: bool = False
    prepare: Callable[[], None] = lambda: None


def stamped(at: Ns, frame_id: str = "") -> Any:
    """Return a ``std_msgs/msg/Header`` with ROS time *at* in ns."""
    return _header(_time(*divmod(at, S)), frame_id)


def merge_translators(*parts: Mapping[str, Translator]) -> dict[str, list[Translator]]:
    """Return all translators by message name; several parts may translate the same message."""
    found: dict[str, list[Translator]] = {}
    for part in parts:
        for name, translate in part.items():
            found.setdefault(name, []).append(translate)
    return found
