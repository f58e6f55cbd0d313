"""MAVLink's numbers that drivers use.

The port between a firmware's sequences and what carries them: MAVLink itself, or MAVROS on a graph.

Missions as items of MAVLink's mission protocol.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from volery.base.errors import CapabilityError, LinkError, UsageError
from volery.base.position import AMSL, AboveGround, AboveHome, Position
from volery.kernel.api import Action
from volery.links.mavlink_messages import constant
from volery.vehicles.telemetry import Telemetry

POSITION_ONLY = 0x0DF8
VELOCITY_AND_YAW_RATE = 0x05C7
VELOCITY_AND_YAW = 0x09C7
"""Type masks of SET_POSITION_TARGET_*: a bit that is set means ignore that field."""

FORCE = 21196.0
"""Parameter 2 of COMPONENT_ARM_DISARM: skip the checks; disarm in the air, too."""

GROUND_SPEED = 1.0
UNCHANGED = -1.0
OWN_SPEED = -1.0
"""In DO_CHANGE_SPEED: back to the autopilot's own."""
SHORTEST_WAY = 0.0

LEFT_ALONE = 65535
"""In RC_CHANNELS_OVERRIDE: this channel stays as it is."""

ARMED = constant("MAV_MODE_FLAG_SAFETY_ARMED")
ACTIVE = constant("MAV_STATE_ACTIVE")
FAILSAFE = (constant("MAV_STATE_CRITICAL"), constant("MAV_STATE_EMERGENCY"))
UNDEFINED = constant("MAV_LANDED_STATE_UNDEFINED")
ON_GROUND = constant("MAV_LANDED_STATE_ON_GROUND")


# Keys of the acknowledgements in ``Telemetry.answers``.
MODE = "mode"
ARM = "arm"
TAKEOFF = "take-off"
SPEED = "speed"
HEADING = "heading"
TARGET = "target"
MISSION = "mission"
START = "mission start"


class Item(NamedTuple):
    """A mission item as MAVLink states it: latitude, longitude in degrees, ``z`` in metres of ``frame``."""

    command: int
    frame: int
    parameters: tuple[float, float, float, float]
    latitude: float
    longitude: float
    z: float


class Backend(Protocol):
    """What every MAVLink autopilot can be sent. Answers arrive in ``telemetry.answers`` under the keys above.

    ``parameters`` are those of the aircraft that its driver wants to know; ``None`` until they are in. With a
    ``cycle`` the calls block; without, none does.
    """

    telemetry: Telemetry

    @property
    def cycle(self) -> Action | None:
        """See ``Driver``."""

    @property
    def parameters(self) -> Mapping[str, float] | None:
        """By name; one that the firmware does not have is missing."""

    def poll(self) -> None:
        """See ``Driver``."""

    def set_mode(self, mode: str) -> None:
        """Change the mode, by the firmware's own name."""

    def arm(self, arm: bool, *, force: bool = False) -> None:
        """Arm or disarm; *force* skips the checks, or stops the motors in the air."""

    def speed(self, metres_per_second: float) -> None:
        """Over ground, from now on, where it goes by position; -1: its own again."""

    def check(self) -> None:
        """Ask for the texts of the arming checks that fail now."""

    def upload(self, items: Sequence[Item]) -> None:
        """Replace the mission; goes on with an upload that is under way."""

    def watch_mission(self) -> None:
        """Ask for progress of the mission from now on."""

    def watch_target(self) -> None:
        """Ask from now on where it goes."""

    def problem(self) -> LinkError | CapabilityError | None:
        """What is wrong with the way there, or with what is there."""

    def close(self) -> None:
        """Stop talking."""


GLOBAL = constant("MAV_FRAME_GLOBAL")
ABOVE_HOME = constant("MAV_FRAME_GLOBAL_RELATIVE_ALT")
ABOVE_GROUND = constant("MAV_FRAME_GLOBAL_TERRAIN_ALT")

INT_FRAMES: Mapping[int, int] = {
    GLOBAL: constant("MAV_FRAME_GLOBAL_INT"),
    ABOVE_HOME: constant("MAV_FRAME_GLOBAL_RELATIVE_ALT_INT"),
    ABOVE_GROUND: constant("MAV_FRAME_GLOBAL_TERRAIN_ALT_INT"),
}
"""Of a global frame in degrees, the one whose latitude and longitude are whole numbers."""


def frame_of(position: Position) -> int:
    """The MAV_FRAME of a global position, in degrees."""
    if isinstance(position.altitude, AMSL):
        return GLOBAL
    if isinstance(position.altitude, AboveHome):
        return ABOVE_HOME
    if isinstance(position.altitude, AboveGround):
        return ABOVE_GROUND
    raise UsageError(f"{position}: autopilots take AMSL, AboveHome and AboveGround")


def item(
    command: str, *parameters: float, at: Position | None = None, z: float = 0.0, frame: int = ABOVE_HOME
) -> Item:
    """An item; *at* states place, altitude and frame at once."""
    first, second, third, fourth = (*parameters, 0.0, 0.0, 0.0, 0.0)[:4]
    stated = (first, second, third, fourth)
    if at is None:
        return Item(constant(command), frame, stated, 0.0, 0.0, z)
    height = at.altitude.metres
    return Item(constant(command), frame_of(at), stated, at.latitude, at.longitude, height)
