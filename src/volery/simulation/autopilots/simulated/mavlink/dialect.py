"""What differs between firmwares that speak MAVLink: what they send, how often, and how they answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from volery.base.time import MS, Ns, S
from volery.simulation.autopilots.simulated.dialect import Act
from volery.simulation.autopilots.simulated.mavlink.command_service import Handler
from volery.simulation.autopilots.simulated.mavlink.habits import ParameterHabits, Texts, UploadHabits
from volery.simulation.autopilots.simulated.plan import Item
from volery.simulation.autopilots.simulated.vehicle import Vehicle

Builder = Callable[[Vehicle], dict[str, Any] | None]
"""The fields of a message as it would be sent now; ``None`` while the firmware does not send it."""


class BootBytes(NamedTuple):
    """Bytes on the wire that are no message, a fixed time after boot."""

    after: Ns
    data: bytes


@dataclass(frozen=True, kw_only=True)
class MavlinkDialect:
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
    texts: Texts = field(default_factory=Texts)
    parameter_habits: ParameterHabits = field(default_factory=ParameterHabits)
    upload_habits: UploadHabits = field(default_factory=UploadHabits)
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
    on_parameter_list: Act
    mission_runs: Callable[[Vehicle], bool]
    """Whether it may not be cleared now."""
    stored_item: Callable[[Item], Item | int]
    """An uploaded item as it is kept, or the MAV_MISSION_RESULT that refuses it."""
    home_item: Callable[[Vehicle], Item | None]
    """Item 0 where the firmware has its home there."""
    go_to_item: Callable[[Vehicle, Item], bool]
    mission_grew: Callable[[Vehicle, int], None]
    timesync_every: Ns = 0
