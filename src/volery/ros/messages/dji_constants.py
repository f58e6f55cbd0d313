"""What the numbers in DJI's messages mean, for those who send them and those who read them.

From the public definitions of the packages ``dji_sdk`` 3.8 and ``dji_osdk_ros`` 4.1.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum, IntFlag
from typing import NamedTuple

OLD_NAMES, NEW_NAMES = "dji_sdk", "dji_osdk_ros"
"""The packages, and what their topics begin with."""

HEALTHY_GPS = 4
"""From this ``gps_health`` on position, velocity and the local reference are to be trusted."""

M100 = "M100"
HARDWARE: Mapping[str, int] = {"A3": 0x03020100, "N3": 0x03030100, "M100": 0x03010A00, "M600": 0x03040100}
"""What ``query_drone_version`` answers. Of the versions only that of the M100 is documented."""


class DisplayMode(IntEnum):
    """``display_mode``: how the aircraft flies."""

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
    """The mode by its public name."""
    try:
        return DisplayMode(number).name
    except ValueError:
        return f"MODE_{number}"


class FlightStatus(IntEnum):
    """``flight_status`` of all aircraft but the M100."""

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
    """The byte of a set-point that says how its four numbers are meant."""

    STABLE = 0x01
    """Brake and hold where the horizontal numbers are zero."""
    BODY = 0x02
    """Forward and left of the aircraft; without it east and north."""
    YAW_RATE = 0x08
    VERTICAL_POSITION = 0x10
    VERTICAL_THRUST = 0x20
    HORIZONTAL_VELOCITY = 0x40
    HORIZONTAL_POSITION = 0x80
    HORIZONTAL_RATE = 0xC0


HORIZONTAL, VERTICAL = 0xC0, 0x30
"""The bits of the flag that say what the horizontal and the vertical numbers are."""

POSITION_YAW = 0x91
VELOCITY_YAW_RATE = 0x49
ANGLE_YAW_RATE_HEIGHT = 0x1B
ANGLE_YAW_RATE_CLIMB = 0x0B
ANGLE_YAW_RATE_THRUST = 0x2B
"""Flags in use: the three that have a topic of their own, and two for sticks."""

SETPOINT = "flight_control_setpoint_"
SETPOINT_TOPICS: Mapping[str, int] = {
    f"{SETPOINT}ENUposition_yaw": POSITION_YAW,
    f"{SETPOINT}ENUvelocity_yawrate": VELOCITY_YAW_RATE,
    f"{SETPOINT}rollpitch_yawrate_zposition": ANGLE_YAW_RATE_HEIGHT,
}
"""Topics of set-points by their flag; any other flag goes by the topic ``...generic``."""


class Range(NamedTuple):
    """From, to, both included."""

    lowest: float
    highest: float


SETPOINT_HEIGHTS = Range(0.0, 120.0)
"""Metres above the point of take-off that a set-point may ask for."""

GO_HOME_ALTITUDES = Range(20.0, 500.0)
"""Metres above home that a program may ask for as the height of the way home; assumed."""

MISSION_SPEEDS = Range(2.0, 15.0)
"""Metres per second of a waypoint mission."""
