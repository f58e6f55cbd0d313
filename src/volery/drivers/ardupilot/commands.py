"""The port between ArduPilot's sequences and what carries them: MAVLink itself, or MAVROS on a graph."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from volery.base.errors import LinkError
from volery.base.position import Position
from volery.kernel.api import Action
from volery.vehicles.telemetry import Telemetry, Velocity

# Keys of the acknowledgements in ``Telemetry.answers``.
MODE = "mode"
ARM = "arm"
TAKEOFF = "take-off"
SPEED = "speed"
HEADING = "heading"
MISSION = "mission"
START = "mission start"

RELEASED = 0
"""The pulse width that gives a channel back to the transmitter."""


class Item(NamedTuple):
    """A mission item as MAVLink states it: latitude, longitude in degrees, ``z`` in metres of ``frame``."""

    command: int
    frame: int
    parameters: tuple[float, float, float, float]
    latitude: float
    longitude: float
    z: float


class Commands(Protocol):
    """What can be sent to an ArduPilot. Answers arrive in ``telemetry.answers`` under the keys above.

    With a ``cycle`` the calls block; without, none does.
    """

    telemetry: Telemetry

    @property
    def cycle(self) -> Action | None:
        """See ``Driver``."""

    def look(self) -> None:
        """See ``Driver``."""

    def set_mode(self, mode: str) -> None:
        """Change the mode, by ArduPilot's name."""

    def arm(self, arm: bool, *, force: bool = False) -> None:
        """Arm or disarm; *force* skips the checks, or stops the motors in the air."""

    def takeoff(self, height: float) -> None:
        """Climb to metres above home, from the ground, armed, in GUIDED."""

    def target(self, goal: Position) -> None:
        """In GUIDED: go there. Has no answer and no time-out."""

    def follow(self, velocity: Velocity, yaw_rate: float) -> None:
        """In GUIDED: m/s, and degrees/s clockwise. Has no answer; stands for 3 s."""

    def turn(self, degrees: float) -> None:
        """In GUIDED: to this heading."""

    def speed(self, metres_per_second: float) -> None:
        """In GUIDED: over ground, from now on."""

    def override(self, channels: Sequence[int | None]) -> None:
        """Pulse widths of channels 1 to 4 in microseconds; ``RELEASED``, or ``None`` for leave it alone."""

    def check(self) -> None:
        """Ask for the texts of the arming checks that fail now."""

    def upload(self, items: Sequence[Item]) -> None:
        """Replace the mission; goes on with an upload that is under way."""

    def start_mission(self) -> None:
        """In AUTO, armed: begin."""

    def watch_mission(self) -> None:
        """Ask for progress of the mission from now on."""

    def problem(self) -> LinkError | None:
        """What is wrong with the way there."""

    def close(self) -> None:
        """Stop talking."""
