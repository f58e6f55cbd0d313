"""MAVROS's mission services and topics, over MAVLink's mission protocol.

Waypoints are passed on unchanged; ArduPilot keeps its home position as the first one. ``mission/push``
replaces the whole mission.
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

ANSWER_TIMEOUT: Ns = 1500 * MS
ATTEMPTS = 3
ACCEPTED = 0
GLOBAL_FRAMES = frozenset({0, 3, 5, 6, 10, 11})
"""MAV_FRAMEs with latitude and longitude."""
_PARAMETERS = ("param1", "param2", "param3", "param4")

MISSION_TOPICS = (
    Topic("mission/waypoints", "mavros_msgs/msg/WaypointList", LATCHED_STATE),
    Topic("mission/reached", "mavros_msgs/msg/WaypointReached", LATCHED_STATE),
)


def _scale(frame: int) -> float:
    """Return the units of x and y of a MISSION_ITEM_INT per degree or metre."""
    return 1e7 if frame in GLOBAL_FRAMES else 1e4


def to_item(waypoint: Any, sequence: int) -> dict[str, Any]:
    """Return a waypoint as the fields of a MISSION_ITEM_INT."""
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
    """Return the fields of a MISSION_ITEM_INT as a waypoint."""
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


class MissionServices:
    """Handlers of the mission services and translators of mission messages.

    ``mission/waypoints`` is published after each ``mission/pull`` and ``mission/push``, and when the current
    item has changed.
    """

    def __init__(self, context: InterfaceContext) -> None:
        self._link, self._publish = context.link, context.publish
        self._waypoints: list[Any] = []
        self._current = 0

    def services(self) -> Mapping[str, Service]:
        """Return types and handlers by service name."""
        return {
            "mission/push": ("mavros_msgs/srv/WaypointPush", self.push),
            "mission/pull": ("mavros_msgs/srv/WaypointPull", self.pull),
            "mission/clear": ("mavros_msgs/srv/WaypointClear", self.clear),
            "mission/set_current": ("mavros_msgs/srv/WaypointSetCurrent", self.set_current),
        }

    def translators(self) -> Mapping[str, Translator]:
        """Return the translators by message name."""
        return {"MISSION_ITEM_REACHED": self._publish_reached, "MISSION_CURRENT": self._update_current}

    def _publish_reached(self, fields: Fields, at: Ns) -> None:
        message = new("mavros_msgs/msg/WaypointReached", header=stamped(at), wp_seq=fields["seq"])
        self._publish("mission/reached", message)

    def _update_current(self, fields: Fields, at: Ns) -> None:
        changed, self._current = fields["seq"] != self._current, fields["seq"]
        if changed and self._waypoints:
            self._publish_waypoints(self._waypoints)

    def _publish_waypoints(self, waypoints: list[Any]) -> None:
        self._waypoints = waypoints
        message = new("mavros_msgs/msg/WaypointList", current_seq=self._current, waypoints=waypoints)
        self._publish("mission/waypoints", message)

    def _request(self, answers: FrameSubscription, message: str, fields: dict[str, Any]) -> Frame | None:
        for _ in range(ATTEMPTS):
            self._link.send_to_autopilot(message, fields)
            answer = answers.next(ANSWER_TIMEOUT)
            if answer is not None:
                return answer
        return None

    def push(self, request: Any) -> Any:
        """Handle ``mission/push``."""
        response = service("mavros_msgs/srv/WaypointPush").response
        waypoints = list(request.waypoints)
        if request.start_index != 0 or not waypoints:
            return response(False, 0)
        sent = 0
        with self._link.subscribe("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK") as answers:
            answer = self._request(answers, "MISSION_COUNT", {"count": len(waypoints)})
            while answer is not None and answer.name != "MISSION_ACK":
                sequence = answer.fields["seq"]
                if sequence >= len(waypoints):
                    return response(False, sent)
                sent = max(sent, sequence + 1)
                self._link.send_to_autopilot("MISSION_ITEM_INT", to_item(waypoints[sequence], sequence))
                answer = answers.next(ATTEMPTS * ANSWER_TIMEOUT)
        accepted = answer is not None and answer.fields["type"] == ACCEPTED
        if accepted:
            self._publish_waypoints(waypoints)
        return response(accepted, sent if accepted else 0)

    def pull(self, request: Any) -> Any:
        """Handle ``mission/pull``."""
        response = service("mavros_msgs/srv/WaypointPull").response
        with self._link.subscribe("MISSION_COUNT", "MISSION_ITEM_INT") as answers:
            count = self._request(answers, "MISSION_REQUEST_LIST", {})
            if count is None or count.name != "MISSION_COUNT":
                return response(False, 0)
            waypoints: list[Any] = []
            for sequence in range(count.fields["count"]):
                item = self._request(answers, "MISSION_REQUEST_INT", {"seq": sequence})
                if item is None or item.fields.get("seq") != sequence:
                    return response(False, len(waypoints))
                waypoints.append(to_waypoint(item.fields))
        self._link.send_to_autopilot("MISSION_ACK", {"type": ACCEPTED})
        self._publish_waypoints(waypoints)
        return response(True, len(waypoints))

    def clear(self, request: Any) -> Any:
        """Handle ``mission/clear``."""
        with self._link.subscribe("MISSION_ACK") as answers:
            answer = self._request(answers, "MISSION_CLEAR_ALL", {})
        accepted = answer is not None and answer.fields["type"] == ACCEPTED
        return service("mavros_msgs/srv/WaypointClear").response(accepted)

    def set_current(self, request: Any) -> Any:
        """Handle ``mission/set_current``."""
        with self._link.subscribe("MISSION_CURRENT") as answers:
            answer = self._request(answers, "MISSION_SET_CURRENT", {"seq": request.wp_seq})
        succeeded = answer is not None and answer.fields["seq"] == request.wp_seq
        return service("mavros_msgs/srv/WaypointSetCurrent").response(succeeded)
