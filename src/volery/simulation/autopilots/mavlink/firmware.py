"""What differs between firmwares that use MAVLink, grouped by subject.

The endpoint and its microservices read these groups: what is sent and how often, how commands, parameters and
missions are answered, when texts are sent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from volery.base.time import MS, Ns, S
from volery.simulation.autopilots.mavlink.channel import Peer, StatusTextPolicy
from volery.simulation.autopilots.mavlink.file_service import FilePolicy
from volery.simulation.autopilots.mavlink.log_service import LogPolicy
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, Handler
from volery.simulation.autopilots.onboard_mission import MissionItem
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, VehicleAction, do_nothing


def _always(*_question: object) -> bool:
    """Return True: the default of permissions."""
    return True


def _never(*_question: object) -> bool:
    """Return False: the default of conditions."""
    return False


def _ignore(*_event: object) -> None:
    """Do nothing: the default of events."""


def _admit(*_list: object) -> bool:
    """Return False: no list is refused."""
    return False


def _plain_request(_number: int) -> str:
    return "MISSION_REQUEST"


class ParameterPolicy(NamedTuple):
    """How parameters are listed, read and written.

    The defaults are ArduPilot's: 1390 parameters in 0.61 s, about 230 each tenth of a second; a parameter
    read by name is answered after 55 to 100 ms, a list and a set at once.
    """

    burst: int = 200
    period: Ns = 100 * MS
    read_delay: Ns = 50 * MS
    bytewise: bool = False
    """Whether an integer is sent as its bytes in the float field; else it is converted to float."""
    keeps_index: bool = False
    """Whether a value outside of a list carries its own index; else 65535."""
    typed: bool = False
    """Whether a PARAM_SET with another type than the parameter's is ignored."""
    reports_missing: bool = False
    """Whether PARAM_ERROR answers what asks for a parameter that does not exist or cannot have a value."""
    checksum: str = ""
    """Name of a checksum over all parameters that is sent first; empty: none."""


CANCELLED = 15
"""MAV_MISSION_RESULT."""


def _cancel(vehicle: AutopilotVehicle) -> int:
    vehicle.send_text(4, "Mission upload timeout")
    return CANCELLED


class MissionUploadPolicy(NamedTuple):
    """How a mission is uploaded."""

    request: Callable[[int], str] = _plain_request
    """Name of the message that requests an item, by the item's number."""
    received: str = "Flight plan received"
    """Text that is sent when the upload is complete; empty: none."""
    falls_back_to_int: bool = False
    """Whether MISSION_REQUEST_INT is used once the peer has acknowledged a request as unsupported."""
    keeps_old: bool = False
    """Whether the mission on board stays until the new one is complete."""
    request_period: Ns = 1 * S
    """Period at which an item that does not arrive is requested again."""
    gives_up_after: Ns = 8 * S
    """Time without an item after which the upload ends."""
    gives_up: Callable[[AutopilotVehicle], int | None] = _cancel
    """Reports that; returns the MAV_MISSION_RESULT that is acknowledged, or ``None``."""


Builder = Callable[[AutopilotVehicle], dict[str, Any] | list[dict[str, Any]] | None]
"""Returns the fields of a message as sent now, a list where several are sent at once, or ``None`` while the
firmware does not send it.
"""

MessageHandler = Callable[[AutopilotVehicle, dict[str, Any], int], None]
"""Handles a message that needs no answer: vehicle, fields, system id of the sender."""


QuestionHandler = Callable[[AutopilotVehicle, dict[str, Any], Peer], None]
"""Answers a message: vehicle, fields, sender."""


class HighLatency(NamedTuple):
    """Links that carry HIGH_LATENCY2 instead of HEARTBEAT, and nothing while they are muted."""

    links: Callable[[AutopilotVehicle], frozenset[int]]
    """Returns their numbers."""
    muted: Callable[[AutopilotVehicle], bool]


class BootBytes(NamedTuple):
    """Bytes that are no message, sent a fixed time after boot."""

    after: Ns
    data: bytes


class LinkStart(NamedTuple):
    """What the firmware sends after boot before anything is requested."""

    boot_bytes: tuple[BootBytes, ...] = ()
    """The first of them is the banner, which the server sends when it accepts a client."""
    heartbeat_first: tuple[Ns, ...] = ()
    """Uptimes of heartbeats before the regular ones."""
    heartbeat_from: Ns = S
    """Uptime of the first regular heartbeat; one each second follows."""
    timesync_every: Ns = 0
    """Period of TIMESYNC requests; 0: none."""


@dataclass(frozen=True, kw_only=True)
class TelemetryPolicy:
    """Which messages are sent, in which order and how often."""

    messages: Mapping[str, Builder]
    message_order: Sequence[str]
    """Order of the messages within one burst."""
    streams: Mapping[int, Sequence[str]] = field(default_factory=dict)
    """The messages of each MAV_DATA_STREAM; empty where REQUEST_DATA_STREAM is not supported."""
    on_stream_request: Callable[[AutopilotVehicle, int, int, int], None] = _ignore
    """Called with the vehicle, the index of the link, the stream and its rate [Hz]."""
    link_uses: Mapping[str, Mapping[str, Ns]] = field(default_factory=lambda: {"": {}})
    """What a link is used for, to the periods of its unrequested streams. The first use is the default."""
    high_latency: HighLatency | None = None
    """``None``: the firmware has no such links."""
    least_period: Ns = 3 * MS
    """Shortest period of a stream."""
    intervals_after: Ns = 0
    """Before that uptime message intervals are acknowledged and ignored."""
    refuse_interval: Callable[[AutopilotVehicle, int], int]
    """Return the MAV_RESULT of an interval for an unknown message number."""
    unknown_message: int
    """MAV_RESULT of a request for an unknown message."""
    nothing_to_send: int = ACCEPTED
    """MAV_RESULT of a request for a message that the firmware does not send now."""
    on_mode_change: Sequence[str] = ("HEARTBEAT",)
    """Messages that a change of mode sends at once on all links."""
    on_home_change: Sequence[str] = ("GPS_GLOBAL_ORIGIN", "HOME_POSITION")
    """Messages that a change of the home position sends at once on all links."""

    def build(self, name: str, vehicle: AutopilotVehicle) -> list[dict[str, Any]]:
        """Return the fields of each message called *name* that is sent now."""
        built = self.messages[name](vehicle)
        if isinstance(built, list):
            return built
        return [] if built is None else [built]


@dataclass(frozen=True, kw_only=True)
class CommandPolicy:
    """How commands and other messages are handled and answered."""

    commands: Mapping[int, Handler]
    handlers: Mapping[str, MessageHandler]
    """Messages for this vehicle that need no answer."""
    questions: Mapping[str, QuestionHandler] = field(default_factory=dict)
    """Messages for this vehicle that are answered with a message."""
    set_mode: Callable[[AutopilotVehicle, int, int], int]
    """Handle SET_MODE (base mode, custom mode) and return a MAV_RESULT."""
    set_mode_ack: int
    """Number of the command that acknowledges SET_MODE."""
    answer_delay: Ns = 5 * MS
    wrong_target: int | None = None
    """MAV_RESULT of a command for another system or component; ``None``: no answer."""
    checks_component: bool = False
    """Whether a message for another component is not handled; else the component is ignored."""
    accepts: Callable[[AutopilotVehicle, str, int], bool] = _always
    """Whether a message, by its name and the system that sends it, is handled at all."""
    private_links: Callable[[AutopilotVehicle], frozenset[int]] | None = None
    """Numbers of the links between which and others nothing is forwarded; ``None``: nothing ever is."""
    reads_nan: bool = False
    """Whether a NaN parameter of a command means that the parameter is not given."""
    nan_commands: frozenset[int] = frozenset()
    """Commands for which it means so at any rate."""


@dataclass(frozen=True, kw_only=True)
class MissionPolicy:
    """How missions are stored and read back."""

    upload: MissionUploadPolicy = field(default_factory=MissionUploadPolicy)
    runs: Callable[[AutopilotVehicle], bool] = _never
    """Whether the mission may not be cleared now."""
    stored_item: Callable[[MissionItem], MissionItem | int]
    """Return an uploaded item as it is stored, or the MAV_MISSION_RESULT that refuses it."""
    home_item: Callable[[AutopilotVehicle], MissionItem | None] = do_nothing
    """Return item 0 where the firmware stores its home position there."""
    go_to_item: Callable[[AutopilotVehicle, MissionItem], bool] = _never
    """Fly to an item that is sent outside an upload (``current`` 2)."""
    grew: Callable[[AutopilotVehicle, int], None] = _ignore
    """Called with the number of items after a change."""
    stored_point: Callable[[int, MissionItem], MissionItem | int] | None = None
    """The same as ``stored_item`` for the points of the fence and for rally points, by MAV_MISSION_TYPE;
    ``None``: they are not supported.
    """
    refuses_points: Callable[[AutopilotVehicle, int, list[MissionItem]], bool] = _admit
    """Reports why a complete list of points is refused, and returns whether it is."""
    names_lists: bool = True
    """Whether items of the fence and rally points are sent with their MAV_MISSION_TYPE."""
    points_changed: Callable[[AutopilotVehicle, int], None] = _ignore
    """Called after such a list has changed, with its MAV_MISSION_TYPE."""
    writes_parts: bool = False
    """Whether MISSION_WRITE_PARTIAL_LIST replaces a part of the mission."""
    list_id: Callable[[AutopilotVehicle, int], int] | None = None
    """Return the checksum of a list by its MAV_MISSION_TYPE; ``None``: acknowledgements carry none."""
    item_refused: VehicleAction = do_nothing
    """Called when an uploaded item is refused."""


@dataclass(frozen=True, kw_only=True)
class MavlinkFirmware:
    """The MAVLink of one firmware for one kind of vehicle."""

    start: LinkStart
    telemetry: TelemetryPolicy
    commands: CommandPolicy
    missions: MissionPolicy
    parameters: ParameterPolicy = field(default_factory=ParameterPolicy)
    texts: StatusTextPolicy = field(default_factory=StatusTextPolicy)
    logs: LogPolicy
    files: FilePolicy
    on_parameter_list: VehicleAction = do_nothing
    """Called when a station lists the parameters."""
