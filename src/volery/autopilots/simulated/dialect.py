"""What differs between firmwares: tables and small functions. The flight stack asks; it never branches on a
name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from volery.autopilots.simulated.flight import Flight
from volery.autopilots.simulated.mavlink.command_service import Handler
from volery.autopilots.simulated.mode import Mode
from volery.autopilots.simulated.parameters import Parameter, Parameters
from volery.autopilots.simulated.plan import Item
from volery.autopilots.simulated.tuning import Tuning
from volery.base.registry import Registry
from volery.base.time import MS, Ns, S

if TYPE_CHECKING:
    from volery.autopilots.simulated.vehicle import Vehicle

Builder = Callable[["Vehicle"], dict[str, Any] | None]
"""The fields of a message as it would be sent now; ``None`` while the firmware does not send it."""

Act = Callable[["Vehicle"], None]


class Event(NamedTuple):
    """Something that happens at a fixed time after boot."""

    after: Ns
    act: Act


class BootBytes(NamedTuple):
    """Bytes on the wire that are no message, a fixed time after boot."""

    after: Ns
    data: bytes


class Watch(NamedTuple):
    """A failsafe: a condition that is looked at regularly, and what is done when it begins and when it
    ends.
    """

    name: str
    tripped: Callable[[Vehicle], bool]
    begins: Act
    ends: Act


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """One firmware for one kind of vehicle."""

    name: str
    kind: str
    """``multirotor`` or ``rover``."""

    # -- boot
    boot_mode: Mode
    boot_events: tuple[Event, ...] = ()
    boot_bytes: tuple[BootBytes, ...] = ()
    ready_after: Ns
    """From then on it streams, and texts follow the answer that they belong to."""
    origin_after: Ns
    """From then on the estimator has an origin and there is a home."""
    position_after: Ns
    """From then on modes that need a position may fly."""
    local_position_after: Ns
    """From then on the local position is sent."""
    warm_age: Ns = 60 * S
    """How long ago a vehicle that starts warm was switched on."""
    on_warm: Act
    """Bring a vehicle to the state in which its boot leaves it, but for its position."""
    on_warm_position: Act
    """A moment later there is a position."""

    # -- time
    tick: Ns = 100 * MS
    watch_every: int = 3
    """Failsafes are looked at each so many ticks."""
    heartbeat_first: tuple[Ns, ...] = ()
    """Heartbeats before the regular ones, after boot."""
    heartbeat_from: Ns = S
    """First of the regular ones, each second."""
    answer_delay: Ns = 5 * MS
    deaf_until: Ns = 0
    """Before that, message intervals are acknowledged and forgotten."""
    least_period: Ns = 3 * MS
    """No message is streamed more often."""
    each_second: Act
    each_second_from: Ns = 0

    # -- flight
    modes: Mapping[int, Mode]
    tuning: Callable[[Parameters], Tuning]
    transmitter: Sequence[int]
    stands: bool
    """Whether on the ground is a state of its own: motors idle and it must take off."""
    motors_rest: Ns = 0
    spool_time: Ns = 0
    takeoff_slew: Ns = 0
    resigns_after: Ns = 0
    """A vehicle that has not left the ground and no longer wants to counts as standing after that."""
    watches: tuple[Watch, ...] = ()
    on_step: Act
    """At each tick, after the manoeuvre."""
    on_disarmed: Act
    throttle_centred: bool = False
    """Whether the throttle stick rests in its middle."""
    guided_arrived: Act
    """A rover has reached the point that it was sent to."""
    guided_stale: Act
    """A rover stops because no target came."""
    mission_item_done: Callable[[Vehicle, int, Item], None]
    mission_item_begins: Callable[[Vehicle, int, Item], None]
    mission_ended: Act
    mission_action: Callable[[Vehicle, Item], None]
    """Do an item that does not navigate."""

    # -- MAVLink
    messages: Mapping[str, Builder]
    message_order: Sequence[str]
    streams: Mapping[int, Sequence[str]]
    """What belongs to each MAV_DATA_STREAM."""
    on_stream_request: Callable[[Vehicle, int, int, int], None]
    """Vehicle, index of the link, stream, rate."""
    usual_period: Callable[[str], Ns]
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

    # -- parameters
    parameters: Callable[[], tuple[Parameter, ...]]
    own_parameters: Callable[[int, Flight], Mapping[str, float]]
    """Values that follow from the vehicle: its system id, its battery."""
    honoured: Mapping[str, str]
    """Parameters that change what the vehicle does, and what they change."""


@dataclass(frozen=True)
class Family:
    """A firmware: its dialects by kind of vehicle."""

    name: str
    kinds: Mapping[str, Dialect]


dialects: Registry[Family] = Registry("volery.autopilots", "simulated autopilot")
"""Entry points of the group ``volery.autopilots``."""
