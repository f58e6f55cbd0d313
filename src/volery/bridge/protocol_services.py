"""MAVROS's services and topics over MAVLink's mission and parameter protocols.

Waypoints are passed on unchanged; ArduPilot keeps its home position as the first one. ``mission/push``
replaces the whole mission.

``param/pull`` reads all parameters and sets them as ROS parameters below ``param`` in the node's namespace;
``param/push`` sends those that were changed there. Where the graph does not accept such ROS parameters,
``param/pull`` still publishes the values. ``param/param_value`` publishes each received parameter.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from volery.base.errors import VoleryError
from volery.base.time import MS, Ns
from volery.bridge.autopilot_link import PX4_ID, FrameSubscription
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
from volery.links.mavlink_messages import from_bytewise, to_bytewise
from volery.ros.messages import new, service

MISSION_TIMEOUT: Ns = 1500 * MS
MISSION_ATTEMPTS = 3
ACCEPTED = 0
GLOBAL_FRAMES = frozenset({0, 3, 5, 6, 10, 11})
"""MAV_FRAMEs with latitude and longitude."""
_ITEM_PARAMETERS = ("param1", "param2", "param3", "param4")

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
        **{name: getattr(waypoint, name) for name in _ITEM_PARAMETERS},
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
        **{name: item[name] for name in _ITEM_PARAMETERS},
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
        for _ in range(MISSION_ATTEMPTS):
            self._link.send_to_autopilot(message, fields)
            answer = answers.next(MISSION_TIMEOUT)
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
                answer = answers.next(MISSION_ATTEMPTS * MISSION_TIMEOUT)
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


PARAMETER_TIMEOUT: Ns = 1000 * MS
PARAMETER_ATTEMPTS = 3
REAL32, REAL64 = 9, 10
PARAMETERS = "param"
"""Name below which the ROS parameters are set."""
VALUE = "mavros_msgs/msg/Param"

PARAMETER_TOPICS = (Topic("param/param_value", VALUE, on_demand=True),)


class ParameterServices:
    """Handlers of the parameter services and the translator of PARAM_VALUE.

    ArduPilot does not answer a request for an unknown parameter: ``success`` is false after three seconds.
    """

    def __init__(self, context: InterfaceContext) -> None:
        self._context = context
        self._link = context.link
        self._types: dict[str, int] = {}
        self._values: dict[str, float] = {}
        self._complete = False

    def services(self) -> Mapping[str, Service]:
        """Return types and handlers by service name."""
        return {
            "param/get": ("mavros_msgs/srv/ParamGet", self.get),
            "param/set": ("mavros_msgs/srv/ParamSet", self.put),
            "param/pull": ("mavros_msgs/srv/ParamPull", self.pull),
            "param/push": ("mavros_msgs/srv/ParamPush", self.push),
        }

    def translators(self) -> Mapping[str, Translator]:
        """Return the translators by message name."""
        return {"PARAM_VALUE": self._publish_value}

    # -- values in the encoding of the firmware

    @property
    def _bytewise(self) -> bool:
        return self._link.autopilot.autopilot == PX4_ID

    def _value(self, fields: Fields) -> float:
        value: float = fields["param_value"]
        return from_bytewise(fields["param_type"], value) if self._bytewise else value

    def _encoded(self, kind: int, value: float) -> Fields:
        return {"param_value": to_bytewise(kind, value) if self._bytewise else value, "param_type": kind}

    def _message(self, fields: Fields) -> Any:
        value = self._value(fields)
        given = {"real": value} if fields["param_type"] in (REAL32, REAL64) else {"integer": round(value)}
        return new("mavros_msgs/msg/ParamValue", **given)

    def _store(self, fields: Fields) -> None:
        name = fields["param_id"]
        self._types[name], self._values[name] = fields["param_type"], self._value(fields)

    def _publish_value(self, fields: Fields, at: Ns) -> None:
        self._store(fields)
        if self._context.wanted("param/param_value"):
            message = new(VALUE, header=stamped(at), param_id=fields["param_id"], value=self._message(fields))
            message.param_index, message.param_count = fields["param_index"], fields["param_count"]
            self._context.publish("param/param_value", message)

    # -- single parameters

    def _request(self, name: str, message: str, fields: Fields) -> Frame | None:
        with self._link.subscribe("PARAM_VALUE") as answers:
            for _ in range(PARAMETER_ATTEMPTS):
                self._link.send_to_autopilot(message, {"param_id": name, **fields})
                answer = answers.next(PARAMETER_TIMEOUT)
                while answer is not None and answer.fields["param_id"] != name:
                    answer = answers.next(PARAMETER_TIMEOUT)
                if answer is not None:
                    return answer
        return None

    def _set(self, name: str, kind: int, value: float) -> Frame | None:
        return self._request(name, "PARAM_SET", self._encoded(kind, value))

    def _response(self, service_type: str, answer: Frame | None) -> Any:
        response = service(service_type).response
        return response() if answer is None else response(True, self._message(answer.fields))

    def get(self, request: Any) -> Any:
        """Handle ``param/get``."""
        answer = self._request(request.param_id, "PARAM_REQUEST_READ", {"param_index": -1})
        return self._response("mavros_msgs/srv/ParamGet", answer)

    def put(self, request: Any) -> Any:
        """Handle ``param/set``: the integer is used unless it is 0, else the real."""
        known = self._request(request.param_id, "PARAM_REQUEST_READ", {"param_index": -1})
        if known is not None:
            value = float(request.value.integer or request.value.real)
            known = self._set(request.param_id, known.fields["param_type"], value)
        return self._response("mavros_msgs/srv/ParamSet", known)

    # -- all parameters

    def pull(self, request: Any) -> Any:
        """Handle ``param/pull``: read all parameters, unless they are known and *force_pull* is false."""
        wanted = request.force_pull or not self._complete
        self._complete = not wanted or self._read_all()
        try:
            self._context.node.set_parameter(PARAMETERS, {name: self._as_ros(name) for name in self._values})
        except VoleryError as error:
            self._context.warn(f"param/pull: not set as ROS parameters: {error}")
        return service("mavros_msgs/srv/ParamPull").response(self._complete, len(self._values))

    def _as_ros(self, name: str) -> float | int:
        value = self._values[name]
        return value if self._types[name] in (REAL32, REAL64) else round(value)

    def _read_all(self) -> bool:
        """Request the list, then each parameter that was lost, and return whether all were received."""
        found: set[int] = set()
        count = 0
        with self._link.subscribe("PARAM_VALUE") as answers:
            for _ in range(PARAMETER_ATTEMPTS):
                self._link.send_to_autopilot("PARAM_REQUEST_LIST", {})
                while (answer := answers.next(PARAMETER_TIMEOUT)) is not None:
                    count = self._keep(answer.fields, found)
                    if len(found) == count:
                        return True
                if found:
                    break
            for _ in range(PARAMETER_ATTEMPTS):
                while (index := _first_missing(found, count)) is not None:
                    self._link.send_to_autopilot("PARAM_REQUEST_READ", {"param_id": "", "param_index": index})
                    answer = answers.next(PARAMETER_TIMEOUT)
                    if answer is None or answer.fields["param_index"] != index:
                        break
                    self._keep(answer.fields, found)
        return bool(found) and len(found) == count

    def _keep(self, fields: Fields, found: set[int]) -> int:
        """Store a value and return the number of parameters."""
        count: int = fields["param_count"]
        if fields["param_index"] < count:
            found.add(fields["param_index"])
        self._store(fields)
        return count

    def push(self, request: Any) -> Any:
        """Handle ``param/push``: send the ROS parameters that differ from the known values."""
        response = service("mavros_msgs/srv/ParamPush").response
        given = self._context.node.get_parameter(PARAMETERS, {})
        sent = 0
        for name, value in sorted(given.items()):
            if name in self._values and float(value) != self._values[name]:
                if self._set(name, self._types[name], float(value)) is None:
                    return response(False, sent)
                sent += 1
        return response(True, sent)


def _first_missing(found: set[int], count: int) -> int | None:
    return next((index for index in range(count) if index not in found), None)
