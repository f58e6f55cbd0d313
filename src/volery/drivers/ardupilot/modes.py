"""ArduPilot's modes by number. Facts of the firmware (``ArduCopter/mode.h``, ``Rover/mode.h``)."""

from __future__ import annotations

from collections.abc import Mapping

GUIDED = "GUIDED"

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
    4: "HOLD",
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

DRONE_KIND, ROVER_KIND = "drone", "rover"

KINDS: Mapping[int, str] = {
    2: DRONE_KIND,  # quadrotor
    3: DRONE_KIND,  # coaxial helicopter
    4: DRONE_KIND,  # helicopter
    13: DRONE_KIND,  # hexarotor
    14: DRONE_KIND,  # octorotor
    15: DRONE_KIND,  # tricopter
    29: DRONE_KIND,  # dodecarotor
    35: DRONE_KIND,  # decarotor
    10: ROVER_KIND,
    11: ROVER_KIND,  # boat: the same firmware
}
"""What a MAV_TYPE is, for ours that can be commanded."""

MODES: Mapping[str, Mapping[int, str]] = {DRONE_KIND: COPTER, ROVER_KIND: ROVER}
NUMBERS: Mapping[str, Mapping[str, int]] = {
    kind: {name: number for number, name in modes.items()} for kind, modes in MODES.items()
}


def mode_name(kind: str, number: int) -> str:
    """The name of a mode; its number in words if the firmware is newer than this table."""
    return MODES.get(kind, {}).get(number, f"MODE {number}")
