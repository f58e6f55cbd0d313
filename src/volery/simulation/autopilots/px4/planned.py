"""The automatic modes of PX4's multirotor, which plan their path: hold, take-off, landing, return, circle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import atan2, cos, dist, hypot, pi, sin

from volery.base.frames import Vector, wrap
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.to_point import Land, ToPoint
from volery.simulation.autopilots.px4.ramps import climb_share, interpolated
from volery.simulation.autopilots.vehicle_state import Manoeuvre, Vehicle

JERK_AUTO = 4.0
"""MPC_JERK_AUTO [m/s^3]."""

CRUISE_SHARE = 0.84
"""Of MPC_XY_CRUISE: legs asked for at 5 m/s were flown at 4.0 to 4.2."""

ACCEL_SHARE = 0.67
"""Of MPC_ACC_HOR: how a leg begins and ends in the recordings."""

ALIGNED, SPEED_ASIDE = 0.35, 0.5
"""A leg is flown in earnest once the nose is that close to its direction [rad]; before, that fast [m/s]."""


class Hold(ToPoint):
    """AUTO.LOITER: stop and stay; a reposition moves the point."""

    def towards(self, point: Vector) -> Setpoint:
        """As planned by the firmware: gently."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        return Setpoint(
            Control.POSITION,
            position=point,
            yaw=self.yaw if vehicle.yaw_target is None else vehicle.yaw_target,
            speed=self._cruise(),
            speed_up=tuning.speed_up,
            speed_down=tuning.speed_down,
            accel=ACCEL_SHARE * tuning.accel,
            accel_z=tuning.accel_z,
            tilt=tuning.tilt,
            jerk=JERK_AUTO,
        )

    def _cruise(self) -> float:
        """Speed in the plane; slow until the nose points along the leg."""
        vehicle = self.vehicle
        speed = CRUISE_SHARE * (self.speed or vehicle.speed or vehicle.parameters["MPC_XY_CRUISE"])
        if self.yaw is None or abs(wrap(self.yaw - vehicle.estimate.attitude[2])) < ALIGNED:
            return speed
        return min(speed, SPEED_ASIDE)

    def near(self, sideways: float, height: float) -> bool:
        """Whether it is that close to the point."""
        if self.point is None:
            return True
        here = self.vehicle.estimate.position
        return dist(here[:2], self.point[:2]) < sideways and abs(here[2] - self.point[2]) < height


class TakeOff(Hold):
    """Straight up to an altitude, as MPC_TKO_SPEED and its ramp allow. It counts as there 0.8 m below."""

    taking_off = True
    slow_start = True

    def __init__(self, vehicle: Vehicle, down: float) -> None:
        super().__init__(vehicle)
        self.down = down

    def enter(self) -> None:
        """From where it stands."""
        north, east, _ = self.vehicle.estimate.position
        self.point = self.target = (north, east, self.down)

    def wants_to_fly(self) -> bool:
        """That is what it is for."""
        return True

    def towards(self, point: Vector) -> Setpoint:
        """Slowly at first."""
        share = climb_share(self.vehicle)
        return replace(super().towards(point), speed_up=share * self.vehicle.parameters["MPC_TKO_SPEED"])

    def arrived(self, passing: bool = False) -> bool:
        """Within NAV_MC_ALT_RAD, or above."""
        reach = self.vehicle.parameters["NAV_MC_ALT_RAD"]
        return self.vehicle.estimate.position[2] - self.down < reach


class Descent(Land):
    """AUTO.LAND: slower and slower below MPC_LAND_ALT1, ALT2 and ALT3."""

    def sink(self) -> float:
        """Metres per second down at the present height."""
        p, height = self.vehicle.parameters, self.vehicle.memory.above_ground
        middle = p["MPC_LAND_SPEED"]
        if height > p["MPC_LAND_ALT2"]:
            return interpolated(
                height, (p["MPC_LAND_ALT2"], middle), (p["MPC_LAND_ALT1"], p["MPC_Z_V_AUTO_DN"])
            )
        return interpolated(height, (p["MPC_LAND_ALT3"], p["MPC_LAND_CRWL"]), (p["MPC_LAND_ALT2"], middle))


class Return(Manoeuvre):
    """AUTO.RTL: climb, fly home, sink to RTL_DESCEND_ALT, land. *stage* is told the name of each stage, its
    altitude AMSL and its height above the destination.
    """

    def __init__(self, vehicle: Vehicle, told: Callable[[Vehicle, str, float, float], None]) -> None:
        super().__init__(vehicle)
        self._told = told
        self._stage = ""
        self._doing: Manoeuvre = Hold(vehicle)

    def enter(self) -> None:
        """Straight up first."""
        here, home = self.vehicle.estimate.position, self._home
        away = hypot(home[0] - here[0], home[1] - here[1])
        self._height = max(self._least_height(away), home[2] - here[2])
        self._next("climb", (here[0], here[1], home[2] - self._height))

    @property
    def _home(self) -> Vector:
        return self.vehicle.home.ned if self.vehicle.home else (0.0, 0.0, 0.0)

    def _least_height(self, away: float) -> float:
        """Above home: RTL_RETURN_ALT, less within a cone of RTL_CONE_ANG about home."""
        p = self.vehicle.parameters
        full, reach, angle = p["RTL_RETURN_ALT"], p["NAV_ACC_RAD"], p["RTL_CONE_ANG"]
        if angle <= 0.0:
            return full
        if away <= reach:
            return 2.0 * away
        if away <= p["RTL_MIN_DIST"]:
            half = min(89.0, max(1.0, angle)) * pi / 180.0
            full = min(full, away * cos(half) / sin(half))
        return max(full, 2.0 * reach)

    def _next(self, stage: str, point: Vector) -> None:
        self._stage = stage
        self._doing = Descent(self.vehicle, point) if stage == "land" else Hold(self.vehicle, point)
        self._doing.enter()
        self.target, self.landing = self._doing.target, self._doing.landing
        above = self._home[2] - point[2]
        amsl = (self.vehicle.home.amsl if self.vehicle.home else 0.0) + above
        self._told(self.vehicle, stage, amsl, above)

    def step(self) -> None:
        """On to the next stage when one is done."""
        doing, home = self._doing, self._home
        p = self.vehicle.parameters
        if isinstance(doing, Hold):
            if self._stage == "climb" and doing.near(1e9, p["NAV_MC_ALT_RAD"]):
                self._next("return", (home[0], home[1], home[2] - self._height))
            elif self._stage == "return" and doing.near(p["NAV_ACC_RAD"], p["NAV_MC_ALT_RAD"]):
                self._next("descend", (home[0], home[1], home[2] - min(self._height, p["RTL_DESCEND_ALT"])))
            elif self._stage == "descend" and doing.near(p["NAV_ACC_RAD"], p["NAV_MC_ALT_RAD"]):
                self._next("land", home)
        self._doing.step()


class Orbit(Manoeuvre):
    """Circles about a centre, nose to it."""

    def __init__(self, vehicle: Vehicle, centre: Vector, radius: float, speed: float) -> None:
        super().__init__(vehicle)
        self.centre, self.radius, self.speed = centre, radius, speed
        self.target = centre

    def step(self) -> None:
        """Along the tangent, with a pull to the circle; positive radius: clockwise."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        north, east, _ = vehicle.estimate.position
        angle = atan2(east - self.centre[1], north - self.centre[0])
        size = abs(self.radius)
        pull = size - hypot(north - self.centre[0], east - self.centre[1])
        along = self.speed * (1.0 if self.radius > 0.0 else -1.0) * max(0.0, 1.0 - abs(pull) / size)
        inward = min(2.5, max(-2.5, pull))
        velocity = (
            inward * cos(angle) - along * sin(angle),
            inward * sin(angle) + along * cos(angle),
            0.0,
        )
        vehicle.drive(
            Setpoint(
                Control.VELOCITY_HEIGHT,
                position=self.centre,
                velocity=velocity,
                yaw=angle + pi,
                speed=tuning.speed,
                accel=tuning.accel,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )
