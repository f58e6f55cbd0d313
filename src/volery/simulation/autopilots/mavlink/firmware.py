"""How firmwares differ in the parts of MAVLink that all of them speak: texts, parameters, missions.

What differs between firmwares that speak MAVLink: what they send, how often, and how they answer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from volery.base.time import MS, Ns, S
from volery.simulation.autopilots.firmware import VehicleAction
from volery.simulation.autopilots.mavlink.command import Handler
from volery.simulation.autopilots.onboard_mission import MissionItem
from volery.simulation.autopilots.vehicle_state import Vehicle


def _always_plain(_number: int) -> str:
    return "MISSION_REQUEST"


class StatusTextPolicy(NamedTuple):
    """How words become STATUSTEXT."""

    numbered: bool = False
    """Whether a text that fits into one message has an id, too."""
    to_stations: bool = False
    """Whether they wait, four at most, until a ground station is heard on the link."""
    spacing: Ns = 0
    """Least time between two texts on a link."""


class ParameterPolicy(NamedTuple):
    """How parameters are listed, read and written.

    The values are those of ArduPilot: 1390 parameters in 0.61 s, about 230 each tenth of a second; a
    parameter read by name is answered after 55 to 100 ms, a list and a set at once.
    """

    burst: int = 200
    period: Ns = 100 * MS
    read_delay: Ns = 50 * MS
    bytewise: bool = False
    """Whether an integer travels as its bytes in the place of the number; else as the number."""
    keeps_index: bool = False
    """Whether a value that nobody listed carries its own index; else 65535."""
    typed: bool = False
    """Whether a set of another type than the parameter's is ignored."""
    checksum: str = ""
    """Name of a value over all of them that is sent first; none if empty."""


class MissionUploadPolicy(NamedTuple):
    """How a mission is taken."""

    asks_with: Callable[[int], str] = _always_plain
    """The message that asks for an item, by its number."""
    received: str = "Flight plan received"
    """Said when it is complete; nothing if empty."""
    turns_to_integers: bool = False
    """Whether a peer that acknowledges a question as unsupported is asked by MISSION_REQUEST_INT instead."""
    keeps_old: bool = False
    """Whether the mission on board stays until the new one is complete."""


Builder = Callable[[Vehicle], dict[str, Any] | None]
"""The fields of a message as it would be sent now; ``None`` while the firmware does not send it."""


class BootBytes(NamedTuple):
    """Bytes on the wire that are no message, a fixed time after boot."""

    after: Ns
    data: bytes


@dataclass(frozen=True, kw_only=True)
class MavlinkFirmware:
    """One firmware's MAVLink, for one kind of vehicle."""

    boot_bytes: tuple[BootBytes, ...] = ()
    """The first of them is the banner: whoever accepts a client sends it."""
    heartbeat_first: tuple[Ns, ...] = ()
    """Heartbeats before the regular ones, after boot."""
    heartbeat_from: Ns = S
    """First of the regular ones, each second."""
    answer_delay: Ns = 5 * MS
    deaf_until: Ns = 0
    """Before that, message intervals are acknowledged and forgotten."""
    least_period: Ns = 3 * MS
    """No message is streamed more often."""
    uses: Mapping[str, Mapping[str, Ns]] = field(default_factory=lambda: {"": {}})
    """What a link is for, to what is streamed on it unasked; the first is what a link is for by default."""
    mode_told: Sequence[str] = ("HEARTBEAT",)
    """Messages that a change of mode sends at once, to everyone."""
    home_told: Sequence[str] = ("GPS_GLOBAL_ORIGIN", "HOME_POSITION")
    """Messages that a change of home sends at once, to everyone."""
    texts: StatusTextPolicy = field(default_factory=StatusTextPolicy)
    parameter_habits: ParameterPolicy = field(default_factory=ParameterPolicy)
    upload_habits: MissionUploadPolicy = field(default_factory=MissionUploadPolicy)
    wrong_target: int | None = None
    """MAV_RESULT of a command for another system or component; ``None``: silence, and components do not
    matter.
    """
    reads_nan: bool = False
    """Whether a parameter of a command may be no number, which means: not given."""

    messages: Mapping[str, Builder]
    message_order: Sequence[str]
    streams: Mapping[int, Sequence[str]]
    """What belongs to each MAV_DATA_STREAM."""
    on_stream_request: Callable[[Vehicle, int, int, int], None]
    """Vehicle, index of the link, stream, rate."""
    refuse_interval: Callable[[Vehicle, int], int]
    unknown_message: int
    commands: Mapping[int, Handler]
    handlers: Mapping[str, Callable[[Vehicle, dict[str, Any], int], None]] = field(default_factory=dict)
    """Messages that are for this vehicle and need no answer: vehicle, fields, sender's system id."""
    set_mode: Callable[[Vehicle, int, int], int]
    """SET_MODE: base mode, custom mode; returns a MAV_RESULT."""
    set_mode_ack: int
    on_parameter_list: VehicleAction
    mission_runs: Callable[[Vehicle], bool]
    """Whether it may not be cleared now."""
    stored_item: Callable[[MissionItem], MissionItem | int]
    """An uploaded item as it is kept, or the MAV_MISSION_RESULT that refuses it."""
    home_item: Callable[[Vehicle], MissionItem | None]
    """Item 0 where the firmware has its home there."""
    go_to_item: Callable[[Vehicle, MissionItem], bool]
    mission_grew: Callable[[Vehicle, int], None]
    timesync_every: Ns = 0
