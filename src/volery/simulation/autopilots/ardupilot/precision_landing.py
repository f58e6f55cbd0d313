"""Precision landing and loiter over a target that a companion computer or a simulated beacon finds.

Laws, times and texts are those of AC_PrecLand and Mode::land_run_vertical_control of ArduCopter. The target
stands: its place is estimated by a filter of one state for each axis, and its velocity is not. Landings are
not tried again (PLND_STRICT, PLND_RET_MAX).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot, radians, sqrt
from typing import Any

from volery.base.elementary import tan
from volery.base.frames import Vector, turn_clockwise, world_to_body
from volery.base.time import MS, Ns, to_seconds
from volery.simulation.autopilots.ardupilot.feature import Feature, Kept, LogForm
from volery.simulation.autopilots.ardupilot.range_finder import range_below
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.manual_flight import Loiter
from volery.simulation.autopilots.mavlink.messages import to_uint32
from volery.simulation.autopilots.onboard_log import LogRow
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import CRITICAL, INFO

COMPANION, IRLOCK, SIMULATED = 1, 2, 4
"""PLND_TYPE; the simulated beacon answers to the last two."""
RAW_SENSOR = 0
"""PLND_EST_TYPE."""
PRECISION_LOITER = 39
"""RCn_OPTION of precision loiter."""
BODY_FRD = 12
"""MAV_FRAME."""
STARTS_AFTER: Ns = 2000 * MS
"""Time for which a target must be seen before it counts [ns]: EKF_INIT_TIME_MS."""
SEEN_WITHIN: Ns = 500 * MS
LOST_AFTER: Ns = 2000 * MS
WANDERS = 0.01
"""Variance that the place of a target gains [m^2/s]; estimated."""
SLOW_FROM, SLOW_TO = 2.0, 0.35
"""Heights above the target between which the descent is slowed down [m]."""
ACCEPTABLE, LEAST_DESCENT = 0.15, 0.1
"""Error that stops the descent there [m], down to that rate [m/s]."""


@dataclass
class PrecisionState:
    """Target of a precision landing. Lengths in metres, times in ns."""

    kind: int | None = None
    """Type that the vehicle has booted with; ``None``: not known yet."""
    found: bool = False
    """Whether the target is seen, and since when."""
    found_at: Ns = NEVER
    acquired: bool = False
    """Whether it counts."""
    measured_at: Ns = NEVER
    place: tuple[float, float] = (0.0, 0.0)
    """Estimated place, north, east about the estimator's origin, and its variance [m^2]."""
    variance: float = 0.0
    down: float = 0.0
    """Distance below the vehicle at the last measurement."""
    loiters: bool = False
    """Whether LOITER is held over it."""


precision_of = Kept(PrecisionState)


def _kind(vehicle: AutopilotVehicle) -> int:
    """Return the type that the vehicle has booted with, 0 without precision landing."""
    state, parameters = precision_of(vehicle), vehicle.parameters
    if state.kind is None:
        state.kind = round(parameters["PLND_TYPE"]) if parameters["PLND_ENABLED"] else 0
    return state.kind


def on_landing_target(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle LANDING_TARGET: angles, or a position in body axes with its distance."""
    if _kind(vehicle) != COMPANION:
        return
    distance = float(fields["distance"])
    if not fields.get("position_valid"):
        _measure(vehicle, (-tan(fields["angle_y"]), tan(fields["angle_x"]), 1.0), distance)
    elif fields["frame"] == BODY_FRD and distance > 0.0:
        _measure(vehicle, (fields["x"], fields["y"], fields["z"]), distance)


def _measure(vehicle: AutopilotVehicle, sight: Vector, distance: float) -> None:
    """Take a measurement of the target.

    Args:
        vehicle: The vehicle.
        sight: A vector towards the target, forward, right, down, of any length.
        distance: Distance of the target [m]; not above 0: the range finder gives the height above it.
    """
    estimate = vehicle.estimate
    if sight[2] <= 0.0 or not estimate.position_ok:
        return
    if distance > 0.0:
        scale = distance / sqrt(sum(one * one for one in sight))
    else:
        height = range_below(vehicle)
        if height is None:
            return
        scale = height / sight[2]
    turn = radians(vehicle.parameters["PLND_YAW_ALIGN"] * 0.01)
    ahead, aside = turn_clockwise((sight[0], sight[1]), turn)
    forward, right = ahead * scale, aside * scale
    w, x, y, z = estimate.quaternion
    north, east, down = world_to_body((w, -x, -y, -z), (forward, right, sight[2] * scale))
    here = estimate.position
    _fuse(vehicle, (here[0] + north, here[1] + east), down, hypot(*estimate.rates))


def _fuse(vehicle: AutopilotVehicle, place: tuple[float, float], down: float, rate: float) -> None:
    """Update the target's place by a measurement; the first one begins a search."""
    state, now = precision_of(vehicle), vehicle.kernel.now()
    sigma = down * (0.01 + 0.01 * rate) + 0.02
    state.down = down
    if not state.found:
        vehicle.send_text(INFO, "PrecLand: Target Found")
        state.found, state.found_at = True, now
        state.place, state.variance = place, sigma * sigma
    state.variance += (
        WANDERS * to_seconds(now - state.measured_at) if state.measured_at > state.found_at else 0.0
    )
    raw = vehicle.parameters["PLND_EST_TYPE"] == RAW_SENSOR
    share = 1.0 if raw else state.variance / (state.variance + sigma * sigma)
    state.place = (
        state.place[0] + share * (place[0] - state.place[0]),
        state.place[1] + share * (place[1] - state.place[1]),
    )
    state.variance *= 1.0 - share
    state.measured_at = now
    state.acquired = state.acquired or raw


def update_target(vehicle: AutopilotVehicle) -> None:
    """Measure the simulated beacon; begin to believe a target, and lose it."""
    if _kind(vehicle) in (IRLOCK, SIMULATED):
        _see_beacon(vehicle)
    state, now = precision_of(vehicle), vehicle.kernel.now()
    if state.acquired:
        if now - state.measured_at > LOST_AFTER:
            vehicle.send_text(CRITICAL, "PrecLand: Target Lost")
            state.found = state.acquired = False
    elif state.found and now - state.measured_at > SEEN_WITHIN:
        vehicle.send_text(CRITICAL, "PrecLand: Init Failed")
        state.found = False
    elif state.found and now - state.found_at > STARTS_AFTER:
        vehicle.send_text(INFO, "PrecLand: Init Complete")
        state.acquired = True


def _see_beacon(vehicle: AutopilotVehicle) -> None:
    """Measure the direction of the beacon that SIM_PLD_ places, within its cylinder."""
    p, estimate = vehicle.parameters, vehicle.estimate
    if not p["SIM_PLD_ENABLE"] or vehicle.home is None:
        return
    amsl = vehicle.home.amsl + p["SIM_PLD_HEIGHT"]
    north, east, down = vehicle.flight.to_ned(p["SIM_PLD_LAT"], p["SIM_PLD_LON"], amsl)
    here = estimate.position
    sight = (north - here[0], east - here[1], down - here[2])
    if 0.0 < sight[2] <= p["SIM_PLD_ALT_LMT"] and hypot(sight[0], sight[1]) <= p["SIM_PLD_DIST_LMT"]:
        _measure(vehicle, world_to_body(estimate.quaternion, sight), 0.0)


def target_place(vehicle: AutopilotVehicle) -> Vector:
    """Return where the copter is to stand: at the target, PLND_LAND_OFS_X ahead and _Y to the right."""
    p, heading = vehicle.parameters, vehicle.estimate.attitude[2]
    ahead, right = p["PLND_LAND_OFS_X"] / 100.0, p["PLND_LAND_OFS_Y"] / 100.0
    north, east = precision_of(vehicle).place
    off_north, off_east = turn_clockwise((ahead, right), heading)
    return north + off_north, east + off_east, 0.0


def aim(vehicle: AutopilotVehicle, setpoint: Setpoint) -> Setpoint:
    """Return the set-point of a landing, or of LOITER with the switch up, over the target if one is seen."""
    state, manoeuvre = precision_of(vehicle), vehicle.manoeuvre.flown
    if not state.acquired or vehicle.landed:
        return setpoint
    if vehicle.manoeuvre.landing and setpoint.control is Control.POSITION_CLIMB:
        place = target_place(vehicle)
        return replace(setpoint, position=place, climb=-_descent(vehicle, place, -setpoint.climb))
    if state.loiters and isinstance(manoeuvre, Loiter) and manoeuvre.is_left_alone():
        return replace(
            setpoint,
            control=Control.POSITION_CLIMB,
            position=target_place(vehicle),
            climb=-setpoint.velocity[2],
        )
    return setpoint


def _descent(vehicle: AutopilotVehicle, place: Vector, rate: float) -> float:
    """Return the rate of descent [m/s] over a target, of a landing that would descend at *rate*."""
    here, farthest = vehicle.estimate.position, vehicle.parameters["PLND_XY_DIST_MAX"]
    if rate <= 0.0:
        return 0.0
    error = hypot(place[0] - here[0], place[1] - here[1])
    if error > farthest > 0.0:
        return 0.0
    if SLOW_TO < precision_of(vehicle).down < SLOW_FROM:
        most = vehicle.tuning.land_speed / 2.0
        return max(LEAST_DESCENT, most - error * most / ACCEPTABLE)
    return rate


def switch_loiter(vehicle: AutopilotVehicle, position: int) -> None:
    """Hold LOITER over the target while the switch is up."""
    if position:
        precision_of(vehicle).loiters = position > 0


def precision_rows(vehicle: AutopilotVehicle) -> tuple[LogRow, ...]:
    """Return PL of the log on board."""
    if not _kind(vehicle):
        return ()
    state, here = precision_of(vehicle), vehicle.estimate.position
    north, east = (there - at for there, at in zip(state.place, here[:2], strict=True))
    speed = vehicle.estimate.velocity
    seen = (north, east, -speed[0], -speed[1], north, east, state.down) if state.acquired else (0.0,) * 7
    at_ms = to_uint32(max(0, (state.measured_at - vehicle.boot_at) // MS))
    kind = vehicle.parameters["PLND_EST_TYPE"]
    return (("PL", (1.0, float(state.acquired), *seen, float(at_ms), 0.0, kind)),)


COPTER = Feature(
    parameters={
        "PLND_ENABLED": ("", "any value but 0: landings are over a target, from the next boot on"),
        "PLND_TYPE": ("", "1: LANDING_TARGET finds it; 2 and 4: a simulated beacon"),
        "PLND_EST_TYPE": ("", "0: its place as measured; 1: filtered, after two seconds"),
        "PLND_LAND_OFS_X": ("cm", "distance of the landing ahead of it"),
        "PLND_LAND_OFS_Y": ("cm", "distance of the landing to its right"),
        "PLND_XY_DIST_MAX": ("m", "distance from it beyond which the copter does not descend; 0: any"),
        "PLND_YAW_ALIGN": ("0.01°", "direction of the sensor's forward axis from the nose"),
        "SIM_PLD_ENABLE": ("", "any value but 0: there is a simulated beacon"),
        "SIM_PLD_LAT": ("°", "its latitude"),
        "SIM_PLD_LON": ("°", "its longitude"),
        "SIM_PLD_HEIGHT": ("m", "its height above home"),
        "SIM_PLD_ALT_LMT": ("m", "height above it up to which it is seen"),
        "SIM_PLD_DIST_LMT": ("m", "distance from it in the plane up to which it is seen"),
    },
    messages={"LANDING_TARGET": on_landing_target},
    switches={PRECISION_LOITER: switch_loiter},
    at_once=(PRECISION_LOITER,),
    on_tick=update_target,
    limit=aim,
    log_forms=(
        LogForm(140, "PL", "QBBfffffffIIB", "TimeUS,Heal,TAcq,pX,pY,vX,vY,mX,mY,mZ,LastMeasMS,EKFOutl,Est"),
    ),
    log_rows=precision_rows,
)
ROVER = Feature(switches=COPTER.switches, at_once=COPTER.at_once)
