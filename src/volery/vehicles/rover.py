"""A rover: operations that block until telemetry shows that they are done."""

from __future__ import annotations

from math import nan

from volery.base.errors import UsageError
from volery.base.position import AboveHome, Position
from volery.vehicles.driver import Capability, ManualControl
from volery.vehicles.monitors import Goal
from volery.vehicles.operations import TO_SAFETY, TRAVEL
from volery.vehicles.vehicle import Vehicle


class Rover(Vehicle):
    """A ground vehicle. See ``Vehicle`` for its state, the constructor's arguments and how operations end."""

    kind = "rover"

    @property
    def driving(self) -> bool:
        """Whether it moves faster than 0.1 m/s, as estimated by the autopilot."""
        north, east, _ = self.velocity
        return north * north + east * east > 0.01

    def arm(self) -> None:
        """Arm in the present mode, which counts as commanded by this program then.

        An armed rover counts as driving; in a pilot's mode, such as MANUAL, what follows would be refused.
        """
        super().arm()
        self._executor.set_commanded(self._telemetry.mode)

    def drive(self, goal: Position | tuple[float, float], speed: float | None = None) -> None:
        """Wait until ready, arm if disarmed, drive straight to *goal* and stop there.

        Args:
            goal: target as a position or as (latitude, longitude) in degrees; an altitude is ignored.
            speed: speed, m/s; ``None`` means the autopilot's own.

        Raises:
            OutOfBounds: limits or fence forbid the goal or the straight path (raised before anything is
                sent), or were violated on the way.
        """
        self._connection.require(Capability.GOTO)
        try:
            latitude, longitude = (goal.latitude, goal.longitude) if isinstance(goal, Position) else goal
        except (TypeError, ValueError):
            raise UsageError(
                f"{self.name}: drive({goal!r}): a goal is a Position or (latitude, longitude) in degrees, as "
                "in drive((46.0826, -103.8995))"
            ) from None
        there = Position(latitude, longitude, AboveHome(0.0))
        asked = f"drive to {latitude:.7f}, {longitude:.7f}"
        if speed is not None:
            self._check_speed(asked, speed)
        if self._telemetry.position is None:
            self.wait_ready()
        here = self.position
        level = Position(here.latitude, here.longitude, self.home.altitude)
        self._bounds.check_path(asked, level, there)
        within = self._bounds.timeout_to(there, speed or 1.0)
        self._operations.run(
            "drive",
            asked,
            lambda: self._driver.goto(there, speed, within),
            policy=TRAVEL,
            goal=lambda: Goal(latitude, longitude, nan),
        )

    def return_home(self) -> None:
        """Let the autopilot return home and stop there.

        The operation of another task is aborted.

        Raises:
            OutOfBounds: the straight path violates the fence, unless the rover is out of bounds already.
        """
        self._connection.require(Capability.RETURN_HOME)
        home, here = self.home, self.position
        level = Position(here.latitude, here.longitude, home.altitude)
        if not self._bounds.is_out_of_bounds():
            self._bounds.check_path("return home", level, home)
        within = self._bounds.timeout_to(home, 1.0)
        self._operations.run(
            "return_home",
            "return home",
            lambda: self._driver.return_home(within),
            policy=TO_SAFETY,
            goal=lambda: Goal(home.latitude, home.longitude, nan),
        )

    def manual(self) -> None:
        """Enter the mode that is driven by ``manual_control``, arm if disarmed, and return when it is seen.

        Raises ``Refused`` unless ``manual_control`` was called within the last second.
        """
        self._connection.require(Capability.MANUAL_CONTROL)
        self._operations.enter_manual_mode("manual", "drive by hand", self._driver.manual)

    def manual_control(self, steering: float, throttle: float) -> None:
        """Set the manual control until the next call.

        Args:
            steering: -1..1, right positive.
            throttle: -1..1, forward positive.

        Raises:
            UsageError: a value is out of range or not a number.
        """
        self._connection.require(Capability.MANUAL_CONTROL)
        call = f"manual_control({steering!r}, {throttle!r})"
        self._check_numbers(call, steering, throttle, example="manual_control(0.0, 0.5)")
        for name, value in (("steering", steering), ("throttle", throttle)):
            if not -1.0 <= value <= 1.0:
                raise UsageError(f"{self.name}: manual control: {name}={value:g}; it goes from -1 to 1")
        self._operations.set_manual_control(ManualControl(roll=steering, throttle=throttle))

    def come_to_rest(self) -> str:
        """Stop and disarm, unless another station has control; return what was done.

        A lost link is given half a minute to return; then ``LinkLost`` is raised.
        """
        telemetry = self._connection.poll()
        if telemetry.last_message_ns < 0:
            return "never sent a message"
        self._connection.wait_for_link()
        self._executor.wait_for_interrupted()
        with self.kernel.interact():
            self._driver.stop()
        if not telemetry.armed:
            return "is disarmed"
        if not self._executor.is_ours():
            return f"is left to the pilot or station in {telemetry.mode}"
        self.hold()
        self.disarm()
        return "stopped and was disarmed"
