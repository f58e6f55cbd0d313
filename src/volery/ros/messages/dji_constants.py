"""Constants of DJI's messages, from the public definitions of ``dji_sdk`` 3.8 and ``dji_osdk_ros`` 4.1."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum, IntFlag
from typing import NamedTuple

OLD_NAMES, NEW_NAMES = "dji_sdk", "dji_osdk_ros"
"""The packages, and the prefixes of their topics."""

HEALTHY_GPS = 4
"""Least ``gps_health`` at which position, velocity and the local reference are reliable."""


class DocumentedBehaviour(NamedTuple):
    """A behaviour of the aircraft that is documented, and by whom."""

    what: str
    whom: str


GUIDES, HEADERS = "guides of DJI", "headers of DJI's library"
"""Sources that are named often; # is the number of a thread at Onboard-SDK or Onboard-SDK-ROS (ROS)."""

A3, N3, M100, M600, M210, M300 = "A3", "N3", "M100", "M600", "M210", "M300"


class HardwareVersion(NamedTuple):
    """Answer of ``query_drone_version``; only the version of the M100 is known."""

    name: str
    version: int


HARDWARE: Mapping[str, HardwareVersion] = {
    A3: HardwareVersion("A3", 0x03020100),
    N3: HardwareVersion("N3", 0x03030100),
    M100: HardwareVersion("M100", 0x03010A00),
    M600: HardwareVersion("PM820V3PRO", 0x03020900),
    M210: HardwareVersion("PM410", 0x03030000),
    M300: HardwareVersion("PM430", 0x03000100),
}
"""Hardware versions by type of aircraft."""
_NAMES_OF_HARDWARE: Mapping[str, str] = {"PM820": M600, "PM410": M210, "PM420": M210, "PM430": M300}


def aircraft_of(hardware: str) -> str:
    """Return the type of aircraft with a ``hardware`` name, which is the name itself where none is known."""
    return next((name for start, name in _NAMES_OF_HARDWARE.items() if hardware.startswith(start)), hardware)


DRONE_TYPES: Mapping[int, str] = {0: M100, 1: M210, 2: M300, 3: M600}
"""Aircraft by the number that ``get_drone_type`` of the vehicle node of 4.1 returns."""
OTHER_DRONE_TYPE = 255
"""Number of an aircraft that has none."""


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


_NAMES = {mode.value: mode.name for mode in DisplayMode}


def display_name(number: int) -> str:
    """Return the public name of a mode."""
    return _NAMES.get(number) or f"MODE_{number}"


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


class Flag(IntEnum):
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


class ClosedInterval(NamedTuple):
    """Closed interval."""

    lowest: float
    highest: float


SETPOINT_HEIGHTS = ClosedInterval(0.0, 120.0)
"""Heights of set-points, m above the take-off point."""

GO_HOME_ALTITUDES = ClosedInterval(20.0, 500.0)
"""Heights of the flight home that a program may set, m above home; assumed."""

MISSION_SPEEDS = ClosedInterval(2.0, 15.0)
"""Speeds of a waypoint mission, m/s."""


# -- values of ``ack_data``


class TaskAck(IntEnum):
    """Answers to tasks and to requests for the motors, of all aircraft except the M100."""

    OK = 0
    MOTORS_ON = 1
    MOTORS_OFF = 2
    IN_AIR = 3
    NOT_IN_AIR = 4
    NO_HOME_POINT = 5
    BAD_GPS = 6
    SIMULATOR = 7
    ALREADY_RUNNING = 8
    NOT_RUNNING = 9


class M100TaskAck(IntEnum):
    """Answers to tasks of the M100 and of an M600 with old firmware."""

    FAILED = 1
    OK = 2


class M100MotorsAck(IntEnum):
    """Answers to requests for the motors of the M100."""

    OK = 0
    NEEDS_AUTHORITY = 1
    ALREADY_DONE = 2
    IN_AIR = 3


class AuthorityAck(IntEnum):
    """Answers to a request for the control authority."""

    WRONG_SWITCH_POSITION = 0
    RELEASED = 1
    OBTAINED = 2
    OBTAINING = 3
    RELEASING = 4
    NEEDS_P = 5
    NEEDS_F = 6
    IOC_MODE = 0xC9


class MissionAck(IntEnum):
    """Answers to requests for waypoint missions."""

    OK = 0
    TOO_HIGH = 0xC0
    TOO_LOW = 0xC1
    FAR_FROM_HOME = 0xC7
    FAR_FROM_HERE = 0xC9
    RTK_NOT_READY = 0xCD
    NOT_AT_F = 0xD0
    NEEDS_AUTHORITY = 0xD1
    BAD_GPS = 0xD8
    LOW_BATTERY = 0xD9
    NOT_TAKEN_OFF = 0xDA
    CROSSES_NO_FLY_ZONE = 0xDD
    NO_HOME_POINT = 0xDE
    PATH_TOO_LONG = 0xE2
    POINTS_TOO_CLOSE = 0xE5
    POINTS_TOO_FAR_APART = 0xE6
    BUSY = 0xF0


class WaypointType(IntEnum):
    """Ways to a waypoint of the second kind, in ``waypointType``."""

    CURVE = 0
    CURVE_AND_STOP = 1
    STRAIGHT_AND_STOP = 2
    COORDINATED = 3


class HeadingMode(IntEnum):
    """Headings on the way to a waypoint of the second kind, in ``headingMode``."""

    AUTO = 0
    FIXED = 1
    BY_WAYPOINT = 3


NO_CODE = 255
"""``ack_data`` of a refusal for which no code is known."""


def ack_name(table: type[IntEnum], code: int) -> str:
    """Return the words for a code, or an empty text if the table does not have it."""
    return table(code).name.lower().replace("_", " ") if code in set(table) else ""


class GimbalMode(IntFlag):
    """Bits of ``mode`` in ``dji_sdk/Gimbal``: absolute angles, and the axes that keep theirs."""

    ABSOLUTE = 1
    KEEPS_YAW = 2
    KEEPS_ROLL = 4
    KEEPS_PITCH = 8


GIMBAL_PITCHES = (-90.0, 30.0)
"""Least and greatest pitch of a gimbal [degrees], up positive: Zenmuse X3 to Z30."""
TAKE_PICTURE = 0
"""``camera_action`` of ``dji_sdk/CameraAction``."""
