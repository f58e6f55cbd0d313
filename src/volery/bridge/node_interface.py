"""What a vehicle node offers to the graph under one set of names: topics, services, and who translates
them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from volery.base.frames import LocalFrame
from volery.base.geoid import EGM96, Geoid
from volery.base.time import Ns, S
from volery.bridge.autopilot_link import AutopilotLink
from volery.ros.graph import DEFAULT, TRANSIENT_LOCAL, Handler, Node, QoS
from volery.ros.messages import message_class

BODY = "base_link"
"""The frame of the vehicle's body: forward, left, up."""
LATCHED_STATE = QoS(10, durability=TRANSIENT_LOCAL)

Fields = dict[str, Any]
"""Of a frame."""
Publish = Callable[[str, Any], None]
"""``publish(topic, message)``."""
Translator = Callable[[Fields, Ns], None]
"""``translate(fields, stamp)`` publishes what a frame says; the stamp is ROS time of its arrival."""
OutgoingMessage = tuple[str, Fields]
"""A frame's name and fields, without addresses."""
Service = tuple[str, Handler]
"""The type of a service and its handler."""

_header = message_class("std_msgs/msg/Header")
_time = message_class("builtin_interfaces/msg/Time")


class Topic(NamedTuple):
    """A topic that the vehicle node publishes; *on_demand*: while somebody subscribes to it."""

    name: str
    type: str
    qos: QoS = DEFAULT
    on_demand: bool = False


class Subscription(NamedTuple):
    """A topic that the vehicle node subscribes to, and what its messages become."""

    name: str
    type: str
    translate: Callable[[Any, Ns], OutgoingMessage]


@dataclass(frozen=True, kw_only=True)
class NodeInterface:
    """All of it. ``disconnected`` publishes that the autopilot has fallen silent."""

    topics: Sequence[Topic]
    translators: Mapping[str, Sequence[Translator]]
    subscriptions: Sequence[Subscription]
    services: Mapping[str, Service]
    disconnected: Callable[[Ns], None]


@dataclass(frozen=True)
class InterfaceContext:
    """What an offering is made with.

    ``wanted(topic)``: it is worth while to publish; ``warn`` records what went wrong; *control*:
    roscopter may be told to send sticks; *origin*: what ``map`` is about, where that is agreed.
    """

    node: Node
    wire: AutopilotLink
    publish: Publish
    wanted: Callable[[str], bool]
    warn: Callable[[str], None]
    geoid: Geoid = EGM96
    control: bool = False
    origin: LocalFrame | None = None


@dataclass(frozen=True)
class NamingScheme:
    """One set of names: that of the node, what it ``offer``s, and the ``streams`` that this takes (hertz by
    MAV_DATA_STREAM); *home*: the home position and the landed state as well.
    """

    node: str
    offer: Callable[[InterfaceContext], NodeInterface]
    streams: Mapping[int, int]
    home: bool


def stamped(at: Ns, frame_id: str = "") -> Any:
    """A header."""
    return _header(_time(*divmod(at, S)), frame_id)


def merge_translators(*parts: Mapping[str, Translator]) -> dict[str, list[Translator]]:
    """Translators by the name of the frame; several parts may want the same one."""
    found: dict[str, list[Translator]] = {}
    for part in parts:
        for name, translate in part.items():
            found.setdefault(name, []).append(translate)
    return found
