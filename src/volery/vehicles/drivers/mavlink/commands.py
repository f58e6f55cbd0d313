"""The port between a firmware's sequences and what carries them: MAVLink itself, or MAVROS on a graph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from volery.base.errors import CapabilityError, LinkError
from volery.kernel.api import Action
from volery.vehicles.telemetry import Telemetry

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


class Carrier(Protocol):
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

    def look(self) -> None:
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
