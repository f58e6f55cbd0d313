"""PX4's modes as the wire knows them: main mode and sub-mode in one number, bits of the heartbeat, words."""

from __future__ import annotations

from collections.abc import Mapping

CUSTOM, AUTO, GUIDED, STABILIZED, MANUAL_INPUT = 1, 4, 8, 16, 64
"""MAV_MODE_FLAG."""

BY_ITSELF = CUSTOM | AUTO | GUIDED | STABILIZED
BY_HAND = CUSTOM | STABILIZED | MANUAL_INPUT
BY_RATES = CUSTOM | MANUAL_INPUT
BY_COMPUTER = CUSTOM | STABILIZED


def custom_mode(main: int, sub: int = 0) -> int:
    """``custom_mode`` of the heartbeat."""
    return sub << 24 | main << 16


def main_and_sub(number: int) -> tuple[int, int]:
    """The inverse of ``custom_mode``."""
    return number >> 16 & 0xFF, number >> 24 & 0xFF


MANUAL, ALTCTL, POSCTL = custom_mode(1), custom_mode(2), custom_mode(3)
ORBIT, ACRO, OFFBOARD, STABILIZE = custom_mode(3, 1), custom_mode(5), custom_mode(6), custom_mode(7)
TAKEOFF, LOITER, MISSION = custom_mode(4, 2), custom_mode(4, 3), custom_mode(4, 4)
RTL, LAND, FOLLOW = custom_mode(4, 5), custom_mode(4, 6), custom_mode(4, 8)

WORDS: Mapping[int, str] = {
    MANUAL: "MANUAL",
    ALTCTL: "ALTCTL",
    POSCTL: "POSCTL",
    ORBIT: "ORBIT",
    ACRO: "ACRO",
    OFFBOARD: "OFFBOARD",
    STABILIZE: "STAB",
    TAKEOFF: "AUTO_TAKEOFF",
    LOITER: "AUTO_LOITER",
    MISSION: "AUTO_MISSION",
    RTL: "AUTO_RTL",
    LAND: "AUTO_LAND",
    FOLLOW: "AUTO_FOLLOW_TARGET",
}
"""How a refusal names a mode: OFFBOARD as recorded, the others as the firmware's status names them."""

NEEDS_STICKS = frozenset({MANUAL, ALTCTL, POSCTL, ACRO, STABILIZE})
"""Cannot be armed, or entered in the air, without MANUAL_CONTROL."""

AUTOMATIC = frozenset({TAKEOFF, LOITER, MISSION, RTL, LAND, ORBIT, FOLLOW})
"""Moving the sticks takes these over."""

NAVIGATION_STATE: Mapping[int, int] = {
    MANUAL: 0,
    ALTCTL: 1,
    POSCTL: 2,
    MISSION: 3,
    LOITER: 4,
    RTL: 5,
    ACRO: 10,
    OFFBOARD: 14,
    STABILIZE: 15,
    TAKEOFF: 17,
    LAND: 18,
    FOLLOW: 19,
    ORBIT: 21,
}
"""Bits by which events name modes: ``nav_state`` of VehicleStatus."""

DESCEND_STATE = 12
