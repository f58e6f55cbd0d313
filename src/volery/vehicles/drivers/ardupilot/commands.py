"""What an ArduPilot can be sent, beyond what every MAVLink autopilot can."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from volery.base.position import Position
from volery.vehicles.drivers.mavlink.commands import Carrier
from volery.vehicles.telemetry import Velocity

RELEASED = 0
"""The pulse width that gives a channel back to the transmitter."""


class Commands(Carrier, Protocol):
    """The port between ArduPilot's sequences and what carries them."""

    def takeoff(self, height: float) -> None:
        """Climb to metres above home, from the ground, armed, in GUIDED."""

    def target(self, goal: Position) -> None:
        """In GUIDED: go there. Has no answer and no time-out."""

    def follow(self, velocity: Velocity, yaw_rate: float) -> None:
        """In GUIDED: m/s, and degrees/s clockwise. Has no answer; stands for 3 s."""

    def turn(self, degrees: float) -> None:
        """In GUIDED: to this heading."""

    def override(self, channels: Sequence[int | None]) -> None:
        """Pulse widths of channels 1 to 4 in microseconds; ``RELEASED``, or ``None`` for leave it alone."""

    def start_mission(self) -> None:
        """In AUTO, armed: begin."""
