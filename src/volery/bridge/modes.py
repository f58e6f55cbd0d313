"""Names and numbers of ArduPilot's flight modes, by MAVLink's type of vehicle.

Source: ArduPilot's ``ArduCopter/mode.h`` and ``Rover/mode.h``. A mode that is not listed goes by
``CMODE(number)``, as in MAVROS.
"""

from __future__ import annotations

import re

COPTER = {
    0: "STABILIZE", 1: "ACRO", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 7: "CIRCLE",
    8: "POSITION", 9: "LAND", 10: "OF_LOITER", 11: "DRIFT", 13: "SPORT", 14: "FLIP", 15: "AUTOTUNE",
    16: "POSHOLD", 17: "BRAKE", 18: "THROW", 19: "AVOID_ADSB", 20: "GUIDED_NOGPS", 21: "SMART_RTL",
    22: "FLOWHOLD", 23: "FOLLOW", 24: "ZIGZAG", 25: "SYSTEMID", 26: "AUTOROTATE", 27: "AUTO_RTL",
    28: "TURTLE",
}  # fmt: skip
ROVER = {
    0: "MANUAL", 1: "ACRO", 3: "STEERING", 4: "HOLD", 5: "LOITER", 6: "FOLLOW", 7: "SIMPLE", 8: "DOCK",
    9: "CIRCLE", 10: "AUTO", 11: "RTL", 12: "SMART_RTL", 15: "GUIDED", 16: "INITIALISING",
}  # fmt: skip
_ROVER_TYPES = frozenset({10, 11})
"""MAV_TYPE: ground rover, surface boat."""
_NUMBERED = re.compile(r"(?:CMODE\()?(\d+)\)?\Z")


def _table(kind: int) -> dict[int, str]:
    return ROVER if kind in _ROVER_TYPES else COPTER


def mode_name(kind: int, number: int) -> str:
    """The name of a mode of a vehicle of MAV_TYPE *kind*."""
    return _table(kind).get(number, f"CMODE({number})")


def mode_number(kind: int, name: str) -> int | None:
    """The number of a mode, ``None`` if there is no such name."""
    for number, known in _table(kind).items():
        if known == name.upper():
            return number
    numbered = _NUMBERED.match(name)
    return int(numbered.group(1)) if numbered else None


def mode_names(kind: int) -> list[str]:
    """All names of modes of a vehicle of MAV_TYPE *kind*."""
    return list(_table(kind).values())
