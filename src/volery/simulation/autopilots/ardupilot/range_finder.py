"""The range finder below a copter: the height that LAND goes by, and the ground that modes by hand follow.

As in ArduCopter a range finder that measures replaces the height above home where a landing becomes slow
(``Mode::get_alt_above_ground_cm``), and the target height moves with the ground below (surface_tracking.cpp).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from volery.base.elementary import cos
from volery.base.time import Ns, S, to_seconds
from volery.simulation.autopilots.ardupilot.feature import Feature, Kept
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.to_point import root_speed
from volery.simulation.autopilots.mavlink.messages import Fields, boot_ms, to_uint16
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

RANGE_FINDER = 10
"""RCn_OPTION of the range finder."""
GROUND = 1
"""SURFTRAK_MODE."""
FOLLOWS_GROUND = ("ALT_HOLD", "LOITER", "POSHOLD", "ZIGZAG", "CIRCLE")
FOLLOWED = (Control.CLIMB, Control.VELOCITY, Control.POSITION_CLIMB)
LOST_AFTER: Ns = S
"""SURFACE_TRACKING_TIMEOUT_MS."""


@dataclass
class SurfaceState:
    """The ground below by the range finder: heights above the estimator's origin [m], times in ns."""

    ignored: bool = False
    """Whether a switch keeps the range finder from being used."""
    ground: float = 0.0
    """Height of the ground, filtered, and by how much of it the target height has moved."""
    followed: float = 0.0
    measured_at: Ns = NEVER
    followed_at: Ns = NEVER


surface_of = Kept(SurfaceState)


def range_below(vehicle: AutopilotVehicle) -> float | None:
    """Return the distance of the ground straight below [m] as measured; ``None``: there is no measurement."""
    p, estimate = vehicle.parameters, vehicle.estimate
    slant = estimate.rangefinder
    if not p["RNGFND1_TYPE"] or surface_of(vehicle).ignored or slant is None:
        return None
    if not p["RNGFND1_MIN_CM"] <= 100.0 * slant <= p["RNGFND1_MAX_CM"]:
        return None
    roll, pitch, _ = estimate.attitude
    return slant * max(0.707, cos(roll) * cos(pitch))


def height_above_ground(vehicle: AutopilotVehicle) -> float:
    """Return the height by the range finder [m], without a measurement that above home."""
    measured = range_below(vehicle)
    return vehicle.height if measured is None else measured


def switch_range_finder(vehicle: AutopilotVehicle, position: int) -> None:
    """Use the range finder while the switch is up."""
    surface_of(vehicle).ignored = position <= 0


def follow_ground(vehicle: AutopilotVehicle, setpoint: Setpoint) -> Setpoint:
    """Return the set-point of a mode by hand whose target height moves with the ground."""
    state, now = surface_of(vehicle), vehicle.kernel.now()
    off = vehicle.parameters["SURFTRAK_MODE"] != GROUND
    if off or vehicle.mode.name not in FOLLOWS_GROUND or setpoint.control not in FOLLOWED or vehicle.landed:
        state.measured_at = now - LOST_AFTER
        return setpoint
    passed = to_seconds(min(now - state.followed_at, S))
    state.followed_at = now
    _measure(vehicle, passed)
    if now - state.measured_at >= LOST_AFTER:
        return setpoint
    missing = state.ground - state.followed
    tuning = vehicle.tuning
    rate = min(root_speed(abs(missing), tuning.pilot_accel_z), tuning.pilot_up)
    climb = rate if missing > 0.0 else -rate
    state.followed += climb * passed
    velocity = (*setpoint.velocity[:2], setpoint.velocity[2] - climb)
    return replace(
        setpoint,
        climb=setpoint.climb + climb,
        velocity=velocity,
        speed_up=max(setpoint.speed_up, setpoint.climb + climb),
        speed_down=max(setpoint.speed_down, -setpoint.climb - climb),
    )


def _measure(vehicle: AutopilotVehicle, passed: float) -> None:
    """Filter the height of the ground with SURFTRAK_TC; following begins with what is measured first."""
    state, now, measured = surface_of(vehicle), vehicle.kernel.now(), range_below(vehicle)
    if measured is None:
        return
    ground = -vehicle.estimate.position[2] - measured
    lost = now - state.measured_at >= LOST_AFTER
    state.measured_at = now
    if lost:
        state.ground = state.followed = ground
        return
    constant = max(0.0, vehicle.parameters["SURFTRAK_TC"])
    state.ground += (ground - state.ground) * passed / (passed + constant) if passed else 0.0


def _reported(vehicle: AutopilotVehicle) -> float | None:
    """Return the measured distance [m] of a configured range finder while it measures."""
    return vehicle.estimate.rangefinder if vehicle.parameters["RNGFND1_TYPE"] else None


def rangefinder(vehicle: AutopilotVehicle) -> Fields | None:
    """Return RANGEFINDER."""
    distance = _reported(vehicle)
    return None if distance is None else {"distance": distance, "voltage": 0.0}


def distance_sensor(vehicle: AutopilotVehicle) -> Fields | None:
    """Return DISTANCE_SENSOR downwards."""
    distance = _reported(vehicle)
    if distance is None:
        return None
    return {
        "time_boot_ms": boot_ms(vehicle),
        "min_distance": 20,
        "max_distance": 3000,
        "current_distance": to_uint16(distance * 100.0),
        "orientation": 25,
    }


ROVER = Feature(
    parameters={
        "RNGFND1_MAX_CM": (
            "cm",
            "largest distance below that counts for landings and for the ground that is followed",
        ),
        "RNGFND1_MIN_CM": ("cm", "least distance below that counts"),
        "RNGFND1_TYPE": ("", "any value but 0: there is a range finder below, and it is reported"),
    },
    switches={RANGE_FINDER: switch_range_finder},
    at_once=(RANGE_FINDER,),
    telemetry={"RANGEFINDER": rangefinder, "DISTANCE_SENSOR": distance_sensor},
)
COPTER = replace(
    ROVER,
    parameters={
        **ROVER.parameters,
        "SURFTRAK_MODE": ("", "1: modes by hand keep the height above the ground by the range finder"),
        "SURFTRAK_TC": ("s", "time constant of that ground's height"),
    },
    limit=follow_ground,
    height_above_ground=height_above_ground,
)
