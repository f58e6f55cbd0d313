"""PX4's modes: names as in MAVROS and in PX4's documentation, numbers from ``px4_custom_mode.h``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

MANUAL, STABILIZED, ALTCTL, POSCTL, ACRO = "MANUAL", "STABILIZED", "ALTCTL", "POSCTL", "ACRO"
OFFBOARD = "OFFBOARD"
HOLD, TAKEOFF, LAND, RTL, MISSION = "AUTO.LOITER", "AUTO.TAKEOFF", "AUTO.LAND", "AUTO.RTL", "AUTO.MISSION"


class Mode(NamedTuple):
    """A mode. ``state`` is its number in arming checks (``nav_state`` of ``VehicleStatus.msg``)."""

    main: int
    sub: int
    state: int

    @property
    def number(self) -> int:
        """Number in a heartbeat's ``custom_mode``."""
        return self.sub << 24 | self.main << 16


MODES: Mapping[str, Mode] = {
    MANUAL: Mode(1, 0, 0),
    ALTCTL: Mode(2, 0, 1),
    POSCTL: Mode(3, 0, 2),
    "POSCTL.ORBIT": Mode(3, 1, 21),
    "AUTO.READY": Mode(4, 1, 4),
    TAKEOFF: Mode(4, 2, 17),
    HOLD: Mode(4, 3, 4),
    MISSION: Mode(4, 4, 3),
    RTL: Mode(4, 5, 5),
    LAND: Mode(4, 6, 18),
    "AUTO.FOLLOW_TARGET": Mode(4, 8, 19),
    "AUTO.PRECLAND": Mode(4, 9, 20),
    "AUTO.VTOL_TAKEOFF": Mode(4, 10, 22),
    ACRO: Mode(5, 0, 10),
    OFFBOARD: Mode(6, 0, 14),
    STABILIZED: Mode(7, 0, 15),
    "RATTITUDE": Mode(8, 0, 16),
}
"""Modes by name."""

MANUAL_MODES = frozenset({MANUAL, STABILIZED, ALTCTL, POSCTL, ACRO, "POSCTL.ORBIT", "RATTITUDE"})
"""Modes that are flown by manual control."""

_NAMES = {mode.number: name for name, mode in MODES.items()}


def mode_name(number: int) -> str:
    """Return the name of a ``custom_mode``, or its number for a mode that is not in this table."""
    return _NAMES.get(number) or f"MODE {number:#010x}"
