"""ArduRover: modes, arming checks and boot, composed as a firmware."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import cache, partial

from volery.base.time import MS, S
from volery.simulation.autopilots.ardupilot import boot, commands, mission, pilot_input, telemetry
from volery.simulation.autopilots.ardupilot.auxiliary import read_switches
from volery.simulation.autopilots.ardupilot.failsafes import ROVER_FAILSAFES
from volery.simulation.autopilots.ardupilot.feature import TICK, ArmingCheck, Feature, build_of
from volery.simulation.autopilots.ardupilot.firmware import (
    ALL,
    MESSAGE_HANDLERS,
    ardupilot_mavlink,
    build_firmware,
    builders,
    parameter_table,
    send_version,
    streams,
    telemetry_policy,
)
from volery.simulation.autopilots.ardupilot.guided import rover_attitude, rover_global, rover_local
from volery.simulation.autopilots.ardupilot.modes import (
    ATTITUDE_CONTROL,
    CUSTOM,
    GUIDED,
    MANUAL,
    RATE_CONTROL,
    SHARED_CHECKS,
    STABILIZED,
    XY_CONTROL,
    YAW_CONTROL,
    between_uptimes,
    failing_prearm_checks,
    mode_not_armable,
    sticks_not_neutral,
)
from volery.simulation.autopilots.ardupilot.parameters import ROVER_PARAMETERS, rover_tuning
from volery.simulation.autopilots.ardupilot.sensor_status import POSITION_KEPT, Health
from volery.simulation.autopilots.ardupilot.telemetry import (
    ACTIVE,
    CALIBRATING,
    CRITICAL,
    STANDBY,
    nav_controller,
)
from volery.simulation.autopilots.ardupilot.versions import ArduPilotVersion
from volery.simulation.autopilots.autopilot import BootSequence, Firmware, PeriodicWork
from volery.simulation.autopilots.autopilot_parameters import StoredParameter, load
from volery.simulation.autopilots.manoeuvres.manual_flight import (
    ReturnAlongTrack,
    RoverHold,
    Simple,
    Steering,
)
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FlyMission, Leg
from volery.simulation.autopilots.manoeuvres.rover_driving import (
    DriveBySticks,
    GuidedRover,
    ReturnRover,
    Stand,
    rover_leg,
)
from volery.simulation.autopilots.mavlink.endpoint import MavlinkEndpoint
from volery.simulation.autopilots.mavlink.firmware import LinkStart
from volery.simulation.autopilots.mavlink.messages import Fields
from volery.simulation.autopilots.onboard_mission import MissionItem
from volery.simulation.autopilots.vehicle_state import (
    AutopilotVehicle,
    Mode,
    RcDefaults,
    StartupTimes,
    VehicleRules,
)
from volery.trace.events import INFO, WARNING

GROUND_ROVER = 10
"""MAV_TYPE."""

CAPABILITIES = 61_935
"""MAV_PROTOCOL_CAPABILITY bits, as recorded."""

AUTO_BITS = CUSTOM | GUIDED
STEERED = RATE_CONTROL | ATTITUDE_CONTROL | YAW_CONTROL | XY_CONTROL

READY = round(2.355 * S)
HOME = round(10.36 * S)
POSITION = round(42.08 * S)

ARMING_TEXTS = ("Throttle armed", "Throttle disarmed")


RUDDER_HOLD = 3 * S
OPTION_MODES = {4: 11, 16: 10, 42: 12, 51: 0, 52: 1, 53: 3, 54: 4, 55: 15, 56: 5, 59: 7}
"""RCn_OPTION to the number of the mode that its switch enters."""


def guided_arrived(vehicle: AutopilotVehicle) -> None:
    """Report a reached guided target as the firmware does, as mission item 0."""
    vehicle.output.send_event("MISSION_ITEM_REACHED", {"seq": 0})


def guided_stale(vehicle: AutopilotVehicle) -> None:
    """Report that no target was received for three seconds."""
    vehicle.send_text(WARNING, "target not received last 3secs, stopping")


def returned(vehicle: AutopilotVehicle) -> None:
    """Report the end of a return."""
    vehicle.send_text(INFO, "Reached destination")


def leg(vehicle: AutopilotVehicle, item: MissionItem, goes_on: bool) -> Leg:
    """Return the leg of an item."""
    return mission.leg_of_feature(vehicle, item) or rover_leg(vehicle, item, goes_on)


MODES = (
    Mode(0, "MANUAL", CUSTOM | MANUAL, DriveBySticks, pilot=True),
    Mode(1, "ACRO", CUSTOM | STABILIZED, Steering, STEERED, needs_position=True, pilot=True),
    Mode(3, "STEERING", CUSTOM | STABILIZED, Steering, STEERED, needs_position=True, pilot=True),
    Mode(4, "HOLD", CUSTOM, Stand),
    Mode(5, "LOITER", AUTO_BITS, RoverHold, STEERED, needs_position=True),
    Mode(7, "SIMPLE", CUSTOM | MANUAL, Simple, pilot=True),
    Mode(12, "SMART_RTL", AUTO_BITS, ReturnAlongTrack, STEERED, needs_position=True, armable=False),
    Mode(
        10,
        "AUTO",
        AUTO_BITS,
        lambda vehicle: FlyMission(vehicle, leg, mission.ROVER_MISSION),
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

INITIALISING = Mode(16, "INITIALISING", CUSTOM | MANUAL, Stand, armable=False)

CHECKS = (
    ArmingCheck("Gyros not healthy", between_uptimes(0.0, 1.85)),
    ArmingCheck("Accels inconsistent", between_uptimes(1.85, 11.5)),
    ArmingCheck("Gyros inconsistent", between_uptimes(11.5, 22.4)),
    ArmingCheck("Compass not healthy", between_uptimes(0.0, 2.4)),
    ArmingCheck("AHRS: waiting for home", between_uptimes(0.0, 10.36)),
    ArmingCheck("Battery 1 unhealthy", between_uptimes(0.0, 2.4)),
    *SHARED_CHECKS,
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


def arming_problems(vehicle: AutopilotVehicle, *, by_rudder: bool = False) -> list[str]:
    """Return the texts of all checks that forbid arming now."""
    found = failing_prearm_checks(vehicle) + mode_not_armable(vehicle)
    if found or not vehicle.parameters["ARMING_CHECK"]:
        return found
    return sticks_not_neutral(vehicle, by_rudder=by_rudder)


def finish_setup(vehicle: AutopilotVehicle) -> None:
    """Finish the set-up: enter the mode that INITIAL_MODE names."""
    modes = vehicle.rules.modes
    vehicle.enter_mode(modes.get(round(vehicle.parameters["INITIAL_MODE"]), MODES[0]))


def start_warm(vehicle: AutopilotVehicle) -> None:
    """Bring a warm vehicle to the state after its boot, except for the position."""
    boot.store_parameters(vehicle, (*boot.ROVER_GYROS, *boot.ROVER_PRESSURE))
    boot.skip_reports(vehicle)
    pilot_input.keep_mode(vehicle, "MODE_CH")
    finish_setup(vehicle)


def on_step(vehicle: AutopilotVehicle) -> None:
    """Read the transmitter, let the features work, and count the driving time, at each tick."""
    pilot_input.on_step(vehicle)
    boot.find_home(vehicle)
    if not pilot_input.sticks_rest(vehicle):
        pilot_input.read_mode_switch(vehicle, "MODE_CH", "MODE")
        pilot_input.read_rudder(vehicle, RUDDER_HOLD)
        read_switches(vehicle)
    pilot_input.mix_steering(vehicle)
    pilot_input.keep_track(vehicle)
    for work in build_of(vehicle).ticks:
        work(vehicle)
    if vehicle.armed:
        vehicle.ground.flight_time += TICK


def system_status(vehicle: AutopilotVehicle) -> int:
    """Return the MAV_STATE: failsafe, starting, holding or driving."""
    if vehicle.failsafes.active:
        return CRITICAL
    if vehicle.mode is INITIALISING:
        return CALIBRATING
    return STANDBY if vehicle.mode.name == "HOLD" else ACTIVE


def send_banner(vehicle: AutopilotVehicle, version: ArduPilotVersion) -> None:
    """Send the status texts that follow a parameter list request."""
    send_version(vehicle, "ArduRover", version)


def on_stream_request(vehicle: AutopilotVehicle, index: int, stream: int, rate: int) -> None:
    """Store the requested stream rates in parameters."""
    names = STREAM_PARAMETERS.values() if stream == ALL else [STREAM_PARAMETERS[stream]]
    for name in names:
        vehicle.set_parameter(vehicle.parameters.name(f"SR{index}_{name}"), rate)


def navigation(vehicle: AutopilotVehicle) -> Fields | None:
    """Return NAV_CONTROLLER_OUTPUT in modes that steer automatically."""
    return nav_controller(vehicle) if vehicle.mode.controls else None


@cache
def parameters() -> tuple[StoredParameter, ...]:
    """Return the recorded and documented parameters."""
    return load("volery.simulation.autopilots.ardupilot", "data/rover.parameters")


CORE = Feature(
    parameters=ROVER_PARAMETERS,
    modes=MODES,
    mode_switches=OPTION_MODES,
    commands=commands.ROVER_COMMANDS,
    messages={
        **MESSAGE_HANDLERS,
        "SET_ATTITUDE_TARGET": rover_attitude,
        "SET_POSITION_TARGET_GLOBAL_INT": rover_global,
        "SET_POSITION_TARGET_LOCAL_NED": rover_local,
    },
    items=mission.ITEMS,
    checks=CHECKS,
)
"""What ArduRover has without features, in every version."""


def rover(version: ArduPilotVersion, optional: Collection[str]) -> Firmware:
    """Return ArduRover in one version, with some features beside those that are on by default."""
    core = replace(
        CORE,
        telemetry={
            **builders(version, GROUND_ROVER, CAPABILITIES, HEALTH, system_status),
            "NAV_CONTROLLER_OUTPUT": navigation,
            "RC_CHANNELS_SCALED": telemetry.rc_channels_scaled,
        },
    )
    build = build_firmware(core, "ROVER", optional, arming_problems, ARMING_TEXTS)
    mavlink = ardupilot_mavlink(
        version=version,
        build=build,
        start=LinkStart(
            boot_bytes=boot.bytes_at(
                (0.0, boot.banner("ArduRover", version)), (1.83, b"Init Gyro"), (2.0, b"*"), (2.35, b"*\n")
            ),
            heartbeat_first=(round(1.025 * S),),
            heartbeat_from=round(3.04 * S),
        ),
        sent=telemetry_policy(
            build,
            streams(("RC_CHANNELS_SCALED",), ()),
            on_stream_request=on_stream_request,
            least_period=25 * MS,
        ),
        on_parameter_list=partial(send_banner, version=version),
    )
    return Firmware(
        name="ardupilot",
        kind="rover",
        rules=VehicleRules(
            modes=build.modes,
            boot_mode=INITIALISING,
            return_point=build.return_point,
            height_above_ground=build.height_above_ground,
            limit=build.limit,
            position_kept=POSITION_KEPT,
            log_extras=build.log_rows,
            firmware_state=lambda _vehicle: build,
            startup=StartupTimes(READY, HOME, POSITION, HOME),
            parameters=parameter_table(build, optional, version, parameters, rover_tuning),
            rc=RcDefaults(
                (1500, 1500, 1500, 1500, 1800, 1000, 1000, 1800, 0, 0, 0, 0, 0, 0, 0, 0),
                True,
                can_be_lost=True,
            ),
        ),
        boot=BootSequence(boot.rover_events(version, finish_setup), start_warm, boot.on_position),
        periodic=PeriodicWork(
            tick=TICK,
            on_step=on_step,
            each_second=boot.each_second,
            each_second_from=round(0.345 * S),
        ),
        failsafes=ROVER_FAILSAFES,
        endpoint=partial(MavlinkEndpoint, mavlink),
    )
