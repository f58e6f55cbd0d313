"""MAVLink's microservices as a client: parameters, plans, logs, commands and corrections.

Each request is sent again until its answer arrives, as the protocols ask: messages are lost on radios. The
calls block the calling task; several tasks may ask at once, because an answer is recognised by its content.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import hypot, isclose, isfinite
from typing import Any

from volery.base.elementary import atan2
from volery.base.errors import CapabilityError, NotArrived, Refused
from volery.base.frames import Vector, upper_triangle
from volery.base.position import Position
from volery.base.time import MS, US, Ns, S
from volery.kernel.api import Kernel
from volery.kernel.waiting import Lock
from volery.links.frame import Frame
from volery.links.mavlink_messages import (
    constant,
    entry_name,
    from_bytewise,
    item_scale,
    message_type,
    mission_type,
    to_bytewise,
)
from volery.vehicles.drivers.mavlink.file_transfer import FileTransfer
from volery.vehicles.drivers.mavlink.pending_requests import AGAIN, TRIES, PendingRequests
from volery.vehicles.external_pose import ExternalPose
from volery.vehicles.rtcm import correction_parts
from volery.vehicles.services import (
    MISSION,
    NO_RULES,
    LogEntry,
    Parameter,
    ParameterRules,
    PlanItem,
    mavlink_parameter_name,
    missing_parameter,
)
from volery.vehicles.telemetry import Telemetry

ANSWERED_WITHIN: Ns = 10 * S
MISSING_AT_ONCE = 20
"""Number of missing parameters that are requested together."""

KEPT_TIMES = 2
"""How often the old value must come in answer to a new one before it counts as the answer."""
LATE_WITHIN: Ns = 250 * MS
"""Time after a new value was sent in which the old one is rather the answer to an earlier request."""

RESETS = 256
SAME_DEGREES = 10
"""Difference of an origin that is stated as a float on the way [1e-7 degrees]."""

LOG_PART = 90
"""Bytes in one LOG_DATA."""

_ACCEPTED = constant("MAV_RESULT_ACCEPTED")
_IN_PROGRESS = constant("MAV_RESULT_IN_PROGRESS")
_UNSUPPORTED = constant("MAV_RESULT_UNSUPPORTED")
_REQUEST_MESSAGE = constant("MAV_CMD_REQUEST_MESSAGE")
_DOES_NOT_EXIST = constant("MAV_PARAM_ERROR_DOES_NOT_EXIST")
LARGEST_FLOAT = 3.4028235e38
_WHOLE: Mapping[int, tuple[int, int]] = {
    constant(f"MAV_PARAM_TYPE_{sign}INT{bits}"): (
        (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    )
    for sign in ("U", "")
    for bits in (8, 16, 32, 64)
}
"""Smallest and largest value of whole parameters, by MAV_PARAM_TYPE."""
_BODY_FRD = constant("MAV_FRAME_BODY_FRD")
_FIDUCIAL = constant("LANDING_TARGET_TYPE_VISION_FIDUCIAL")
_REAL32, _REAL64 = constant("MAV_PARAM_TYPE_REAL32"), constant("MAV_PARAM_TYPE_REAL64")

Send = Callable[..., None]


class MavlinkServices(PendingRequests):
    """``Services`` of one autopilot on a MAVLink link.

    Args:
        kernel: clock and tasks.
        telemetry: telemetry of the vehicle.
        send: sends a message without a target.
        send_to: sends a message, given its name and its fields without the target.
        bytewise: whether whole parameters lie in the bytes of the float, as in PX4.
        parameter_rules: its parameters with other names in other versions, and those that it writes itself.
        home_first: whether item 0 of a mission is home, as in ArduPilot.
        sender: system and component ids that the messages are sent with.
    """

    def __init__(
        self,
        kernel: Kernel,
        telemetry: Telemetry,
        send: Send,
        send_to: Send,
        *,
        bytewise: bool,
        home_first: bool,
        parameter_rules: ParameterRules = NO_RULES,
        sender: tuple[int, int] | None = None,
    ) -> None:
        super().__init__(kernel, telemetry.name)
        self.home_first = home_first
        self.sender = sender
        self.files = FileTransfer(self, telemetry.name, send_to)
        self._telemetry = telemetry
        self._send, self._send_to = send, send_to
        self._bytewise = bytewise
        self.parameter_rules = parameter_rules
        self._plan_lock = Lock(kernel, f"plan of {telemetry.name}")
        self._known: dict[str, Parameter] = {}
        self._whole = False  # all parameters are known, and none was written since
        self._correction = 0
        self._lands_on_target = False  # the parameters are known to be so
        self._answers_time = False  # an autopilot that gets poses may ask for the time of their stamps

    def command(self, asked: str, command: str, *parameters: float, within: Ns = 0) -> None:
        """See ``Services``."""
        number = constant(command)
        named = {f"param{place}": float(value) for place, value in enumerate(parameters, 1)}
        began = self._kernel.now()
        in_progress = [False]  # it is not sent again then: PX4 rejects what it carries out already

        def acknowledged(frame: Frame) -> bool | None:
            if frame.name != "COMMAND_ACK" or frame.fields["command"] != number:
                return None
            result = frame.fields["result"]
            if result == _IN_PROGRESS:
                in_progress[0] = True
                return None
            if result == _UNSUPPORTED:
                raise CapabilityError(f"{self._name}: {asked}: the autopilot does not support {command}")
            if result != _ACCEPTED:
                said = self._telemetry.texts_since(began)
                why = f"; it said {said[-1]!r}" if said else ""
                raise Refused(self._name, asked, f"{entry_name('MAV_RESULT', result)} to {command}{why}")
            return True

        def send() -> None:
            if not in_progress[0]:
                self._send_to("COMMAND_LONG", command=number, **named)

        self.ask(asked, send, acknowledged, within=within or ANSWERED_WITHIN, again=2 * S)

    # -- parameters

    def parameter_name(self, name: str) -> str:
        """See ``Services``."""
        return mavlink_parameter_name(self._name, name)

    def _parameter(self, frame: Frame) -> Parameter | None:
        if frame.name != "PARAM_VALUE":
            return None
        fields = frame.fields
        value = fields["param_value"]
        if self._bytewise:
            value = from_bytewise(fields["param_type"], value)
        parameter = Parameter(fields["param_id"], float(value), fields["param_type"])
        self._known[parameter.name] = parameter
        return parameter

    def read_parameter(self, name: str) -> Parameter:
        """See ``Services``."""
        if self._whole and name not in self._known:
            raise self._missing(name)
        found = self._ask_parameter(name, AGAIN)
        if found is None:  # nearly all that do not answer do not exist: all names are read once
            if name not in self.read_parameters():
                raise self._missing(name)
            found = self._ask_parameter(name, AGAIN * TRIES)
        if found is None:
            raise NotArrived(self._name, f"read the parameter {name}", self._unanswered(AGAIN * TRIES))
        return found

    def _ask_parameter(self, name: str, within: Ns) -> Parameter | None:
        """Return a parameter; ``None`` if no answer arrives. ``Refused`` if it is answered by an error."""
        asked = f"read the parameter {name}"
        try:
            return self.ask(
                asked,
                lambda: self._send_to("PARAM_REQUEST_READ", param_id=name, param_index=-1),
                self._answer_for(name, asked),
                within=within,
            )
        except NotArrived:
            return None

    def _answer_for(self, name: str, asked: str) -> Callable[[Frame], Parameter | None]:
        """Return a function that takes the value of a parameter, or the error that is sent in its place."""

        def answer(frame: Frame) -> Parameter | None:
            if frame.name == "PARAM_ERROR" and frame.fields["param_id"] == name:
                error = frame.fields["error"]
                if error == _DOES_NOT_EXIST:
                    raise self._missing(name)
                raise Refused(
                    self._name, asked, f"the autopilot answered {entry_name('MAV_PARAM_ERROR', error)}"
                )
            found = self._parameter(frame)
            return found if found is not None and found.name == name else None

        return answer

    def _missing(self, name: str) -> Refused:
        return missing_parameter(self._name, name, self._known, self.parameter_rules.renamed.get(name))

    def write_parameter(self, name: str, value: float) -> Parameter:
        """See ``Services``."""
        before = self.read_parameter(name)
        asked = f"set the parameter {name} to {value:g}"
        _check_fits(self._name, asked, before, value)
        sent = to_bytewise(before.type, value) if self._bytewise else value
        taken = self._answer_for(name, asked)
        began, kept = self._kernel.now(), 0

        def send() -> None:
            self._send_to("PARAM_SET", param_id=name, param_value=sent, param_type=before.type)

        def answer(frame: Frame) -> Parameter | None:
            nonlocal kept
            found = taken(frame)
            if found is None or _same(found.value, value):
                return found
            if not _same(found.value, before.value):
                return found  # it keeps a third value
            # perhaps a late answer to the request before: only one that comes again is the answer
            kept += 1
            if kept <= KEPT_TIMES or self._kernel.now() - began < LATE_WITHIN:
                send()
                return None
            return found

        after = self.ask(asked, send, answer)
        self._whole = False  # it may have brought others into being
        if not _same(after.value, value):
            raise Refused(self._name, asked, f"the autopilot keeps {after.value:g}")
        return after

    def read_parameters(self) -> dict[str, Parameter]:
        """See ``Services``."""
        by_index: dict[int, Parameter] = {}
        counts = [0]

        def listen(frame: Frame) -> None:
            found = self._parameter(frame)
            if found is not None:
                counts[0] = max(counts[0], frame.fields["param_count"])
                if frame.fields["param_index"] < frame.fields["param_count"]:
                    by_index[frame.fields["param_index"]] = found

        def ask() -> None:
            missing = [index for index in range(counts[0]) if index not in by_index]
            for index in missing[:MISSING_AT_ONCE]:
                self._send_to("PARAM_REQUEST_READ", param_id="", param_index=index)
            if not counts[0]:
                self._send_to("PARAM_REQUEST_LIST")

        def so_far() -> str:
            return f"{len(by_index)} of {counts[0]} arrived" if counts[0] else "no answer"

        self.gather(
            "read all parameters",
            ask,
            listen,
            count=lambda: len(by_index),
            whole=lambda: 0 < counts[0] <= len(by_index),
            so_far=so_far,
        )
        read = {found.name: found for _, found in sorted(by_index.items())}
        self._known, self._whole = dict(read), True
        return read

    # -- metadata

    def metadata_uri(self) -> str:
        """Return the URI of the file that names the vehicle's files of metadata (COMPONENT_METADATA)."""
        number = float(message_type("COMPONENT_METADATA").id)

        def stated(frame: Frame) -> str | None:
            fields = frame.fields
            if frame.name == "COMPONENT_METADATA":
                return str(fields["uri"])
            refused = fields["command"] == _REQUEST_MESSAGE if frame.name == "COMMAND_ACK" else False
            if refused and fields["result"] == _UNSUPPORTED:
                raise CapabilityError(f"{self._name}: it states no metadata")
            return None

        return self.ask(
            "name its metadata",
            lambda: self._send_to("COMMAND_LONG", command=_REQUEST_MESSAGE, param1=number),
            stated,
        )

    # -- plans

    def download_items(self, kind: int) -> list[PlanItem]:
        """See ``Services``."""

        def counted(frame: Frame) -> int | None:
            _refuse_list(self._name, frame, kind)
            mine = frame.name == "MISSION_COUNT" and mission_type(frame.fields) == kind
            return int(frame.fields["count"]) if mine else None

        with self._kernel.joined(), self._plan_lock:
            asked = f"read its {_LISTS[kind]}"
            count = self.ask(asked, lambda: self._send_to("MISSION_REQUEST_LIST", mission_type=kind), counted)
            items = [self._download_item(asked, kind, number) for number in range(count)]
            with self._kernel.interact():
                self._send_to("MISSION_ACK", type=0, mission_type=kind)
        return items

    def _download_item(self, asked: str, kind: int, number: int) -> PlanItem:
        def item(frame: Frame) -> PlanItem | None:
            _refuse_list(self._name, frame, kind)
            fields = frame.fields
            if (
                frame.name != "MISSION_ITEM_INT"
                or mission_type(frame.fields) != kind
                or fields["seq"] != number
            ):
                return None
            parameters = (fields["param1"], fields["param2"], fields["param3"], fields["param4"])
            scale = item_scale(fields["command"], fields["frame"])
            place = fields["x"] / scale, fields["y"] / scale
            return PlanItem(fields["command"], fields["frame"], parameters, *place, fields["z"])

        return self.ask(
            asked, lambda: self._send_to("MISSION_REQUEST_INT", seq=number, mission_type=kind), item
        )

    def upload_items(self, kind: int, items: Sequence[PlanItem]) -> None:
        """See ``Services``."""
        asked = f"store {len(items)} items of its {_LISTS[kind]}"
        first = 0 if self.home_first and kind == MISSION else 1
        sent: list[int] = []

        def answer(frame: Frame) -> bool | None:
            if mission_type(frame.fields) != kind:
                return None
            if frame.name in ("MISSION_REQUEST", "MISSION_REQUEST_INT"):
                number = frame.fields["seq"]
                if number < len(items):
                    sent.append(number)
                    self._send_to("MISSION_ITEM_INT", **item_fields(items[number], number, kind))
                return None
            result = _refusal(frame, kind)
            if result and sent:
                why = _why_refused(result, items[sent[-1]], sent[-1] + first)
                raise Refused(self._name, asked, why)
            if result == "UNSUPPORTED":
                raise CapabilityError(f"{self._name}: {asked}: the autopilot keeps no {_LISTS[kind]}")
            if result:
                raise Refused(self._name, asked, f"the autopilot answered {result}")
            return True if frame.name == "MISSION_ACK" else None

        def send() -> None:
            if items:
                self._send_to("MISSION_COUNT", count=len(items), mission_type=kind)
            else:
                self._send_to("MISSION_CLEAR_ALL", mission_type=kind)

        with self._kernel.joined(), self._plan_lock:
            lasting = 30 * S + len(items) * S
            self.ask(asked, send, answer, within=lasting, again=10 * S + len(items) * 200 * MS)

    # -- logs

    def list_logs(self) -> list[LogEntry]:
        """See ``Services``."""
        entries: dict[int, LogEntry] = {}

        def answer(frame: Frame) -> list[LogEntry] | None:
            if frame.name != "LOG_ENTRY":
                return None
            fields = frame.fields
            if not fields["num_logs"]:
                return []
            entries[fields["id"]] = LogEntry(fields["id"], fields["size"], fields["time_utc"])
            whole = len(entries) >= fields["num_logs"]
            return [entries[number] for number in sorted(entries)] if whole else None

        return self.ask(
            "list its logs", lambda: self._send_to("LOG_REQUEST_LIST", start=0, end=0xFFFF), answer
        )

    def read_log(self, entry: LogEntry, offset: int, count: int) -> bytes:
        """See ``Services``."""
        count = min(count, entry.size - offset)
        parts: dict[int, bytes] = {}

        def missing() -> int:
            place = offset
            while place < offset + count and place in parts:
                place += len(parts[place])
            return place

        def answer(frame: Frame) -> bytes | None:
            fields = frame.fields
            if frame.name != "LOG_DATA" or fields["id"] != entry.number:
                return None
            if fields["count"]:
                parts[fields["ofs"]] = bytes(fields["data"][: fields["count"]])
            if missing() < offset + count:
                return None
            return b"".join(parts[part] for part in sorted(parts) if part >= offset)[:count]

        def send() -> None:
            place = missing()
            rest = offset + count - place
            self._send_to("LOG_REQUEST_DATA", id=entry.number, ofs=place, count=rest)

        return self.ask(f"read log {entry.number} from byte {offset}", send, answer, within=20 * S)

    def end_log_transfer(self) -> None:
        """See ``Services``."""
        with self._kernel.joined(), self._kernel.interact():
            self._send_to("LOG_REQUEST_END")

    # -- corrections

    def send_corrections(self, message: bytes) -> None:
        """See ``Services``."""
        with self._kernel.joined(), self._kernel.interact():
            for fields in correction_parts(message, self._correction):
                self._send("GPS_RTCM_DATA", **fields)
            self._correction = (self._correction + 1) % 32

    # -- landing target

    def send_landing_target(self, offset: Vector) -> None:
        """See ``Services``."""
        if not self._lands_on_target:
            self._check_landing_target()
            self._lands_on_target = True
        forward, right, down = offset
        with self._kernel.guard:  # a framework's callback may send it, too
            self._send(
                "LANDING_TARGET",
                time_usec=self._kernel.now() // US,
                frame=_BODY_FRD,
                angle_x=atan2(right, down),
                angle_y=atan2(-forward, down),
                distance=hypot(forward, right, down),
                x=forward,
                y=right,
                z=down,
                q=(1.0, 0.0, 0.0, 0.0),
                type=_FIDUCIAL,
                position_valid=1,
            )

    def _check_landing_target(self) -> None:
        """Raise an error if the autopilot would ignore a landing target."""
        asked = "send a landing target"
        needed = self.parameter_rules.landing_target
        if not needed:
            raise CapabilityError(
                f"{self._name}: {asked}: this autopilot does not land on one by this driver; "
                "fly velocities towards it, as volery.autonomy.precision_landing gives them"
            )
        for name, value in needed.items():
            if self.read_parameter(name).value != value:
                raise Refused(
                    self._name,
                    asked,
                    f"its parameter {name} is not {value:g}, so it would ignore it; set it and reboot",
                )

    # -- flight without satellites

    def send_external_pose(self, pose: ExternalPose) -> None:
        """Send VISION_POSITION_ESTIMATE; from then on the autopilot's requests for the time are answered."""
        self._answers_time = True
        roll, pitch, yaw = pose.attitude_ned()
        with self._kernel.guard:  # a framework's callback may send it, too
            self._send(
                "VISION_POSITION_ESTIMATE",
                usec=pose.time // 1000,
                x=pose.north,
                y=pose.east,
                z=-pose.up,
                roll=roll,
                pitch=pitch,
                yaw=yaw,
                covariance=upper_triangle(pose.covariance_ned()),
                reset_counter=pose.resets % RESETS,
            )

    def set_origin(self, place: Position) -> None:
        """Send SET_GPS_GLOBAL_ORIGIN until GPS_GLOBAL_ORIGIN states it."""
        latitude, longitude = round(place.latitude * 1e7), round(place.longitude * 1e7)
        number = float(message_type("GPS_GLOBAL_ORIGIN").id)

        def send() -> None:
            altitude = round(place.altitude.metres * 1000.0)
            self._send(
                "SET_GPS_GLOBAL_ORIGIN",
                target_system=self._telemetry.system,
                latitude=latitude,
                longitude=longitude,
                altitude=altitude,
                time_usec=self._kernel.now() // 1000,
            )
            self._send_to("COMMAND_LONG", command=_REQUEST_MESSAGE, param1=number)

        def stated(frame: Frame) -> bool | None:
            if frame.name != "GPS_GLOBAL_ORIGIN":
                return None
            off = max(abs(frame.fields["latitude"] - latitude), abs(frame.fields["longitude"] - longitude))
            return True if off <= SAME_DEGREES else None

        other = "; it has another one, of satellites, or its estimator has not started"
        self.ask(f"take {place} as the origin of its estimator", send, stated, unanswered=other)

    def uses(self, name: str) -> bool:
        """Return whether a periodic message of that name is needed now."""
        return self.listening or (self._answers_time and name == "TIMESYNC")

    def receive(self, frame: Frame) -> None:
        """Pass a frame of the autopilot to the requests in progress, and tell it the time if it asks."""
        if self._answers_time and frame.name == "TIMESYNC" and frame.fields["tc1"] == 0:
            self._send("TIMESYNC", tc1=self._kernel.now(), ts1=frame.fields["ts1"])
        super().receive(frame)


def _same(one: float, other: float) -> bool:
    """Return whether two values differ by no more than a 32-bit float does."""
    return isclose(one, other, rel_tol=1e-6, abs_tol=1e-6)


def _check_fits(vehicle: str, asked: str, before: Parameter, value: float) -> None:
    """Raise ``Refused`` if a value does not fit the type: the autopilot would keep another one."""
    if before.type in (_REAL32, _REAL64):
        if before.type == _REAL32 and isfinite(value) and abs(value) > LARGEST_FLOAT:
            raise Refused(vehicle, asked, f"its numbers go up to {LARGEST_FLOAT:g}")
        return
    if value != round(value):
        raise Refused(vehicle, asked, "it takes whole numbers only")
    limits = _WHOLE.get(before.type)
    if limits is not None and not limits[0] <= value <= limits[1]:
        raise Refused(vehicle, asked, f"it takes whole numbers from {limits[0]} to {limits[1]}")


_LISTS = {0: "mission", 1: "geofence", 2: "rally points"}


def _refuse_list(name: str, frame: Frame, kind: int) -> None:
    """Raise if *frame* is the refusal of a list of that kind, before any of its items."""
    result = _refusal(frame, kind)
    if result == "UNSUPPORTED":
        raise CapabilityError(f"{name}: read: the autopilot keeps no {_LISTS[kind]}")
    if result:
        raise Refused(name, f"read its {_LISTS[kind]}", f"the autopilot answered {result}")


def _refusal(frame: Frame, kind: int) -> str:
    """Return the reason of the refusal of a list, as MAV_MISSION_RESULT names it; empty if it is none."""
    if frame.name != "MISSION_ACK" or mission_type(frame.fields) != kind or frame.fields["type"] == 0:
        return ""
    return entry_name("MAV_MISSION_RESULT", frame.fields["type"]).removeprefix("MAV_MISSION_")


_PLACES = {"INVALID_PARAM5_X": 5, "INVALID_PARAM6_Y": 6, "INVALID_PARAM7": 7}


def _why_refused(result: str, item: PlanItem, number: int) -> str:
    """Return what the autopilot refuses of item *number* of the plan, in words."""
    command = entry_name("MAV_CMD", item.command)
    what = f"item {number}, command {item.command}"
    if not command.isdigit():
        what = f"item {number}, MAV_CMD_{command} ({item.command})"
    values = (*item.parameters, item.latitude, item.longitude, item.z)
    last = result.removeprefix("INVALID_PARAM")
    place = _PLACES.get(result, int(last) if last.isdigit() else 0)
    if place:
        return f"the autopilot does not take parameter {place} = {values[place - 1]:.9g} of {what}"
    if result == "UNSUPPORTED":
        return f"the autopilot does not take {what} in a mission, or not with its parameters"
    if result == "UNSUPPORTED_FRAME":
        return f"the autopilot does not take {what} in the frame {item.frame}"
    if result == "INVALID_SEQUENCE":
        return f"the autopilot lost the order at {what}; is another program storing a plan at the same time?"
    return f"the autopilot answered {result} at {what}"


def item_fields(item: PlanItem, number: int, kind: int) -> dict[str, Any]:
    """Return an item as the fields of MISSION_ITEM_INT."""
    first, second, third, fourth = item.parameters
    scale = item_scale(item.command, item.frame)
    return {
        "seq": number,
        "frame": item.frame,
        "command": item.command,
        "current": 0,
        "autocontinue": 1,
        "param1": first,
        "param2": second,
        "param3": third,
        "param4": fourth,
        "x": round(item.latitude * scale),
        "y": round(item.longitude * scale),
        "z": item.z,
        "mission_type": kind,
    }
