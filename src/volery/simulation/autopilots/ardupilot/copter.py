"""ArduCopter: modes, arming checks and boot, composed as a firmware."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import cache, partial

from volery.base.time import MS, S, from_seconds, to_seconds
from volery.links.mavlink_messages import constant
from volery.simulation.autopilots.ardupilot import (
    boot,
    commands,
    mission,
    pilot_input,
    telemetry,
)
from volery.simulation.autopilots.ardupilot.auxiliary import read_switches
from volery.simulation.autopilots.ardupilot.failsafes import (
    BATTERY_FAILSAFES,
    COPTER_FAILSAFES,
    conditions_of,
    radio_never_received,
    radio_too_low,
)
from volery.simulation.autopilots.ardupilot.feature import TICK, ArmingCheck, Feature, build_of
from volery.simulation.autopilots.ardupilot.firmware import (
    MESSAGE_HANDLERS,
    ardupilot_mavlink,
    build_firmware,
    builders,
    parameter_table,
    send_version,
    streams,
    telemetry_policy,
)
from volery.simulation.autopilots.ardupilot.guided import (
    copter_attitude,
    copter_global,
    copter_local,
    strict_copter_attitude,
)
from volery.simulation.autopilots.ardupilot.modes import (
    AUTO_BITS,
    LEVEL_AND_HEIGHT,
    MANUAL_BITS,
    SHARED_CHECKS,
    Z_CONTROL,
    between_uptimes,
    disarm,
    failing_prearm_checks,
    in_other_modes,
    in_position_modes,
    mode_not_armable,
    reports_of,
    sticks_not_neutral,
)
from volery.simulation.autopilots.ardupilot.parameters import COPTER_PARAMETERS, copter_tuning
from volery.simulation.autopilots.ardupilot.sensor_status import POSITION_KEPT, Health
from volery.simulation.autopilots.ardupilot.telemetry import ACTIVE, CRITICAL, STANDBY
from volery.simulation.autopilots.ardupilot.versions import ArduPilotVersion
from volery.simulation.autopilots.autopilot import BootSequence, Firmware, PeriodicWork
from volery.simulation.autopilots.autopilot_parameters import StoredParameter, load
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
from volery.simulation.autopilots.manoeuvres.to_point import Brake, DescendAndLand, ReturnAndLand
from volery.simulation.autopilots.manoeuvres.zigzag import ZigZag
from volery.simulation.autopilots.mavlink.endpoint import MavlinkEndpoint
from volery.simulation.autopilots.mavlink.firmware import LinkStart
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import (
    ArmingTimes,
    AutopilotVehicle,
    Mode,
    RcDefaults,
    StartupTimes,
    VehicleRules,
)
from volery.trace.events import INFO

QUADROTOR = constant("MAV_TYPE_QUADROTOR")

CAPABILITIES = 64_495
"""MAV_PROTOCOL_CAPABILITY bits, as recorded."""

READY = round(2.28 * S)
ORIGIN = round(19.852 * S)
POSITION = round(41.45 * S)
EACH_SECOND = round(0.285 * S)

ARMING_TEXTS = ("Arming motors", "Disarming motors")
LANDED_TO_DISARM = 800 * MS
"""Time in which the motors spool down. Recorded: disarming 2.07 s after touch-down, 1.3 s of it in the landed
detector."""
RUDDER_HOLD = 2 * S
OPTION_MODES = {
    4: 6,
    16: 3,
    18: 9,
    33: 17,
    42: 21,
    52: 1,
    55: 4,
    56: 5,
    68: 0,
    69: 16,
    70: 2,
    72: 7,
    73: 11,
}
"""RCn_OPTION to the number of the mode that its switch enters."""
ALIGNS_ABOVE = 2.5
"""Height of the in-flight yaw alignment [m]."""

FRAME_NAMES = {4: "QUAD", 6: "HEXA", 8: "OCTA"}
"""Name of the frame class by the number of rotors."""

MODES = (
    Mode(0, "STABILIZE", MANUAL_BITS, Stabilize, pilot=True, manual_throttle=True),
    Mode(2, "ALT_HOLD", MANUAL_BITS, AltitudeHold, Z_CONTROL, pilot=True),
    Mode(
        3,
        "AUTO",
        AUTO_BITS,
        mission.fly_mission,
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
    Mode(6, "RTL", AUTO_BITS, ReturnAndLand, LEVEL_AND_HEIGHT, needs_position=True, armable=False),
    Mode(9, "LAND", MANUAL_BITS, DescendAndLand, LEVEL_AND_HEIGHT, armable=False),
    Mode(1, "ACRO", MANUAL_BITS, Acro, pilot=True, manual_throttle=True),
    Mode(7, "CIRCLE", AUTO_BITS, CircleMode, LEVEL_AND_HEIGHT, needs_position=True, armable=False),
    Mode(11, "DRIFT", MANUAL_BITS, Drift, needs_position=True, pilot=True, manual_throttle=True),
    Mode(16, "POSHOLD", AUTO_BITS, Loiter, LEVEL_AND_HEIGHT, True, pilot=True, user_takeoff=True),
    Mode(20, "GUIDED_NOGPS", MANUAL_BITS, GuidedAttitude, Z_CONTROL, starts_high=True),
    Mode(21, "SMART_RTL", AUTO_BITS, ReturnAlongTrack, LEVEL_AND_HEIGHT, True, armable=False),
    Mode(24, "ZIGZAG", AUTO_BITS, ZigZag, LEVEL_AND_HEIGHT, needs_position=True, pilot=True),
    Mode(17, "BRAKE", AUTO_BITS, Brake, LEVEL_AND_HEIGHT, needs_position=True, armable=False),
)

CHECKS = (
    ArmingCheck("GCS failsafe on", lambda vehicle: "station" in vehicle.failsafes.active),
    ArmingCheck("Need Alt Estimate", in_position_modes(0.0, 5.7)),
    ArmingCheck("Gyros not healthy", between_uptimes(0.0, 1.8)),
    ArmingCheck("Accels inconsistent", between_uptimes(1.8, 11.5)),
    ArmingCheck("Gyros inconsistent", between_uptimes(11.5, 22.35)),
    ArmingCheck("EKF attitude is bad", between_uptimes(0.0, 5.6)),
    ArmingCheck("Compass not healthy", between_uptimes(0.0, 2.4)),
    ArmingCheck("AHRS: EKF3 not started", in_other_modes(0.0, 4.28)),
    ArmingCheck("AHRS: waiting for home", in_position_modes(0.0, 19.852)),
    ArmingCheck("Battery 1 unhealthy", between_uptimes(0.0, 2.4)),
    ArmingCheck("RC not found", radio_never_received),
    ArmingCheck("Throttle below failsafe", radio_too_low),
    *SHARED_CHECKS,
    ArmingCheck(
        "Battery failsafe", lambda vehicle: not BATTERY_FAILSAFES.isdisjoint(vehicle.failsafes.active)
    ),
)

HEALTH = Health(0x5371FC2F, 0x53619C2F, 0x57719C2F, round(22.0 * S), round(22.0 * S))


def arming_problems(vehicle: AutopilotVehicle, *, by_rudder: bool = False) -> list[str]:
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


def _throttle_is_high(vehicle: AutopilotVehicle) -> bool:
    sticks = ManualFlight(vehicle)
    throttle = sticks.pilot.throttle
    return sticks.climb(throttle) > 0.0 or (vehicle.mode.manual_throttle and throttle > 0.0)


def _initial_mode(vehicle: AutopilotVehicle) -> Mode:
    return vehicle.rules.modes.get(round(vehicle.parameters["INITIAL_MODE"]), MODES[0])


def finish_setup(vehicle: AutopilotVehicle) -> None:
    """Finish the set-up: on the ground, in the mode that INITIAL_MODE names."""
    vehicle.ground.landed = True
    initial = _initial_mode(vehicle)
    if initial is not vehicle.mode:
        vehicle.enter_mode(initial)


def start_warm(vehicle: AutopilotVehicle) -> None:
    """Bring a warm vehicle to the state after its boot, except for the position."""
    boot.store_parameters(vehicle, (*boot.COPTER_GYROS, *boot.COPTER_PRESSURE))
    boot.skip_reports(vehicle)
    pilot_input.keep_mode(vehicle, "FLTMODE_CH")
    finish_setup(vehicle)


def on_step(vehicle: AutopilotVehicle) -> None:
    """Read the transmitter, let the features work, and disarm automatically, at each tick."""
    pilot_input.on_step(vehicle)
    boot.find_home(vehicle)
    if not pilot_input.sticks_rest(vehicle):
        pilot_input.read_mode_switch(vehicle, "FLTMODE_CH", "FLTMODE")
        pilot_input.read_rudder(vehicle, RUDDER_HOLD)
        read_switches(vehicle)
    pilot_input.keep_track(vehicle)
    commands.continue_turn(vehicle, to_seconds(TICK))
    for work in build_of(vehicle).ticks:
        work(vehicle)
    if conditions_of(vehicle).suspended or not vehicle.armed:
        return
    _disarm_stopped_motors(vehicle)
    if not vehicle.landed:
        vehicle.ground.idle_since = vehicle.kernel.now()
        vehicle.ground.flight_time += TICK
        _notice_flight(vehicle)
    else:
        _disarm_automatically(vehicle)


def _notice_flight(vehicle: AutopilotVehicle) -> None:
    height = vehicle.height
    if height > ALIGNS_ABOVE and "aligned" not in vehicle.reports.sent_once:
        vehicle.reports.sent_once.add("aligned")
        for text in boot.for_both_units("EKF3 IMU{unit} MAG0 in-flight yaw alignment complete"):
            vehicle.send_text(INFO, text)
    if height < 1.0:
        truth = vehicle.flight.truth()
        if truth.contacts != reports_of(vehicle).contacts:
            reports_of(vehicle).contacts = truth.contacts
            vehicle.send_text(INFO, f"SIM Hit ground at {truth.contact_speed:.6f} m/s")


def _disarm_stopped_motors(vehicle: AutopilotVehicle) -> None:
    """Disarm, also in flight, once a switch has kept the motors from turning for half of DISARM_DELAY."""
    stopped, delay = vehicle.arming.motors_stopped_at, vehicle.parameters["DISARM_DELAY"]
    since = max(stopped, vehicle.arming.armed_at)
    if stopped != NEVER and delay > 0.0 and vehicle.kernel.now() - since >= from_seconds(delay / 2.0):
        disarm(vehicle, force=True)


def _disarm_automatically(vehicle: AutopilotVehicle) -> None:
    now = vehicle.kernel.now()
    finished = vehicle.mode.name == "LAND" or (
        vehicle.mode.name in ("RTL", "SMART_RTL") and vehicle.manoeuvre.landing
    )
    if finished and now - vehicle.ground.landed_at >= LANDED_TO_DISARM:
        disarm(vehicle, force=True)
        return
    if vehicle.manoeuvre.starts_at_once or ManualFlight(vehicle).pilot.throttle > 0.0:
        vehicle.ground.idle_since = now
    delay = vehicle.parameters["DISARM_DELAY"]
    if delay > 0.0 and now - vehicle.ground.idle_since >= from_seconds(delay):
        disarm(vehicle, force=True)


def system_status(vehicle: AutopilotVehicle) -> int:
    """Return the MAV_STATE: failsafe, on the ground or flying."""
    if vehicle.failsafes.active:
        return CRITICAL
    return STANDBY if vehicle.landed else ACTIVE


def send_banner(vehicle: AutopilotVehicle, version: ArduPilotVersion) -> None:
    """Send the status texts that follow a parameter list request."""
    shape = {0: "PLUS", 1: "X"}.get(round(vehicle.parameters["FRAME_TYPE"]), "X")
    send_version(vehicle, "ArduCopter", version)
    vehicle.send_text(INFO, f"Frame: {FRAME_NAMES[vehicle.flight.rotors]}/{shape}")


@cache
def parameters() -> tuple[StoredParameter, ...]:
    """Return the recorded parameters."""
    return load("volery.simulation.autopilots.ardupilot", "data/copter.parameters")


CORE = Feature(
    parameters=COPTER_PARAMETERS,
    modes=MODES,
    mode_switches=OPTION_MODES,
    avoiding=("LOITER", "GUIDED", "ZIGZAG"),
    tumbling=("ACRO",),
    commands=commands.COPTER_COMMANDS,
    messages={
        **MESSAGE_HANDLERS,
        "SET_POSITION_TARGET_GLOBAL_INT": copter_global,
        "SET_POSITION_TARGET_LOCAL_NED": copter_local,
    },
    items=mission.ITEMS,
    checks=CHECKS,
)
"""What ArduCopter has without features, in every version."""


def copter(version: ArduPilotVersion, optional: Collection[str]) -> Firmware:
    """Return ArduCopter in one version, with some features beside those that are on by default."""
    target = {"ATTITUDE_TARGET": telemetry.attitude_target} if version.sends_attitude_target else {}
    attitude = strict_copter_attitude if version.rates_all_or_none else copter_attitude
    core = replace(
        CORE,
        messages={**CORE.messages, "SET_ATTITUDE_TARGET": attitude},
        telemetry={
            **builders(version, QUADROTOR, CAPABILITIES, HEALTH, system_status),
            "TERRAIN_REPORT": telemetry.terrain_report,
            "WIND": telemetry.wind,
            **target,
        },
    )
    build = build_firmware(core, "COPTER", optional, arming_problems, ARMING_TEXTS)
    mavlink = ardupilot_mavlink(
        version=version,
        build=build,
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
        sent=telemetry_policy(build, streams((), ("WIND", "TERRAIN_REPORT", "ESC_TELEMETRY_1_TO_4"))),
        on_parameter_list=partial(send_banner, version=version),
    )
    return Firmware(
        name="ardupilot",
        kind="multirotor",
        rules=VehicleRules(
            modes=build.modes,
            boot_mode=MODES[0],
            return_point=build.return_point,
            height_above_ground=build.height_above_ground,
            limit=build.limit,
            position_kept=POSITION_KEPT,
            senses_ground=lambda vehicle: vehicle.estimate.landed and not pilot_input.lacks_motor(vehicle),
            log_extras=build.log_rows,
            firmware_state=lambda _vehicle: build,
            startup=StartupTimes(READY, ORIGIN, POSITION, POSITION),
            arming=ArmingTimes(
                motors_rest=2 * S, spool_up=500 * MS, takeoff_slew=100 * MS, abandoned_after=1500 * MS
            ),
            parameters=parameter_table(build, optional, version, parameters, copter_tuning),
            rc=RcDefaults(
                (1500, 1500, 1000, 1500, 1800, 1000, 1000, 1800, 0, 0, 0, 0, 0, 0, 0, 0), can_be_lost=True
            ),
        ),
        boot=BootSequence(boot.copter_events(version, finish_setup), start_warm, boot.on_position),
        periodic=PeriodicWork(
            tick=TICK,
            on_step=on_step,
            each_second=boot.each_second,
            each_second_from=EACH_SECOND,
        ),
        failsafes=COPTER_FAILSAFES,
        endpoint=partial(MavlinkEndpoint, mavlink),
    )
