"""What a mode is: a number and a name on the wire, and a manoeuvre that flies it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot
from typing import TYPE_CHECKING

from volery.base.frames import Vector
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint

if TYPE_CHECKING:
    from volery.simulation.autopilots.vehicle_state import Vehicle


class Manoeuvre:
    """One way of flying. ``enter`` once, then ``step`` at every tick and whenever the sticks moved.

    While the vehicle stands on the ground with its motors off or idling, the manoeuvre says whether it
    wants to lift off (``wants_to_fly``); until the motors are up it gives no set-points that would lift it.
    """

    landing: bool = False
    """Whether it is on its way down to the ground."""

    taking_off: bool = False
    """Whether it is climbing away from the ground to a stated height."""

    slow_start: bool = False
    """Whether the motors come up slowly."""

    target: Vector | None = None
    """Where it goes: north, east, down about the estimator's origin [m]; ``None`` where it has no such
    point.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle

    def enter(self) -> None:
        """It begins now."""

    def step(self) -> None:
        """Look, decide, drive."""
        raise NotImplementedError

    def on_ground(self) -> None:
        """Called at every tick while it stands on the ground with its motors running."""

    def item_chosen(self) -> None:
        """Another mission item has become current."""

    def wants_to_fly(self) -> bool:
        """Whether the motors should come up from idle while it stands on the ground."""
        return False

    def distance(self) -> float:
        """Metres to the target in the plane; 0 without a target."""
        if self.target is None:
            return 0.0
        here = self.vehicle.estimate.position
        return hypot(self.target[0] - here[0], self.target[1] - here[1])

    def drive(self, setpoint: Setpoint) -> None:
        """Hand a set-point to the inner loops, unless they hold the same one already."""
        self.vehicle.drive(setpoint)

    def idle(self) -> None:
        """Motors turn slowly, nothing is held."""
        self.vehicle.drive(IDLE)


OFF = Setpoint(Control.OFF)
IDLE = Setpoint(Control.IDLE)


@dataclass(frozen=True)
class Mode:
    """One mode of a firmware.

    ``base_mode`` holds the heartbeat's bits while disarmed. ``controls`` are the bits of SYS_STATUS that
    are enabled and healthy in this mode only. ``pilot`` says that the sticks fly it, ``manual_throttle``
    that they command thrust. ``user_takeoff`` says that a take-off command is accepted.
    """

    number: int
    name: str
    base_mode: int
    manoeuvre: Callable[[Vehicle], Manoeuvre]
    controls: int = 0
    needs_position: bool = False
    armable: bool = True
    pilot: bool = False
    manual_throttle: bool = False
    user_takeoff: bool = False
    starts_high: bool = False
    """May be armed by a ground station with the throttle stick up."""
