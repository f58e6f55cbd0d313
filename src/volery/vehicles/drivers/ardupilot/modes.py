"""ArduPilot's modes by number, and the reaction to a lost link, in words, from its parameters.

Sources: the firmware (``ArduCopter/mode.h``, ``Rover/mode.h``) and the parameter documentation of ArduCopter
and ArduRover. The failsafe for a lost link acts only after a heartbeat of a ground station was received.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf

from volery.base.errors import CapabilityError
from volery.vehicles.driver import LinkLossAction, Settings
from volery.vehicles.drivers.mavlink.client import GCS_SYSTEM
from volery.vehicles.drivers.steps import DRONE_KIND, ROVER_KIND

GUIDED = "GUIDED"
RESTING = "HOLD"
"""Mode in which an armed rover stands."""
STOPPED = "BRAKE"
"""Mode in which a copter stands that a failsafe has stopped; no pilot steers it there."""

COPTER: Mapping[int, str] = {
    0: "STABILIZE",
    1: "ACRO",
    2: "ALT_HOLD",
    3: "AUTO",
    4: GUIDED,
    5: "LOITER",
    6: "RTL",
    7: "CIRCLE",
    9: "LAND",
    11: "DRIFT",
    13: "SPORT",
    14: "FLIP",
    15: "AUTOTUNE",
    16: "POSHOLD",
    17: STOPPED,
    18: "THROW",
    19: "AVOID_ADSB",
    20: "GUIDED_NOGPS",
    21: "SMART_RTL",
    22: "FLOWHOLD",
    23: "FOLLOW",
    24: "ZIGZAG",
    25: "SYSTEMID",
    26: "AUTOROTATE",
    27: "AUTO_RTL",
    28: "TURTLE",
}

ROVER: Mapping[int, str] = {
    0: "MANUAL",
    1: "ACRO",
    3: "STEERING",
    4: RESTING,
    5: "LOITER",
    6: "FOLLOW",
    7: "SIMPLE",
    8: "DOCK",
    9: "CIRCLE",
    10: "AUTO",
    11: "RTL",
    12: "SMART_RTL",
    15: GUIDED,
    16: "INITIALISING",
}

MODES: Mapping[str, Mapping[int, str]] = {DRONE_KIND: COPTER, ROVER_KIND: ROVER}
NUMBERS: Mapping[str, Mapping[str, int]] = {
    kind: {name: number for number, name in modes.items()} for kind, modes in MODES.items()
}


def mode_name(kind: str, number: int) -> str:
    """Return the name of a mode, or its number for a mode that is not in this table."""
    return MODES.get(kind, {}).get(number, f"MODE {number}")


STATION_PARAMETERS = ("SYSID_MYGCS", "MAV_GCS_SYSID", "MAV_GCS_SYSID_HI")
"""System ids of ground stations: the first before 4.7, the others, a range, since."""
LINK_LOSS_PARAMETERS: Mapping[str, Sequence[str]] = {
    DRONE_KIND: ("FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "FS_OPTIONS", "GUID_TIMEOUT", *STATION_PARAMETERS),
    ROVER_KIND: ("FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "FS_ACTION", *STATION_PARAMETERS),
}
"""Parameters that define the reaction, by kind of vehicle."""

FENCE_PARAMETERS = ("FENCE_ENABLE", "FENCE_TYPE", "FENCE_RADIUS", "FENCE_ALT_MAX")
"""Parameters of the aircraft's own fence that a target is compared with."""
_CEILING, _CIRCLE = 1, 2
"""Bits of FENCE_TYPE."""


def beyond_own_fence(parameters: Mapping[str, float], away_m: float, above_home_m: float) -> str:
    """Return which parameter of the aircraft's own fence a target exceeds, in words; empty: none.

    Polygons are not compared: the autopilot does not take up a target beyond them, which is noticed.

    Args:
        parameters: The parameters as read so far.
        away_m: Distance of the target from home.
        above_home_m: Height of the target above home; NaN is not compared.
    """
    if not parameters.get("FENCE_ENABLE", 0.0):
        return ""
    kinds = round(parameters.get("FENCE_TYPE", 0.0))
    radius, ceiling = parameters.get("FENCE_RADIUS", inf), parameters.get("FENCE_ALT_MAX", inf)
    if kinds & _CIRCLE and away_m > radius:
        return f"it is {away_m:.0f} m from home, outside the aircraft's own fence (FENCE_RADIUS={radius:g})"
    if kinds & _CEILING and above_home_m > ceiling:
        limit = f"(FENCE_ALT_MAX={ceiling:g})"
        return f"it is {above_home_m:.0f} m above home, over the aircraft's own fence {limit}"
    return ""


_COPTER: Mapping[int, str] = {
    1: "it returns home (RTL)",
    2: "it goes on with a mission, else returns home (RTL)",
    3: "it returns by the way it came (SMART_RTL), else straight (RTL)",
    4: "it returns by the way it came (SMART_RTL), else lands",
    5: "it lands",
    6: "it flies its landing sequence (AUTO), else returns home (RTL)",
    7: "it stops (BRAKE), else lands",
}
"""Values of FS_GCS_ENABLE."""
_ROVER: Mapping[int, str] = {
    1: "it returns home (RTL)",
    2: "it stops (HOLD)",
    3: "it returns by the way it came (SMART_RTL), else straight (RTL)",
    4: "it returns by the way it came (SMART_RTL), else stops (HOLD)",
    5: "it disarms",
    6: "it stops (LOITER or HOLD)",
}
"""Values of FS_ACTION."""
_MISSIONS_GO_ON = 1 << 1
"""Bit of FS_OPTIONS: a mission continues without a ground station."""


def listened_for(parameters: Mapping[str, float]) -> range:
    """Return the system ids that count as ground stations."""
    first = round(parameters.get("MAV_GCS_SYSID", parameters.get("SYSID_MYGCS", GCS_SYSTEM)))
    last = round(parameters.get("MAV_GCS_SYSID_HI", 0.0))
    return range(first, max(first, last) + 1)


def on_link_loss(kind: str, parameters: Mapping[str, float]) -> str:
    """Return the reaction in one line; empty for a vehicle that is neither copter nor rover."""
    if kind not in LINK_LOSS_PARAMETERS:
        return ""
    copter = kind == DRONE_KIND
    enabled = round(parameters.get("FS_GCS_ENABLE", 0.0))
    if not enabled:
        line = "it does not react (FS_GCS_ENABLE=0): it flies to its last target and stays there"
        lasts = parameters.get("GUID_TIMEOUT", 3.0)
        return f"{line}; a velocity ends after {lasts:g} s" if copter else line
    action = _COPTER.get(enabled) if copter else _ROVER.get(round(parameters.get("FS_ACTION", 0.0)))
    after = parameters.get("FS_GCS_TIMEOUT", 5.0)
    line = f"{after:g} s after the last heartbeat {action or 'it does nothing'}"
    stations = listened_for(parameters)
    if GCS_SYSTEM not in stations:
        which = f"system {stations[0]}" if len(stations) == 1 else f"systems {stations[0]} to {stations[-1]}"
        line += f" (it listens for {which}, not for this program)"
    goes_on = round(parameters.get("FS_OPTIONS", 0.0)) & _MISSIONS_GO_ON
    return f"{line}; a mission goes on" if copter and goes_on else line


_COPTER_ACTIONS: Mapping[LinkLossAction, float] = {"return": 1.0, "land": 5.0, "hover": 7.0}
"""Values of FS_GCS_ENABLE: RTL, LAND, BRAKE."""
_ROVER_ACTIONS: Mapping[LinkLossAction, float] = {"return": 1.0, "hover": 2.0}
"""Values of FS_ACTION: RTL, HOLD."""
_PILOT_GOES_ON = 1 << 4
"""Bit of FS_OPTIONS: a mode that sticks fly continues without a ground station."""


def link_loss_settings(
    name: str, kind: str, action: LinkLossAction, parameters: Mapping[str, float]
) -> Settings:
    """Return the parameters with which the vehicle *name* does *action* when the link is lost.

    Args:
        name: Name of the vehicle, for errors.
        kind: Kind of the vehicle.
        action: What it is to do.
        parameters: The parameters as read so far.
    """
    stations = listened_for(parameters)
    if GCS_SYSTEM not in stations:
        found = next(one for one in STATION_PARAMETERS if one in parameters)
        raise CapabilityError(
            f"{name}: it reacts when the ground station with system id {stations[0]} is lost, not for this "
            f"program, which has {GCS_SYSTEM}: leave it to that station, or set {found} to {GCS_SYSTEM}"
        )
    if kind == DRONE_KIND:
        return {
            "FS_GCS_ENABLE": lambda _: _COPTER_ACTIONS[action],
            "FS_OPTIONS": lambda value: float(round(value) & ~(_MISSIONS_GO_ON | _PILOT_GOES_ON)),
        }
    if action not in _ROVER_ACTIONS:
        raise CapabilityError(f"{name}: a rover does not land; hover stops it, return drives it home")
    return {
        "FS_GCS_ENABLE": lambda _: 1.0,
        "FS_ACTION": lambda _: _ROVER_ACTIONS[action],
    }
