"""Weathervaning: in AUTO and GUIDED a copter that holds its place turns its nose, tail or side into the wind.

The lean that holds the copter against the wind gives the rate of the turn, as in ArduPilot's AC_WeatherVane.
The turned heading is the commanded one while it lasts, so every manoeuvre that takes commands follows it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, degrees, hypot, radians

from volery.base.elementary import exp, log
from volery.base.time import Ns, S, to_seconds
from volery.simulation.autopilots.ardupilot.feature import TICK, Feature
from volery.simulation.autopilots.manoeuvres.manual_flight import ManualFlight
from volery.simulation.autopilots.state_groups import NEVER, CommandedLimits
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.simulation.world.arithmetic import wrap_angle
from volery.trace.events import INFO

ALLOWED = 1 << 7
"""Bit of AUTO_OPTIONS and GUID_OPTIONS."""
ONLY_NEAR_GROUND, OFF, NOSE, NOSE_OR_TAIL, SIDE, TAIL = -1, 0, 1, 2, 3, 4
"""WVANE_ENABLE."""
WORDS = {NOSE: "nose in", NOSE_OR_TAIL: "nose or tail in", SIDE: "side in", TAIL: "tail in"}
USE_PITCH = 1
"""Bit of WVANE_OPTIONS."""
WAITS: Ns = 2 * S
"""Time for which the conditions must hold before it turns."""
DECAY = 400 * log(0.98)
"""Logarithm of the share of the rate that is left after a second: 0.98 at each of 400 steps, as there."""


@dataclass
class VaneState:
    """Turning into the wind."""

    commanded: CommandedLimits
    """Limits of the mode in which it began: it begins anew with another mode."""
    since: Ns = NEVER
    """Since when [ns] the conditions have held."""
    turning: bool = False
    rate: float = 0.0
    """Rate of the turn, clockwise [degrees/s]."""
    heading: float = 0.0
    """Heading that it has commanded, clockwise from north [rad], and the command before it."""
    before: float | None = None


def _vane_of(vehicle: AutopilotVehicle) -> VaneState:
    vane: VaneState | None = vehicle.kept.get(VaneState)
    if vane is None or vane.commanded is not vehicle.commanded:
        vane = vehicle.kept[VaneState] = VaneState(vehicle.commanded)
    return vane


def turn_into_wind(vehicle: AutopilotVehicle) -> None:
    """Move the commanded heading while the copter weathervanes, and give it back afterwards."""
    vane = _vane_of(vehicle)
    if not vehicle.parameters["WVANE_ENABLE"]:
        if vane.since != NEVER:
            _give_back(vehicle, vane)
        return
    side = _side(vehicle)
    if side not in WORDS or not _steady(vehicle):
        _give_back(vehicle, vane)
        return
    now = vehicle.kernel.now()
    if vane.since == NEVER:
        vane.since = now
    if now - vane.since < WAITS:
        return
    if not vane.turning:
        vane.turning, vane.before = True, vehicle.commanded.yaw
        vane.heading = vehicle.estimate.attitude[2]
        vehicle.send_text(INFO, f"Weathervane Active: {WORDS[side]}")
    kept = exp(DECAY * to_seconds(TICK))
    vane.rate = kept * vane.rate + (1.0 - kept) * vehicle.parameters["WVANE_GAIN"] * _rate(vehicle, side)
    vane.heading = wrap_angle(vane.heading + radians(vane.rate) * to_seconds(TICK))
    vehicle.commanded.yaw = vane.heading


def _give_back(vehicle: AutopilotVehicle, vane: VaneState) -> None:
    if vane.turning and vehicle.commanded.yaw == vane.heading:
        vehicle.commanded.yaw = vane.before
    vehicle.kept[VaneState] = VaneState(vehicle.commanded)


def _side(vehicle: AutopilotVehicle) -> int:
    """Return the side that turns into the wind, or ``OFF``."""
    parameters = vehicle.parameters
    options = {"AUTO": parameters["AUTO_OPTIONS"], "GUIDED": parameters["GUID_OPTIONS"]}
    flying = vehicle.armed and not vehicle.landed
    if not flying or not round(options.get(vehicle.mode.name, 0.0)) & ALLOWED:
        return OFF
    if parameters["WVANE_GAIN"] <= 0.0 or ManualFlight(vehicle).pilot.yaw != 0.0:
        return OFF
    side = round(parameters["WVANE_ENABLE"])
    if vehicle.manoeuvre.flown.taking_off and parameters["WVANE_TAKEOFF"] >= 0.0:
        side = round(parameters["WVANE_TAKEOFF"])
    if vehicle.manoeuvre.flown.landing and parameters["WVANE_LAND"] >= 0.0:
        side = round(parameters["WVANE_LAND"])
    return side


def _steady(vehicle: AutopilotVehicle) -> bool:
    """Return whether the copter is high and slow enough."""
    parameters = vehicle.parameters
    lowest, fastest = parameters["WVANE_HGT_MIN"], parameters["WVANE_SPD_MAX"]
    steepest = parameters["WVANE_VELZ_MAX"]
    north, east, down = vehicle.estimate.velocity
    return (
        (lowest <= 0.0 or vehicle.height > lowest)
        and (fastest <= 0.0 or hypot(north, east) <= fastest)
        and (steepest <= 0.0 or abs(down) <= steepest)
    )


def _rate(vehicle: AutopilotVehicle, side: int) -> float:
    """Return the rate of the turn [degrees/s] at a gain of 1: the lean beyond WVANE_ANG_MIN."""
    roll, pitch = (degrees(angle) for angle in vehicle.estimate.target_attitude[:2])
    dead = vehicle.parameters["WVANE_ANG_MIN"]
    by_pitch = round(vehicle.parameters["WVANE_OPTIONS"]) & USE_PITCH
    if side == SIDE:
        size, clockwise = max(abs(pitch) - dead, 0.0), (pitch > 0.0) == (roll > 0.0)
        return size if clockwise else -size
    size = max(abs(roll) - dead, 0.0)
    if side == NOSE_OR_TAIL:
        return size if (roll < 0.0) == (pitch > 0.0) else -size
    away = pitch if side == NOSE else -pitch
    if by_pitch and away > dead:
        size = abs(roll) + away - dead
    return copysign(size, roll if side == NOSE else -roll)


COPTER = Feature(
    parameters={
        "GUID_OPTIONS": ("", "bit 7 allows weathervaning"),
        "WVANE_ENABLE": (
            "",
            "weathervaning: 1 nose, 2 nose or tail, 3 side, 4 tail into the wind; -1 as below",
        ),
        "WVANE_ANG_MIN": ("°", "lean up to which it does not turn"),
        "WVANE_GAIN": ("°/s per °", "rate of the turn for each degree of lean"),
        "WVANE_HGT_MIN": ("m", "height above home up to which it does not weathervane"),
        "WVANE_LAND": ("", "as WVANE_ENABLE, while it lands; -1: as there"),
        "WVANE_OPTIONS": ("", "bit 0: the pitch turns it, too"),
        "WVANE_SPD_MAX": ("m/s", "speed in the plane above which it does not weathervane; 0: none"),
        "WVANE_TAKEOFF": ("", "as WVANE_ENABLE, during a take-off; -1: as there"),
        "WVANE_VELZ_MAX": ("m/s", "climb or descent above which it does not weathervane; 0: none"),
    },
    on_tick=turn_into_wind,
)
