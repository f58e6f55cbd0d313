"""What differs between firmwares: tables and small functions. The flight stack asks; it never branches on a
name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from volery.base.registry import Registry
from volery.base.time import MS, Ns, S
from volery.links.link import Codec
from volery.links.mavlink_codec import MAVLINK
from volery.simulation.autopilots.autopilot_parameters import Parameter, Parameters, Tuning
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.autopilots.onboard_mission import MissionItem
from volery.simulation.autopilots.vehicle_state import Mode

if TYPE_CHECKING:
    from volery.simulation.autopilots.endpoint import ProtocolEndpoint
    from volery.simulation.autopilots.vehicle_state import Vehicle

VehicleAction = Callable[["Vehicle"], None]


class BootEvent(NamedTuple):
    """Something that happens at a fixed time after boot."""

    after: Ns
    act: VehicleAction


class Failsafe(NamedTuple):
    """A failsafe: a condition that is looked at regularly, and what is done when it begins and when it
    ends.
    """

    name: str
    tripped: Callable[[Vehicle], bool]
    begins: VehicleAction
    ends: VehicleAction


def _nothing(_vehicle: Vehicle) -> None:
    """Many firmwares do nothing special then."""


def _no_item(_vehicle: Vehicle, _number: int, _item: MissionItem) -> None:
    """Nothing is said of items."""


def _no_action(_vehicle: Vehicle, _item: MissionItem) -> None:
    """No item is an action."""


def _no_memory(_vehicle: Vehicle) -> object:
    """What all firmwares keep is enough."""
    return None


@dataclass(frozen=True, kw_only=True)
class Firmware:
    """One firmware for one kind of vehicle: how it flies. What it says on the wire is its face's."""

    name: str
    kind: str
    """``multirotor`` or ``rover``."""
    face: Callable[[Vehicle], ProtocolEndpoint]
    """The protocol it speaks."""
    memory: Callable[[Vehicle], object] = _no_memory
    """What this firmware alone keeps about a vehicle: ``Vehicle.memory``."""

    # -- boot
    boot_mode: Mode
    boot_events: tuple[BootEvent, ...] = ()
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
    on_warm: VehicleAction
    """Bring a vehicle to the state in which its boot leaves it, but for its position."""
    on_warm_position: VehicleAction
    """A moment later there is a position."""

    # -- time
    tick: Ns = 100 * MS
    watch_every: int = 3
    """Failsafes are looked at each so many ticks."""
    each_second: VehicleAction
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
    watches: tuple[Failsafe, ...] = ()
    on_step: VehicleAction
    """At each tick, after the manoeuvre."""
    on_disarmed: VehicleAction
    throttle_centred: bool = False
    """Whether the throttle stick rests in its middle."""
    first_item: int = 1
    """Number of the first mission item that is flown: 1 where item 0 is home."""
    actions_count: bool = False
    """Whether an item that does not navigate is told to be done, too."""
    guided_arrived: VehicleAction = _nothing
    """A rover has reached the point that it was sent to."""
    guided_stale: VehicleAction = _nothing
    """A rover stops because no target came."""
    mission_item_done: Callable[[Vehicle, int, MissionItem], None] = _no_item
    mission_item_begins: Callable[[Vehicle, int, MissionItem], None] = _no_item
    mission_ended: VehicleAction = _nothing
    mission_action: Callable[[Vehicle, MissionItem], None] = _no_action
    """Do an item that does not navigate."""

    # -- parameters
    parameters: Callable[[], tuple[Parameter, ...]]
    own_parameters: Callable[[int, Flight], Mapping[str, float]]
    """Values that follow from the vehicle: its system id, its battery."""
    supported_parameters: Mapping[str, str]
    """Parameters that change what the vehicle does, and what they change."""


class Station(NamedTuple):
    """An address where somebody usually listens to a firmware, and what the firmware has that link for."""

    address: str
    use: str = ""


GROUND_STATION = Station("udp://127.0.0.1:14550")
"""Where ground stations of MAVLink listen."""


@dataclass(frozen=True)
class FirmwareFamily:
    """A firmware: its dialects by kind of vehicle, and the codec of its links; without one it is reached over
    a graph.
    """

    name: str
    kinds: Mapping[str, Firmware]
    codec: Codec | None = MAVLINK
    stations: tuple[Station, ...] = (GROUND_STATION,)
    """Where one that is served speaks, unless it is told otherwise."""


firmwares: Registry[FirmwareFamily] = Registry("volery.autopilots", "simulated autopilot")
"""Entry points of the group ``volery.simulation.autopilots``."""
