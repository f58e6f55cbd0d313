"""Messages that PX4 takes without an answer: heartbeats, sticks, set-points."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol, runtime_checkable

from volery.simulation.autopilots.mavlink.channel import GROUND_STATION
from volery.simulation.autopilots.px4 import events, modes, offboard
from volery.simulation.autopilots.px4.commander import Commander, of
from volery.simulation.autopilots.px4.joystick import deflection, move_channels
from volery.simulation.autopilots.px4.watching import OFFBOARD_LOST
from volery.simulation.autopilots.vehicle_state import Vehicle

Hear = Callable[[Vehicle, dict[str, Any], int], None]

FROM_JOYSTICK = (1, 2, 3)
"""Values of COM_RC_IN_MODE with which MANUAL_CONTROL counts."""


@runtime_checkable
class Follower(Protocol):
    """A manoeuvre of OFFBOARD."""

    def take(self, target: offboard.Target | offboard.AttitudeTarget | None) -> None:
        """A set-point came."""


OVERRIDE_AUTOMATIC, OVERRIDE_OFFBOARD = 1, 2
"""Bits of COM_RC_OVERRIDE."""


def on_heartbeat(vehicle: Vehicle, fields: dict[str, Any], _sender: int) -> None:
    """HEARTBEAT of somebody else."""
    if fields["type"] == GROUND_STATION:
        of(vehicle).station_seen = vehicle.kernel.now()


def on_manual_control(vehicle: Vehicle, fields: dict[str, Any], _sender: int) -> None:
    """MANUAL_CONTROL."""
    given = deflection(fields)
    enabled = round(vehicle.parameters["COM_RC_IN_MODE"]) in FROM_JOYSTICK
    if given is None or not enabled or fields["target"] not in (0, vehicle.system):
        return
    commander = of(vehicle)
    away = commander.joystick.take(given, vehicle.kernel.now())
    if away:
        commander.log.tell(events.STICKS_BACK, events.real(away))
    move_channels(vehicle, given)
    if vehicle.armed:
        _override(commander)
        if vehicle.mode.pilot:
            vehicle.act()


def _override(commander: Commander) -> None:
    """Moving the sticks takes an automatic mode over, in the air."""
    vehicle = commander.vehicle
    may = round(vehicle.parameters["COM_RC_OVERRIDE"])
    number = vehicle.mode.number
    by_itself = number in modes.AUTOMATIC and may & OVERRIDE_AUTOMATIC
    by_computer = number == modes.OFFBOARD and may & OVERRIDE_OFFBOARD
    resting = vehicle.firmware.stands and vehicle.landed
    if resting or not (by_itself or by_computer):
        return
    if commander.joystick.moved(vehicle.parameters["COM_RC_STICK_OV"] / 100.0):
        commander.pilot_takes_over()


def _take(vehicle: Vehicle, target: offboard.Target | offboard.AttitudeTarget | None) -> None:
    if target is None:
        return
    commander = of(vehicle)
    commander.stream.take(target, vehicle.kernel.now())
    if commander.failsafe == OFFBOARD_LOST and vehicle.armed:
        commander.give_back()
    if isinstance(vehicle.manoeuvre, Follower):
        vehicle.manoeuvre.take(target)
        if vehicle.armed and not (vehicle.firmware.stands and vehicle.landed):
            vehicle.act()


def on_local_target(vehicle: Vehicle, fields: dict[str, Any], _sender: int) -> None:
    """SET_POSITION_TARGET_LOCAL_NED."""
    _take(vehicle, offboard.local_target(vehicle, fields, of(vehicle).log))


def on_global_target(vehicle: Vehicle, fields: dict[str, Any], _sender: int) -> None:
    """SET_POSITION_TARGET_GLOBAL_INT: counts only with a position."""
    if vehicle.has_position:
        _take(vehicle, offboard.global_target(vehicle, fields, of(vehicle).log))


def on_attitude_target(vehicle: Vehicle, fields: dict[str, Any], _sender: int) -> None:
    """SET_ATTITUDE_TARGET."""
    _take(vehicle, offboard.attitude_target(fields))


COPTER: Mapping[str, Hear] = {
    "HEARTBEAT": on_heartbeat,
    "MANUAL_CONTROL": on_manual_control,
    "SET_ATTITUDE_TARGET": on_attitude_target,
    "SET_POSITION_TARGET_GLOBAL_INT": on_global_target,
    "SET_POSITION_TARGET_LOCAL_NED": on_local_target,
}
"""What a multirotor hears."""

ROVER: Mapping[str, Hear] = COPTER
"""What a rover hears: it makes nothing of attitudes."""
