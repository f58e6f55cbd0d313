"""A drone: operations that block until telemetry shows that they are done."""

from __future__ import annotations

from math import nan

from volery.base.errors import OutOfBounds, Refused, UsageError
from volery.base.frames import LocalFrame
from volery.base.position import AboveHome, Position
from volery.base.time import Ns, S, from_seconds
from volery.vehicles.driver import Acceleration, AttitudeTarget, Capability, ManualControl
from volery.vehicles.executor import RESTARTS
from volery.vehicles.limits import height_violation
from volery.vehicles.monitors import NO_GOAL, Goal, StreamedSetpoint
from volery.vehicles.operations import LANDING, STREAM, TO_SAFETY, TRAVEL, TURN
from volery.vehicles.telemetry import Velocity
from volery.vehicles.vehicle import Vehicle
from volery.vehicles.vehicle_bounds import path_timeout, travel_timeout

VELOCITY_LASTS_S = 3.0
SETPOINT_LASTS_S = 1.0
"""Duration of attitudes and accelerations, which a control loop sets several times a second."""
LANDED_STATE_WITHIN: Ns = 2 * S
"""Time after disarming in which the landed state is reported."""
SAFE_ACTION_WITHIN: Ns = 10 * S
"""Time for which an autopilot in a failsafe may hold before it lands or returns: 5 s by default in PX4."""
RETURN_CLIMB = 30.0
"""Climb before a return, m, that a time-out allows for; ArduPilot's RTL_ALT is 15 m."""


class Drone(Vehicle):
    """A multirotor. See ``Vehicle`` for its state, the constructor's arguments and how operations end.

    ``takeoff``, ``goto`` and ``return_home`` need a position estimate. ``land`` and manual flight
    (``manual_control``, ``stabilize``, ``altitude_hold``) do not. All may be mixed in one flight.
    """

    kind = "drone"

    @property
    def flying(self) -> bool:
        """Whether it is off the ground, as judged by the autopilot."""
        return self._connection.poll().flying

    @property
    def landed(self) -> bool:
        """Whether it is on the ground, as judged by the autopilot."""
        return not self.flying

    # -- operations that need a position

    def takeoff(self, height: float) -> None:
        """Wait until ready, arm, and climb.

        The sequence starts again, at most three times, if it is undone before lift-off because another
        station changes the mode or disarms.

        Args:
            height: metres above home.

        Raises:
            OutOfBounds: limits or fence forbid it; raised before anything is sent.
            Refused: it flies already, or the autopilot refuses.
        """
        self._connection.require(Capability.TAKEOFF)
        self._check_numbers(f"takeoff({height!r})", height, example="takeoff(10), in metres above home")
        asked = f"take off to {height:g} m"
        if height <= 0:
            raise UsageError(f"{self.name}: {asked}: give metres above home, above 0")
        telemetry = self._telemetry
        if self.flying and not telemetry.armed:  # it has landed, and will report so
            self._executor.wait(lambda: not telemetry.flying, LANDED_STATE_WITHIN)
        if telemetry.flying:
            where = f"it flies already, {telemetry.above_home:.1f} m above home"
            raise Refused(self.name, asked, f"{where}; goto(position) changes its height")
        violation = height_violation(height, self.limits, telemetry.home)
        if violation:
            raise OutOfBounds(self.name, asked, violation)
        if self.fence is not None:
            if telemetry.home is None:
                self.wait_ready()
            ground = self.position
            self._bounds.check_path(
                asked, ground, Position(ground.latitude, ground.longitude, AboveHome(height))
            )
        here = telemetry.position
        within = travel_timeout(0.0, height)

        def goal() -> Goal:
            home = telemetry.home
            if home is None:
                return NO_GOAL
            over = here or home
            return self._bounds.goal(Position(over.latitude, over.longitude, AboveHome(height)))

        self._operations.run(
            "takeoff",
            asked,
            lambda: self._driver.takeoff(height, within),
            policy=TRAVEL,
            goal=goal,
            restarts=RESTARTS,
        )

    def goto(self, goal: Position, speed: float | None = None) -> None:
        """Fly straight to *goal* and stop there.

        Args:
            goal: target position, AMSL or above home.
            speed: speed over ground, m/s; ``None`` means the autopilot's own.

        Raises:
            OutOfBounds: limits or fence forbid the goal or the straight path (raised before anything is
                sent), or were violated on the way.
            Refused: it is on the ground, or the autopilot refuses.
        """
        self._connection.require(Capability.GOTO)
        if not isinstance(goal, Position):
            raise UsageError(
                f"{self.name}: goto({goal!r}): a goal is a Position, as in "
                "goto(Position(46.0826, -103.8995, AboveHome(10))); altitudes are AMSL(...) or AboveHome(...)"
            )
        asked = f"go to {goal}"
        if speed is not None:
            self._check_speed(asked, speed)
        self._check_flying(asked)
        self._bounds.check_altitude(goal)
        path = self._bounds.check_path(asked, self._connection.poll().position, goal)
        within = path_timeout(path, speed)
        self._operations.run(
            "goto",
            asked,
            lambda: self._driver.goto(goal, speed, within),
            policy=TRAVEL,
            goal=lambda: self._bounds.goal(goal),
        )

    def return_home(self) -> None:
        """Let the autopilot return home and land; return when it is disarmed.

        The operation of another task is aborted.

        Raises:
            OutOfBounds: the straight path violates the fence, unless the drone is out of bounds already.
        """
        self._connection.require(Capability.RETURN_HOME)
        home, here = self.home, self.position
        if not self._bounds.is_out_of_bounds():
            self._bounds.check_path(
                "return home", here, Position(home.latitude, home.longitude, here.altitude)
            )
        within = self._bounds.timeout_to(home) + self._bounds.landing_timeout(RETURN_CLIMB)
        self._operations.run(
            "return_home",
            "return home",
            lambda: self._driver.return_home(within),
            policy=TO_SAFETY,
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
        """Fly at a velocity and return as soon as the vehicle follows it.

        The velocity lasts until the next operation or for *lasting* seconds, then the drone stops, so that a
        program that hangs does not fly away. A control loop calls this in each round. If the drone leaves the
        bounds after the call, it is commanded to hold and the next call raises ``OutOfBounds``.

        Args:
            north: velocity to the north, m/s.
            east: velocity to the east, m/s.
            up: velocity upwards, m/s.
            yaw_rate: turn rate, degrees/s, clockwise positive.
            lasting: duration, s.

        Raises:
            OutOfBounds: it would leave limits or fence within *lasting* seconds.
        """
        self._connection.require(Capability.VELOCITY)
        velocity = Velocity(north, east, up)
        call = f"set_velocity({north!r}, {east!r}, {up!r}, {yaw_rate!r}, lasting={lasting!r})"
        self._check_numbers(call, north, east, up, yaw_rate, lasting, example="set_velocity(north=2.0)")
        self._check_lasting(call, lasting)
        asked = f"fly at {north:g} m/s north, {east:g} m/s east, {up:g} m/s up"
        self._check_flying(asked)
        self._check_way(asked, velocity, lasting)
        self._operations.run(
            "set_velocity",
            asked,
            lambda: self._driver.velocity(velocity, yaw_rate, from_seconds(lasting)),
            policy=STREAM,
        )
        self._operations.note_streamed(StreamedSetpoint(velocity=velocity, yaw_rate=yaw_rate), lasting)

    def set_acceleration(
        self,
        north: float = 0.0,
        east: float = 0.0,
        up: float = 0.0,
        yaw_rate: float = 0.0,
        *,
        lasting: float = SETPOINT_LASTS_S,
    ) -> None:
        """Accelerate and return as soon as the autopilot follows; then as ``set_velocity``.

        Args:
            north: acceleration to the north, m/s².
            east: acceleration to the east, m/s².
            up: acceleration upwards, m/s².
            yaw_rate: turn rate, degrees/s, clockwise positive.
            lasting: duration, s.

        Raises:
            OutOfBounds: it would leave limits or fence within *lasting* seconds.
        """
        self._connection.require(Capability.ACCELERATION)
        call = f"set_acceleration({north!r}, {east!r}, {up!r}, {yaw_rate!r}, lasting={lasting!r})"
        self._check_numbers(call, north, east, up, yaw_rate, lasting, example="set_acceleration(north=1.0)")
        self._check_lasting(call, lasting)
        asked = f"accelerate at {north:g} m/s² north, {east:g} m/s² east, {up:g} m/s² up"
        self._check_flying(asked)
        seen, half = self.velocity, 0.5 * lasting
        mean = Velocity(seen.north + north * half, seen.east + east * half, seen.up + up * half)
        self._check_way(asked, mean, lasting)
        self._operations.run(
            "set_acceleration",
            asked,
            lambda: self._driver.acceleration(Acceleration(north, east, up), yaw_rate, from_seconds(lasting)),
            policy=STREAM,
        )
        self._operations.note_streamed(
            StreamedSetpoint(acceleration=(north, east, up), yaw_rate=yaw_rate), lasting
        )

    def set_attitude(
        self,
        roll: float = 0.0,
        pitch: float = 0.0,
        heading: float | None = None,
        *,
        thrust: float = 0.5,
        yaw_rate: float = 0.0,
        lasting: float = SETPOINT_LASTS_S,
    ) -> None:
        """Fly at an attitude and return as soon as the autopilot follows; then as ``set_velocity``.

        A thrust of 0.5 hovers. ArduPilot and DJI take thrust as a climb rate and keep the height at 0.5; PX4
        takes it as collective thrust, which hovers at its ``MPC_THR_HOVER``.

        Args:
            roll: degrees, right positive.
            pitch: degrees, nose up positive: a negative pitch flies forward.
            heading: degrees clockwise from north; ``None`` turns at *yaw_rate*.
            thrust: 0..1.
            yaw_rate: turn rate, degrees/s, clockwise positive.
            lasting: duration, s.

        Raises:
            UsageError: a value is out of range or not a number.
        """
        self._connection.require(Capability.ATTITUDE)
        call = f"set_attitude({roll!r}, {pitch!r}, {heading!r}, thrust={thrust!r}, yaw_rate={yaw_rate!r})"
        turn = nan if heading is None else heading
        given = (roll, pitch, thrust, yaw_rate, 0.0 if heading is None else heading)
        self._check_numbers(call, *given, lasting, example="set_attitude(pitch=-5, thrust=0.5)")
        self._check_lasting(call, lasting)
        if abs(roll) >= 90.0 or abs(pitch) >= 90.0:
            raise UsageError(f"{self.name}: {call}: roll and pitch are degrees within -90 and 90")
        if not 0.0 <= thrust <= 1.0:
            raise UsageError(f"{self.name}: {call}: thrust goes from 0 to 1; 0.5 hovers")
        asked = f"fly at a roll of {roll:g} and a pitch of {pitch:g} degrees"
        self._check_flying(asked)
        target = AttitudeTarget(roll, pitch, thrust, turn % 360.0, yaw_rate)
        self._operations.run(
            "set_attitude",
            asked,
            lambda: self._driver.attitude(target, from_seconds(lasting)),
            policy=STREAM,
        )
        turning = yaw_rate if heading is None else nan
        asked_for = StreamedSetpoint(
            roll=roll, pitch=pitch, heading=target.heading, yaw_rate=turning, thrust=thrust
        )
        self._operations.note_streamed(asked_for, lasting)

    def set_heading(self, degrees: float) -> None:
        """Turn in place.

        Args:
            degrees: heading, clockwise from north.
        """
        self._connection.require(Capability.HEADING)
        self._check_numbers(f"set_heading({degrees!r})", degrees, example="set_heading(90)")
        asked = f"turn to {degrees:g} degrees"
        self._check_flying(asked)
        self._operations.run("set_heading", asked, lambda: self._driver.heading(degrees % 360.0), policy=TURN)

    def hold(self) -> None:
        """Stop and hold the position, also outside the bounds; on the ground nothing is sent.

        The operation of another task is aborted. Raises ``Overridden`` if another station has control.
        """
        if self.flying:
            super().hold()

    # -- operations without a position

    def land(self, at: Position | None = None) -> None:
        """Descend in place and return when landed and disarmed; also out of bounds and without a position.

        The operation of another task is aborted. Raises ``Overridden`` if another station has control.

        Args:
            at: intended touch-down point, against which the record measures the landing; the descent is
                vertical in any case.
        """
        self._land("land", at)

    def _land(self, operation: str, at: Position | None = None) -> None:
        """Land as *operation*: what a program asked for and its end are recorded under different names."""
        self._connection.require(Capability.LAND)
        here = at or self._telemetry.position
        within = self._bounds.landing_timeout(0.0)
        self._operations.run(
            operation,
            "land",
            lambda: self._driver.land(within),
            policy=LANDING,
            goal=lambda: NO_GOAL if here is None else Goal(here.latitude, here.longitude, nan),
        )

    def manual_control(self, pitch: float, roll: float, throttle: float, yaw: float) -> None:
        """Set the manual control (the sticks) until the next call.

        The values are repeated, because an autopilot would otherwise fall back on a transmitter. They take
        effect in ``stabilize`` and ``altitude_hold``; an operation with a position, or another station that
        changes the mode, ends the repetition.

        Args:
            pitch: -1..1, forward positive.
            roll: -1..1, right positive.
            throttle: 0..1; 0.5 keeps the altitude in altitude hold.
            yaw: -1..1, clockwise positive.

        Raises:
            UsageError: a value is out of range or not a number.
        """
        self._connection.require(Capability.MANUAL_CONTROL)
        call = f"manual_control({pitch!r}, {roll!r}, {throttle!r}, {yaw!r})"
        self._check_numbers(call, pitch, roll, throttle, yaw, example="manual_control(0, 0, 0.5, 0)")
        control = ManualControl(pitch, roll, throttle, yaw)
        for name, value, low in zip(ManualControl._fields, control, (-1.0, -1.0, 0.0, -1.0), strict=True):
            if not low <= value <= 1.0:
                raise UsageError(f"{self.name}: manual control: {name}={value:g}; it goes from {low:g} to 1")
        self._operations.set_manual_control(control)

    def stabilize(self) -> None:
        """Enter the mode in which manual control commands attitude and throttle; on the ground also arm.

        It needs no position and returns when the mode is seen. Raises ``Refused`` unless ``manual_control``
        was called within the last second.
        """
        self._connection.require(Capability.STABILIZE)
        self._operations.enter_manual_mode("stabilize", "fly stabilized", self._driver.stabilize)

    def altitude_hold(self) -> None:
        """Enter the mode in which manual control commands attitude and climb rate; on the ground also arm.

        A throttle of 0.5 keeps the altitude; a Paparazzi keeps it whatever the throttle says. It needs no
        position and returns when the mode is seen. Raises ``Refused`` unless ``manual_control`` was called
        within the last second.
        """
        self._connection.require(Capability.ALTITUDE_HOLD)
        self._operations.enter_manual_mode("altitude_hold", "hold the altitude", self._driver.altitude_hold)

    def hand_over(self) -> None:
        """Stop all set-points and manual control at once, and let the pilot's transmitter fly the drone.

        The operation of another task is aborted. Where the autopilot follows a computer, it changes to a mode
        that the transmitter commands. Raises ``Refused`` if the autopilot receives no transmitter.
        """
        self._connection.require(Capability.MANUAL_CONTROL)
        self._operations.run(
            "hand_over", "hand over to the transmitter", self._driver.hand_over, policy=LANDING
        )

    # -- end of a program

    def come_to_rest(self) -> str:
        """Land if armed, unless another station has control; return what was done.

        A drone that the autopilot is already landing is monitored until it is disarmed. A lost link is given
        half a minute to return; then ``LinkLost`` is raised.
        """
        telemetry = self._connection.poll()
        if telemetry.last_message_ns < 0:
            return "never sent a message"
        self._connection.wait_for_link()
        self._executor.wait_for_interrupted()
        if self._acts_by_itself():
            with self.kernel.interact():
                self._driver.stop()
            return self._watch_landing()
        if telemetry.flying and (
            self._executor.is_ours() or telemetry.stream_lost or telemetry.failsafe_lasts
        ):
            # manual control is repeated until the autopilot lands; otherwise it would fall
            self._land("come_to_rest")
            return "landed"
        with self.kernel.interact():
            self._driver.stop()
        if telemetry.flying:
            return self._watch_landing()
        if telemetry.armed:
            self.disarm()
            return "was disarmed on the ground"
        return "is disarmed"

    def _acts_by_itself(self) -> bool:
        """Return whether a failsafe of the autopilot lands or returns the drone; it may hold first.

        A landing by this program would overrule it: it would land where it is instead of at home.
        """
        telemetry = self._telemetry
        if (
            not telemetry.flying
            or not telemetry.failsafe
            or telemetry.stream_lost
            or telemetry.failsafe_lasts
        ):
            return False
        landing_modes = self._driver.landing_modes
        return telemetry.mode in landing_modes or self._executor.wait(
            lambda: telemetry.mode in landing_modes, SAFE_ACTION_WITHIN
        )

    def _watch_landing(self) -> str:
        telemetry, mode = self._telemetry, self._telemetry.mode
        landing_modes = self._driver.landing_modes
        if mode in landing_modes:
            home = telemetry.home
            within = self._bounds.landing_timeout(RETURN_CLIMB) + (
                self._bounds.timeout_to(home) if home else 0
            )
            self._executor.wait(lambda: not telemetry.armed or telemetry.mode not in landing_modes, within)
            if not telemetry.armed:
                return f"landed by itself in {mode}"
        return f"is left to the pilot or station in {telemetry.mode}"

    # -- checks and time-outs

    def _check_flying(self, asked: str) -> None:
        """Raise the bounds error found since the last call, or ``Refused`` on the ground."""
        self._operations.raise_bounds_error()
        if not self._telemetry.flying:
            raise Refused(self.name, asked, "it is on the ground; takeoff(height) first")

    def _check_lasting(self, call: str, lasting: float) -> None:
        if lasting <= 0.0:
            raise UsageError(f"{self.name}: {call}: lasting is in seconds, above 0")

    def _check_way(self, asked: str, velocity: Velocity, lasting: float) -> None:
        """Raise ``OutOfBounds`` if *lasting* seconds at *velocity* lead out of the bounds."""
        try:
            self._bounds.check_path(asked, self.position, self._position_after(velocity, lasting))
        except OutOfBounds as error:
            if not self._operations.monitoring:
                raise
            # the set-point before would go on over the bound
            raise OutOfBounds(self.name, asked, f"{error.what}; {self._operations.react(error)}") from None

    def _position_after(self, velocity: Velocity, seconds: float) -> Position:
        """Return the position after *seconds* at *velocity*; the ground stops a descent."""
        here = self.position
        frame = LocalFrame(here.latitude, here.longitude, here.altitude.metres)
        moved = velocity.east * seconds, velocity.north * seconds, velocity.up * seconds
        latitude, longitude, _ = frame.from_enu(moved)
        height = self._telemetry.above_home + velocity.up * seconds
        return Position(latitude, longitude, AboveHome(max(height, self.limits.lowest)))
