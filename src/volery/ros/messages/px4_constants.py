"""Numbers and names of PX4's own ROS 2 interface, which its vehicle node and its driver have in common.

Sources: ``px4_custom_mode.h``, ``VehicleStatus.msg`` and ``dds_topics.yaml`` of PX4.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum

from volery.ros.messages.store import message_class

PACKAGE = "px4_msgs"

MainAndSub = tuple[int, int]
"""Main mode and sub-mode of PX4's ``custom_mode``."""


class NavState(IntEnum):
    """``nav_state`` of VehicleStatus."""

    MANUAL = 0
    ALTCTL = 1
    POSCTL = 2
    AUTO_MISSION = 3
    AUTO_LOITER = 4
    AUTO_RTL = 5
    POSITION_SLOW = 6
    ALTITUDE_CRUISE = 8
    ACRO = 10
    DESCEND = 12
    TERMINATION = 13
    OFFBOARD = 14
    STAB = 15
    AUTO_TAKEOFF = 17
    AUTO_LAND = 18
    AUTO_FOLLOW_TARGET = 19
    AUTO_PRECLAND = 20
    ORBIT = 21
    AUTO_VTOL_TAKEOFF = 22
    EXTERNAL1 = 23


MODES: Mapping[NavState, MainAndSub] = {
    NavState.MANUAL: (1, 0),
    NavState.ALTCTL: (2, 0),
    NavState.POSCTL: (3, 0),
    NavState.ORBIT: (3, 1),
    NavState.POSITION_SLOW: (3, 2),
    NavState.AUTO_TAKEOFF: (4, 2),
    NavState.AUTO_LOITER: (4, 3),
    NavState.AUTO_MISSION: (4, 4),
    NavState.AUTO_RTL: (4, 5),
    NavState.AUTO_LAND: (4, 6),
    NavState.AUTO_FOLLOW_TARGET: (4, 8),
    NavState.AUTO_PRECLAND: (4, 9),
    NavState.AUTO_VTOL_TAKEOFF: (4, 10),
    NavState.ACRO: (5, 0),
    NavState.OFFBOARD: (6, 0),
    NavState.STAB: (7, 0),
    NavState.TERMINATION: (10, 0),
    NavState.ALTITUDE_CRUISE: (11, 0),
}
"""Modes that a program can ask for."""

_EXTERNAL_MODES = 8
_STATES = {
    **{mode: int(state) for state, mode in MODES.items()},
    **{(4, 11 + place): NavState.EXTERNAL1 + place for place in range(_EXTERNAL_MODES)},
}


def nav_state(custom_mode: int) -> int:
    """Return the navigation state of a ``custom_mode``; that of MANUAL for one that is not known."""
    return _STATES.get((custom_mode >> 16 & 255, custom_mode >> 24), NavState.MANUAL)


def type_name(name: str) -> str:
    """Return the full name of a message of ``px4_msgs``."""
    return f"{PACKAGE}/msg/{name}"


def topic_name(below: str, topic: str, kind: str) -> str:
    """Return the name of a topic below ``fmu/in`` or ``fmu/out``, which ends with the version of its type.

    A type whose ``MESSAGE_VERSION`` is 0, or that has none, adds nothing.
    """
    version = getattr(message_class(type_name(kind)), "MESSAGE_VERSION", 0)
    return f"fmu/{below}/{topic}_v{version}" if version else f"fmu/{below}/{topic}"
