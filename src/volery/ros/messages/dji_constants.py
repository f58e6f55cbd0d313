"""Constants of DJI's messages, from the public definitions of ``dji_sdk`` 3.8 and ``dji_osdk_ros`` 4.1."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum, IntFlag
from typing import NamedTuple

OLD_NAMES, NEW_NAMES = "dji_sdk", "dji_osdk_ros"
"""The packages, and the prefixes of their topics."""

HEALTHY_GPS = 4
"""Least ``gps_health`` at which position, velocity and the local reference are reliable."""

M100 = "M100"
HARDWARE: Mapping[str, int] = {"A3": 0x03020100, "N3": 0x03030100, "M100": 0x03010A00, "M600": 0x03040100}
"""Answers of ``query_drone_version``; only the version of the M100 is documented."""


class DisplayMode(IntEnum):
    """Flight modes in ``display_mode``."""

    MANUAL_CTRL = 0
    ATTITUDE = 1
    P_GPS = 6
    HOTPOINT_MODE = 9
    ASSISTED_TAKEOFF = 10
    AUTO_TAKEOFF = 11
    AUTO_LANDING = 12
    NAVI_MISSION = 14  # reserved in the public list
    NAVI_GO_HOME = 15
    NAVI_SDK_CTRL = 17
    FORCE_AUTO_LANDING = 33
    SEARCH_MODE = 40
    ENGINE_START = 41


def display_name(number: int) -> str:
    """Return the public name of a mode."""
    try:
        return DisplayMode(number).name
    except ValueError:
        return f"MODE_{number}"


class FlightStatus(IntEnum):
    """``flight_status`` of all aircraft except the M100."""

    STOPPED = 0
    ON_GROUND = 1
    IN_AIR = 2


class M100Status(IntEnum):
    """``flight_status`` of the M100."""

    ON_GROUND = 1
    TAKING_OFF = 2
    IN_AIR = 3
    LANDING = 4
    FINISHED_LANDING = 5


class Flag(IntFlag):
    """Control flag of a set-point: meaning and frame of its four numbers."""

    STABLE = 0x01
    """Brake and hold position if the horizontal numbers are zero."""
    BODY = 0x02
    """Body frame (forward, left); without it east and north."""
    YAW_RATE = 0x08
    VERTICAL_POSITION = 0x10
    VERTICAL_THRUST = 0x20
    HORIZONTAL_VELOCITY = 0x40
    HORIZONTAL_POSITION = 0x80
    HORIZONTAL_RATE = 0xC0


HORIZONTAL, VERTICAL = 0xC0, 0x30
"""Bits of the flag for the horizontal and the vertical numbers."""

POSITION_YAW = 0x91
VELOCITY_YAW_RATE = 0x49
ANGLE_YAW_RATE_HEIGHT = 0x1B
ANGLE_YAW_RATE_CLIMB = 0x0B
ANGLE_YAW_RATE_THRUST = 0x2B
"""Flags in use: the three with a topic of their own, and two for manual control."""

SETPOINT = "flight_control_setpoint_"
SETPOINT_TOPICS: Mapping[str, int] = {
    f"{SETPOINT}ENUposition_yaw": POSITION_YAW,
    f"{SETPOINT}ENUvelocity_yawrate": VELOCITY_YAW_RATE,
    f"{SETPOINT}rollpitch_yawrate_zposition": ANGLE_YAW_RATE_HEIGHT,
}
"""Flags of the set-point topics; other flags use the topic ``...generic``."""


class Range(NamedTuple):
    """Closed interval."""

    lowest: float
    highest: float


SETPOINT_HEIGHTS = Range(0.0, 120.0)
"""Heights of set-points, m above the take-off point."""

GO_HOME_ALTITUDES = Range(20.0, 500.0)
"""Heights of the flight home that a program may set, m above home; assumed."""

MISSION_SPEEDS = Range(2.0, 15.0)
"""Speeds of a waypoint mission, m/s."""
