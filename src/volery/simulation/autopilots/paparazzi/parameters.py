"""Figures of the airframe as parameters, and settings that a ground station reads and writes by number.

Names are the firmware's own where it has one. Values are observed of the stock rotorcraft, documented
defaults of the firmware, or assumptions (docs/paparazzi.md). The numbers of settings are those of the stock
rotorcraft.
Values outside the bounds of a setting are accepted, as in the firmware: only the ground station checks the
bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite, radians
from typing import NamedTuple

from volery.links.paparazzi_aircraft import stock_aircraft
from volery.simulation.autopilots.autopilot_parameters import (
    REAL32,
    ManoeuvreTuning,
    StoredParameter,
    VehicleParameters,
)
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.autopilots.manual_control import ChannelRange, StickMap
from volery.simulation.autopilots.paparazzi.modes import set_mode_by_datalink, set_motors
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

MANUAL_SWITCH, AUTO1_SWITCH, AUTO2_SWITCH = "MODE_MANUAL", "MODE_AUTO1", "MODE_AUTO2"
"""Parameters that define the positions of a transmitter's mode switch."""

CRITICAL_CELL_VOLTS = 3.1
FARTHEST_M = stock_aircraft().farthest or 150.0
"""Largest distance from HOME in NAV, by the flight plan [m]."""
SLOWEST = 0.1


class AirframeFigure(NamedTuple):
    """Value and meaning of a figure of the airframe."""

    value: float
    what: str


FIGURES: Mapping[str, AirframeFigure] = {
    "MODE_STARTUP": AirframeFigure(13.0, "mode after switching on: NAV"),
    MANUAL_SWITCH: AirframeFigure(4.0, "mode at the transmitter's MANUAL: ATTITUDE_DIRECT"),
    AUTO1_SWITCH: AirframeFigure(9.0, "mode at AUTO1: ATTITUDE_Z_HOLD"),
    AUTO2_SWITCH: AirframeFigure(13.0, "mode at AUTO2, the setting `auto2`: NAV"),
    "MAX_DIST_FROM_HOME": AirframeFigure(FARTHEST_M, "m from HOME at which NAV becomes HOME"),
    "FAILSAFE_MODE_DISTANCE": AirframeFigure(
        1.2 * FARTHEST_M, "m from HOME beyond which it becomes FAILSAFE instead"
    ),
    "FAILSAFE_DESCENT_SPEED": AirframeFigure(
        0.0, "m/s down in FAILSAFE: v6.2 keeps its height; 1.5 is intended"
    ),
    "RC_CLIMB_BY_THROTTLE": AirframeFigure(
        0.0, "1: the throttle climbs in ATTITUDE_RC_CLIMB as intended; v6.2 does not follow it"
    ),
    "FAILSAFE_ON_BAT_CRITICAL": AirframeFigure(
        0.0, "1: a critical battery is FAILSAFE, and keeps motors off"
    ),
    "CRITIC_BAT_LEVEL": AirframeFigure(0.0, "V that are critical; 3.1 V a cell of its battery"),
    "GEOFENCE_DATALINK_LOST_TIME": AirframeFigure(0.0, "s of silence after which NAV becomes HOME; 0: never"),
    "GEOFENCE_MAX_ALTITUDE": AirframeFigure(0.0, "m above the origin at which NAV becomes HOME; 0: none"),
    "GPS_TIMEOUT": AirframeFigure(0.3, "s without a fix after which satellites are lost"),
    "RC_LOST_TIME": AirframeFigure(0.5, "s without sticks: LOST"),
    "RC_REALLY_LOST_TIME": AirframeFigure(1.0, "s without sticks: REALLY_LOST, in modes of sticks FAILSAFE"),
    "GUIDANCE_H_REF_MAX_SPEED": AirframeFigure(5.0, "m/s in the plane"),
    "GUIDANCE_H_REF_MAX_ACCEL": AirframeFigure(2.5, "m/s^2 in the plane"),
    "GUIDANCE_V_REF_MAX_CLIMB": AirframeFigure(3.0, "m/s up"),
    "GUIDANCE_V_REF_MAX_DESCENT": AirframeFigure(3.0, "m/s down"),
    "GUIDANCE_V_REF_MAX_ACCEL": AirframeFigure(1.0, "m/s^2 up and down"),
    "STABILIZATION_ATTITUDE_SP_MAX_PHI": AirframeFigure(45.0, "degrees of lean"),
    "STABILIZATION_ATTITUDE_SP_MAX_R": AirframeFigure(90.0, "degrees/s of turn by stick"),
    "ARRIVED_AT_WAYPOINT": AirframeFigure(3.0, "m from a waypoint at which the plan goes on"),
    "NAV_CLIMB_VSPEED": AirframeFigure(0.5, "m/s up in block Takeoff"),
    "NAV_DESCEND_VSPEED": AirframeFigure(-0.8, "m/s up in block flare"),
    "DEFAULT_CIRCLE_RADIUS": AirframeFigure(5.0, "m; clockwise if positive"),
}
"""Figures by name. A model's ``parameters`` of a vehicle replace their values."""

_FULL = ChannelRange(1000.0, 1500.0, 2000.0, 0.0)


def default_parameters() -> tuple[StoredParameter, ...]:
    """Return the default parameters."""
    return tuple(StoredParameter(name, REAL32, figure.value) for name, figure in FIGURES.items())


def own_parameters(_system: int, flight: Flight) -> dict[str, float]:
    """Return the parameters that follow from the battery."""
    return {"CRITIC_BAT_LEVEL": CRITICAL_CELL_VOLTS * flight.spec.battery.cells}


def tuning(parameters: VehicleParameters) -> ManoeuvreTuning:
    """Return the tuning that follows from the parameters."""
    p = parameters
    up, down = _moving(p["GUIDANCE_V_REF_MAX_CLIMB"]), _moving(p["GUIDANCE_V_REF_MAX_DESCENT"])
    accel_z = _moving(p["GUIDANCE_V_REF_MAX_ACCEL"])
    return ManoeuvreTuning(
        sticks=StickMap(travels=(_FULL, _FULL, _FULL, _FULL)),
        speed=_moving(p["GUIDANCE_H_REF_MAX_SPEED"]),
        speed_up=up,
        speed_down=down,
        accel=_moving(p["GUIDANCE_H_REF_MAX_ACCEL"]),
        accel_z=accel_z,
        tilt=radians(min(80.0, max(5.0, p["STABILIZATION_ATTITUDE_SP_MAX_PHI"]))),
        waypoint_radius=_moving(p["ARRIVED_AT_WAYPOINT"]),
        pilot_up=up,
        pilot_down=down,
        pilot_accel_z=accel_z,
        pilot_yaw_rate=radians(p["STABILIZATION_ATTITUDE_SP_MAX_R"]),
    )


def _moving(value: float) -> float:
    """Return a speed, acceleration or distance that is not 0."""
    return max(SLOWEST, value)


class Variable(NamedTuple):
    """Access to one setting."""

    read: Callable[[AutopilotVehicle], float]
    write: Callable[[AutopilotVehicle, float], None]


def _parameter(name: str) -> Variable:
    def write(vehicle: AutopilotVehicle, value: float) -> None:
        vehicle.set_parameter(name, value)

    return Variable(lambda vehicle: vehicle.parameters[name], write)


def _set_telemetry_mode(vehicle: AutopilotVehicle, value: float) -> None:
    vehicle.firmware_state.telemetry_mode = int(value)


def _stored(number: int) -> Variable:
    """Return what answers for a number without a setting: it is stored, as observed."""

    def write(vehicle: AutopilotVehicle, value: float) -> None:
        vehicle.firmware_state.stored_settings[number] = value

    return Variable(lambda vehicle: vehicle.firmware_state.stored_settings.get(number, 0.0), write)


def _keep(_vehicle: AutopilotVehicle, _value: float) -> None:
    """Leave a setting as it is."""


WITHOUT_MODEL = Variable(lambda _vehicle: 0.0, _keep)
"""A setting that would change nothing that is simulated: it keeps its value, and the answer says so."""

VARIABLES = {
    "telemetry_mode_Main": Variable(
        lambda vehicle: float(vehicle.firmware_state.telemetry_mode), _set_telemetry_mode
    ),
    "autopilot_mode_auto2": _parameter(AUTO2_SWITCH),
    "autopilot.kill_throttle": Variable(
        lambda vehicle: float(not vehicle.armed), lambda vehicle, value: set_motors(vehicle, value == 0.0)
    ),
    "autopilot.mode": Variable(
        lambda vehicle: float(vehicle.mode.number),
        lambda vehicle, value: set_mode_by_datalink(vehicle, int(value)),
    ),
}
"""Settings by the variables of the stock rotorcraft."""

NUMBERED = {
    setting.number: VARIABLES.get(setting.variable, WITHOUT_MODEL) for setting in stock_aircraft().settings
}


def read_setting(vehicle: AutopilotVehicle, number: int) -> float:
    """Return the value of a setting; a number without a setting answers as well, at first with 0."""
    return NUMBERED.get(number, _stored(number)).read(vehicle)


def write_setting(vehicle: AutopilotVehicle, number: int, value: float) -> float:
    """Write a setting, and return its new value; a number without a setting answers what was written."""
    variable = NUMBERED.get(number, _stored(number))
    if isfinite(value):
        variable.write(vehicle, value)
    return variable.read(vehicle)
