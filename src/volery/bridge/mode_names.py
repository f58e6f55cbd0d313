"""Names and numbers of flight modes by MAVLink's autopilot and vehicle type.

Source: ArduPilot's ``ArduCopter/mode.h`` and ``Rover/mode.h``, PX4's ``px4_custom_mode.h``; for autopilots
without MAVLink the definitions of their own protocols. A mode that is not listed is called ``CMODE(number)``,
as in MAVROS.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from volery.links.pprzlink_messages import message_type
from volery.ros.messages.dji_constants import DisplayMode

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
_PX4_MODES = (
    (1, 0, "MANUAL"), (2, 0, "ALTCTL"), (3, 0, "POSCTL"), (3, 1, "POSCTL.ORBIT"), (4, 1, "AUTO.READY"),
    (4, 2, "AUTO.TAKEOFF"), (4, 3, "AUTO.LOITER"), (4, 4, "AUTO.MISSION"), (4, 5, "AUTO.RTL"),
    (4, 6, "AUTO.LAND"), (4, 8, "AUTO.FOLLOW_TARGET"), (4, 9, "AUTO.PRECLAND"), (4, 10, "AUTO.VTOL_TAKEOFF"),
    (5, 0, "ACRO"), (6, 0, "OFFBOARD"), (7, 0, "STABILIZED"), (8, 0, "RATTITUDE"),
)  # fmt: skip
PX4 = {sub << 24 | main << 16: name for main, sub, name in _PX4_MODES}
"""The modes of PX4 are the same for all vehicle types."""
PAPARAZZI = dict(enumerate(message_type("ROTORCRAFT_STATUS").words("ap_mode")))
DJI = {mode.value: mode.name for mode in DisplayMode}

GENERIC_ID, ARDUPILOT_ID, PAPARAZZI_ID, PX4_ID = 0, 3, 9, 12
"""MAV_AUTOPILOT."""
DJI_ID = 255
"""MAVLink defines no id for DJI and does not use this one. The id is used within this process only."""
AUTOPILOT_NAMES = {ARDUPILOT_ID: "ArduPilot", PX4_ID: "PX4", PAPARAZZI_ID: "Paparazzi", DJI_ID: "DJI"}

_ROVER_TYPES = frozenset({10, 11})
"""MAV_TYPE: ground rover, surface boat."""
_SAME_FOR_ALL_TYPES = {PX4_ID: PX4, PAPARAZZI_ID: PAPARAZZI, DJI_ID: DJI}
_NUMBERED = re.compile(r"(?:CMODE\(|MODE_)?(\d+)\)?\Z")


class AutopilotType(NamedTuple):
    """MAV_AUTOPILOT and MAV_TYPE of a heartbeat, which determine the mode names."""

    autopilot: int = ARDUPILOT_ID
    kind: int = 0


def _mode_table(autopilot: AutopilotType) -> dict[int, str]:
    by_type = ROVER if autopilot.kind in _ROVER_TYPES else COPTER
    return _SAME_FOR_ALL_TYPES.get(autopilot.autopilot, by_type)


def mode_name(autopilot: AutopilotType, number: int) -> str:
    """Return the name of mode *number*."""
    return _mode_table(autopilot).get(number, f"CMODE({number})")


def mode_number(autopilot: AutopilotType, name: str) -> int | None:
    """Return the number of the mode called *name*, or None."""
    for number, known in _mode_table(autopilot).items():
        if known == name.upper():
            return number
    numbered = _NUMBERED.match(name)
    return int(numbered.group(1)) if numbered else None


def mode_names(autopilot: AutopilotType) -> list[str]:
    """Return the names of all modes of an autopilot."""
    return list(_mode_table(autopilot).values())
