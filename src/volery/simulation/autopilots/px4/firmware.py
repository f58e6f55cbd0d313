"""What PX4's kinds of vehicles share: boot timeline, telemetry rates of each link, MAVLink rules.

All times are recorded.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from volery.base.time import MS, Ns, S
from volery.simulation.autopilots.autopilot import BootEvent, BootSequence, Firmware, PeriodicWork
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.autopilots.mavlink.channel import StatusTextPolicy
from volery.simulation.autopilots.mavlink.endpoint import MavlinkEndpoint
from volery.simulation.autopilots.mavlink.firmware import (
    Builder,
    CommandPolicy,
    LinkStart,
    MavlinkFirmware,
    MissionPolicy,
    MissionUploadPolicy,
    ParameterPolicy,
    TelemetryPolicy,
)
from volery.simulation.autopilots.mavlink.log_service import LogPolicy
from volery.simulation.autopilots.mavlink.messages import DENIED, FAILED, MULTIROTORS, Handler
from volery.simulation.autopilots.px4 import files, geofence, mission, telemetry, ulog
from volery.simulation.autopilots.px4.commands import DO_SET_MODE, MESSAGE_HANDLERS, set_mode
from volery.simulation.autopilots.px4.external_vision import uses_satellites
from volery.simulation.autopilots.px4.follow_target import on_follow_target
from volery.simulation.autopilots.px4.modes import LOITER, READY_AFTER, CommanderState, commander_of
from volery.simulation.autopilots.px4.versions import Px4Version
from volery.simulation.autopilots.vehicle_state import (
    ArmingTimes,
    AutopilotVehicle,
    Mode,
    ParameterTable,
    RcDefaults,
    StartupTimes,
    VehicleAction,
    VehicleRules,
)
from volery.simulation.world.body_specs import Multirotor

ORIGIN: Ns = 6_200 * MS
"""First position; recorded from 6.4 s on."""

HOME: Ns = 7_600 * MS
"""First home position; recorded 7.59 to 7.60 s after boot."""

POSITION_KEPT_S = 5.0
"""Time for which a position counts after the last fix [s]: recorded of 1.14 and 1.17."""

POSE_KEPT_S = 4.6
"""The same after the last external pose: with 1.17 the failsafe came 4.6 to 4.7 s after it."""

STREAMS: Ns = 500 * MS
"""First telemetry stream."""

FIRST_HEARTBEAT: Ns = 1_252 * MS
"""Recorded 1.19 to 1.34 s after boot."""


def set_home_position(vehicle: AutopilotVehicle) -> None:
    """Set the home position where the vehicle is, unless it has one or the estimator has no position."""
    if vehicle.estimate.position_ok and vehicle.home is None:
        vehicle.set_home_here()


def stand_on_ground(vehicle: AutopilotVehicle) -> None:
    """Put the vehicle on the ground."""
    vehicle.ground.landed = True


def find_position(vehicle: AutopilotVehicle) -> None:
    """Begin to take the position from satellites, unless the parameters forbid it."""
    if uses_satellites(vehicle):
        vehicle.flight.set_origin()


def start_warm(vehicle: AutopilotVehicle) -> None:
    """Put a vehicle that starts warm on the ground, without satellites if the parameters forbid them."""
    stand_on_ground(vehicle)
    if not uses_satellites(vehicle):
        vehicle.flight.use_poses()


EVENTS = (
    BootEvent(0, stand_on_ground),
    BootEvent(ORIGIN, find_position),
    BootEvent(HOME, set_home_position),
    BootEvent(READY_AFTER - 50 * MS, set_home_position),
)


def on_position(vehicle: AutopilotVehicle) -> None:
    """Set the home position of a vehicle that starts warm, whose arming checks are not reported."""
    set_home_position(vehicle)
    commander_of(vehicle).reported = commander_of(vehicle).checks()


AIRFRAMES = {
    "quad-x": 4001,
    "quad-plus": 5001,
    "hexa-x": 6001,
    "hexa-plus": 7001,
    "octo-x": 8001,
    "octo-plus": 9001,
}
"""SYS_AUTOSTART of the generic airframes."""
LEAST_HOVER, MOST_HOVER = 0.1, 0.8
"""Limits of MPC_THR_HOVER."""


def own_parameters(system: int, flight: Flight) -> Mapping[str, float]:
    """Return the parameters that follow from the system id and the airframe."""
    own: dict[str, float] = {"MAV_SYS_ID": system}
    spec = flight.spec
    if not isinstance(spec, Multirotor) or not spec.frame:
        return own
    own |= {
        "CA_ROTOR_COUNT": len(spec.rotors),
        "MAV_TYPE": MULTIROTORS[len(spec.rotors)],
        "MPC_THR_HOVER": round(min(MOST_HOVER, max(LEAST_HOVER, spec.hover_throttle)), 4),
        "SYS_AUTOSTART": AIRFRAMES[spec.frame],
    }
    for number, rotor in enumerate(spec.rotors):
        own[f"CA_ROTOR{number}_PX"] = rotor.forward
        own[f"CA_ROTOR{number}_PY"] = -rotor.left
        own[f"CA_ROTOR{number}_KM"] = -0.05 * rotor.spin
    return own


def _every(rates: Mapping[float, Sequence[str]]) -> dict[str, Ns]:
    return {name: round(S / rate) for rate, names in rates.items() for name in names}


ONBOARD, STATION = "onboard", "station"

USES: Mapping[str, Mapping[str, Ns]] = {
    ONBOARD: _every(
        {
            100.0: ("ATTITUDE",),
            50.0: ("ATTITUDE_QUATERNION", "GLOBAL_POSITION_INT", "HIGHRES_IMU"),
            30.0: ("LOCAL_POSITION_NED", "ODOMETRY"),
            10.0: (
                "ALTITUDE",
                "ATTITUDE_TARGET",
                "DISTANCE_SENSOR",
                "POSITION_TARGET_GLOBAL_INT",
                "POSITION_TARGET_LOCAL_NED",
                "SERVO_OUTPUT_RAW",
                "TIMESYNC",
                "VFR_HUD",
            ),
            8.0: ("GPS_RAW_INT",),
            5.0: ("EXTENDED_SYS_STATE", "SYS_STATUS"),
            2.0: ("ORBIT_EXECUTION_STATUS",),
            1.0: ("ESTIMATOR_STATUS", "PING", "SCALED_PRESSURE", "SYSTEM_TIME"),
            0.5: ("BATTERY_STATUS", "HOME_POSITION", "VIBRATION"),
            0.333: ("CURRENT_EVENT_SEQUENCE",),
        }
    ),
    STATION: _every(
        {
            50.0: (
                "ATTITUDE",
                "ATTITUDE_QUATERNION",
                "ATTITUDE_TARGET",
                "GLOBAL_POSITION_INT",
                "LOCAL_POSITION_NED",
                "POSITION_TARGET_LOCAL_NED",
                "SERVO_OUTPUT_RAW",
            ),
            4.0: ("VFR_HUD",),
            2.0: ("ORBIT_EXECUTION_STATUS",),
            1.0: (
                "ALTITUDE",
                "EXTENDED_SYS_STATE",
                "GPS_RAW_INT",
                "POSITION_TARGET_GLOBAL_INT",
                "SCALED_PRESSURE",
                "SYS_STATUS",
            ),
            0.5: ("BATTERY_STATUS", "DISTANCE_SENSOR", "ESTIMATOR_STATUS", "HOME_POSITION"),
            0.333: ("CURRENT_EVENT_SEQUENCE",),
            0.1: ("PING", "VIBRATION"),
        }
    ),
}
"""Use of a link to the period of each message on it, as recorded."""

BUILDERS: Mapping[str, Builder] = {
    "ALTITUDE": telemetry.altitude,
    "ATTITUDE": telemetry.attitude,
    "ATTITUDE_QUATERNION": telemetry.attitude_quaternion,
    "ATTITUDE_TARGET": telemetry.attitude_target,
    "AUTOPILOT_VERSION": telemetry.autopilot_version,
    "AVAILABLE_MODES": telemetry.available_modes,
    "BATTERY_STATUS": telemetry.battery_status,
    "CURRENT_EVENT_SEQUENCE": telemetry.event_sequence,
    "CURRENT_MODE": telemetry.current_mode,
    "DISTANCE_SENSOR": telemetry.distance_sensor,
    "ESTIMATOR_STATUS": telemetry.estimator_status,
    "EXTENDED_SYS_STATE": telemetry.extended_sys_state,
    "GLOBAL_POSITION_INT": telemetry.global_position,
    "GPS_GLOBAL_ORIGIN": telemetry.origin,
    "GPS_RAW_INT": telemetry.gps_raw,
    "HIGHRES_IMU": telemetry.highres_imu,
    "HOME_POSITION": telemetry.home_position,
    "LOCAL_POSITION_NED": telemetry.local_position,
    "MISSION_CURRENT": telemetry.mission_current,
    "ODOMETRY": telemetry.odometry,
    "ORBIT_EXECUTION_STATUS": telemetry.orbit_status,
    "PING": telemetry.ping,
    "POSITION_TARGET_GLOBAL_INT": telemetry.global_target,
    "POSITION_TARGET_LOCAL_NED": telemetry.position_target,
    "SCALED_PRESSURE": telemetry.pressure,
    "SERVO_OUTPUT_RAW": telemetry.servo_output,
    "SYSTEM_TIME": telemetry.system_time,
    "SYS_STATUS": telemetry.sys_status,
    "TIMESYNC": telemetry.timesync,
    "VFR_HUD": telemetry.vfr_hud,
    "VIBRATION": telemetry.vibration,
}

ORDER: Sequence[str] = tuple(sorted(BUILDERS))
"""Order of the messages within one burst."""


TEXTS = StatusTextPolicy(numbered=True, to_stations=True, spacing=48 * MS)
"""Recorded: at most one text each 48 to 52 ms."""

PARAMETERS = ParameterPolicy(
    burst=20,
    period=20 * MS,
    read_delay=2 * MS,
    bytewise=True,
    keeps_index=True,
    typed=True,
    checksum="_HASH_CHECK",
)
"""Recorded: 877 parameters in 0.85 s."""


def _link_uses(version: Px4Version) -> Mapping[str, Mapping[str, Ns]]:
    """Return the streams of each use of a link."""
    return {use: {**rates, "MISSION_CURRENT": version.mission_period} for use, rates in USES.items()}


def px4_mavlink(mav_type: int, commands: Mapping[int, Handler], version: Px4Version) -> MavlinkFirmware:
    """Return the MAVLink rules of one version, for a kind of vehicle.

    Args:
        mav_type: MAV_TYPE.
        commands: Its commands.
        version: The version.
    """
    return MavlinkFirmware(
        start=LinkStart(heartbeat_from=FIRST_HEARTBEAT),
        telemetry=TelemetryPolicy(
            messages={**BUILDERS, "HEARTBEAT": partial(telemetry.heartbeat, kind=mav_type)},
            message_order=ORDER,
            link_uses=_link_uses(version),
            refuse_interval=lambda _vehicle, _message: FAILED,
            unknown_message=DENIED,
            nothing_to_send=DENIED,
            on_mode_change=(),
            on_home_change=("GPS_GLOBAL_ORIGIN",),
        ),
        commands=CommandPolicy(
            commands=commands,
            handlers={**MESSAGE_HANDLERS, "FOLLOW_TARGET": on_follow_target},
            questions={
                "SERIAL_CONTROL": files.on_shell,
            },
            set_mode=set_mode,
            set_mode_ack=DO_SET_MODE,
            answer_delay=6 * MS,
            wrong_target=version.wrong_target,
            checks_component=True,
            reads_nan=True,
        ),
        missions=MissionPolicy(
            upload=MissionUploadPolicy(
                mission.request_message,
                received="",
                falls_back_to_int=True,
                keeps_old=True,
                request_period=250 * MS,
                gives_up_after=5 * S,
                gives_up=mission.give_up,
            ),
            stored_item=mission.stored_item,
            stored_point=geofence.stored_fence_point,
            names_lists=False,
            list_id=telemetry.list_id if version.plan_ids else None,
            item_refused=mission.report_refused_item,
        ),
        parameters=PARAMETERS,
        texts=TEXTS,
        logs=LogPolicy(ulog.encode, first=0, while_armed=True),
        files=files.FILES,
    )


ROVER_ARMING = ArmingTimes()
"""A rover has no spool-up."""


def px4_firmware(
    *,
    kind: str,
    modes: Mapping[int, Mode],
    parameters: ParameterTable,
    endpoint: Callable[[AutopilotVehicle], MavlinkEndpoint],
    on_step: VehicleAction,
    version: Px4Version,
    arming: ArmingTimes = ROVER_ARMING,
) -> Firmware:
    """Return one version for one kind of vehicle: the shared rules, and the arguments."""
    return Firmware(
        name="px4",
        kind=kind,
        rules=VehicleRules(
            modes=modes,
            boot_mode=modes[LOITER],
            startup=StartupTimes(STREAMS, HOME, READY_AFTER, STREAMS),
            arming=arming,
            parameters=parameters,
            rc=RcDefaults((1500,) * 4 + (0,) * 12, throttle_centred=True),
            firmware_state=partial(CommanderState, version=version),
            position_kept=POSITION_KEPT_S,
            pose_kept=POSE_KEPT_S,
        ),
        boot=BootSequence(EVENTS, start_warm, on_position),
        periodic=PeriodicWork(on_step=on_step, failsafe_ticks=1),
        endpoint=endpoint,
    )
