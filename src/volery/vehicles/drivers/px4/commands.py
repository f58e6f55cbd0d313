"""What a PX4 can be sent, beyond what every MAVLink autopilot can."""

from __future__ import annotations

from math import nan
from typing import Any, NamedTuple, Protocol

from volery.base.position import Position
from volery.base.time import Ns
from volery.links.mavlink import constant
from volery.vehicles.driver import Sticks
from volery.vehicles.drivers.arrival import DRONE_KIND
from volery.vehicles.drivers.mavlink.commands import Carrier
from volery.vehicles.drivers.mavlink.items import GLOBAL, INT_FRAMES
from volery.vehicles.telemetry import Velocity


class Setpoint(NamedTuple):
    """Of OFFBOARD: a velocity, and a heading in degrees, or, where that is NaN, degrees/s clockwise."""

    velocity: Velocity
    yaw_rate: float = 0.0
    heading: float = nan


_CHANGES_MODE = float(constant("MAV_DO_REPOSITION_FLAGS_CHANGE_MODE"))
"""In DO_REPOSITION: enter AUTO.LOITER for it. Without this PX4 refuses the command, and flies there."""
_NO_SPEED = -1.0
"""In DO_REPOSITION: as fast as it would anyhow."""


def reposition_fields(goal: Position) -> dict[str, Any]:
    """DO_REPOSITION as the fields of a COMMAND_INT; the altitude of *goal* is AMSL."""
    return {
        "frame": INT_FRAMES[GLOBAL],
        "command": constant("MAV_CMD_DO_REPOSITION"),
        "param1": _NO_SPEED,
        "param2": _CHANGES_MODE,
        "param4": nan,
        "x": round(goal.latitude * 1e7),
        "y": round(goal.longitude * 1e7),
        "z": goal.altitude.metres,
    }


def stick_axes(sticks: Sticks, kind: str) -> dict[str, int]:
    """As in MANUAL_CONTROL: 1000 either way, and throttle 0 to 1000 with its centre at 500."""
    throttle = sticks.throttle if kind == DRONE_KIND else (sticks.throttle + 1.0) / 2.0
    return {
        "x": round(1000 * sticks.pitch),
        "y": round(1000 * sticks.roll),
        "z": round(1000 * throttle),
        "r": round(1000 * sticks.yaw),
    }


class Commands(Carrier, Protocol):
    """The port between PX4's sequences and what carries them."""

    @property
    def beat(self) -> Ns:
        """When the last heartbeat came: PX4's mode is only ever a second old, and as old as that."""

    def takeoff(self, amsl: float) -> None:
        """Climb from the ground, armed, to metres above mean sea level; at least its MIS_TAKEOFF_ALT."""

    def reposition(self, goal: Position) -> None:
        """Change to AUTO.LOITER and go there; the altitude is AMSL."""

    def setpoint(self, setpoint: Setpoint) -> None:
        """One of the stream without which there is no OFFBOARD."""

    def sticks(self, sticks: Sticks) -> None:
        """One of the stream without which there are no sticks."""

    def rewind(self) -> None:
        """The mission begins at its first item."""
