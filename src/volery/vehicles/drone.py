"""A drone: blocking operations, each seen on the telemetry before it returns."""

from __future__ import annotations

from math import isfinite, nan

from volery.base.errors import OutOfBounds, Refused, UsageError
from volery.base.frames import LocalFrame
from volery.base.position import AboveHome, Position
from volery.base.time import Ns, from_seconds
from volery.vehicles.driver import Capability, ManualControl
from volery.vehicles.executor import RESTARTS
from volery.vehicles.limits import height_violation
from volery.vehicles.telemetry import Velocity
from volery.vehicles.vehicle import NO_GOAL, STREAM, TO_SAFETY, TRAVEL, TURN, Goal, Vehicle, travel_within

VELOCITY_LASTS_S = 3.0
RETURN_CLIMB = 30.0
"""Metres that a time-out allows an autopilot to climb before it returns; ArduPilot's RTL_ALT is 15."""


class Drone(Vehicle):
    """A multirotor. See ``Vehicle`` for its state and for what the arguments mean.

    The operations of positioning (``takeoff``, ``goto``, ``return_home``) need a position; those of sticks
    (``manual_control``, ``stabilize``, ``altitude_hold``) and ``land`` do not. One may change between them in
    flight.
    """

    kind = "drone"

    @property
    def flying(self) -> bool:
        """Off the ground, by the autopilot's own judgement."""
        return self._look().flying

    @property
    def landed(self) -> bool:
        """On the ground, by the autopilot's own judgement."""
        return not self.flying

    # -- with a position

    def takeoff(self, height: float) -> None:
        """Wait until it is ready, arm, and climb to *height* metres above home.

        A sequence that is undone before lift-off (somebody changed the mode or disarmed) is started over, at
        most 3 times.
        """
        self._require(Capability.TAKEOFF)
        asked = f"take off to {height:g} m"
        if not isfinite(height) or height <= 0:
            raise UsageError(f"{self.name}: {asked}: give metres above home, above 0")
        if self.flying:
            where = f"it flies already, {self._driver.telemetry.above_home:.1f} m above home"
            raise Refused(self.name, asked, f"{where}; goto(position) changes its height")
        found = height_violation(height, self.limits, self._driver.telemetry.home)
        if found:
            raise OutOfBounds(self.name, asked, found)
        if self.fence is not None:
            if self._driver.telemetry.home is None:
                self.wait_ready()
            ground = self.position
            self._check_path(asked, ground, Position(ground.latitude, ground.longitude, AboveHome(height)))
        here = self._driver.telemetry.position
        within = from_seconds(travel_within(0.0, height, None))
        self._operate(
            "takeoff",
            asked,
            lambda: self._driver.takeoff(height, within),
            manner=TRAVEL,
            goal=lambda: self._above(here, height),
            restarts=RESTARTS,
        )

    def goto(self, goal: Position, speed: float | None = None) -> None:
        """Go straight to *goal* and stop there; *speed* in m/s over ground, else the autopilot's own.

        Raises ``OutOfBounds`` before anything moves if limits or fence forbid the goal or the straight way,
        and on the way if it strays all the same.
        """
        self._require(Capability.GOTO)
        asked = f"go to {goal}"
        self._check_speed(asked, speed)
        self._in_flight(asked)
        self._check_altitude(goal)
        self._check_path(asked, self.position, goal)
        within = self._within(goal, speed)
        self._operate(
            "goto",
            asked,
            lambda: self._driver.goto(goal, speed, within),
            manner=TRAVEL,
            goal=lambda: self._goal(goal),
        )

    def return_home(self) -> None:
        """Let the autopilot return to home and land there, until it is disarmed.

        Raises ``OutOfBounds`` if the straight way leads out of the fence or through a no-fly zone, but not
        if it is out of bounds already. What another task has under way ends with ``Overridden``.
        """
        self._require(Capability.RETURN_HOME)
        home, here = self.home, self.position
        if not self._strayed_already():
            self._check_path("return home", here, Position(home.latitude, home.longitude, here.altitude))
        within = self._within(home, None) + self._landing_within(RETURN_CLIMB)
        self._operate(
            "return_home",
            "return home",
            lambda: self._driver.return_home(within),
            manner=TO_SAFETY,
            goal=lambda: Goal(home.latitude, home.longitude, nan),
        )

    def set_velocity(
        self,
        north: float = 0.0,
        east: float = 0.0,
        up: float = 0.0,
        yaw_rate: float = 0.0,
        *,
        lasting: float = VELOCITY_LASTS_S,
    ) -> None:
        """Fly at this velocity, m/s and degrees per second clockwise. Returns as soon as it is under way.

        It stands for *lasting* seconds or until the next operation, then the drone stops: a program that
        hangs does not fly away. A loop that controls calls it each time round. Raises ``OutOfBounds`` if it
        would leave limits or fence in that time; where it strays later it is told to hold, and the next
        call raises it.
        """
        self._require(Capability.VELOCITY)
        velocity = Velocity(north, east, up)
        asked = f"fly at {north:g} m/s north, {east:g} m/s east, {up:g} m/s up"
        if not all(isfinite(part) for part in (*velocity, yaw_rate)):
            raise UsageError(f"{self.name}: {asked}, {yaw_rate:g} degrees/s: not all of these are numbers")
        if not (isfinite(lasting) and lasting > 0):
            raise UsageError(f"{self.name}: {asked}, lasting {lasting:g} s; give seconds above 0")
        self._in_flight(asked)
        self._check_path(asked, self.position, self._after(velocity, lasting))
        self._operate(
            "set_velocity",
            asked,
            lambda: self._driver.velocity(velocity, yaw_rate, from_seconds(lasting)),
            manner=STREAM,
        )

    def set_heading(self, degrees: float) -> None:
        """Turn to *degrees* clockwise from north, in place."""
        self._require(Capability.HEADING)
        asked = f"turn to {degrees:g} degrees"
        if not isfinite(degrees):
            raise UsageError(f"{self.name}: {asked}: not a number")
        self._in_flight(asked)
        self._operate("set_heading", asked, lambda: self._driver.heading(degrees % 360.0), manner=TURN)

    def hold(self) -> None:
        """Stop and stay where it is, also out of bounds; on the ground it does that anyhow.

        What another task has under way ends with ``Overridden``; a drone that somebody else has is left
        alone.
        """
        if self.flying:
            super().hold()

    # -- without

    def land(self, at: Position | None = None) -> None:
        """Descend here, until it is on the ground and disarmed: also out of bounds and without a position.

        What another task has under way ends with ``Overridden``; a drone that somebody else has is left
        alone: ``Overridden``, too. *at* is where it was to touch down, if that is not here: the record
        measures against it. The autopilot goes straight down either way.
        """
        self._require(Capability.LAND)
        here = at or self._driver.telemetry.position
        within = self._landing_within(0.0)
        self._operate(
            "land",
            "land",
            lambda: self._driver.land(within),
            manner=TO_SAFETY,
            goal=lambda: NO_GOAL if here is None else Goal(here.latitude, here.longitude, nan),
        )

    def manual_control(self, pitch: float, roll: float, throttle: float, yaw: float) -> None:
        """Hold the sticks like this until the next call.

        Pitch (forward +), roll (right +), yaw (clockwise +) in -1..1; throttle in 0..1, where 0.5 keeps the
        altitude in altitude hold. They are sent again and again: else the autopilot would fall back on a
        transmitter. They take effect in ``stabilize`` and ``altitude_hold``, and are let go by the operations
        with a position and as soon as somebody else changes the mode.

        Raises ``UsageError`` naming the stick that is out of range or no number.
        """
        self._require(Capability.STICKS)
        sticks = ManualControl(pitch, roll, throttle, yaw)
        for name, value, low in zip(ManualControl._fields, sticks, (-1.0, -1.0, 0.0, -1.0), strict=True):
            if not low <= value <= 1.0:
                raise UsageError(f"{self.name}: manual control: {name}={value:g}; it goes from {low:g} to 1")
        self._move_sticks(sticks)

    def stabilize(self) -> None:
        """Fly by sticks: they command attitude and throttle. On the ground it is armed, too.

        Returns when the mode is seen, without a position, too. Raises ``Refused`` unless
        ``manual_control`` was called within the last second.
        """
        self._require(Capability.STABILIZE)
        self._by_hand("stabilize", "fly stabilized", self._driver.stabilize)

    def altitude_hold(self) -> None:
        """Fly by sticks: they command attitude and climb rate; the throttle's middle keeps the altitude. On
        the ground it is armed, too.

        Returns when the mode is seen, without a position, too. Raises ``Refused`` unless
        ``manual_control`` was called within the last second.
        """
        self._require(Capability.ALTITUDE_HOLD)
        self._by_hand("altitude_hold", "hold the altitude", self._driver.altitude_hold)

    # -- the end of a program

    def come_to_rest(self) -> str:
        """Land it if it is armed and nobody else has it; says what was done. For the end of a program.

        One that its autopilot already brings down is watched until it is down. It waits half a minute for a
        link that is lost at that moment; ``LinkLost`` if that does not return.
        """
        seen = self._look()
        if seen.heard < 0:
            return "was never heard"
        self._wait_for_link()
        if seen.flying and self._performer.is_ours():
            self.land()  # the sticks are held until the autopilot lands: it must not fall
            return "landed"
        with self._kernel:
            self._driver.stop()
        if seen.flying:
            return self._watch_down()
        if seen.armed:
            self.disarm()
            return "was disarmed on the ground"
        return "is disarmed"

    def _watch_down(self) -> str:
        seen, mode = self._driver.telemetry, self._driver.telemetry.mode
        if mode in self._driver.comes_down:
            home = seen.home
            within = self._landing_within(RETURN_CLIMB) + (self._within(home, None) if home else 0)
            self._performer.wait(lambda: not seen.armed or seen.mode not in self._driver.comes_down, within)
            if not seen.armed:
                return f"came down by itself in {mode}"
        return f"is left to whoever flies it in {seen.mode}"

    def _after(self, velocity: Velocity, seconds: float) -> Position:
        """Where it will be after so many *seconds*. Downwards the ground stops it: that is no offence."""
        here = self.position
        frame = LocalFrame(here.latitude, here.longitude, here.altitude.metres)
        moved = velocity.east * seconds, velocity.north * seconds, velocity.up * seconds
        latitude, longitude, _ = frame.from_enu(moved)
        height = self._driver.telemetry.above_home + velocity.up * seconds
        return Position(latitude, longitude, AboveHome(max(height, self.limits.lowest)))

    def _landing_within(self, climb: float) -> Ns:
        """ArduPilot lands at 0.5 m/s; from an unknown height, allow for the highest."""
        height = self._driver.telemetry.above_home
        height = max(height, 0.0) if isfinite(height) else self.limits.highest
        return from_seconds(travel_within(0.0, 2.0 * (height + climb), None))

    def _above(self, here: Position | None, height: float) -> Goal:
        home = self._driver.telemetry.home
        if home is None:
            return NO_GOAL
        over = here or home
        return self._goal(Position(over.latitude, over.longitude, AboveHome(height)))
