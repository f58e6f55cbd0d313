"""What a dialect of ArduPilot 4.5.6 says of every vehicle, whatever its kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from volery.base.time import MS, S
from volery.simulation.autopilots.ardupilot import commands, missions, radio, status
from volery.simulation.autopilots.ardupilot.arming import INFO
from volery.simulation.autopilots.ardupilot.modes import set_mode
from volery.simulation.autopilots.ardupilot.status import Health
from volery.simulation.autopilots.ardupilot.tables import BUILDERS, ORDER
from volery.simulation.autopilots.firmware import Firmware
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.autopilots.mavlink.command import DENIED, FAILED
from volery.simulation.autopilots.mavlink.firmware import Builder, MavlinkFirmware
from volery.simulation.autopilots.vehicle_state import Vehicle


def board(vehicle: Vehicle) -> str:
    """The board's own number, different for each system id."""
    return f"{(vehicle.system + 2) % 16:x}d1219c7c4c5404aaa"


def introduce(vehicle: Vehicle, name: str) -> None:
    """Version and board, said to whoever lists the parameters."""
    vehicle.say(INFO, f"{name} V4.5.6 (7ce11b41)")
    vehicle.say(INFO, f"{board(vehicle)}1f6d2a48adfda4")


def own_parameters(system: int, flight: Flight) -> dict[str, float]:
    """What follows from the vehicle."""
    return {"SYSID_THISMAV": system, "BATT_CAPACITY": flight.spec.battery.capacity_ah * 1000.0}


def refuse_interval(vehicle: Vehicle, number: int) -> int:
    """SET_MESSAGE_INTERVAL of a message that the firmware does not know."""
    vehicle.say(INFO, f"No ap_message for mavlink id ({number})")
    return DENIED


def builders(
    kind: int, capabilities: int, health: Health, system_status: Callable[[Vehicle], int]
) -> Mapping[str, Builder]:
    """What every vehicle sends of itself. *kind* is the MAV_TYPE, *capabilities* are bits of
    MAV_PROTOCOL_CAPABILITY, and *system_status* gives the MAV_STATE.
    """
    return {
        **BUILDERS,
        "AUTOPILOT_VERSION": lambda vehicle: status.autopilot_version(
            vehicle, capabilities, board(vehicle).encode()
        ),
        "HEARTBEAT": lambda vehicle: status.heartbeat(vehicle, kind, system_status(vehicle)),
        "SYS_STATUS": partial(status.sys_status, health=health),
    }


HEARD = {
    "HEARTBEAT": radio.on_heartbeat,
    "MANUAL_CONTROL": radio.on_manual_control,
    "RC_CHANNELS_OVERRIDE": radio.on_override,
}
"""What every vehicle obeys of sticks and stations."""

mavlink = partial(
    MavlinkFirmware,
    deaf_until=100 * MS,
    message_order=ORDER,
    refuse_interval=refuse_interval,
    unknown_message=FAILED,
    set_mode=set_mode,
    set_mode_ack=11,
    mission_runs=missions.runs,
    stored_item=missions.stored_item,
    home_item=missions.home_item,
    go_to_item=commands.go_to_item,
    mission_grew=missions.mission_grew,
    timesync_every=10 * S,
)
"""A ``MavlinkFirmware`` but for what depends on the kind."""

ardupilot = partial(
    Firmware,
    name="ardupilot",
    mission_item_done=missions.item_done,
    mission_item_begins=missions.item_begins,
    mission_action=missions.act,
    own_parameters=own_parameters,
)
"""A ``Firmware`` but for what depends on the kind."""
