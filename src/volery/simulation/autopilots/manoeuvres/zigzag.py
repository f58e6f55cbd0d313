"""ZIGZAG: the pilot stores two points, then flies between the lines through them, as ArduCopter's mode does.

The lines are perpendicular to the way from A to B. The vehicle flies to the nearest point of the line of A or
B, and the pilot flies it sideways in between.
"""

from __future__ import annotations

from math import dist

from volery.base.frames import Vector
from volery.simulation.autopilots.manoeuvres.manual_flight import Loiter
from volery.simulation.autopilots.manoeuvres.to_point import ToPoint, quarter_time
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import INFO


class ZigZag(Loiter):
    """Fly by the sticks, as in LOITER, or to the line of a stored point.

    Args:
        vehicle: The vehicle.
    """

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._stored: dict[str, Vector] = {}
        self._going: ToPoint | None = None

    def choose(self, name: str, jerk: float) -> None:
        """Store the present position as point "A" or "B"; once both are stored, fly to the line of one.

        Args:
            name: "A" or "B".
            jerk: Jerk of the way to the line [m/s^3], which limits the speed that a short one reaches.
        """
        here = self.vehicle.estimate.position
        if len(self._stored) < 2:
            self._stored[name] = here
            self.vehicle.send_text(INFO, f"ZigZag: point {name} stored")
            return
        point = self._nearest(self._stored[name], here)
        if point is None:
            return
        self._going = ToPoint(self.vehicle, point)
        quarter = quarter_time(dist(here, point), jerk)
        self._going.speed = min(self.vehicle.tuning.speed, jerk * quarter * quarter)
        self._going.enter()
        self.target = point
        self.vehicle.send_text(INFO, f"ZigZag: moving to {name}")

    def _nearest(self, through: Vector, here: Vector) -> Vector | None:
        """Return the point of the line through a stored point nearest to *here*, at the target height."""
        (an, ae, _), (bn, be, _) = self._stored["A"], self._stored["B"]
        along = bn - an, be - ae
        square = along[0] * along[0] + along[1] * along[1]
        if square == 0.0:
            return None
        share = ((here[0] - through[0]) * along[0] + (here[1] - through[1]) * along[1]) / square
        height = self.vehicle.estimate.target[2]
        return here[0] - share * along[0], here[1] - share * along[1], height

    def let_pilot_fly(self) -> None:
        """Return from the flight to a line to the sticks."""
        if self._going is None:
            return
        self._going = self.target = None
        super().enter()
        self.vehicle.send_text(INFO, "ZigZag: manual control")

    def step(self) -> None:
        """Fly to the line until it is reached, else by the sticks."""
        if self._going is not None and self._going.arrived():
            self.let_pilot_fly()
        if self._going is None:
            super().step()
        else:
            self._going.step()
