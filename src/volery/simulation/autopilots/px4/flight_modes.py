"""Manoeuvres of PX4's multirotor: hold, take-off, landing, return, circle, and POSCTL by stick.

Figures without a parameter name are fitted to the recordings.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import dist, hypot, inf, pi

from volery.base.elementary import atan2, cos, sin
from volery.base.frames import Vector, turn_clockwise
from volery.base.time import Ns, to_seconds
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.manual_flight import AltitudeHold, ManualFlight
from volery.simulation.autopilots.manoeuvres.to_point import DescendAndLand, ToPoint, bearing
from volery.simulation.autopilots.manual_control import StickPositions
from volery.simulation.autopilots.px4.position_control import Cruise, PositionLoops
from volery.simulation.autopilots.px4.yaw_stick import YawStick
from volery.simulation.autopilots.state_groups import NEVER, Home
from volery.simulation.autopilots.vehicle_state import IDLE, AutopilotVehicle, FlightManoeuvre

CLIMB_RAMP = ((0.0, 0.05), (0.6, 0.08), (0.75, 0.33), (1.5, 1.0))
"""Share of the climb rate over the time since lift-off in MPC_TKO_RAMP_T, as recorded."""


def interpolated(value: float, low: tuple[float, float], high: tuple[float, float]) -> float:
    """Interpolate linearly between two points (value, result), constant beyond them."""
    if high[0] <= low[0]:
        return high[1] if value > low[0] else low[1]
    share = min(1.0, max(0.0, (value - low[0]) / (high[0] - low[0])))
    return low[1] + share * (high[1] - low[1])


def climb_share(vehicle: AutopilotVehicle) -> float:
    """Return the share of the climb rate that is allowed this long after lift-off."""
    lifted = vehicle.firmware_state.lifted_at
    if lifted == NEVER:
        return CLIMB_RAMP[0][1]
    along = to_seconds(vehicle.kernel.now() - lifted) / max(0.1, vehicle.parameters["MPC_TKO_RAMP_T"])
    for low, high in pairwise(CLIMB_RAMP):
        if along <= high[0]:
            return interpolated(along, low, high)
    return 1.0


class Hold(ToPoint):
    """AUTO.LOITER: stop and hold a point, which a reposition moves."""

    _towards: float | None = None
    """Heading towards the point when it was last farther than NAV_ACC_RAD away [rad]."""

    def step(self) -> None:
        """Move the trajectory towards the point and follow it."""
        if self.point is None:
            return
        control: PositionLoops = self.vehicle.firmware_state.control
        control.fly_to(self.point, self.cruise(), self._heading())

    def _heading(self) -> float | None:
        """Return the heading [rad]: towards a region of interest, the commanded one, or towards the point.

        The nose stays where it is within NAV_ACC_RAD of the point (MPC_YAW_MODE 0).
        """
        vehicle, commanded = self.vehicle, self.vehicle.commanded
        if commanded.look_at is not None:
            return bearing(vehicle.estimate.position, commanded.look_at)
        if commanded.yaw is not None or self.yaw is not None or self.point is None:
            return self.yaw if commanded.yaw is None else commanded.yaw
        if not self.near(vehicle.parameters["NAV_ACC_RAD"], inf):
            self._towards = bearing(vehicle.estimate.position, self.point)
        return self._towards

    def cruise(self) -> Cruise:
        """Return the speeds of the trajectory."""
        vehicle, p = self.vehicle, self.vehicle.parameters
        speed = self.speed or vehicle.commanded.speed or p["MPC_XY_CRUISE"]
        return Cruise(
            min(max(0.1, speed), vehicle.tuning.speed),
            p["MPC_Z_V_AUTO_UP"],
            p["MPC_Z_V_AUTO_DN"],
            p["MPC_ACC_UP_MAX"],
        )

    def near(self, sideways: float, height: float) -> bool:
        """Return whether the point is within these distances [m]."""
        if self.point is None:
            return True
        here = self.vehicle.estimate.position
        return dist(here[:2], self.point[:2]) < sideways and abs(here[2] - self.point[2]) < height


class Px4TakeOff(Hold):
    """Climb vertically to an altitude at MPC_TKO_SPEED with its ramp."""

    def __init__(self, vehicle: AutopilotVehicle, down: float) -> None:
        super().__init__(vehicle)
        self.taking_off = self.slow_start = True
        self.down = down

    def enter(self) -> None:
        """Climb over the present position."""
        north, east, _ = self.vehicle.estimate.position
        self.point = self.target = (north, east, self.down)

    def takeoff_requested(self) -> bool:
        """Return True: the manoeuvre is a take-off."""
        return True

    def cruise(self) -> Cruise:
        """Return the limits of the trajectory, below MPC_LAND_ALT1 those of a take-off."""
        p, cruise = self.vehicle.parameters, super().cruise()
        if self.vehicle.firmware_state.above_ground >= p["MPC_LAND_ALT1"]:
            return cruise
        lift = min(cruise.lift, p["MPC_TKO_SPEED"] / max(0.1, p["MPC_TKO_RAMP_T"]))
        return cruise._replace(up=p["MPC_TKO_SPEED"], lift=lift, at_vehicle=True)

    def arrived(self, passing: bool = False) -> bool:
        """Return whether the vehicle is within NAV_MC_ALT_RAD below the altitude, or above it."""
        reach = self.vehicle.parameters["NAV_MC_ALT_RAD"]
        return self.vehicle.estimate.position[2] - self.down < reach


class Descent(DescendAndLand):
    """AUTO.LAND: sink more slowly below MPC_LAND_ALT1, and at MPC_LAND_SPEED below ALT2."""

    def enter(self) -> None:
        """Take the present position where no point was given, as Navigator's ``set_land_item`` does."""
        if self.point is None:
            self.point = self.vehicle.estimate.position

    def step(self) -> None:
        """Move the trajectory down over the point and follow it."""
        vehicle = self.vehicle
        control: PositionLoops = vehicle.firmware_state.control
        if vehicle.estimate.landed:  # no thrust after a ground contact
            control.rest()
            vehicle.drive(IDLE)
            return
        if not vehicle.has_position or self.point is None:
            super().step()
            return
        p = vehicle.parameters
        limits = Cruise(p["MPC_XY_CRUISE"], p["MPC_Z_V_AUTO_UP"], self.sink(), p["MPC_ACC_UP_MAX"])
        control.fly_to((self.point[0], self.point[1], inf), limits, vehicle.commanded.yaw)

    def sink(self) -> float:
        """Return the sink rate at the present height [m/s]."""
        p, height = self.vehicle.parameters, self.vehicle.firmware_state.above_ground
        if height <= p["MPC_LAND_ALT3"] and self.vehicle.firmware_state.reads_range:
            return p["MPC_LAND_CRWL"]
        high = p["MPC_LAND_ALT1"], p["MPC_Z_VEL_MAX_DN"]
        return min(
            p["MPC_Z_V_AUTO_DN"], interpolated(height, (p["MPC_LAND_ALT2"], p["MPC_LAND_SPEED"]), high)
        )


class Px4Return(FlightManoeuvre):
    """AUTO.RTL: climb, fly home, descend to RTL_DESCEND_ALT, land. ``report`` is called at each stage."""

    def __init__(
        self, vehicle: AutopilotVehicle, report: Callable[[AutopilotVehicle, str, float, float], None]
    ) -> None:
        super().__init__(vehicle)
        self._report = report
        self._stage = ""
        self._active: FlightManoeuvre = Hold(vehicle)

    def enter(self) -> None:
        """Climb vertically first."""
        here, home = self.vehicle.estimate.position, self._home
        away = hypot(home[0] - here[0], home[1] - here[1])
        self._height = max(self._least_height(away), home[2] - here[2])
        self._next("climb", (here[0], here[1], home[2] - self._height))

    @property
    def _home(self) -> Vector:
        return self._destination.ned if self._destination else (0.0, 0.0, 0.0)

    @property
    def _destination(self) -> Home | None:
        destination: Home | None = self.vehicle.firmware_state.return_to
        return destination

    def _least_height(self, away: float) -> float:
        """Return the least height above home [m]: RTL_RETURN_ALT, less within the cone of RTL_CONE_ANG."""
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
        self._active = Descent(self.vehicle, point) if stage == "land" else Hold(self.vehicle, point)
        self._active.enter()
        self.target, self.landing = self._active.target, self._active.landing
        above = self._home[2] - point[2]
        amsl = (self._destination.amsl if self._destination else 0.0) + above
        self._report(self.vehicle, stage, amsl, above)

    def step(self) -> None:
        """Continue with the next stage when one has ended."""
        active, home = self._active, self._home
        p = self.vehicle.parameters
        if isinstance(active, Hold):
            if self._stage == "climb" and active.near(1e9, p["NAV_MC_ALT_RAD"]):
                self._next("return", (home[0], home[1], home[2] - self._height))
            elif self._stage == "return" and active.near(p["NAV_ACC_RAD"], p["NAV_MC_ALT_RAD"]):
                self._next("descend", (home[0], home[1], home[2] - min(self._height, p["RTL_DESCEND_ALT"])))
            elif self._stage == "descend" and active.near(p["NAV_ACC_RAD"], p["NAV_MC_ALT_RAD"]):
                self._next("land", home)
        self._active.step()


class Orbit(FlightManoeuvre):
    """Circle about a centre with the nose towards it."""

    def __init__(self, vehicle: AutopilotVehicle, centre: Vector, radius: float, speed: float) -> None:
        super().__init__(vehicle)
        self.centre, self.radius, self.speed = centre, radius, speed
        self.target = centre

    def step(self) -> None:
        """Fly along the tangent with a correction towards the circle; a positive radius is clockwise."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        north, east, _ = vehicle.estimate.position
        angle = atan2(east - self.centre[1], north - self.centre[0])
        size = abs(self.radius)
        pull = size - hypot(north - self.centre[0], east - self.centre[1])
        along = self.speed * (1.0 if self.radius > 0.0 else -1.0) * max(0.0, 1.0 - abs(pull) / size)
        inward = min(2.5, max(-2.5, pull))
        velocity = (*turn_clockwise((inward, along), angle), 0.0)
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


SINK_BLIND = 0.7
"""MPC_LAND_SPEED: sink rate in POSCTL without sticks [m/s]."""

EXPO = 0.6
"""MPC_XY_MAN_EXPO, MPC_Z_MAN_EXPO, MPC_YAW_EXPO."""

STICK_SPEED_SHARE = 0.78
"""Share of MPC_VEL_MANUAL that a held stick reaches, as recorded."""


def bend(share: float) -> float:
    """Return a share of a stick's way, -1..1, on the expo curve."""
    return EXPO * share * share * share + (1.0 - EXPO) * share


def apply_expo(stick: float, dead: float) -> float:
    """Return a stick deflection -1..1 after dead zone and expo curve."""
    size = abs(stick)
    if size <= dead:
        return 0.0
    shaped = bend((size - dead) / (1.0 - dead))
    return shaped if stick > 0.0 else -shaped


class AltitudeControl(AltitudeHold):
    """ALTCTL: as ``AltitudeHold``; throttle and yaw stick have a dead zone and an expo curve."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._turn = YawStick()
        self._turned_at: Ns = vehicle.kernel.now()

    def climb(self, throttle: float) -> float:
        """Return the climb rate [m/s] for a throttle position 0..1 on the expo curve."""
        rate = super().climb(throttle)
        most = self.vehicle.tuning.pilot_up if rate > 0.0 else self.vehicle.tuning.pilot_down
        return most * bend(rate / most)

    def enter(self) -> None:
        """Start without a turn."""
        super().enter()
        self._turn, self._turned_at = YawStick(), self.vehicle.kernel.now()

    def step(self) -> None:
        """Turn as the yaw stick results in, and pass the sticks on."""
        now = self.vehicle.kernel.now()
        passed, self._turned_at = to_seconds(now - self._turned_at), now
        turn_by_stick(self.vehicle, self._turn, super().pilot.yaw, passed)
        super().step()

    @property
    def pilot(self) -> StickPositions:
        """The stick positions now, the yaw as the rate of turn that it results in."""
        return super().pilot._replace(yaw=self._turn.rate / self.vehicle.tuning.pilot_yaw_rate)


def turn_by_stick(vehicle: AutopilotVehicle, turn: YawStick, stick: float, passed: float) -> float:
    """Advance a turn by a yaw stick -1..1 and return its rate [rad/s]; on the ground there is none."""
    if vehicle.landed:
        turn.reset()
        return 0.0
    wanted = apply_expo(stick, vehicle.parameters["MPC_HOLD_DZ"]) * vehicle.tuning.pilot_yaw_rate
    return turn.step(wanted, passed)


class BlindDescent(FlightManoeuvre):
    """POSCTL without manual control: hold the horizontal position and sink."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._held: Vector = (0.0, 0.0, 0.0)

    def enter(self) -> None:
        """Hold the present position."""
        self._held = self.vehicle.estimate.position

    def step(self) -> None:
        """Sink at MPC_LAND_SPEED."""
        tuning = self.vehicle.tuning
        self.vehicle.drive(
            Setpoint(
                Control.POSITION_CLIMB,
                position=self._held,
                climb=-SINK_BLIND,
                speed=tuning.speed,
                speed_down=tuning.speed_down,
                accel=tuning.accel,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )


class PositionControl(ManualFlight):
    """POSCTL: sticks command an acceleration against drag; centred sticks brake and hold."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self.slow_start = True
        self._velocity = (0.0, 0.0)
        self._turn = YawStick()
        self._last: Ns = 0
        self._held: Vector | None = None
        self._blind: BlindDescent | None = None

    def enter(self) -> None:
        """Start with the present velocity."""
        north, east, _ = self.vehicle.estimate.velocity
        self._velocity, self._held, self._blind = (north, east), None, None
        self._last, self._turn = self.vehicle.kernel.now(), YawStick()

    def takeoff_requested(self) -> bool:
        """Return whether the pilot commands a climb."""
        return self._sticks and self._climb() > 0.0

    @property
    def _sticks(self) -> bool:
        valid: bool = self.vehicle.firmware_state.joystick.valid
        return valid

    def _climb(self) -> float:
        p = self.vehicle.parameters
        stick = apply_expo(self.vehicle.firmware_state.joystick.now.throttle, p["MPC_HOLD_DZ"])
        return stick * (p["MPC_Z_VEL_MAX_UP"] if stick > 0.0 else p["MPC_Z_VEL_MAX_DN"])

    def step(self) -> None:
        """Follow the sticks; sink without them."""
        if not self._sticks:
            if self._blind is None:
                self._blind = BlindDescent(self.vehicle)
                self._blind.enter()
            self._blind.step()
            return
        if self._blind is not None:
            self.enter()
        self._fly()

    def _fly(self) -> None:
        vehicle, tuning, p = self.vehicle, self.vehicle.tuning, self.vehicle.parameters
        now = vehicle.kernel.now()
        passed, self._last = to_seconds(now - self._last), now
        sticks, dead = vehicle.firmware_state.joystick.now, p["MPC_HOLD_DZ"]
        forward, right = apply_expo(sticks.pitch, dead), apply_expo(sticks.roll, dead)
        self._move(forward, right, passed)
        climb = self._climb()
        north, east = self._velocity
        self.vehicle.drive(
            Setpoint(
                Control.VELOCITY if self._held is None else Control.POSITION_CLIMB,
                position=self._held or (0.0, 0.0, 0.0),
                velocity=(north, east, -climb),
                climb=min(climb, climb_share(vehicle) * tuning.speed_up),
                yaw_rate=turn_by_stick(vehicle, self._turn, sticks.yaw, passed),
                speed=tuning.speed,
                speed_up=climb_share(vehicle) * tuning.speed_up,
                speed_down=tuning.speed_down,
                accel=tuning.accel,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )

    def _move(self, forward: float, right: float, passed: float) -> None:
        p = self.vehicle.parameters
        heading = self.vehicle.estimate.attitude[2]
        north, east = self._velocity
        push, top = p["MPC_ACC_HOR"], STICK_SPEED_SHARE * p["MPC_VEL_MANUAL"]
        if forward or right:
            self._held = None
            kept = 1.0 / (1.0 + push / top * passed)
            northward, eastward = turn_clockwise((forward, right), heading)
            north = (north + push * northward * passed) * kept
            east = (east + push * eastward * passed) * kept
            self._velocity = (north, east)
            return
        speed = hypot(north, east)
        left = max(0.0, speed - max(0.3, min(push, 1.2 * speed)) * passed)
        self._velocity = (north * left / speed, east * left / speed) if speed > 0.0 else (0.0, 0.0)
        if left == 0.0 and self._held is None:
            self._held = self.vehicle.estimate.target
