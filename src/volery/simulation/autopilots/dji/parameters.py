"""Figures of a DJI aircraft, as parameters: where no public source states a figure, it is assumed.

The names are ours; a DJI aircraft has no parameters that a program could read.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import radians

from volery.ros.messages.dji_constants import HARDWARE, M600
from volery.simulation.autopilots.autopilot_parameters import (
    INT8,
    REAL32,
    ManoeuvreTuning,
    StoredParameter,
    VehicleParameters,
    quantised,
)

AIRCRAFT = tuple(HARDWARE)
"""Types of aircraft by value of the parameter AIRCRAFT."""

_FIGURES: tuple[tuple[str, int, float, str], ...] = (
    ("AIRCRAFT", INT8, 0.0, ", ".join(f"{number} {name}" for number, name in enumerate(AIRCRAFT))),
    ("PRESSURE_OFFSET", REAL32, 0.0, "metres that the altitude of `gps_position` is above the true one"),
    ("TAKEOFF_HEIGHT", REAL32, 1.2, "metres to which task 4 climbs"),
    ("SETPOINT_TIMEOUT", REAL32, 0.5, "seconds without a set-point after which it brakes and hovers"),
    ("GO_HOME_ALTITUDE", REAL32, 30.0, "metres above home to which it climbs before it goes home"),
    ("GO_HOME_NEAR", REAL32, 20.0, "metres from home within which going home is landing"),
    ("LOW_BATTERY", REAL32, 30.0, "percent at which it goes home"),
    ("LOW_BATTERY_DELAY", REAL32, 10.0, "seconds between the warning and going home"),
    ("CRITICAL_BATTERY", REAL32, 10.0, "percent at which it lands"),
    ("IDLE_STOP", REAL32, 10.0, "seconds that the motors turn on the ground before they stop"),
    ("LANDED_STOP", REAL32, 1.0, "seconds after touch-down of a landing until the motors stop"),
    ("LAND_WAITS", INT8, 0.0, "1: a landing waits at 0.7 m for a confirmation"),
    ("MAX_SPEED", REAL32, 3.0, "metres per second over ground towards a set-point of position, at most"),
    ("POSITION_GAIN", REAL32, 0.5, "metres per second for each metre that is left to go"),
    ("GO_HOME_SPEED", REAL32, 10.0, "metres per second over ground on the way home"),
    ("CLIMB_SPEED", REAL32, 3.0, "metres per second up towards a height"),
    ("SINK_SPEED", REAL32, 2.0, "metres per second down towards a height"),
    ("LAND_SPEED", REAL32, 0.7, "metres per second near the ground in a landing; an M600 has 0.5"),
    ("RC_CONNECTED", INT8, 1.0, "0: the transmitter is off"),
    ("NO_FLY_NORTH", REAL32, 0.0, "metres from the place of power-on to the middle of a no-fly zone"),
    ("NO_FLY_EAST", REAL32, 0.0, "the same to the east"),
    ("NO_FLY_RADIUS", REAL32, 0.0, "metres of its radius; 0: none"),
    ("RC_LOST_ACTION", INT8, 0.0, "3 s after the transmitter is lost: 0 goes home, 1 hovers"),
)

SUPPORTED: Mapping[str, str] = {name: what for name, _, _, what in _FIGURES}
"""Meaning of each parameter; all have an effect."""

SDK_TILT = radians(35.0)
"""Documented limit of angles in set-points [rad]."""
SDK_SPEED, SDK_CLIMB = 30.0, 5.0
"""Documented limits of horizontal and vertical velocities in set-points [m/s]."""

PILOT_SPEED = 10.0
"""Speed over ground at full deflection, and to which a mission or a landing is limited [m/s]: assumed."""
SLOW_BELOW = 5.0
"""Height above home below which a landing is slow [m]: assumed."""
M600_SLOW_BELOW, M600_LAND_FAST, M600_LAND_SLOW = 20.0, 3.0, 0.5
"""The same of an M600, and its speeds in a landing [m, m/s]: support of DJI, in a thread."""


def parameters() -> tuple[StoredParameter, ...]:
    """Return the default parameters."""
    return tuple(StoredParameter(name, kind, quantised(kind, value)) for name, kind, value, _ in _FIGURES)


def aircraft_type(parameters: VehicleParameters) -> str:
    """Return the type of the aircraft, such as A3 or M100."""
    return AIRCRAFT[min(len(AIRCRAFT) - 1, max(0, round(parameters["AIRCRAFT"])))]


def tuning(parameters: VehicleParameters) -> ManoeuvreTuning:
    """Return the tuning that follows from the parameters."""
    p, m600 = parameters, aircraft_type(parameters) == M600
    return ManoeuvreTuning(
        speed=PILOT_SPEED,
        speed_up=max(0.1, p["CLIMB_SPEED"]),
        speed_down=max(0.1, p["SINK_SPEED"]),
        tilt=SDK_TILT,
        land_speed=M600_LAND_SLOW if m600 else max(0.1, p["LAND_SPEED"]),
        land_speed_high=M600_LAND_FAST if m600 else max(0.1, p["SINK_SPEED"]),
        land_slow_below=M600_SLOW_BELOW if m600 else SLOW_BELOW,
        return_height=p["GO_HOME_ALTITUDE"],
        return_cone=0.0,
        return_speed=max(0.1, p["GO_HOME_SPEED"]),
        return_wait=0,
        pilot_up=4.0,
        pilot_down=3.0,
    )
