"""ArduPilot's modes by number, from the firmware (``ArduCopter/mode.h``, ``Rover/mode.h``)."""

from __future__ import annotations

from collections.abc import Mapping

from volery.vehicles.drivers.steps import DRONE_KIND, ROVER_KIND

GUIDED = "GUIDED"
RESTING = "HOLD"
"""Mode in which an armed rover stands."""

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
    17: "BRAKE",
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
