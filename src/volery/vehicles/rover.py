"""A rover: blocking operations, each seen on the telemetry before it returns."""

from __future__ import annotations

from math import nan

from volery.base.errors import UsageError
from volery.base.position import AboveHome, Position
from volery.vehicles.driver import Capability, ManualControl
from volery.vehicles.vehicle import TO_SAFETY, TRAVEL, Goal, Vehicle


class Rover(Vehicle):
    """A ground vehicle. See ``Vehicle`` for its state and for what the arguments mean."""

    kind = "rover"

    @property
    def driving(self) -> bool:
        """It moves, by the autopilot's estimate faster than 0.1 m/s."""
        north, east, _ = self.velocity
        return north * north + east * east > 0.01

    def drive(self, goal: Position | tuple[float, float], speed: float | None = None) -> None:
        """Wait until it is ready, arm if need be, drive straight to *goal* and stop there.

        *goal* may be a latitude and a longitude; an altitude is not looked at. *speed* in m/s, else the
        autopilot's own. Raises ``OutOfBounds`` before anything moves if limits or fence forbid the goal or
        the straight way.
        """
        self._require(Capability.GOTO)
        latitude, longitude = (goal.latitude, goal.longitude) if isinstance(goal, Position) else goal
        there = Position(latitude, longitude, AboveHome(0.0))
        asked = f"drive to {latitude:.7f}, {longitude:.7f}"
        self._check_speed(asked, speed)
        if self._driver.telemetry.position is None:
            self.wait_ready()
        here = self.position
        level = Position(here.latitude, here.longitude, self.home.altitude)
        self._check_path(asked, level, there)
        within = self._within(there, speed or 1.0)
        self._operate(
            "drive",
            asked,
            lambda: self._driver.goto(there, speed, within),
            manner=TRAVEL,
            goal=lambda: Goal(latitude, longitude, nan),
        )

    def return_home(self) -> None:
        """Let the autopilot return to home and stop there. See ``Drone.return_home``."""
        self._require(Capability.RETURN_HOME)
        home, here = self.home, self.position
        level = Position(here.latitude, here.longitude, home.altitude)
        if not self._strayed_already():
            self._check_path("return home", level, home)
        within = self._within(home, 1.0)
        self._operate(
            "return_home",
            "return home",
            lambda: self._driver.return_home(within),
            manner=TO_SAFETY,
            goal=lambda: Goal(home.latitude, home.longitude, nan),
        )

    def manual(self) -> None:
        """Drive by ``manual_control``; it is armed if need be. Returns when the mode is seen.

        Raises ``Refused`` unless ``manual_control`` was called within the last second.
        """
        self._require(Capability.STICKS)
        self._by_hand("manual", "drive by hand", self._driver.manual)

    def manual_control(self, steering: float, throttle: float) -> None:
        """Hold the controls so until the next call: steering (right +) and throttle (back -) in -1..1.

        Raises ``UsageError`` naming the control that is out of range or no number.
        """
        self._require(Capability.STICKS)
        for name, value in (("steering", steering), ("throttle", throttle)):
            if not -1.0 <= value <= 1.0:
                raise UsageError(f"{self.name}: manual control: {name}={value:g}; it goes from -1 to 1")
        self._move_sticks(ManualControl(roll=steering, throttle=throttle))

    def come_to_rest(self) -> str:
        """Stop and disarm it if nobody else has it; says what was done. For the end of a program.

        It waits half a minute for a link that is lost at that moment; ``LinkLost`` if that does not return.
        """
        seen = self._look()
        if seen.heard < 0:
            return "was never heard"
        self._wait_for_link()
        with self._kernel:
            self._driver.stop()
        if not seen.armed:
            return "is disarmed"
        if not self._performer.is_ours():
            return f"is left to whoever drives it in {seen.mode}"
        self.hold()
        self.disarm()
        return "stopped and was disarmed"
