"""MAVROS's services for mission, geofence and rally points over MAVLink's mission protocol.

Items are passed on unchanged; ArduPilot keeps its home position as the first item of a mission. ``push``
replaces a whole list. MAVROS 1 and 2 name the lists of geofence and rally points differently: both names are
published.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from volery.base.time import MS, Ns, S
from volery.bridge.autopilot_link import ARDUPILOT_ID, FrameSubscription
from volery.bridge.node_interface import (
    LATCHED_STATE,
    Fields,
    InterfaceContext,
    PublishedByNode,
    Service,
    Translator,
    stamped,
)
from volery.links.frame import Frame
from volery.links.mavlink_messages import constant, item_scale, mission_type
from volery.ros.messages import new, service

ANSWERED_WITHIN: Ns = 1500 * MS
ATTEMPTS = 3
READ_AFTER: Ns = 15 * S
"""When MAVROS reads the lists, after it has connected."""
REPORTS = 5
"""Reports of the current item that may still state the one before."""
ACCEPTED = constant("MAV_MISSION_ACCEPTED")
_ITEM_PARAMETERS = ("param1", "param2", "param3", "param4")
_LIST = "mavros_msgs/msg/WaypointList"


class PlanList(NamedTuple):
    """A list that an autopilot keeps: its MAV_MISSION_TYPE, the namespace of its services, and its topics."""

    kind: int
    name: str
    topics: tuple[str, ...]


MISSION = PlanList(0, "mission", ("mission/waypoints",))
GEOFENCE = PlanList(1, "geofence", ("geofence/waypoints", "geofence/fences"))
RALLY_POINTS = PlanList(2, "rallypoint", ("rallypoint/waypoints", "rallypoint/rallypoints"))

PLAN_TOPICS = (
    *(
        PublishedByNode(topic, _LIST, LATCHED_STATE, on_demand=True)
        for plan in (MISSION, GEOFENCE, RALLY_POINTS)
        for topic in plan.topics
    ),
    PublishedByNode("mission/reached", "mavros_msgs/msg/WaypointReached", LATCHED_STATE),
)


def to_item(waypoint: Any, sequence: int, kind: int = MISSION.kind) -> dict[str, Any]:
    """Return a waypoint as the fields of a MISSION_ITEM_INT."""
    scale = item_scale(waypoint.command, waypoint.frame)
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
        "mission_type": kind,
    }


def to_waypoint(item: dict[str, Any]) -> Any:
    """Return the fields of a MISSION_ITEM_INT as a waypoint."""
    scale = item_scale(item["command"], item["frame"])
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


class PlanServices:
    """Handlers of ``push``, ``pull`` and ``clear`` of one list.

    The list is published after each ``pull``, ``push`` and ``clear``. It is read by itself once the autopilot
    has been connected for a while, if its topic has a subscription.

    Args:
        context: The interface.
        plan: The list.
    """

    def __init__(self, context: InterfaceContext, plan: PlanList) -> None:
        self._link, self._publish, self._warn = context.link, context.publish, context.warn
        self._wanted = context.wanted
        self._plan = plan
        self._read_at: Ns | None = None
        self._known = False
        """Whether the list on board is known, or a request about it is under way."""
        self._of = {"mission_type": plan.kind}
        self.waypoints: list[Any] = []
        self.current = 0

    def services(self) -> Mapping[str, Service]:
        """Return types and handlers by service name."""
        return {
            f"{self._plan.name}/push": ("mavros_msgs/srv/WaypointPush", self.push),
            f"{self._plan.name}/pull": ("mavros_msgs/srv/WaypointPull", self.pull),
            f"{self._plan.name}/clear": ("mavros_msgs/srv/WaypointClear", self.clear),
        }

    def due(self, now: Ns) -> Callable[[], None] | None:
        """Return what reads the list, once it is time and its topic has a subscription."""
        if self._known or not self._link.known:
            return None
        self._read_at = now + READ_AFTER if self._read_at is None else self._read_at
        if now < self._read_at or not any(self._wanted(topic) for topic in self._plan.topics):
            return None
        self._known = True
        return self._read

    def _read(self) -> None:
        self.pull(None)

    def publish_list(self, waypoints: list[Any]) -> None:
        """Publish the list as it is on board."""
        self.waypoints = waypoints
        for topic in self._plan.topics:
            self._publish(topic, new(_LIST, current_seq=self.current, waypoints=waypoints))

    def _next(self, answers: FrameSubscription, within: Ns) -> Frame | None:
        """Return the next frame about this list."""
        answer = answers.next(within)
        while answer is not None and mission_type(answer.fields) != self._plan.kind:
            answer = answers.next(within)
        return answer

    def _request(self, answers: FrameSubscription, message: str, fields: dict[str, Any]) -> Frame | None:
        for _ in range(ATTEMPTS):
            self._link.send_to_autopilot(message, fields)
            answer = self._next(answers, ANSWERED_WITHIN)
            if answer is not None:
                return answer
        return None

    def push(self, request: Any) -> Any:
        """Handle ``push`` of a whole list, or of a part from ``start_index`` on, which ArduPilot stores."""
        response, self._known = service("mavros_msgs/srv/WaypointPush").response, True
        given, first = list(request.waypoints), request.start_index
        if not given:
            return response(False, 0)
        begin, fields = "MISSION_COUNT", {"count": len(given)}
        before: list[Any] = []
        if first:
            before = self._stored_before(first, len(given))
            if not before:
                return response(False, 0)
            begin = "MISSION_WRITE_PARTIAL_LIST"
            fields = {"start_index": first, "end_index": first + len(given) - 1}
        waypoints = [*before[:first], *given, *before[first + len(given) :]]
        sent = 0
        with self._link.subscribe("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK") as answers:
            answer = self._request(answers, begin, {**fields, **self._of})
            while answer is not None and answer.name != "MISSION_ACK":
                sequence = answer.fields["seq"]
                if not 0 <= sequence - first < len(given):
                    return response(False, sent)
                sent = max(sent, sequence - first + 1)
                item = to_item(waypoints[sequence], sequence, self._plan.kind)
                self._link.send_to_autopilot("MISSION_ITEM_INT", item)
                answer = self._next(answers, ATTEMPTS * ANSWERED_WITHIN)
        accepted = answer is not None and answer.fields["type"] == ACCEPTED
        if accepted:
            self.publish_list(waypoints)
        return response(accepted, sent if accepted else 0)

    def _stored_before(self, first: int, count: int) -> list[Any]:
        """Return the stored list, of which a part is to be replaced; empty, with a warning, if not."""
        name, problem = f"{self._plan.name}/push", ""
        if self._link.autopilot.autopilot != ARDUPILOT_ID:
            problem = "only ArduPilot stores a part of a list; push the whole list with start_index 0"
        elif not self.waypoints and not self.pull(None).success:
            problem = "the list on board cannot be read"
        elif first + count > len(self.waypoints):
            problem = f"items {first} to {first + count - 1} do not exist: {len(self.waypoints)} are on board"
        if problem:
            self._warn(f"{name} with start_index {first}: {problem}")
            return []
        return self.waypoints

    def pull(self, request: Any) -> Any:
        """Handle ``pull``."""
        response, self._known = service("mavros_msgs/srv/WaypointPull").response, True
        with self._link.subscribe("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK") as answers:
            count = self._request(answers, "MISSION_REQUEST_LIST", self._of)
            if count is None or count.name != "MISSION_COUNT":
                return response(False, 0)
            waypoints: list[Any] = []
            for sequence in range(count.fields["count"]):
                item = self._request(answers, "MISSION_REQUEST_INT", {"seq": sequence, **self._of})
                if item is None or item.fields.get("seq") != sequence:
                    return response(False, len(waypoints))
                waypoints.append(to_waypoint(item.fields))
        self._link.send_to_autopilot("MISSION_ACK", {"type": ACCEPTED, **self._of})
        self.publish_list(waypoints)
        return response(True, len(waypoints))

    def clear(self, request: Any) -> Any:
        """Handle ``clear``."""
        self._known = True
        with self._link.subscribe("MISSION_ACK") as answers:
            answer = self._request(answers, "MISSION_CLEAR_ALL", self._of)
        accepted = answer is not None and answer.fields["type"] == ACCEPTED
        if accepted:
            self.publish_list([])
        return service("mavros_msgs/srv/WaypointClear").response(accepted)


class MissionServices(PlanServices):
    """The list that is flown: it has a current item, and items that were reached.

    ``mission/waypoints`` is also published when the current item has changed.
    """

    def __init__(self, context: InterfaceContext) -> None:
        super().__init__(context, MISSION)

    def services(self) -> Mapping[str, Service]:
        """Return types and handlers by service name."""
        set_current = ("mavros_msgs/srv/WaypointSetCurrent", self.set_current)
        return {**super().services(), "mission/set_current": set_current}

    def translators(self) -> Mapping[str, Translator]:
        """Return the translators by message name."""
        return {"MISSION_ITEM_REACHED": self._publish_reached, "MISSION_CURRENT": self._update_current}

    def _publish_reached(self, fields: Fields, at: Ns) -> None:
        message = new("mavros_msgs/msg/WaypointReached", header=stamped(at), wp_seq=fields["seq"])
        self._publish("mission/reached", message)

    def publish_list(self, waypoints: list[Any]) -> None:
        """Publish the list as it is on board, with the current item marked."""
        for sequence, waypoint in enumerate(waypoints):
            waypoint.is_current = sequence == self.current
        super().publish_list(waypoints)

    def _update_current(self, fields: Fields, at: Ns) -> None:
        changed, self.current = fields["seq"] != self.current, fields["seq"]
        if changed and self.waypoints:
            self.publish_list(self.waypoints)

    def set_current(self, request: Any) -> Any:
        """Handle ``mission/set_current``: success is that the autopilot reports the item as current."""
        wanted = {"seq": request.wp_seq}
        with self._link.subscribe("MISSION_CURRENT") as answers:
            answer = self._request(answers, "MISSION_SET_CURRENT", wanted)
            for _ in range(REPORTS):  # those under way when it was asked state the item before
                if answer is None or answer.fields["seq"] == request.wp_seq:
                    break
                answer = answers.next(ANSWERED_WITHIN)
        succeeded = answer is not None and answer.fields["seq"] == request.wp_seq
        return service("mavros_msgs/srv/WaypointSetCurrent").response(succeeded)
