"""The figures of the airframe: what an airframe file defines for the rotorcraft firmware, as parameters.

Names are the firmware's own where it has one. None is recorded: the values are the firmware's documented
defaults where those make sense for the simulated body, and assumptions else (docs/paparazzi.md).
"""

from __future__ import annotations

from math import radians

from volery.autopilots.simulated.flight import Flight
from volery.autopilots.simulated.parameters import REAL32, Parameter, Parameters
from volery.autopilots.simulated.sticks import Travel
from volery.autopilots.simulated.tuning import StickMap, Tuning
from volery.links.pprz_aircraft import stock_aircraft

MANUAL_SWITCH, AUTO1_SWITCH, AUTO2_SWITCH = "MODE_MANUAL", "MODE_AUTO1", "MODE_AUTO2"
"""What the three positions of a transmitter's mode switch mean."""

CRITICAL_CELL_VOLTS = 3.1
FARTHEST_M = stock_aircraft().farthest or 150.0
"""From HOME in NAV, by the flight plan."""
SLOWEST = 0.1

_VALUES = {
    "MODE_STARTUP": 13.0,
    MANUAL_SWITCH: 4.0,
    AUTO1_SWITCH: 12.0,
    AUTO2_SWITCH: 13.0,
    "MAX_DIST_FROM_HOME": FARTHEST_M,
    "FAILSAFE_MODE_DISTANCE": 1.5 * FARTHEST_M,
    "FAILSAFE_DESCENT_SPEED": 1.5,
    "FAILSAFE_ON_BAT_CRITICAL": 0.0,
    "CRITIC_BAT_LEVEL": 0.0,
    "GEOFENCE_DATALINK_LOST_TIME": 0.0,
    "GEOFENCE_MAX_ALTITUDE": 0.0,
    "GPS_TIMEOUT": 2.0,
    "RC_LOST_TIME": 0.5,
    "RC_REALLY_LOST_TIME": 1.0,
    "GUIDANCE_H_REF_MAX_SPEED": 5.0,
    "GUIDANCE_H_REF_MAX_ACCEL": 2.5,
    "GUIDANCE_V_REF_MAX_CLIMB": 2.5,
    "GUIDANCE_V_REF_MAX_DESCENT": 1.5,
    "GUIDANCE_V_REF_MAX_ACCEL": 1.0,
    "STABILIZATION_ATTITUDE_SP_MAX_PHI": 30.0,
    "STABILIZATION_ATTITUDE_SP_MAX_R": 90.0,
    "ARRIVED_AT_WAYPOINT": 3.0,
    "NAV_CLIMB_VSPEED": 0.5,
    "NAV_DESCEND_VSPEED": -0.8,
    "DEFAULT_CIRCLE_RADIUS": 5.0,
}
"""Metres, m/s, m/s^2, degrees, seconds, volts, numbers of modes. Zero switches a geofence off."""

_FULL = Travel(1000.0, 1500.0, 2000.0, 0.0)


def parameters() -> tuple[Parameter, ...]:
    """All of them."""
    return tuple(Parameter(name, REAL32, value) for name, value in _VALUES.items())


def own_parameters(_system: int, flight: Flight) -> dict[str, float]:
    """What follows from the battery."""
    return {"CRITIC_BAT_LEVEL": CRITICAL_CELL_VOLTS * flight.spec.battery.cells}


def tuning(parameters: Parameters) -> Tuning:
    """What manoeuvres fly by."""
    p = parameters
    up, down = _moving(p["GUIDANCE_V_REF_MAX_CLIMB"]), _moving(p["GUIDANCE_V_REF_MAX_DESCENT"])
    accel_z = _moving(p["GUIDANCE_V_REF_MAX_ACCEL"])
    return Tuning(
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
    """A speed, an acceleration or a distance that is not none."""
    return max(SLOWEST, value)
