"""Handlers of the messages from the ground segment.

Nothing is acknowledged: a setting is answered by its value, a moved waypoint by its position; everything else
shows in the telemetry only. EMERGENCY_CMD has no effect and RC_4CH no longer exists in the observed version.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from volery.base.frames import ned_to_enu
from volery.simulation.autopilots.paparazzi import modes, parameters, rotorcraft_state
from volery.simulation.autopilots.paparazzi.flight_modes import Guided
from volery.simulation.autopilots.paparazzi.parameters import AUTO1_SWITCH, AUTO2_SWITCH, MANUAL_SWITCH
from volery.simulation.autopilots.paparazzi.rotorcraft_state import (
    FULL,
    PER_COUNT,
    StickFrame,
    bounded,
    state_of,
)
from volery.simulation.autopilots.paparazzi.telemetry import waypoint
from volery.simulation.autopilots.vehicle_state import Vehicle

Fields = dict[str, Any]

MANUAL_BELOW, AUTO2_ABOVE = -FULL // 2, FULL // 2
"""Limits of the mode switch."""


def on_ping(vehicle: Vehicle, _fields: Fields) -> None:
    """Handle PING."""
    vehicle.output.send_event("PONG", {})


def on_setting(vehicle: Vehicle, fields: Fields) -> None:
    """Handle SETTING: write, and send the new value."""
    value = parameters.write_setting(vehicle, fields["index"], fields["value"])
    vehicle.output.send_event("DL_VALUE", {"index": fields["index"], "value": value})


def on_get_setting(vehicle: Vehicle, fields: Fields) -> None:
    """Handle GET_SETTING."""
    value = parameters.read_setting(vehicle, fields["index"])
    vehicle.output.send_event("DL_VALUE", {"index": fields["index"], "value": value})


def on_block(vehicle: Vehicle, fields: Fields) -> None:
    """Handle BLOCK, which changes the block in any mode; only NAV flies it.

    A number beyond the plan means its last block.
    """
    navigation = state_of(vehicle).navigation
    navigation.jump(min(fields["block_id"], len(navigation.plan.blocks) - 1))


def on_move_waypoint(vehicle: Vehicle, fields: Fields) -> None:
    """Handle MOVE_WP (1e-7 deg, mm AMSL), which is ignored without a local frame."""
    if not vehicle.estimate.position_ok:
        return
    place = vehicle.flight.to_ned(fields["lat"] / 1e7, fields["lon"] / 1e7, fields["alt"] / 1000.0)
    if state_of(vehicle).navigation.move(fields["wp_id"], ned_to_enu(place)):
        vehicle.output.send_event("WP_MOVED_ENU", waypoint(vehicle, fields["wp_id"]))


def on_guided(vehicle: Vehicle, fields: Fields) -> None:
    """Handle GUIDED_SETPOINT_NED: ignored in every mode but GUIDED, and obeyed there whatever it says."""
    manoeuvre = vehicle.manoeuvre
    if isinstance(manoeuvre, Guided):
        manoeuvre.follow(fields["flags"], (fields["x"], fields["y"], fields["z"]), fields["yaw"])


# -- sticks


def on_channels(vehicle: Vehicle, fields: Fields) -> None:
    """Handle RC_UP: channels roll, pitch, yaw, throttle, mode; a shorter frame is ignored."""
    channels = fields["channels"]
    if len(channels) >= len(StickFrame._fields):
        roll, pitch, yaw, throttle, mode = (PER_COUNT * channel for channel in channels[:5])
        frame = StickFrame(bounded(roll), bounded(pitch), bounded(yaw), bounded(throttle, 0), bounded(mode))
        _receive(vehicle, frame)


def on_joystick(vehicle: Vehicle, fields: Fields) -> None:
    """Handle JOYSTICK_RAW, with the mode switch at AUTO2."""
    roll, pitch, yaw = (bounded(fields[name]) for name in ("roll", "pitch", "yaw"))
    _receive(vehicle, StickFrame(roll, pitch, yaw, bounded(fields["throttle"], 0), FULL))


def _receive(vehicle: Vehicle, frame: StickFrame) -> None:
    """Apply a frame of radio control: first the mode switch, then the sticks."""
    state_of(vehicle).radio.receive(vehicle, frame)
    _switch(vehicle, frame.mode)
    if vehicle.armed and vehicle.mode.pilot:
        vehicle.run_manoeuvre()


def _switch(vehicle: Vehicle, position: int) -> None:
    """Apply the mode switch.

    MANUAL always counts, the other positions not in HOME or FAILSAFE, and NAV not without a GPS fix.
    """
    manual = position < MANUAL_BELOW
    name = MANUAL_SWITCH if manual else AUTO2_SWITCH if position > AUTO2_ABOVE else AUTO1_SWITCH
    wanted = round(vehicle.parameters[name])
    if wanted == modes.NAV and rotorcraft_state.gps_lost(vehicle):
        return
    if manual or vehicle.mode.number not in (modes.HOME, modes.FAILSAFE):
        modes.set_mode(vehicle, wanted)


HANDLERS: Mapping[str, Callable[[Vehicle, Fields], None]] = {
    "BLOCK": on_block,
    "GET_SETTING": on_get_setting,
    "GUIDED_SETPOINT_NED": on_guided,
    "JOYSTICK_RAW": on_joystick,
    "MOVE_WP": on_move_waypoint,
    "PING": on_ping,
    "RC_UP": on_channels,
    "SETTING": on_setting,
}
"""Handlers by name of the message."""
