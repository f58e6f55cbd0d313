"""ArduRover: modes, arming checks and boot, composed as a firmware."""

from __future__ import annotations

from functools import cache, partial

from volery.base.time import MS, S
from volery.simulation.autopilots.ardupilot import boot, commands, mission, pilot_input, telemetry
from volery.simulation.autopilots.ardupilot.auxiliary import STOP_CHECKS, AuxiliaryFunctions
from volery.simulation.autopilots.ardupilot.avoidance import limit_rover
from volery.simulation.autopilots.ardupilot.buttons import read_buttons
from volery.simulation.autopilots.ardupilot.camera import update_camera
from volery.simulation.autopilots.ardupilot.estimator_sources import watch_glitches
from volery.simulation.autopilots.ardupilot.failsafes import ROVER_FAILSAFES
from volery.simulation.autopilots.ardupilot.fence import FENCE_CHECKS, check_fence, respond_rover
from volery.simulation.autopilots.ardupilot.firmware import (
    ALL,
    ardupilot_mavlink,
    builders,
    own_parameters,
    send_version,
    streams,
    telemetry_policy,
)
from volery.simulation.autopilots.ardupilot.guided import rover_attitude, rover_global, rover_local
from volery.simulation.autopilots.ardupilot.guided_items import rover_guided_leg
from volery.simulation.autopilots.ardupilot.modes import (
    CUSTOM,
    GUIDED,
    INFO,
    MANUAL,
    ROVER_DISARMED,
    SHARED_CHECKS,
    STABILIZED,
    WARNING,
    Check,
    between_uptimes,
    failing_checks,
    mode_not_armable,
    sticks_not_neutral,
)
from volery.simulation.autopilots.ardupilot.motor_test import drive_tested_output
from volery.simulation.autopilots.ardupilot.mount import update_mount
from volery.simulation.autopilots.ardupilot.parameter_checks import source_problems
from volery.simulation.autopilots.ardupilot.parameters import ROVER_SUPPORTED, rover_tuning
from volery.simulation.autopilots.ardupilot.proximity import PROXIMITY_CHECK, log_rows, update_proximity
from volery.simulation.autopilots.ardupilot.rally import return_point
from volery.simulation.autopilots.ardupilot.sensor_status import (
    ATTITUDE_CONTROL,
    POSITION_KEPT,
    RATE_CONTROL,
    XY_CONTROL,
    YAW_CONTROL,
    Health,
)
from volery.simulation.autopilots.ardupilot.servo_outputs import pass_transmitter_through
from volery.simulation.autopilots.ardupilot.sprayer import update_sprayer
from volery.simulation.autopilots.ardupilot.telemetry import (
    ACTIVE,
    CALIBRATING,
    CRITICAL,
    STANDBY,
    nav_controller,
)
from volery.simulation.autopilots.ardupilot.versions import Version
from volery.simulation.autopilots.autopilot import BootSequence, Firmware, PeriodicWork
from volery.simulation.autopilots.autopilot_parameters import Parameter, load
from volery.simulation.autopilots.manoeuvres.manual_flight import (
    HoldPlace,
    ReturnAlongTrack,
    Simple,
    Steering,
)
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FlyMission, Leg, MissionRules
from volery.simulation.autopilots.manoeuvres.rover_driving import (
    GuidedRover,
    Manual,
    ReturnRover,
    Stand,
    rover_leg,
)
from volery.simulation.autopilots.mavlink.endpoint import MavlinkEndpoint
from volery.simulation.autopilots.mavlink.firmware import LinkStart
from volery.simulation.autopilots.mavlink.messages import Fields
from volery.simulation.autopilots.onboard_mission import DO_AUX_FUNCTION, GUIDED_ENABLE, MissionItem
from volery.simulation.autopilots.vehicle_state import (
    Mode,
    ParameterTable,
    RcDefaults,
    StartupTimes,
    Vehicle,
    VehicleRules,
)

GROUND_ROVER = 10
"""MAV_TYPE."""

CAPABILITIES = 61_935
"""MAV_PROTOCOL_CAPABILITY bits, as recorded."""

AUTO_BITS = CUSTOM | GUIDED
STEERED = RATE_CONTROL | ATTITUDE_CONTROL | YAW_CONTROL | XY_CONTROL

TICK = 100 * MS
READY = round(2.355 * S)
HOME = round(10.36 * S)
POSITION = round(42.08 * S)

ARMING_TEXTS = ("Throttle armed", ROVER_DISARMED)


RUDDER_HOLD = 3 * S
OPTION_MODES = {4: 11, 16: 10, 42: 12, 51: 0, 52: 1, 53: 3, 54: 4, 55: 15, 56: 5, 59: 7}
"""RCn_OPTION to the number of the mode that its switch enters."""


def guided_arrived(vehicle: Vehicle) -> None:
    """Report a reached guided target as the firmware does, as mission item 0."""
    vehicle.output.send_event("MISSION_ITEM_REACHED", {"seq": 0})


def guided_stale(vehicle: Vehicle) -> None:
    """Report that no target was received for three seconds."""
    vehicle.send_text(WARNING, "target not received last 3secs, stopping")


def returned(vehicle: Vehicle) -> None:
    """Report the end of a return."""
    vehicle.send_text(INFO, "Reached destination")


def leg(vehicle: Vehicle, item: MissionItem, goes_on: bool) -> Leg:
    """Return the leg of an item."""
    if item.command == GUIDED_ENABLE:
        return rover_guided_leg(vehicle, item, guided_arrived, guided_stale)
    return rover_leg(vehicle, item, goes_on)


MODES = {
    mode.number: mode
    for mode in (
        Mode(0, "MANUAL", CUSTOM | MANUAL, Manual, pilot=True),
        Mode(1, "ACRO", CUSTOM | STABILIZED, Steering, STEERED, needs_position=True, pilot=True),
        Mode(3, "STEERING", CUSTOM | STABILIZED, Steering, STEERED, needs_position=True, pilot=True),
        Mode(4, "HOLD", CUSTOM, Stand),
        Mode(5, "LOITER", AUTO_BITS, HoldPlace, STEERED, needs_position=True),
        Mode(7, "SIMPLE", CUSTOM | MANUAL, Simple, pilot=True),
        Mode(12, "SMART_RTL", AUTO_BITS, ReturnAlongTrack, STEERED, needs_position=True, armable=False),
        Mode(
            10,
            "AUTO",
            AUTO_BITS,
            lambda vehicle: FlyMission(vehicle, leg, ROVER_MISSION),
            STEERED,
            needs_position=True,
        ),
        Mode(
            11,
            "RTL",
            AUTO_BITS,
            lambda vehicle: ReturnRover(vehicle, returned),
            STEERED,
            needs_position=True,
            armable=False,
        ),
        Mode(
            15,
            "GUIDED",
            AUTO_BITS,
            lambda vehicle: GuidedRover(vehicle, guided_arrived, guided_stale),
            STEERED,
            needs_position=True,
        ),
    )
}

INITIALISING = Mode(16, "INITIALISING", CUSTOM | MANUAL, Stand, armable=False)

CHECKS = (
    Check("Gyros not healthy", between_uptimes(0.0, 1.85)),
    Check("Accels inconsistent", between_uptimes(1.85, 11.5)),
    Check("Gyros inconsistent", between_uptimes(11.5, 22.4)),
    Check("Compass not healthy", between_uptimes(0.0, 2.4)),
    Check("AHRS: waiting for home", between_uptimes(0.0, 10.36)),
    Check("Battery 1 unhealthy", between_uptimes(0.0, 2.4)),
    *SHARED_CHECKS,
    *FENCE_CHECKS,
    PROXIMITY_CHECK,
    *STOP_CHECKS,
)

HEALTH = Health(0x1330DC2F, 0x1320802F, 0x1330812F, round(22.4 * S), round(42.0 * S))

STREAM_PARAMETERS = {
    1: "RAW_SENS",
    2: "EXT_STAT",
    3: "RC_CHAN",
    4: "RAW_CTRL",
    6: "POSITION",
    10: "EXTRA1",
    11: "EXTRA2",
    12: "EXTRA3",
    13: "ADSB",
}
"""Suffix of the parameter that stores the rate of each MAV_DATA_STREAM."""


def failing_prearm_checks(vehicle: Vehicle) -> list[str]:
    """Return the texts of the pre-arm checks that fail."""
    return failing_checks(vehicle, CHECKS, source_problems)


def arming_problems(vehicle: Vehicle, *, by_rudder: bool = False) -> list[str]:
    """Return the texts of all checks that forbid arming now."""
    found = failing_prearm_checks(vehicle) + mode_not_armable(vehicle)
    if found or not vehicle.parameters["ARMING_CHECK"]:
        return found
    return sticks_not_neutral(vehicle, by_rudder=by_rudder)


AUXILIARY = AuxiliaryFunctions(OPTION_MODES, arming_problems, ARMING_TEXTS)
ROVER_MISSION: MissionRules = mission.rover_rules({DO_AUX_FUNCTION: AUXILIARY.act})


def finish_setup(vehicle: Vehicle) -> None:
    """Finish the set-up: enter the mode that INITIAL_MODE names."""
    vehicle.enter_mode(MODES.get(round(vehicle.parameters["INITIAL_MODE"]), MODES[0]))


def start_warm(vehicle: Vehicle) -> None:
    """Bring a warm vehicle to the state after its boot, except for the position."""
    boot.store_parameters(vehicle, (*boot.ROVER_GYROS, *boot.ROVER_PRESSURE))
    boot.skip_elevation(vehicle)
    pilot_input.keep_mode(vehicle, "MODE_CH")
    finish_setup(vehicle)


def on_step(vehicle: Vehicle) -> None:
    """Expire overrides and count the driving time, at each tick."""
    pilot_input.on_step(vehicle)
    boot.find_home(vehicle)
    watch_glitches(vehicle)
    if not pilot_input.sticks_rest(vehicle):
        pilot_input.read_mode_switch(vehicle, "MODE_CH", "MODE")
        pilot_input.read_rudder(vehicle, partial(arming_problems, by_rudder=True), ARMING_TEXTS, RUDDER_HOLD)
        AUXILIARY.read_switches(vehicle)
    read_buttons(vehicle, AUXILIARY)
    pilot_input.mix_steering(vehicle)
    pass_transmitter_through(vehicle)
    update_sprayer(vehicle)
    update_camera(vehicle)
    update_mount(vehicle, TICK)
    pilot_input.keep_track(vehicle)
    check_fence(vehicle, respond_rover)
    update_proximity(vehicle)
    drive_tested_output(vehicle, ROVER_DISARMED)
    if vehicle.armed:
        vehicle.ground.flight_time += TICK


def system_status(vehicle: Vehicle) -> int:
    """Return the MAV_STATE: failsafe, starting, holding or driving."""
    if vehicle.failsafes.active:
        return CRITICAL
    if vehicle.mode is INITIALISING:
        return CALIBRATING
    return STANDBY if vehicle.mode.name == "HOLD" else ACTIVE


def send_banner(vehicle: Vehicle, version: Version) -> None:
    """Send the status texts that follow a parameter list request."""
    send_version(vehicle, "ArduRover", version)


def on_stream_request(vehicle: Vehicle, index: int, stream: int, rate: int) -> None:
    """Store the requested stream rates in parameters."""
    names = STREAM_PARAMETERS.values() if stream == ALL else [STREAM_PARAMETERS[stream]]
    for name in names:
        vehicle.set_parameter(vehicle.parameters.name(f"SR{index}_{name}"), rate)


def navigation(vehicle: Vehicle) -> Fields | None:
    """Return NAV_CONTROLLER_OUTPUT in modes that steer automatically."""
    return nav_controller(vehicle) if vehicle.mode.controls else None


@cache
def parameters() -> tuple[Parameter, ...]:
    """Return the recorded and documented parameters."""
    return load("volery.simulation.autopilots.ardupilot", "data/rover.parameters")


def rover(version: Version) -> Firmware:
    """Return ArduRover in one version."""
    mavlink = ardupilot_mavlink(
        version=version,
        start=LinkStart(
            boot_bytes=boot.bytes_at(
                (0.0, boot.banner("ArduRover", version)), (1.83, b"Init Gyro"), (2.0, b"*"), (2.35, b"*\n")
            ),
            heartbeat_first=(round(1.025 * S),),
            heartbeat_from=round(3.04 * S),
        ),
        sent=telemetry_policy(
            messages={
                **builders(version, GROUND_ROVER, CAPABILITIES, HEALTH, system_status),
                "NAV_CONTROLLER_OUTPUT": navigation,
                "RC_CHANNELS_SCALED": telemetry.rc_channels_scaled,
            },
            streams=streams(("RC_CHANNELS_SCALED",), ()),
            on_stream_request=on_stream_request,
            least_period=25 * MS,
        ),
        commands={
            **commands.rover_commands(
                arming_problems,
                failing_prearm_checks,
                ARMING_TEXTS,
                {mode.name: mode.number for mode in MODES.values()},
            ),
            DO_AUX_FUNCTION: AUXILIARY.on_command,
        },
        handlers={
            "SET_ATTITUDE_TARGET": rover_attitude,
            "SET_POSITION_TARGET_GLOBAL_INT": rover_global,
            "SET_POSITION_TARGET_LOCAL_NED": rover_local,
        },
        on_parameter_list=partial(send_banner, version=version),
    )
    return Firmware(
        name="ardupilot",
        kind="rover",
        rules=VehicleRules(
            modes=MODES,
            boot_mode=INITIALISING,
            return_point=return_point,
            limit=limit_rover,
            position_kept=POSITION_KEPT,
            log_extras=log_rows,
            startup=StartupTimes(READY, HOME, POSITION, HOME),
            parameters=ParameterTable(
                parameters, rover_tuning, own_parameters, ROVER_SUPPORTED, version.renamed
            ),
            rc=RcDefaults((1500, 1500, 1500, 1500, 1800, 1000, 1000, 1800, 0, 0, 0, 0, 0, 0, 0, 0), True),
        ),
        boot=BootSequence(
            boot.rover_events(version, finish_setup),
            start_warm,
            partial(boot.on_position, before_arming=failing_prearm_checks),
        ),
        periodic=PeriodicWork(
            tick=TICK,
            on_step=on_step,
            each_second=partial(boot.each_second, before_arming=failing_prearm_checks),
            each_second_from=round(0.345 * S),
        ),
        failsafes=ROVER_FAILSAFES,
        endpoint=partial(MavlinkEndpoint, mavlink),
    )
