"""Assumed figures of a DJI aircraft, as parameters: the public definitions state none of them.

The names are ours; a DJI aircraft has no parameters that a program could read.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import radians

from volery.ros.messages.dji_constants import HARDWARE
from volery.simulation.autopilots.autopilot_parameters import (
    INT8,
    REAL32,
    Parameter,
    Parameters,
    Tuning,
    quantised,
)

AIRCRAFT = tuple(HARDWARE)
"""Types of aircraft by value of the parameter AIRCRAFT."""

_ASSUMED: tuple[tuple[str, int, float, str], ...] = (
    ("AIRCRAFT", INT8, 0.0, "0 A3, 1 N3, 2 M100, 3 M600: type of aircraft, and its numbering of states"),
    ("TAKEOFF_HEIGHT", REAL32, 1.2, "metres to which task 4 climbs"),
    ("SETPOINT_TIMEOUT", REAL32, 0.5, "seconds without a set-point after which it brakes and hovers"),
    ("GO_HOME_ALTITUDE", REAL32, 30.0, "metres above home to which it climbs before it goes home"),
    ("GO_HOME_NEAR", REAL32, 5.0, "metres from home within which going home is landing"),
    ("LOW_BATTERY", REAL32, 30.0, "percent at which it goes home"),
    ("CRITICAL_BATTERY", REAL32, 10.0, "percent at which it lands"),
    ("IDLE_STOP", REAL32, 10.0, "seconds that the motors turn on the ground before they stop"),
    ("LANDED_STOP", REAL32, 1.0, "seconds after touch-down of a landing until the motors stop"),
    ("MAX_SPEED", REAL32, 10.0, "metres per second over ground towards a position"),
    ("GO_HOME_SPEED", REAL32, 10.0, "metres per second over ground on the way home"),
    ("CLIMB_SPEED", REAL32, 3.0, "metres per second up towards a height"),
    ("SINK_SPEED", REAL32, 2.0, "metres per second down towards a height"),
    ("LAND_SPEED", REAL32, 0.7, "metres per second near the ground in a landing"),
)

SUPPORTED: Mapping[str, str] = {name: what for name, _, _, what in _ASSUMED}
"""Meaning of each parameter; all have an effect."""

SDK_TILT = radians(35.0)
"""Documented limit of angles in set-points [rad]."""
SDK_SPEED, SDK_CLIMB = 30.0, 5.0
"""Documented limits of horizontal and vertical velocities in set-points [m/s]."""


def parameters() -> tuple[Parameter, ...]:
    """Return the default parameters."""
    return tuple(Parameter(name, kind, quantised(kind, value)) for name, kind, value, _ in _ASSUMED)


def tuning(parameters: Parameters) -> Tuning:
    """Return the tuning that follows from the parameters."""
    p = parameters
    return Tuning(
        speed=max(0.1, p["MAX_SPEED"]),
        speed_up=max(0.1, p["CLIMB_SPEED"]),
        speed_down=max(0.1, p["SINK_SPEED"]),
        tilt=SDK_TILT,
        land_speed=max(0.1, p["LAND_SPEED"]),
        land_speed_high=max(0.1, p["SINK_SPEED"]),
        land_slow_below=5.0,
        return_height=p["GO_HOME_ALTITUDE"],
        return_cone=0.0,
        return_speed=max(0.1, p["GO_HOME_SPEED"]),
        return_wait=0,
        pilot_up=4.0,
        pilot_down=3.0,
    )
