"""MAVLink tables that ArduPilot's copter and rover share: messages, telemetry streams, answers to requests.

Fence and rally points are served in their deprecated messages, too.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache, partial
from typing import Any

from volery.base.time import MS, Ns, S
from volery.simulation.autopilots.ardupilot import (
    dataflash,
    fence_points,
    files,
    mission,
    pilot_input,
    telemetry,
)
from volery.simulation.autopilots.ardupilot.battery import battery_status
from volery.simulation.autopilots.ardupilot.commands import go_to_item
from volery.simulation.autopilots.ardupilot.feature import ArmingProblems, Feature, FeatureSet
from volery.simulation.autopilots.ardupilot.features import absent, features_of
from volery.simulation.autopilots.ardupilot.modes import set_mode
from volery.simulation.autopilots.ardupilot.parameters import LEAST_HOVER, MOST_HOVER
from volery.simulation.autopilots.ardupilot.sensor_status import Health, sys_status
from volery.simulation.autopilots.ardupilot.versions import ArduPilotVersion
from volery.simulation.autopilots.autopilot_parameters import (
    ManoeuvreTuning,
    StoredParameter,
    VehicleParameters,
)
from volery.simulation.autopilots.flight_stack.flight import Flight, hover_collective
from volery.simulation.autopilots.mavlink import messages
from volery.simulation.autopilots.mavlink.channel import Peer
from volery.simulation.autopilots.mavlink.firmware import (
    Builder,
    CommandPolicy,
    LinkStart,
    MavlinkFirmware,
    MessageHandler,
    MissionPolicy,
    ParameterPolicy,
    QuestionHandler,
    TelemetryPolicy,
)
from volery.simulation.autopilots.mavlink.log_service import LogPolicy
from volery.simulation.autopilots.mavlink.messages import (
    ACCEPTED,
    DENIED,
    FAILED,
    Command,
    vehicle_type,
)
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, ParameterTable, VehicleAction
from volery.simulation.world.body_specs import Multirotor
from volery.trace.events import INFO

SEND_BANNER = 42_428


def on_terrain_check(_vehicle: AutopilotVehicle, fields: dict[str, Any], sender: Peer) -> None:
    """Handle TERRAIN_CHECK: there is no terrain data on board."""
    sender.send("TERRAIN_REPORT", {"lat": fields["lat"], "lon": fields["lon"], "spacing": 0, "pending": 0})


def accepts(vehicle: AutopilotVehicle, name: str, system: int) -> bool:
    """Return whether a message called *name* from a system counts: SYSID_ENFORCE admits SYSID_MYGCS only.

    The vehicle's own components and the state of the radio always count.
    """
    if not vehicle.parameters["SYSID_ENFORCE"] or name in ("RADIO", "RADIO_STATUS"):
        return True
    return system in (vehicle.system, round(vehicle.parameters["SYSID_MYGCS"]))


PRIVATE = 1 << 10
"""Bit of SERIALn_OPTIONS."""
SERIAL_PORTS = range(1, 8)


def private_links(vehicle: AutopilotVehicle) -> frozenset[int]:
    """Return the numbers of the links that SERIALn_OPTIONS makes private."""
    options = ((port, round(vehicle.parameters[f"SERIAL{port}_OPTIONS"])) for port in SERIAL_PORTS)
    return frozenset(port for port, value in options if value & PRIVATE)


def _questions(sent: TelemetryPolicy, build: FeatureSet) -> dict[str, QuestionHandler]:
    """Return the handlers by message; *sent* builds AUTOPILOT_VERSION."""

    def on_version(vehicle: AutopilotVehicle, _fields: dict[str, Any], sender: Peer) -> None:
        for version in sent.build("AUTOPILOT_VERSION", vehicle):
            sender.send("AUTOPILOT_VERSION", version)

    return {
        "AUTOPILOT_VERSION_REQUEST": on_version,
        "TERRAIN_CHECK": on_terrain_check,
        **build.questions,
    }


RAW_SENSORS, EXTENDED_STATUS, RC_CHANNELS, RAW_CONTROLLER, POSITION = 1, 2, 3, 4, 6
EXTRA1, EXTRA2, EXTRA3, ALL = 10, 11, 12, 0
"""MAV_DATA_STREAM."""


def never_sent(_vehicle: AutopilotVehicle) -> None:
    """Return None: the firmware knows the message and has no reason to send it."""
    return


BUILDERS: Mapping[str, Builder] = {
    "AHRS": telemetry.ahrs,
    "AHRS2": telemetry.ahrs2,
    "ATTITUDE": messages.attitude,
    "ATTITUDE_QUATERNION": messages.attitude_quaternion,
    "BATTERY_STATUS": battery_status,
    "EKF_STATUS_REPORT": telemetry.ekf_status,
    "EXTENDED_SYS_STATE": telemetry.extended_sys_state,
    "GLOBAL_POSITION_INT": telemetry.global_position,
    "GPS_GLOBAL_ORIGIN": telemetry.origin,
    "GPS_RAW_INT": telemetry.gps_raw,
    "HOME_POSITION": telemetry.home_position,
    "LOCAL_POSITION_NED": telemetry.local_position,
    "MEMINFO": telemetry.meminfo,
    "MISSION_CURRENT": telemetry.mission_current,
    "NAV_CONTROLLER_OUTPUT": telemetry.nav_controller,
    "POSITION_TARGET_GLOBAL_INT": telemetry.position_target,
    "POSITION_TARGET_LOCAL_NED": telemetry.local_target,
    "POWER_STATUS": telemetry.power_status,
    "RAW_IMU": telemetry.raw_imu,
    "RC_CHANNELS": telemetry.rc_channels,
    "RC_CHANNELS_RAW": telemetry.rc_channels_raw,
    "SCALED_IMU2": telemetry.scaled_imu2,
    "SCALED_IMU3": telemetry.scaled_imu3,
    "SCALED_PRESSURE": telemetry.pressure,
    "SCALED_PRESSURE2": telemetry.pressure,
    "SERVO_OUTPUT_RAW": telemetry.servo_output,
    "SIMSTATE": telemetry.simstate,
    "SYSTEM_TIME": telemetry.system_time,
    "VFR_HUD": telemetry.vfr_hud,
    "VIBRATION": telemetry.vibration,
    **dict.fromkeys(
        (
            "ADSB_VEHICLE",
            "AOA_SSA",
            "EFI_STATUS",
            "GENERATOR_STATUS",
            "GPS2_RAW",
            "GPS2_RTK",
            "GPS_RTK",
            "HYGROMETER_SENSOR",
            "MAG_CAL_PROGRESS",
            "MAG_CAL_REPORT",
            "MCU_STATUS",
            "OPTICAL_FLOW",
            "PID_TUNING",
            "RPM",
            "SCALED_PRESSURE3",
            "WINCH_STATUS",
        ),
        never_sent,
    ),
}

ORDER: Sequence[str] = (
    "ATTITUDE",
    "ATTITUDE_QUATERNION",
    "ATTITUDE_TARGET",
    "GLOBAL_POSITION_INT",
    "HOME_POSITION",
    "GPS_GLOBAL_ORIGIN",
    "SYS_STATUS",
    "POWER_STATUS",
    "MEMINFO",
    "NAV_CONTROLLER_OUTPUT",
    "MISSION_CURRENT",
    "VFR_HUD",
    "SERVO_OUTPUT_RAW",
    "RC_CHANNELS",
    "RC_CHANNELS_RAW",
    "RAW_IMU",
    "SCALED_IMU2",
    "SCALED_IMU3",
    "SCALED_PRESSURE",
    "SCALED_PRESSURE2",
    "GPS_RAW_INT",
    "FENCE_STATUS",
    "SYSTEM_TIME",
    "RC_CHANNELS_SCALED",
    "AHRS",
    "SIMSTATE",
    "AHRS2",
    "WIND",
    "RANGEFINDER",
    "DISTANCE_SENSOR",
    "TERRAIN_REPORT",
    "EKF_STATUS_REPORT",
    "LOCAL_POSITION_NED",
    "VIBRATION",
    "POSITION_TARGET_GLOBAL_INT",
    "POSITION_TARGET_LOCAL_NED",
    "BATTERY_STATUS",
    "GIMBAL_DEVICE_ATTITUDE_STATUS",
    "ESC_TELEMETRY_1_TO_4",
    "EXTENDED_SYS_STATE",
)
"""Order of the messages within one burst, as recorded."""


def streams(controller: Sequence[str], extra: Sequence[str]) -> dict[int, tuple[str, ...]]:
    """Return the messages of each MAV_DATA_STREAM.

    Args:
        controller: Messages that one kind of vehicle adds to RAW_CONTROLLER.
        extra: Messages that one kind of vehicle adds to EXTRA3.
    """
    groups: dict[int, tuple[str, ...]] = {
        RAW_SENSORS: ("RAW_IMU", "SCALED_IMU2", "SCALED_IMU3", "SCALED_PRESSURE", "SCALED_PRESSURE2"),
        EXTENDED_STATUS: (
            "SYS_STATUS",
            "POWER_STATUS",
            "MEMINFO",
            "NAV_CONTROLLER_OUTPUT",
            "MISSION_CURRENT",
            "GPS_RAW_INT",
            "FENCE_STATUS",
            "POSITION_TARGET_GLOBAL_INT",
        ),
        RC_CHANNELS: ("SERVO_OUTPUT_RAW", "RC_CHANNELS"),
        RAW_CONTROLLER: tuple(controller),
        POSITION: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
        EXTRA1: ("ATTITUDE", "SIMSTATE", "AHRS2"),
        EXTRA2: ("VFR_HUD",),
        EXTRA3: (
            "SYSTEM_TIME",
            "AHRS",
            "RANGEFINDER",
            "DISTANCE_SENSOR",
            "EKF_STATUS_REPORT",
            "VIBRATION",
            "BATTERY_STATUS",
            "GIMBAL_DEVICE_ATTITUDE_STATUS",
            *extra,
        ),
    }
    return {**groups, ALL: tuple(name for names in groups.values() for name in names)}


def board_id(vehicle: AutopilotVehicle) -> str:
    """Return the board's serial number, which follows from the system id."""
    return f"{(vehicle.system + 2) % 16:x}d1219c7c4c5404aaa"


def send_version(vehicle: AutopilotVehicle, name: str, version: ArduPilotVersion) -> None:
    """Report firmware version and board, as after a parameter list request."""
    vehicle.send_text(INFO, f"{name} {version.text}")
    vehicle.send_text(INFO, f"{board_id(vehicle)}1f6d2a48adfda4")


FRAME_CLASSES = {4: 1, 6: 2, 8: 3}
"""FRAME_CLASS by the number of rotors."""
PLUS, X = 0, 1
"""FRAME_TYPE."""


def own_parameters(system: int, flight: Flight) -> dict[str, float]:
    """Return the parameters that follow from the system id, the battery and the airframe."""
    own = {"SYSID_THISMAV": system, "BATT_CAPACITY": flight.spec.battery.capacity_ah * 1000.0}
    spec = flight.spec
    if not isinstance(spec, Multirotor) or not spec.frame:
        return own
    return own | {
        "FRAME_CLASS": FRAME_CLASSES[len(spec.rotors)],
        "FRAME_TYPE": PLUS if spec.frame.endswith("plus") else X,
        "MOT_THST_HOVER": round(min(MOST_HOVER, max(LEAST_HOVER, hover_collective(spec))), 4),
    }


def refuse_interval(vehicle: AutopilotVehicle, number: int) -> int:
    """Refuse SET_MESSAGE_INTERVAL of a message that the firmware does not know."""
    vehicle.send_text(INFO, f"No ap_message for mavlink id ({number})")
    return DENIED


def ignore_stream_request(_vehicle: AutopilotVehicle, _link: int, _stream: int, _rate: int) -> None:
    """Ignore REQUEST_DATA_STREAM: a copter stores no stream rates."""


def builders(
    version: ArduPilotVersion,
    kind: int,
    capabilities: int,
    health: Health,
    system_status: Callable[[AutopilotVehicle], int],
) -> Mapping[str, Builder]:
    """Return the builders of all common messages.

    Args:
        version: Version of the firmware.
        kind: MAV_TYPE.
        capabilities: Bits of MAV_PROTOCOL_CAPABILITY.
        health: Sensor bits of SYS_STATUS.
        system_status: Returns the MAV_STATE.
    """
    return {
        **BUILDERS,
        "AUTOPILOT_VERSION": lambda vehicle: telemetry.autopilot_version(
            version, capabilities, board_id(vehicle).encode()
        ),
        "HEARTBEAT": lambda vehicle: telemetry.heartbeat(
            vehicle, vehicle_type(vehicle, kind), system_status(vehicle)
        ),
        "SYS_STATUS": partial(sys_status, health=health),
    }


MESSAGE_HANDLERS: Mapping[str, MessageHandler] = {
    "HEARTBEAT": pilot_input.on_heartbeat,
    "MANUAL_CONTROL": pilot_input.on_manual_control,
    "RC_CHANNELS_OVERRIDE": pilot_input.on_override,
}
"""Messages that need no answer, for every kind of vehicle."""


def build_firmware(
    core: Feature, kind: str, optional: Collection[str], problems: ArmingProblems, words: tuple[str, str]
) -> FeatureSet:
    """Return the tables of a core and its features.

    Args:
        core: What the core adds by itself.
        kind: ``COPTER`` or ``ROVER``.
        optional: Features that are on beside those that are on by default.
        problems: Returns the texts that forbid arming.
        words: Status texts of arming and disarming.
    """
    return FeatureSet([core, *features_of(kind, optional).values()], problems, words)


def parameter_table(
    build: FeatureSet,
    optional: Collection[str],
    version: ArduPilotVersion,
    recorded: Callable[[], tuple[StoredParameter, ...]],
    tuning: Callable[[VehicleParameters], ManoeuvreTuning],
) -> ParameterTable:
    """Return the parameters of one kind of vehicle: the recorded ones, but those of features that are off."""

    @cache
    def defaults() -> tuple[StoredParameter, ...]:
        return tuple(one for one in recorded() if not absent(one.name, optional))

    def remedy(name: str) -> str:
        feature = absent(name, optional)
        return f"features={feature} or features=all adds it" if feature else ""

    meanings = {name: meaning for name, (_, meaning) in build.parameters.items()}
    return ParameterTable(defaults, tuning, own_parameters, meanings, version.renamed, remedy)


def telemetry_policy(
    build: FeatureSet,
    streams: Mapping[int, Sequence[str]],
    on_stream_request: Callable[[AutopilotVehicle, int, int, int], None] = ignore_stream_request,
    least_period: Ns = 3 * MS,
) -> TelemetryPolicy:
    """Return what one kind of vehicle sends."""
    return TelemetryPolicy(
        messages=build.telemetry,
        message_order=ORDER,
        streams=streams,
        on_stream_request=on_stream_request,
        high_latency=build.high_latency,
        least_period=least_period,
        intervals_after=100 * MS,
        refuse_interval=refuse_interval,
        unknown_message=FAILED,
    )


def ardupilot_mavlink(
    *,
    version: ArduPilotVersion,
    build: FeatureSet,
    start: LinkStart,
    sent: TelemetryPolicy,
    on_parameter_list: VehicleAction,
) -> MavlinkFirmware:
    """Return the MAVLink rules of one kind of vehicle."""

    def on_banner(vehicle: AutopilotVehicle, _command: Command) -> int:
        on_parameter_list(vehicle)
        return ACCEPTED

    return MavlinkFirmware(
        start=start._replace(timesync_every=10 * S),
        telemetry=sent,
        commands=CommandPolicy(
            commands={**build.commands, SEND_BANNER: on_banner},
            handlers=build.messages,
            set_mode=set_mode,
            set_mode_ack=11,
            questions=_questions(sent, build),
            accepts=accepts,
            private_links=private_links,
            nan_commands=build.nan_commands,
        ),
        missions=MissionPolicy(
            runs=mission.runs,
            stored_item=partial(mission.stored_item, items=build.items),
            home_item=mission.home_item,
            go_to_item=go_to_item,
            grew=mission.mission_grew,
            stored_point=fence_points.stored_fence_point,
            refuses_points=fence_points.refuse_points,
            points_changed=fence_points.points_changed,
            writes_parts=True,
        ),
        parameters=ParameterPolicy(reports_missing=version.reports_missing_parameters),
        logs=LogPolicy(
            partial(dataflash.encode, version=version, added=build.log_forms), first=1, while_armed=False
        ),
        files=files.FILES,
        on_parameter_list=on_parameter_list,
    )
