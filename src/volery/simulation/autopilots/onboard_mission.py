"""The mission stored on board, as uploaded; item 0 is the home position where the firmware stores it there.

Numbers and frames are MAVLink's. Coordinates stay the integers of the wire (degrees times 1e7), so that a
download returns what was uploaded.
"""

from __future__ import annotations

from typing import NamedTuple

WAYPOINT, LOITER_UNLIMITED, LOITER_TURNS, LOITER_TIME, RETURN, LAND, TAKEOFF = 16, 17, 18, 19, 20, 21, 22
LOITER_TO_ALTITUDE, SPLINE_WAYPOINT, GUIDED_ENABLE, DELAY, PAYLOAD_PLACE = 31, 82, 92, 93, 94
CONDITION_DELAY, CONDITION_DISTANCE, CONDITION_YAW, LAST_CONDITION = 112, 114, 115, 159
JUMP, CHANGE_SPEED, SET_HOME, SET_YAW_SPEED = 177, 178, 179, 213
LAND_START, DO_AUX_FUNCTION, GUIDED_LIMITS, JUMP_TAG = 189, 218, 222, 600
LAST_NAVIGATION = 95

GLOBAL, LOCAL_NED, GLOBAL_RELATIVE, GLOBAL_INT, GLOBAL_RELATIVE_INT = 0, 1, 3, 5, 6
LOCAL_OFFSET_NED, BODY_NED, BODY_OFFSET_NED, GLOBAL_TERRAIN, GLOBAL_TERRAIN_INT = 7, 8, 9, 10, 11


MISSION_FRAME = 2
"""MAV_FRAME of an item without a place."""
_DIGICAM = (202, 203)


def coordinate_scale(command: int, frame: int) -> float:
    """Return what a float x or y of MISSION_ITEM is multiplied by: 1e7 for degrees, 1 without a place.

    The commands of a camera are sent with any frame, and mean other numbers by both fields.
    """
    return 1.0 if frame == MISSION_FRAME or command in _DIGICAM else 1e7


class MissionItem(NamedTuple):
    """One mission item.

    Args:
        command: MAV_CMD.
        frame: MAV_FRAME.
        param1: First parameter; likewise ``param2`` to ``param4``.
        x: Latitude [1e-7 degrees].
        y: Longitude [1e-7 degrees].
        z: Height in the frame [m].
        autocontinue: Flag of the wire; stored only.
    """

    command: int
    frame: int = GLOBAL_RELATIVE
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    x: int = 0
    y: int = 0
    z: float = 0.0
    autocontinue: int = 1

    @property
    def navigates(self) -> bool:
        """Whether the item is flown or waited for, as against an action that is done at once."""
        return self.command <= LAST_NAVIGATION or self.command == SET_YAW_SPEED

    @property
    def is_condition(self) -> bool:
        """Whether the item delays the actions that follow it."""
        return CONDITION_DELAY <= self.command <= LAST_CONDITION

    @property
    def has_place(self) -> bool:
        """Whether the item names a point; without coordinates it means the present position."""
        return bool(self.x or self.y)


class OnboardMission:
    """The items, and the index of the item that is flown now or next."""

    def __init__(self) -> None:
        self.items: list[MissionItem] = []
        self.current = 0
        self.complete = False

    def __len__(self) -> int:
        return len(self.items)

    def __getitem__(self, index: int) -> MissionItem:
        return self.items[index]

    def clear(self) -> None:
        """Delete all items."""
        self.replace([])

    def replace(self, items: list[MissionItem]) -> None:
        """Store another mission, to be flown from its start."""
        self.items = items
        self.restart()

    def restart(self) -> None:
        """Fly from the start next time."""
        self.current = 0
        self.complete = False

    def choose(self, index: int) -> bool:
        """Make item *index* the current one; return False if there is none."""
        if not 0 <= index < len(self.items):
            return False
        self.current = index
        self.complete = False
        return True
