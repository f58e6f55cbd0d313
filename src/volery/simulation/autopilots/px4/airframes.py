"""PX4 on a multirotor and on a rover: parameters, tuning and modes of each, composed as firmwares.

Parameters that do not change the behaviour are only stored, listed and read back. There is no recording of a
rover: what it shares with the multirotor is recorded, its driving is assumed.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from functools import cache, partial
from math import ceil, hypot, isfinite, radians
from types import MappingProxyType

from volery.base.elementary import atan2
from volery.base.frames import Vector
from volery.base.time import MS, S
from volery.links.mavlink_messages import constant
from volery.simulation.autopilots.autopilot import Firmware
from volery.simulation.autopilots.autopilot_parameters import (
    REAL32,
    ManoeuvreTuning,
    StoredParameter,
    VehicleParameters,
)
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.guided_flight import Turn
from volery.simulation.autopilots.manoeuvres.manual_flight import Stabilize
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FlyMission
from volery.simulation.autopilots.manoeuvres.rover_driving import (
    DriveBySticks,
    DriveTo,
    FollowSpeed,
    ReturnRover,
    Stand,
    rover_leg,
)
from volery.simulation.autopilots.manual_control import ChannelRange, StickMap
from volery.simulation.autopilots.mavlink.endpoint import MavlinkEndpoint
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, DENIED, UNSUPPORTED, Command, Handler
from volery.simulation.autopilots.px4 import commands, event_interface, mission, modes
from volery.simulation.autopilots.px4.failsafes import on_step
from volery.simulation.autopilots.px4.firmware import own_parameters, px4_firmware, px4_mavlink
from volery.simulation.autopilots.px4.flight_modes import (
    AltitudeControl,
    Descent,
    Hold,
    Orbit,
    PositionControl,
    Px4Return,
    Px4TakeOff,
)
from volery.simulation.autopilots.px4.follow_target import FollowTarget
from volery.simulation.autopilots.px4.modes import commander_of
from volery.simulation.autopilots.px4.offboard import Offboard, OffboardTarget, StreamTarget
from volery.simulation.autopilots.px4.versions import Px4Version
from volery.simulation.autopilots.vehicle_state import (
    ArmingTimes,
    AutopilotVehicle,
    FlightManoeuvre,
    ParameterTable,
)
from volery.trace.events import CRITICAL, INFO

_SHARED = {
    "PD_GRIPPER_EN": "any value but 0: there is a gripper",
    "BAT_CRIT_THR": "critical level of the battery",
    "BAT_EMERGEN_THR": "emergency level of the battery",
    "BAT_LOW_THR": "low level of the battery",
    "COM_ARM_MIS_REQ": "any value but 0: arming needs a mission on board",
    "COM_ARM_WO_GPS": "any value but 0: modes that need no position may be armed without one",
    "COM_DL_LOSS_T": "silence after which the ground station is lost",
    "COM_FAIL_ACT_T": "time for which a failsafe holds before it acts",
    "COM_LOW_BAT_ACT": "0 warns, 2 lands, 3 returns at the critical level; any but 0 lands in an emergency",
    "COM_OBL_RC_ACT": "action when the stream of OFFBOARD set-points ends",
    "COM_OF_LOSS_T": "silence after which the stream has ended",
    "COM_RCL_EXCEPT": "bits 0, 1, 2: mission, hold and offboard continue without manual control",
    "COM_RC_IN_MODE": "1, 2, 3: MANUAL_CONTROL counts",
    "COM_RC_LOSS_T": "silence after which manual control is lost",
    "COM_RC_OVERRIDE": "bit 0: moved sticks end an automatic mode; bit 1: OFFBOARD, too",
    "COM_RC_STICK_OV": "stick movement that takes over",
    "EKF2_EVP_GATE": "distance from which an external pose is refused",
    "EKF2_EVP_NOISE": "least standard deviation of external poses",
    "EKF2_EV_CTRL": "bits 0, 1, 3: position, height and heading are those of external poses",
    "EKF2_EV_DELAY": "time that is subtracted from the time of an external pose",
    "EKF2_EV_NOISE_MD": "any value but 0: the covariance of external poses does not count",
    "EKF2_GPS_CTRL": "bit 0 off: satellites are not used",
    "EKF2_HGT_REF": "3: the height may be that of external poses",
    "GF_ACTION": "outside the geofence 1 warns, 2 holds, 3 returns, 4 terminates, 5 lands; 0: no geofence",
    "GF_MAX_HOR_DIST": "largest distance from home; 0: none",
    "GF_MAX_VER_DIST": "largest height above home; 0: none",
    "NAV_ACC_RAD": "radius within which a waypoint is reached",
    "NAV_DLL_ACT": "action when the ground station is lost",
    "NAV_RCL_ACT": "action when manual control is lost",
    "SIM_BAT_DRAIN": "time from arming in which the battery drains, unless both SIM_BAT have their defaults",
    "SIM_BAT_MIN_PCT": "charge at which that ends",
    "SIM_GPS_USED": "below 4 satellites the receiver has no fix",
    "SYS_FAILURE_EN": "0: INJECT_FAILURE is denied",
}

COPTER_SUPPORTED: Mapping[str, str] = MappingProxyType(
    {
        **_SHARED,
        "COM_DISARM_LAND": "time after a landing until disarming; 0: never",
        "COM_DISARM_PRFLT": "time after arming without a take-off until disarming; 0: never",
        "FLW_TGT_DST": "distance from a target that is followed",
        "FLW_TGT_FA": "angle from the course of that target; 180: behind it",
        "FLW_TGT_HT": "height over home while following",
        "FLW_TGT_MAX_VEL": "largest speed while following",
        "MIS_DIST_1WP": "largest distance to the first waypoint of a mission; 0: any",
        "MIS_TAKEOFF_ALT": "minimum height of a take-off",
        "MPC_ACC_DOWN_MAX": "largest acceleration down",
        "MPC_ACC_HOR": "acceleration in the plane",
        "MPC_ACC_UP_MAX": "largest acceleration up",
        "MPC_HOLD_DZ": "dead zone of the sticks",
        "MPC_JERK_AUTO": "largest jerk of the automatic modes",
        "MPC_LAND_ALT1": "height below which the landing becomes slower",
        "MPC_LAND_ALT2": "height at which it lands at MPC_LAND_SPEED",
        "MPC_LAND_ALT3": "height below which it lands at MPC_LAND_CRWL",
        "MPC_LAND_CRWL": "landing speed close to the ground",
        "MPC_LAND_SPEED": "landing speed",
        "MPC_MAN_Y_MAX": "the pilot's turn rate",
        "MPC_THR_HOVER": "thrust of a set-point that hovers",
        "MPC_TILTMAX_AIR": "largest lean",
        "MPC_TKO_RAMP_T": "time in which a take-off reaches its full speed",
        "MPC_TKO_SPEED": "climb of a take-off",
        "MPC_VEL_MANUAL": "the pilot's largest speed",
        "MPC_XY_CRUISE": "speed of the automatic modes",
        "MPC_XY_ERR_MAX": "distance behind its trajectory at which the trajectory waits",
        "MPC_XY_P": "gain on a position error in the plane",
        "MPC_XY_VEL_D_ACC": "gain on the derivative of the velocity in the plane",
        "MPC_XY_VEL_I_ACC": "gain on the integral of the velocity error in the plane",
        "MPC_XY_VEL_MAX": "largest speed in the plane",
        "MPC_XY_VEL_P_ACC": "gain on the velocity error in the plane",
        "MPC_YAWRAUTO_MAX": "largest rate of the heading set-point in the automatic modes",
        "MPC_Z_P": "gain on a height error",
        "MPC_Z_VEL_D_ACC": "gain on the derivative of the climb",
        "MPC_Z_VEL_I_ACC": "gain on the integral of the climb error",
        "MPC_Z_VEL_MAX_DN": "largest descent",
        "MPC_Z_VEL_MAX_UP": "largest climb",
        "MPC_Z_VEL_P_ACC": "gain on the climb error",
        "MPC_Z_V_AUTO_DN": "descent of the automatic modes, and landing speed while high",
        "MPC_Z_V_AUTO_UP": "climb of the automatic modes",
        "NAV_MC_ALT_RAD": "height error within which a waypoint is reached",
        "RTL_CONE_ANG": "lower return close to home; 0: always RTL_RETURN_ALT",
        "RTL_DESCEND_ALT": "height over home at which the landing begins",
        "RTL_MIN_DIST": "distance within which the cone counts",
        "RTL_RETURN_ALT": "height of the return",
    }
)
"""Parameters of a multirotor that have an effect, and what each changes."""

ROVER_SUPPORTED: Mapping[str, str] = MappingProxyType({**_SHARED, "GND_SPEED_TRIM": "speed"})
"""Parameters of a rover that have an effect, and what each changes."""


SLOWEST, FASTEST = 0.1, 100.0
"""Limits of speeds and accelerations [m/s, m/s^2]: no parameter value stops a manoeuvre."""

STICKS = StickMap(1, 2, 3, 4, (ChannelRange(1000, 1500, 2000, 0),) * 4)


def _moving(value: float) -> float:
    return min(FASTEST, max(SLOWEST, value))


def copter_tuning(parameters: VehicleParameters) -> ManoeuvreTuning:
    """Return the tuning of a multirotor."""
    p = parameters
    tilt = radians(min(80.0, max(5.0, p["MPC_TILTMAX_AIR"])))
    return ManoeuvreTuning(
        sticks=STICKS,
        speed=_moving(p["MPC_XY_VEL_MAX"]),
        speed_up=_moving(p["MPC_Z_VEL_MAX_UP"]),
        speed_down=_moving(p["MPC_Z_VEL_MAX_DN"]),
        accel=_moving(p["MPC_ACC_HOR"]),
        accel_z=_moving(min(p["MPC_ACC_UP_MAX"], p["MPC_ACC_DOWN_MAX"])),
        tilt=tilt,
        waypoint_radius=_moving(p["NAV_ACC_RAD"]),
        land_speed=_moving(p["MPC_LAND_SPEED"]),
        land_speed_high=_moving(p["MPC_Z_V_AUTO_DN"]),
        pilot_up=_moving(p["MPC_Z_VEL_MAX_UP"]),
        pilot_down=_moving(p["MPC_Z_VEL_MAX_DN"]),
        pilot_accel_z=_moving(min(p["MPC_ACC_UP_MAX"], p["MPC_ACC_DOWN_MAX"])),
        pilot_yaw_rate=radians(min(720.0, max(1.0, p["MPC_MAN_Y_MAX"]))),
        throttle_dead=p["MPC_HOLD_DZ"] / 2.0,
    )


def rover_tuning(parameters: VehicleParameters) -> ManoeuvreTuning:
    """Return the tuning of a rover."""
    p = parameters
    speed = _moving(p["GND_SPEED_TRIM"])
    return ManoeuvreTuning(
        sticks=STICKS,
        speed=speed,
        accel=2.0,
        waypoint_radius=_moving(p["NAV_ACC_RAD"]),
        return_speed=speed,
    )


def report_return_stage(vehicle: AutopilotVehicle, stage: str, amsl: float, above: float) -> None:
    """Report a stage of AUTO.RTL as status text and event.

    Args:
        vehicle: The vehicle.
        stage: ``climb``, ``return``, ``descend`` or ``land``.
        amsl: Altitude of the stage [m AMSL].
        above: The same above the destination [m].
    """
    if commander_of(vehicle).version.short_return:
        _report_short_return(vehicle, stage, amsl, above)
        return
    log = commander_of(vehicle).log
    figures = struct.pack("<iB", int(amsl), max(0, min(255, int(above))))
    heights = f"{int(amsl)} m ({int(above)} m above destination)\t"
    if stage == "climb":
        vehicle.send_text(INFO, "RTL HOME activated\t")
        log.send(event_interface.RETURN_ACTIVATED)
        if not vehicle.armed:
            return
        vehicle.send_text(INFO, "RTL: landing at home position.\t")
        vehicle.send_text(INFO, f"RTL: climb to {heights}")
        log.send(event_interface.RETURN_HOME)
        log.send(event_interface.RETURN_CLIMB, figures)
    elif stage == "return":
        vehicle.send_text(INFO, f"RTL: return at {heights}")
        log.send(event_interface.RETURN_FLY, figures)
    elif stage == "descend":
        vehicle.send_text(INFO, f"RTL: descend to {heights}")
        log.send(event_interface.RETURN_DESCEND, figures)
    else:
        vehicle.send_text(INFO, "RTL: land at destination\t")
        log.send(event_interface.RETURN_LAND)


def _report_short_return(vehicle: AutopilotVehicle, stage: str, amsl: float, above: float) -> None:
    """Report how high a return begins, and that it lands: no other stages, as newer versions."""
    log = commander_of(vehicle).log
    if stage == "climb":
        heights = ceil(amsl), ceil(above)
        vehicle.send_text(INFO, "RTL: start return at {} m ({} m above destination)\t".format(*heights))
        log.send(event_interface.RETURN_CLIMB, struct.pack("<ii", *heights))
    elif stage == "land":
        vehicle.send_text(INFO, "RTL: land at destination\t")
        log.send(event_interface.RETURN_LAND)


QUADROTOR = constant("MAV_TYPE_QUADROTOR")


def _take_off(vehicle: AutopilotVehicle) -> FlightManoeuvre:
    """Create the take-off to the commanded altitude, or to MIS_TAKEOFF_ALT above the vehicle."""
    commander = commander_of(vehicle)
    here = vehicle.estimate.geodetic[2]
    least = vehicle.parameters["MIS_TAKEOFF_ALT"]
    amsl = commander.takeoff_amsl
    if amsl is None or (commander.version.least_takeoff and amsl < here + least):
        amsl = here + least
        commander.minimum_height = least
        if vehicle.armed:
            commander.report_minimum_height()
    elif amsl < here:
        amsl = here
        vehicle.send_text(CRITICAL, "Already higher than takeoff altitude\t")
    return Px4TakeOff(vehicle, vehicle.estimate.origin[2] - amsl)


def _orbit(vehicle: AutopilotVehicle) -> FlightManoeuvre:
    centre, radius, speed = commander_of(vehicle).orbit or (vehicle.estimate.position, 5.0, 1.0)
    return Orbit(vehicle, centre, radius, speed)


COPTER_MODES = modes.mode_table(
    {
        modes.MANUAL: Stabilize,
        modes.ALTCTL: AltitudeControl,
        modes.POSCTL: PositionControl,
        modes.ORBIT: _orbit,
        modes.ACRO: Stabilize,
        modes.OFFBOARD: Offboard,
        modes.STABILIZE: Stabilize,
        modes.TAKEOFF: _take_off,
        modes.LOITER: Hold,
        modes.MISSION: lambda vehicle: FlyMission(
            vehicle, mission.leg, mission.MISSION_RULES, lambda _vehicle: True
        ),
        modes.RTL: lambda vehicle: Px4Return(vehicle, report_return_stage),
        modes.LAND: Descent,
        modes.FOLLOW: FollowTarget,
        modes.TERMINATION: FlightManoeuvre,
    },
    flies=True,
)


def _on_step(vehicle: AutopilotVehicle) -> None:
    on_step(vehicle)
    manoeuvre = vehicle.manoeuvre
    if vehicle.armed and not vehicle.landed and isinstance(manoeuvre, Px4TakeOff) and manoeuvre.arrived():
        _stay_here(vehicle)


def _stay_here(vehicle: AutopilotVehicle) -> None:
    """End the take-off: hold the position at which the end was detected."""
    here = vehicle.estimate.position
    commander_of(vehicle).continue_with(modes.LOITER)
    if isinstance(vehicle.manoeuvre, Hold):
        vehicle.manoeuvre.point = here


LANDED_AFTER = 2 * S
"""PX4's landed detector passes three states, each for LNDMC_TRIG_TIME; the first second is that of the
flight stack's detector. Logged of seven landings: 3.0 s."""


def table_of(
    version: Px4Version,
    defaults: Callable[[], tuple[StoredParameter, ...]],
    tuning: Callable[[VehicleParameters], ManoeuvreTuning],
    supported: Mapping[str, str],
) -> ParameterTable:
    """Return the parameters of one version: those that it has."""
    gone = version.gone_parameters()
    there = {name: what for name, what in supported.items() if name not in gone}
    return ParameterTable(defaults, tuning, own_parameters, there, version.renamed)


def copter(version: Px4Version) -> Firmware:
    """Return one version of the firmware for a multirotor."""
    return px4_firmware(
        kind="multirotor",
        modes=COPTER_MODES,
        arming=ArmingTimes(spool_up=1 * S, abandoned_after=1500 * MS, landed_after=LANDED_AFTER),
        parameters=table_of(version, cache(version.parameters), copter_tuning, COPTER_SUPPORTED),
        on_step=_on_step,
        endpoint=partial(MavlinkEndpoint, px4_mavlink(QUADROTOR, commands.COPTER_COMMANDS, version)),
        version=version,
    )


GROUND_ROVER = constant("MAV_TYPE_GROUND_ROVER")

ASSUMED = (StoredParameter("GND_SPEED_MAX", REAL32, 10.0), StoredParameter("GND_SPEED_TRIM", REAL32, 3.0))
"""Documented defaults of parameters that the recorded multirotor does not list."""


class HoldRover(FlightManoeuvre):
    """AUTO.LOITER: stand, or drive to a point."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._active: FlightManoeuvre = Stand(vehicle)

    def send_to(self, point: Vector) -> None:
        """Drive to a point and stand there."""
        self._active = DriveTo(self.vehicle, point)
        self.target = point

    def step(self) -> None:
        """Drive until the point is reached."""
        if isinstance(self._active, DriveTo) and self._active.arrived():
            self._active = Stand(self.vehicle)
        self._active.step()


class OffboardRover(FlightManoeuvre):
    """OFFBOARD: a point, or a speed over ground in a direction."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._active: FlightManoeuvre = Stand(vehicle)

    def enter(self) -> None:
        """Stand until a set-point arrives."""
        self.receive(commander_of(self.vehicle).stream.target)

    def receive(self, target: StreamTarget | None) -> None:
        """Follow a new set-point; attitudes are ignored."""
        if not isinstance(target, OffboardTarget):
            return
        north, east, _ = target.position
        if isfinite(north) and isfinite(east):
            self._drive_to((north, east, 0.0))
            return
        north, east, _ = (value if isfinite(value) else 0.0 for value in target.velocity)
        speed = hypot(north, east)
        turn = Turn(target.yaw, target.yaw_rate)
        self.target = None
        if speed < 0.05 and turn.rate is None:
            self._active = Stand(self.vehicle)
        else:
            if turn == Turn():
                turn = Turn(_course(north, east, self.vehicle.estimate.attitude[2]))
            self._active = FollowSpeed(self.vehicle, speed, turn)

    def _drive_to(self, point: Vector) -> None:
        if not isinstance(self._active, DriveTo) or self._active.point != point:
            self._active = DriveTo(self.vehicle, point)
        self.target = point

    def step(self) -> None:
        """Drive, and stand on a reached point."""
        active = self._active
        if isinstance(active, DriveTo) and active.arrived():
            Stand(self.vehicle).step()
        else:
            active.step()


def _course(north: float, east: float, otherwise: float) -> float:
    return atan2(east, north) if north or east else otherwise


class StickDrive(DriveBySticks):
    """MANUAL and POSCTL: sticks are steering and throttle; without them the rover brakes and stands."""

    def step(self) -> None:
        """Pass the sticks to the wheels, or brake."""
        if commander_of(self.vehicle).joystick.valid:
            super().step()
        else:
            accel = self.vehicle.tuning.accel
            self.vehicle.drive(Setpoint(Control.DRIVE, speed=self.vehicle.tuning.speed, accel=accel))


def on_reposition(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_REPOSITION with its flag."""
    point = commands.commanded_point(vehicle, command)
    if point is None or not vehicle.has_position:
        return DENIED
    if commands.to_integer(command.param2) != commands.CHANGE_MODE:
        return UNSUPPORTED
    commander_of(vehicle).restart_mode(modes.LOITER)
    if isinstance(vehicle.manoeuvre, HoldRover):
        vehicle.manoeuvre.send_to(point)
    return ACCEPTED


ROVER_COMMANDS: dict[int, Handler] = {**commands.SHARED_COMMANDS, commands.REPOSITION: on_reposition}

ROVER_MODES = modes.mode_table(
    {
        modes.MANUAL: StickDrive,
        modes.ALTCTL: StickDrive,
        modes.POSCTL: StickDrive,
        modes.ACRO: StickDrive,
        modes.OFFBOARD: OffboardRover,
        modes.STABILIZE: StickDrive,
        modes.TAKEOFF: HoldRover,
        modes.LOITER: HoldRover,
        modes.MISSION: lambda vehicle: FlyMission(
            vehicle, rover_leg, mission.MISSION_RULES, lambda _vehicle: True
        ),
        modes.RTL: ReturnRover,
        modes.LAND: Stand,
        modes.TERMINATION: Stand,
    },
    flies=False,
)


def rover_parameters(version: Px4Version) -> tuple[StoredParameter, ...]:
    """Return the multirotor's recorded parameters with a rover's MAV_TYPE and a rover's additions."""
    shared = (
        parameter._replace(value=float(GROUND_ROVER)) if parameter.name == "MAV_TYPE" else parameter
        for parameter in version.parameters()
    )
    return (*shared, *ASSUMED)


def rover(version: Px4Version) -> Firmware:
    """Return one version of the firmware for a rover."""
    return px4_firmware(
        kind="rover",
        modes=ROVER_MODES,
        parameters=table_of(
            version, cache(partial(rover_parameters, version)), rover_tuning, ROVER_SUPPORTED
        ),
        on_step=on_step,
        endpoint=partial(MavlinkEndpoint, px4_mavlink(GROUND_ROVER, ROVER_COMMANDS, version)),
        version=version,
    )
