"""ArduCopter: modes, arming checks and boot, composed as a firmware."""

from __future__ import annotations

from functools import cache, partial
from typing import Any

from volery.base.time import MS, S, from_seconds, to_seconds
from volery.simulation.autopilots.ardupilot import (
    boot,
    commands,
    follow,
    mission,
    pilot_input,
    telemetry,
    traffic,
)
from volery.simulation.autopilots.ardupilot.auxiliary import STOP_CHECKS, AuxiliaryFunctions
from volery.simulation.autopilots.ardupilot.avoidance import limit_copter, obstacle_problems
from volery.simulation.autopilots.ardupilot.buttons import read_buttons
from volery.simulation.autopilots.ardupilot.camera import update_camera
from volery.simulation.autopilots.ardupilot.crash_check import check_crash, lacks_motor
from volery.simulation.autopilots.ardupilot.estimator_sources import GLITCH_CHECK, watch_glitches
from volery.simulation.autopilots.ardupilot.failsafes import (
    BATTERY_FAILSAFES,
    COPTER_FAILSAFES,
    radio_never_received,
    radio_too_low,
)
from volery.simulation.autopilots.ardupilot.fence import FENCE_CHECKS, check_fence, respond_copter
from volery.simulation.autopilots.ardupilot.firmware import (
    ardupilot_mavlink,
    builders,
    own_parameters,
    send_version,
    streams,
    telemetry_policy,
)
from volery.simulation.autopilots.ardupilot.flip import Flip
from volery.simulation.autopilots.ardupilot.guided import (
    copter_attitude,
    copter_global,
    copter_local,
    strict_copter_attitude,
)
from volery.simulation.autopilots.ardupilot.landing_gear import watch_gear
from volery.simulation.autopilots.ardupilot.landing_sequence import leave_sequence
from volery.simulation.autopilots.ardupilot.modes import (
    COPTER_DISARMED,
    CUSTOM,
    GUIDED,
    INFO,
    MANUAL,
    SHARED_CHECKS,
    STABILIZED,
    Check,
    between_uptimes,
    disarm,
    failing_checks,
    in_other_modes,
    in_position_modes,
    mode_not_armable,
    sticks_not_neutral,
)
from volery.simulation.autopilots.ardupilot.motor_test import turn_tested_motor
from volery.simulation.autopilots.ardupilot.mount import update_mount
from volery.simulation.autopilots.ardupilot.mount_control import on_other_position
from volery.simulation.autopilots.ardupilot.parameter_checks import copter_problems
from volery.simulation.autopilots.ardupilot.parameters import COPTER_SUPPORTED, copter_tuning
from volery.simulation.autopilots.ardupilot.precision_landing import (
    aim,
    on_landing_target,
    precision_rows,
    update_target,
)
from volery.simulation.autopilots.ardupilot.proximity import PROXIMITY_CHECK, log_rows, update_proximity
from volery.simulation.autopilots.ardupilot.rally import return_point
from volery.simulation.autopilots.ardupilot.range_finder import follow_ground, height_above_ground
from volery.simulation.autopilots.ardupilot.sensor_status import POSITION_KEPT, XY_CONTROL, Z_CONTROL, Health
from volery.simulation.autopilots.ardupilot.servo_outputs import pass_transmitter_through
from volery.simulation.autopilots.ardupilot.sprayer import update_sprayer
from volery.simulation.autopilots.ardupilot.takeoff_check import check_takeoff
from volery.simulation.autopilots.ardupilot.telemetry import ACTIVE, CRITICAL, STANDBY
from volery.simulation.autopilots.ardupilot.throw import Throw
from volery.simulation.autopilots.ardupilot.versions import Version
from volery.simulation.autopilots.ardupilot.weathervane import turn_into_wind
from volery.simulation.autopilots.ardupilot.winch import no_servo, update_winch
from volery.simulation.autopilots.autopilot import BootSequence, Firmware, PeriodicWork
from volery.simulation.autopilots.autopilot_parameters import Parameter, load
from volery.simulation.autopilots.flight_stack.flight import Setpoint
from volery.simulation.autopilots.manoeuvres.guided_flight import Guided, GuidedAttitude
from volery.simulation.autopilots.manoeuvres.manual_flight import (
    Acro,
    AltitudeHold,
    CircleMode,
    Drift,
    Loiter,
    ManualFlight,
    ReturnAlongTrack,
    Stabilize,
)
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FlyMission, MissionRules
from volery.simulation.autopilots.manoeuvres.to_point import Brake, Land, Return
from volery.simulation.autopilots.manoeuvres.zigzag import ZigZag
from volery.simulation.autopilots.mavlink.endpoint import MavlinkEndpoint
from volery.simulation.autopilots.mavlink.firmware import LinkStart
from volery.simulation.autopilots.onboard_log import LogRow
from volery.simulation.autopilots.onboard_mission import DO_AUX_FUNCTION
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import (
    ArmingTimes,
    Mode,
    ParameterTable,
    RcDefaults,
    StartupTimes,
    Vehicle,
    VehicleRules,
)

QUADROTOR = 2
"""MAV_TYPE."""

CAPABILITIES = 64_495
"""MAV_PROTOCOL_CAPABILITY bits, as recorded."""

MANUAL_BITS = CUSTOM | STABILIZED | MANUAL
AUTO_BITS = MANUAL_BITS | GUIDED
"""``base_mode`` of a disarmed vehicle, as recorded."""
LEVEL_AND_HEIGHT = XY_CONTROL | Z_CONTROL

TICK = 100 * MS
READY = round(2.28 * S)
ORIGIN = round(19.852 * S)
POSITION = round(41.45 * S)
EACH_SECOND = round(0.285 * S)

ARMING_TEXTS = ("Arming motors", COPTER_DISARMED)
LANDED_TO_DISARM = 200 * MS
"""Recorded: disarming 2.07 s after touch-down, most of it in the landed detector."""
RUDDER_HOLD = 2 * S
OPTION_MODES = {
    2: 14,
    4: 6,
    16: 3,
    18: 9,
    33: 17,
    42: 21,
    52: 1,
    55: 4,
    56: 5,
    57: 23,
    68: 0,
    69: 16,
    70: 2,
    72: 7,
    73: 11,
    99: 27,
}
"""RCn_OPTION to the number of the mode that its switch enters."""
ALIGNS_ABOVE = 2.5
"""Height of the in-flight yaw alignment [m]."""

FRAME_NAMES = {4: "QUAD", 6: "HEXA", 8: "OCTA"}
"""Name of the frame class by the number of rotors."""

MODES = {
    mode.number: mode
    for mode in (
        Mode(0, "STABILIZE", MANUAL_BITS, Stabilize, pilot=True, manual_throttle=True),
        Mode(2, "ALT_HOLD", MANUAL_BITS, AltitudeHold, Z_CONTROL, pilot=True),
        Mode(
            3,
            "AUTO",
            AUTO_BITS,
            lambda vehicle: FlyMission(vehicle, mission.leg_of_copter, COPTER_MISSION, mission.leaves_ground),
            LEVEL_AND_HEIGHT,
            needs_position=True,
            armable=False,
            starts_high=True,
        ),
        Mode(
            27,
            "AUTO_RTL",
            AUTO_BITS,
            lambda vehicle: FlyMission(vehicle, mission.leg_of_copter, COPTER_MISSION, mission.leaves_ground),
            LEVEL_AND_HEIGHT,
            needs_position=True,
            armable=False,
            starts_high=True,
        ),
        Mode(
            4,
            "GUIDED",
            AUTO_BITS,
            Guided,
            LEVEL_AND_HEIGHT,
            needs_position=True,
            user_takeoff=True,
            starts_high=True,
        ),
        Mode(
            5,
            "LOITER",
            AUTO_BITS,
            Loiter,
            LEVEL_AND_HEIGHT,
            needs_position=True,
            pilot=True,
            user_takeoff=True,
        ),
        Mode(6, "RTL", AUTO_BITS, Return, LEVEL_AND_HEIGHT, needs_position=True, armable=False),
        Mode(9, "LAND", MANUAL_BITS, Land, LEVEL_AND_HEIGHT, armable=False),
        Mode(1, "ACRO", MANUAL_BITS, Acro, pilot=True, manual_throttle=True),
        Mode(7, "CIRCLE", AUTO_BITS, CircleMode, LEVEL_AND_HEIGHT, needs_position=True, armable=False),
        Mode(11, "DRIFT", MANUAL_BITS, Drift, needs_position=True, pilot=True, manual_throttle=True),
        Mode(14, "FLIP", MANUAL_BITS, Flip, armable=False),
        Mode(16, "POSHOLD", AUTO_BITS, Loiter, LEVEL_AND_HEIGHT, True, pilot=True, user_takeoff=True),
        Mode(18, "THROW", MANUAL_BITS, Throw, needs_position=True, manual_throttle=True),
        Mode(19, "AVOID_ADSB", AUTO_BITS, Guided, LEVEL_AND_HEIGHT, needs_position=True, armable=False),
        Mode(20, "GUIDED_NOGPS", MANUAL_BITS, GuidedAttitude, Z_CONTROL, starts_high=True),
        Mode(21, "SMART_RTL", AUTO_BITS, ReturnAlongTrack, LEVEL_AND_HEIGHT, True, armable=False),
        Mode(23, "FOLLOW", AUTO_BITS, follow.Follow, LEVEL_AND_HEIGHT, needs_position=True, armable=False),
        Mode(24, "ZIGZAG", AUTO_BITS, ZigZag, LEVEL_AND_HEIGHT, needs_position=True, pilot=True),
        Mode(17, "BRAKE", AUTO_BITS, Brake, LEVEL_AND_HEIGHT, needs_position=True, armable=False),
    )
}

CHECKS = (
    Check("GCS failsafe on", lambda vehicle: "station" in vehicle.failsafes.active),
    Check("Need Alt Estimate", in_position_modes(0.0, 5.7)),
    Check("Gyros not healthy", between_uptimes(0.0, 1.8)),
    Check("Accels inconsistent", between_uptimes(1.8, 11.5)),
    Check("Gyros inconsistent", between_uptimes(11.5, 22.35)),
    Check("EKF attitude is bad", between_uptimes(0.0, 5.6)),
    Check("Compass not healthy", between_uptimes(0.0, 2.4)),
    Check("AHRS: EKF3 not started", in_other_modes(0.0, 4.28)),
    Check("AHRS: waiting for home", in_position_modes(0.0, 19.852)),
    Check("Battery 1 unhealthy", between_uptimes(0.0, 2.4)),
    Check("RC not found", radio_never_received),
    Check("Throttle below failsafe", radio_too_low),
    Check("winch unhealthy", no_servo),
    *SHARED_CHECKS,
    Check("Battery failsafe", lambda vehicle: not BATTERY_FAILSAFES.isdisjoint(vehicle.failsafes.active)),
    *FENCE_CHECKS,
    GLITCH_CHECK,
    PROXIMITY_CHECK,
    traffic.TRAFFIC_CHECK,
    *STOP_CHECKS,
)

HEALTH = Health(0x5371FC2F, 0x53619C2F, 0x57719C2F, round(22.0 * S), round(22.0 * S))


def failing_prearm_checks(vehicle: Vehicle) -> list[str]:
    """Return the texts of the pre-arm checks that fail."""
    return failing_checks(vehicle, CHECKS, lambda one: copter_problems(one) + obstacle_problems(one))


def arming_problems(vehicle: Vehicle, *, by_rudder: bool = False) -> list[str]:
    """Return the texts of all checks that forbid arming now: pre-arm checks, else mode or sticks."""
    found = failing_prearm_checks(vehicle)
    may_arm_auto = vehicle.mode.name == "AUTO" and round(vehicle.parameters["AUTO_OPTIONS"]) & 1
    if not found and not may_arm_auto:
        found = mode_not_armable(vehicle)
    if found or not vehicle.parameters["ARMING_CHECK"]:
        return found
    if not vehicle.mode.starts_high and _throttle_is_high(vehicle):
        return ["Throttle too high"]
    return sticks_not_neutral(vehicle, by_rudder=by_rudder)


def _throttle_is_high(vehicle: Vehicle) -> bool:
    sticks = ManualFlight(vehicle)
    throttle = sticks.pilot.throttle
    return sticks.climb(throttle) > 0.0 or (vehicle.mode.manual_throttle and throttle > 0.0)


AUXILIARY = AuxiliaryFunctions(OPTION_MODES, arming_problems, ARMING_TEXTS)
COPTER_MISSION: MissionRules = mission.copter_rules({DO_AUX_FUNCTION: AUXILIARY.act})


def finish_setup(vehicle: Vehicle) -> None:
    """Finish the set-up: on the ground, in the mode that INITIAL_MODE names."""
    vehicle.ground.landed = True
    initial = MODES.get(round(vehicle.parameters["INITIAL_MODE"]), MODES[0])
    if initial is not vehicle.mode:
        vehicle.enter_mode(initial)


def start_warm(vehicle: Vehicle) -> None:
    """Bring a warm vehicle to the state after its boot, except for the position."""
    boot.store_parameters(vehicle, (*boot.COPTER_GYROS, *boot.COPTER_PRESSURE))
    boot.skip_elevation(vehicle)
    pilot_input.keep_mode(vehicle, "FLTMODE_CH")
    finish_setup(vehicle)


def on_step(vehicle: Vehicle) -> None:
    """Expire overrides, and disarm automatically after a landing or without a take-off."""
    pilot_input.on_step(vehicle)
    boot.find_home(vehicle)
    watch_glitches(vehicle)
    if not pilot_input.sticks_rest(vehicle):
        pilot_input.read_mode_switch(vehicle, "FLTMODE_CH", "FLTMODE")
        pilot_input.read_rudder(vehicle, partial(arming_problems, by_rudder=True), ARMING_TEXTS, RUDDER_HOLD)
        AUXILIARY.read_switches(vehicle)
    read_buttons(vehicle, AUXILIARY)
    pass_transmitter_through(vehicle)
    update_sprayer(vehicle)
    update_camera(vehicle)
    update_mount(vehicle, TICK)
    update_winch(vehicle, TICK)
    watch_gear(vehicle)
    leave_sequence(vehicle)
    pilot_input.keep_track(vehicle)
    check_fence(vehicle, respond_copter)
    update_proximity(vehicle)
    update_target(vehicle)
    traffic.update_traffic(vehicle)
    check_takeoff(vehicle)
    commands.continue_turn(vehicle, to_seconds(TICK))
    turn_into_wind(vehicle, TICK)
    if turn_tested_motor(vehicle) or not vehicle.armed:
        return
    _disarm_stopped_motors(vehicle)
    if not vehicle.landed:
        vehicle.ground.idle_since = vehicle.kernel.now()
        vehicle.ground.flight_time += TICK
        _notice_flight(vehicle)
        check_crash(vehicle)
    else:
        _disarm_automatically(vehicle)


def _notice_flight(vehicle: Vehicle) -> None:
    height = vehicle.height
    if height > ALIGNS_ABOVE and "aligned" not in vehicle.reports.sent_once:
        vehicle.reports.sent_once.add("aligned")
        for text in boot.for_both_units("EKF3 IMU{unit} MAG0 in-flight yaw alignment complete"):
            vehicle.send_text(INFO, text)
    if height < 1.0:
        truth = vehicle.flight.truth()
        if truth.contacts != vehicle.reports.contacts:
            vehicle.reports.contacts = truth.contacts
            vehicle.send_text(INFO, f"SIM Hit ground at {truth.contact_speed:.6f} m/s")


def _disarm_stopped_motors(vehicle: Vehicle) -> None:
    """Disarm, also in flight, once a switch has kept the motors from turning for half of DISARM_DELAY."""
    stopped, delay = vehicle.switches.motors_stopped_at, vehicle.parameters["DISARM_DELAY"]
    since = max(stopped, vehicle.arming.armed_at)
    if stopped != NEVER and delay > 0.0 and vehicle.kernel.now() - since >= from_seconds(delay / 2.0):
        disarm(vehicle, COPTER_DISARMED, force=True)


def _disarm_automatically(vehicle: Vehicle) -> None:
    now = vehicle.kernel.now()
    finished = vehicle.mode.name == "LAND" or (
        vehicle.mode.name in ("RTL", "SMART_RTL") and vehicle.manoeuvre.landing
    )
    if finished and now - vehicle.ground.landed_at >= LANDED_TO_DISARM:
        disarm(vehicle, COPTER_DISARMED, force=True)
        return
    if vehicle.mode.name == "THROW" or ManualFlight(vehicle).pilot.throttle > 0.0:
        vehicle.ground.idle_since = now
    delay = vehicle.parameters["DISARM_DELAY"]
    if delay > 0.0 and now - vehicle.ground.idle_since >= from_seconds(delay):
        disarm(vehicle, COPTER_DISARMED, force=True)


def system_status(vehicle: Vehicle) -> int:
    """Return the MAV_STATE: failsafe, on the ground or flying."""
    if vehicle.failsafes.active:
        return CRITICAL
    return STANDBY if vehicle.landed else ACTIVE


def send_banner(vehicle: Vehicle, version: Version) -> None:
    """Send the status texts that follow a parameter list request."""
    shape = {0: "PLUS", 1: "X"}.get(round(vehicle.parameters["FRAME_TYPE"]), "X")
    send_version(vehicle, "ArduCopter", version)
    vehicle.send_text(INFO, f"Frame: {FRAME_NAMES[vehicle.flight.rotors]}/{shape}")


@cache
def parameters() -> tuple[Parameter, ...]:
    """Return the recorded parameters."""
    return load("volery.simulation.autopilots.ardupilot", "data/copter.parameters")


def _on_other_position(vehicle: Vehicle, fields: dict[str, Any], sender: int) -> None:
    """Handle GLOBAL_POSITION_INT of another system, which the copter or its mount may follow, or avoid."""
    follow.on_position(vehicle, fields, sender)
    on_other_position(vehicle, fields, sender)
    traffic.on_position(vehicle, fields, sender)


def limit(vehicle: Vehicle, setpoint: Setpoint) -> Setpoint:
    """Return the set-point that is given: over ground and target below, and within avoidance."""
    return limit_copter(vehicle, follow_ground(vehicle, aim(vehicle, setpoint)))


def log_extras(vehicle: Vehicle) -> tuple[LogRow, ...]:
    """Return what the log has beside the samples of every firmware."""
    return (*log_rows(vehicle), *precision_rows(vehicle))


def copter(version: Version) -> Firmware:
    """Return ArduCopter in one version."""
    mavlink = ardupilot_mavlink(
        version=version,
        start=LinkStart(
            boot_bytes=boot.bytes_at(
                (0.0, boot.banner("ArduCopter", version)),
                (1.75, b"Init Gyro"),
                (2.01, b"*"),
                (2.037, b"*"),
                (2.28, b"\n"),
            ),
            heartbeat_first=(round(1.05 * S),),
            heartbeat_from=round(2.037 * S),
        ),
        sent=telemetry_policy(
            messages={
                **builders(version, QUADROTOR, CAPABILITIES, HEALTH, system_status),
                "ESC_TELEMETRY_1_TO_4": telemetry.esc_telemetry,
                "TERRAIN_REPORT": telemetry.terrain_report,
                "WIND": telemetry.wind,
                **({"ATTITUDE_TARGET": telemetry.attitude_target} if version.sends_attitude_target else {}),
            },
            streams=streams((), ("WIND", "TERRAIN_REPORT", "ESC_TELEMETRY_1_TO_4")),
        ),
        commands={
            **commands.copter_commands(
                arming_problems,
                failing_prearm_checks,
                ARMING_TEXTS,
                {mode.name: mode.number for mode in MODES.values()},
            ),
            DO_AUX_FUNCTION: AUXILIARY.on_command,
        },
        handlers={
            "ADSB_VEHICLE": traffic.on_adsb,
            "FOLLOW_TARGET": follow.on_target,
            "GLOBAL_POSITION_INT": _on_other_position,
            "LANDING_TARGET": on_landing_target,
            "SET_ATTITUDE_TARGET": strict_copter_attitude if version.rates_all_or_none else copter_attitude,
            "SET_POSITION_TARGET_GLOBAL_INT": copter_global,
            "SET_POSITION_TARGET_LOCAL_NED": copter_local,
        },
        on_parameter_list=partial(send_banner, version=version),
    )
    return Firmware(
        name="ardupilot",
        kind="multirotor",
        rules=VehicleRules(
            modes=MODES,
            boot_mode=MODES[0],
            return_point=return_point,
            height_above_ground=height_above_ground,
            limit=limit,
            position_kept=POSITION_KEPT,
            senses_ground=lambda vehicle: vehicle.estimate.landed and not lacks_motor(vehicle),
            log_extras=log_extras,
            startup=StartupTimes(READY, ORIGIN, POSITION, POSITION),
            arming=ArmingTimes(
                motors_rest=2 * S, spool_up=500 * MS, takeoff_slew=100 * MS, abandoned_after=1500 * MS
            ),
            parameters=ParameterTable(
                parameters, copter_tuning, own_parameters, COPTER_SUPPORTED, version.renamed
            ),
            rc=RcDefaults((1500, 1500, 1000, 1500, 1800, 1000, 1000, 1800, 0, 0, 0, 0, 0, 0, 0, 0)),
        ),
        boot=BootSequence(
            boot.copter_events(version, finish_setup),
            start_warm,
            partial(boot.on_position, before_arming=failing_prearm_checks),
        ),
        periodic=PeriodicWork(
            tick=TICK,
            on_step=on_step,
            each_second=partial(boot.each_second, before_arming=failing_prearm_checks),
            each_second_from=EACH_SECOND,
        ),
        failsafes=COPTER_FAILSAFES,
        endpoint=partial(MavlinkEndpoint, mavlink),
    )
