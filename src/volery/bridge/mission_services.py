"""Services that read and write the autopilot's mission: MAVLink's mission protocol.

Waypoints go through as they are; ArduPilot keeps its home as the first one. ``mission/push`` replaces the
whole mission.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from volery.base.time import MS, Ns
from volery.bridge.autopilot_link import FrameSubscription
from volery.bridge.node_interface import (
    LATCHED_STATE,
    Fields,
    InterfaceContext,
    Service,
    Topic,
    Translator,
    stamped,
)
from volery.links.link import Frame
from volery.ros.messages import new, service

ANSWER_WITHIN: Ns = 1500 * MS
TRIES = 3
ACCEPTED = 0
GLOBAL_FRAMES = frozenset({0, 3, 5, 6, 10, 11})
_PARAMETERS = ("param1", "param2", "param3", "param4")


def _scale(frame: int) -> float:
    """Units of x and y in a MISSION_ITEM_INT per degree or metre."""
    return 1e7 if frame in GLOBAL_FRAMES else 1e4


def to_item(waypoint: Any, sequence: int) -> dict[str, Any]:
    """A waypoint as the fields of a MISSION_ITEM_INT."""
    scale = _scale(waypoint.frame)
    return {
        "seq": sequence,
        "frame": waypoint.frame,
        "command": waypoint.command,
        "current": int(waypoint.is_current),
        "autocontinue": int(waypoint.autocontinue),
        **{name: getattr(waypoint, name) for name in _PARAMETERS},
        "x": round(waypoint.x_lat * scale),
        "y": round(waypoint.y_long * scale),
        "z": waypoint.z_alt,
    }


def to_waypoint(item: dict[str, Any]) -> Any:
    """The fields of a MISSION_ITEM_INT as a waypoint."""
    scale = _scale(item["frame"])
    return new(
        "mavros_msgs/msg/Waypoint",
        frame=item["frame"],
        command=item["command"],
        is_current=bool(item["current"]),
        autocontinue=bool(item["autocontinue"]),
        **{name: item[name] for name in _PARAMETERS},
        x_lat=item["x"] / scale,
        y_long=item["y"] / scale,
        z_alt=item["z"],
    )


MISSION_TOPICS = (
    Topic("mission/waypoints", "mavros_msgs/msg/WaypointList", LATCHED_STATE),
    Topic("mission/reached", "mavros_msgs/msg/WaypointReached", LATCHED_STATE),
)


class MissionServices:
    """Handlers and translators. ``mission/waypoints`` is published after each ``mission/pull`` and
    ``mission/push``, and when another of its items has become the current one.
    """

    def __init__(self, around: InterfaceContext) -> None:
        self._wire, self._publish = around.wire, around.publish
        self._known: list[Any] = []
        self._current = 0

    def services(self) -> Mapping[str, Service]:
        """Handlers by the service's name, with its type."""
        return {
            "mission/push": ("mavros_msgs/srv/WaypointPush", self.push),
            "mission/pull": ("mavros_msgs/srv/WaypointPull", self.pull),
            "mission/clear": ("mavros_msgs/srv/WaypointClear", self.clear),
            "mission/set_current": ("mavros_msgs/srv/WaypointSetCurrent", self.set_current),
        }

    def translators(self) -> Mapping[str, Translator]:
        """By the name of the frame."""
        return {"MISSION_ITEM_REACHED": self._reached, "MISSION_CURRENT": self._is_current}

    def _reached(self, said: Fields, at: Ns) -> None:
        message = new("mavros_msgs/msg/WaypointReached", header=stamped(at), wp_seq=said["seq"])
        self._publish("mission/reached", message)

    def _is_current(self, said: Fields, at: Ns) -> None:
        changed, self._current = said["seq"] != self._current, said["seq"]
        if changed and self._known:
            self._show(self._known)

    def _show(self, waypoints: list[Any]) -> None:
        self._known = waypoints
        message = new("mavros_msgs/msg/WaypointList", current_seq=self._current, waypoints=waypoints)
        self._publish("mission/waypoints", message)

    def _ask(self, ear: FrameSubscription, message: str, fields: dict[str, Any]) -> Frame | None:
        for _ in range(TRIES):
            self._wire.send_to(message, fields)
            answer = ear.next(ANSWER_WITHIN)
            if answer is not None:
                return answer
        return None

    def push(self, request: Any) -> Any:
        """``mission/push``."""
        response = service("mavros_msgs/srv/WaypointPush").response
        waypoints = list(request.waypoints)
        if request.start_index != 0 or not waypoints:
            return response(False, 0)
        sent = 0
        with self._wire.listen("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK") as ear:
            said = self._ask(ear, "MISSION_COUNT", {"count": len(waypoints)})
            while said is not None and said.name != "MISSION_ACK":
                sequence = said.fields["seq"]
                if sequence >= len(waypoints):
                    return response(False, sent)
                sent = max(sent, sequence + 1)
                self._wire.send_to("MISSION_ITEM_INT", to_item(waypoints[sequence], sequence))
                said = ear.next(TRIES * ANSWER_WITHIN)
        accepted = said is not None and said.fields["type"] == ACCEPTED
        if accepted:
            self._show(waypoints)
        return response(accepted, sent if accepted else 0)

    def pull(self, request: Any) -> Any:
        """``mission/pull``."""
        response = service("mavros_msgs/srv/WaypointPull").response
        with self._wire.listen("MISSION_COUNT", "MISSION_ITEM_INT") as ear:
            counted = self._ask(ear, "MISSION_REQUEST_LIST", {})
            if counted is None or counted.name != "MISSION_COUNT":
                return response(False, 0)
            waypoints: list[Any] = []
            for sequence in range(counted.fields["count"]):
                item = self._ask(ear, "MISSION_REQUEST_INT", {"seq": sequence})
                if item is None or item.fields.get("seq") != sequence:
                    return response(False, len(waypoints))
                waypoints.append(to_waypoint(item.fields))
        self._wire.send_to("MISSION_ACK", {"type": ACCEPTED})
        self._show(waypoints)
        return response(True, len(waypoints))

    def clear(self, request: Any) -> Any:
        """``mission/clear``."""
        with self._wire.listen("MISSION_ACK") as ear:
            said = self._ask(ear, "MISSION_CLEAR_ALL", {})
        accepted = said is not None and said.fields["type"] == ACCEPTED
        return service("mavros_msgs/srv/WaypointClear").response(accepted)

    def set_current(self, request: Any) -> Any:
        """``mission/set_current``."""
        with self._wire.listen("MISSION_CURRENT") as ear:
            said = self._ask(ear, "MISSION_SET_CURRENT", {"seq": request.wp_seq})
        succeeded = said is not None and said.fields["seq"] == request.wp_seq
        return service("mavros_msgs/srv/WaypointSetCurrent").response(succeeded)
