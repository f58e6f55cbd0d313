"""What a PX4 publishes by its uXRCE-DDS client: the topics below ``fmu/out``, made of its MAVLink telemetry.

Positions are north, east, down about the estimator's origin, bodies forward, right, down, and times
microseconds of ROS time, to which the client synchronises the firmware's clock. A topic whose type states a
``MESSAGE_VERSION`` above 0 has its number as an ending (``vehicle_status_v1``). Publishers are best effort
and transient local.

Differences from the firmware: rates are at most those of the MAVLink messages, 50 Hz; most topics are
published only while they have a subscription; ``vehicle_status`` shows a change of mode or arming with the
next heartbeat; what MAVLink does not carry is 0, false or NaN (reset counters, failure detectors, the user's
intention beside the mode that is flown). ``manual_control_setpoint`` has the sticks of
``manual_control_input`` only, not those of a transmitter or a ground station.
``position_setpoint_triplet`` is not published, nor ``airspeed_validated``, which a PX4 without an airspeed
sensor does not publish either.

Sources: PX4's ``dds_topics.yaml`` of each release, and the messages of ``px4_msgs``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from math import hypot, isfinite, nan, sqrt
from typing import Any

from volery.base import frames
from volery.base.time import MS, US, Ns, S
from volery.bridge.node_interface import Fields, InterfaceContext, PublishedByNode, Translator
from volery.links.mavlink_messages import constant
from volery.ros.graph import BEST_EFFORT, TRANSIENT_LOCAL, QoS
from volery.ros.messages import message_class
from volery.ros.messages.px4_constants import NavState, nav_state, topic_name, type_name

QOS = QoS(depth=1, reliability=BEST_EFFORT, durability=TRANSIENT_LOCAL)
OUTPUTS: Mapping[str, tuple[str, str]] = {
    "failsafe_flags": ("FailsafeFlags", "1.14"),
    "sensor_combined": ("SensorCombined", "1.14"),
    "timesync_status": ("TimesyncStatus", "1.14"),
    "vehicle_attitude": ("VehicleAttitude", "1.14"),
    "vehicle_control_mode": ("VehicleControlMode", "1.14"),
    "vehicle_global_position": ("VehicleGlobalPosition", "1.14"),
    "vehicle_gps_position": ("SensorGps", "1.14"),
    "vehicle_local_position": ("VehicleLocalPosition", "1.14"),
    "vehicle_odometry": ("VehicleOdometry", "1.14"),
    "vehicle_status": ("VehicleStatus", "1.14"),
    "battery_status": ("BatteryStatus", "1.15"),
    "manual_control_setpoint": ("ManualControlSetpoint", "1.15"),
    "vehicle_command_ack": ("VehicleCommandAck", "1.15"),
    "home_position": ("HomePosition", "1.16"),
    "vehicle_land_detected": ("VehicleLandDetected", "1.16"),
}
"""Type of each topic below ``fmu/out``, and the first version that publishes it."""

RATES: Mapping[str, float] = {
    "ODOMETRY": 50.0,
    "HIGHRES_IMU": 50.0,
    "GLOBAL_POSITION_INT": 10.0,
    "GPS_RAW_INT": 5.0,
    "SYS_STATUS": 5.0,
    "EXTENDED_SYS_STATE": 5.0,
    "ESTIMATOR_STATUS": 2.0,
    "BATTERY_STATUS": 1.0,
    "HOME_POSITION": 1.0,
    "GPS_GLOBAL_ORIGIN": 1.0,
}
"""Rates in Hz of the MAVLink messages that are requested from the autopilot."""

_ALWAYS = ("home_position", "vehicle_command_ack", "vehicle_status")
"""Topics that are published without a subscription, too: a late one receives what is kept."""

SAFETY_ARMED = constant("MAV_MODE_FLAG_SAFETY_ARMED")
DISARMED, ARMED = 1, 2
COPTER, ROVER = 1, 3
"""``vehicle_type``."""
_ROVER_TYPES = (10, 11)
_PREARM_CHECK, _RC_RECEIVER = 0x1000_0000, 0x1_0000
"""MAV_SYS_STATUS_SENSOR."""
_ATTITUDE_VALID, _SPEED_VALID, _CLIMB_VALID, _RELATIVE, _ABSOLUTE, _HEIGHT = 1, 2, 4, 8, 16, 32
"""ESTIMATOR_STATUS_FLAGS."""
_IN_FAILSAFE = (5, 6)
"""MAV_STATE: critical, emergency."""
_ON_GROUND = 1
STATUS_PERIOD: Ns = 500 * MS
G = 9.80665
_UNKNOWN_U8, _UNKNOWN_U16 = 255, 65_535
_LOCAL_NED, _BODY_FRD = constant("MAV_FRAME_LOCAL_NED"), 12
_FRAME_NED = 1
"""``pose_frame`` and ``velocity_frame``."""
_DDS = 2
"""``source_protocol`` of TimesyncStatus."""
_FIX_NONE = 1

_MANUAL = frozenset(
    {
        *(NavState.MANUAL, NavState.ALTCTL, NavState.POSCTL, NavState.POSITION_SLOW),
        *(NavState.ALTITUDE_CRUISE, NavState.ACRO, NavState.STAB, NavState.ORBIT),
    }
)
_AUTO = frozenset(state for state in NavState if state.name.startswith("AUTO_"))
_BY_POSITION = _AUTO | {NavState.POSCTL, NavState.POSITION_SLOW, NavState.ORBIT}
_BY_HEIGHT = _BY_POSITION | {NavState.ALTCTL, NavState.ALTITUDE_CRUISE, NavState.DESCEND}
_WITHOUT_ATTITUDE = (NavState.ACRO, NavState.TERMINATION)
"""Navigation states by what the firmware controls in them."""


@cache
def _maker(kind: str) -> Callable[..., Any]:
    """Return a function that makes a message of those fields that its version has."""
    made = message_class(type_name(kind))
    known = frozenset(made.__match_args__)
    return lambda fields: made(**{name: value for name, value in fields.items() if name in known})


def make(kind: str, at: Ns, **fields: Any) -> Any:
    """Return a message of ``px4_msgs`` at a ROS time in ns; fields that its version lacks are left out."""
    return _maker(kind)({"timestamp": at // US, "timestamp_sample": at // US, **fields})


class ControlMode:
    """What a program on board commands in OFFBOARD: its last ``offboard_control_mode``."""

    def __init__(self) -> None:
        self.flags: Mapping[str, bool] = {}
        self.last_received: Ns | None = None

    def lasts(self, now: Ns, within: Ns) -> bool:
        """Return whether the last one is not older than *within* at the time *now*."""
        return self.last_received is not None and now - self.last_received <= within


class PX4Telemetry:
    """Publishes the topics below ``fmu/out``.

    Args:
        context: What the parts of an interface work with.
        offboard: What is commanded in OFFBOARD.
        version: Version of the firmware, on which depends what there is.
    """

    def __init__(self, context: InterfaceContext, offboard: ControlMode, version: str) -> None:
        self._link, self._geoid, self._offboard = context.link, context.geoid, offboard
        self._send, self._is_wanted = context.publish, context.wanted
        self._names = {
            topic: topic_name("out", topic, kind)
            for topic, (kind, since) in OUTPUTS.items()
            if _as_number(since) <= _as_number(version)
        }
        self._armed_at = self._took_off_at = self._mode_at = 0
        self._nav_state = -1
        self._status_at: Ns = -STATUS_PERIOD
        self._awaited: dict[int, int] = {}
        """Commands from this graph by their MAV_CMD, as the graph names them."""

    def topics(self) -> tuple[PublishedByNode, ...]:
        """Return the topics."""
        return tuple(
            PublishedByNode(name, type_name(OUTPUTS[topic][0]), QOS, on_demand=topic not in _ALWAYS)
            for topic, name in self._names.items()
        )

    def translators(self) -> Mapping[str, Translator]:
        """Return the translators by message name."""
        return {
            "HEARTBEAT": self._heartbeat,
            "SYS_STATUS": self._sys_status,
            "EXTENDED_SYS_STATE": self._landed,
            "ODOMETRY": self._odometry,
            "GLOBAL_POSITION_INT": self._global,
            "GPS_RAW_INT": self._gps,
            "HIGHRES_IMU": self._imu,
            "BATTERY_STATUS": self._battery,
            "HOME_POSITION": self._home,
            "COMMAND_ACK": self._acknowledge,
        }

    def _wanted(self, topic: str) -> bool:
        name = self._names.get(topic)
        return name is not None and self._is_wanted(name)

    def _publish(self, topic: str, at: Ns, **fields: Any) -> None:
        self._send(self._names[topic], make(OUTPUTS[topic][0], at, **fields))

    def _flags(self) -> int:
        status = self._link.last("ESTIMATOR_STATUS")
        return status["flags"] if status else 0

    def sticks(self, given: Any, at: Ns) -> None:
        """Publish the sticks that a program on board gives, as those that the firmware has chosen."""
        if self._wanted("manual_control_setpoint"):
            stated = {name: getattr(given, name) for name in given.__match_args__}
            self._publish("manual_control_setpoint", at, **{**stated, "timestamp": at // US})

    # -- state

    def _heartbeat(self, fields: Fields, at: Ns) -> None:
        armed, nav = bool(fields["base_mode"] & SAFETY_ARMED), nav_state(fields["custom_mode"])
        self._armed_at = (self._armed_at or at // US) if armed else 0
        if nav != self._nav_state:
            self._nav_state, self._mode_at = nav, at // US
        self._status(fields, at)
        if self._wanted("timesync_status"):
            self._publish("timesync_status", at, source_protocol=_DDS, remote_timestamp=at // US)

    def _sys_status(self, fields: Fields, at: Ns) -> None:
        """Publish the state between heartbeats, as often as the firmware does."""
        heartbeat = self._link.last("HEARTBEAT")
        if heartbeat is not None and at - self._status_at >= STATUS_PERIOD:
            self._status(heartbeat, at)

    def _status(self, heartbeat: Fields, at: Ns) -> None:
        self._status_at = at
        checks = self._link.last("SYS_STATUS") or {}
        self._publish(
            "vehicle_status",
            at,
            armed_time=self._armed_at,
            takeoff_time=self._took_off_at,
            arming_state=ARMED if heartbeat["base_mode"] & SAFETY_ARMED else DISARMED,
            nav_state_timestamp=self._mode_at,
            nav_state_user_intention=self._nav_state,
            nav_state=self._nav_state,
            vehicle_type=ROVER if heartbeat["type"] in _ROVER_TYPES else COPTER,
            failsafe=heartbeat["system_status"] in _IN_FAILSAFE,
            system_type=heartbeat["type"],
            system_id=self._link.target[0],
            component_id=self._link.target[1],
            safety_off=True,
            power_input_valid=True,
            pre_flight_checks_pass=bool(checks.get("onboard_control_sensors_health", 0) & _PREARM_CHECK),
        )
        if self._wanted("vehicle_control_mode"):
            self._publish("vehicle_control_mode", at, **self._controlled(heartbeat))
        if self._wanted("failsafe_flags"):
            self._publish("failsafe_flags", at, **self._failsafes(checks, at))

    def _controlled(self, heartbeat: Fields) -> Fields:
        nav, commanded = self._nav_state, self._offboard.flags
        offboard = nav == NavState.OFFBOARD
        position = commanded.get("position", False) if offboard else nav in _BY_POSITION
        velocity = position or (offboard and commanded.get("velocity", False))
        acceleration = offboard and (velocity or commanded.get("acceleration", False))
        height = velocity if offboard else nav in _BY_HEIGHT
        attitude = acceleration or commanded.get("attitude", False)
        attitude = attitude if offboard else nav not in _WITHOUT_ATTITUDE
        return {
            "flag_armed": bool(heartbeat["base_mode"] & SAFETY_ARMED),
            "flag_multicopter_position_control_enabled": height or acceleration,
            "flag_control_manual_enabled": nav in _MANUAL,
            "flag_control_auto_enabled": nav in _AUTO,
            "flag_control_offboard_enabled": offboard,
            "flag_control_position_enabled": position,
            "flag_control_velocity_enabled": velocity,
            "flag_control_altitude_enabled": height,
            "flag_control_climb_rate_enabled": height,
            "flag_control_acceleration_enabled": acceleration,
            "flag_control_attitude_enabled": attitude,
            "flag_control_rates_enabled": nav != NavState.TERMINATION,
            "flag_control_allocation_enabled": True,
            "flag_control_termination_enabled": nav == NavState.TERMINATION,
        }

    def _failsafes(self, checks: Fields, at: Ns) -> Fields:
        flags, battery = self._flags(), self._link.last("BATTERY_STATUS")
        now = self._link.kernel.now()
        return {
            "attitude_invalid": not flags & _ATTITUDE_VALID,
            "local_altitude_invalid": not flags & _HEIGHT,
            "local_position_invalid": not flags & (_RELATIVE | _ABSOLUTE),
            "local_velocity_invalid": not flags & _SPEED_VALID,
            "global_position_invalid": not flags & _ABSOLUTE,
            "home_position_invalid": self._link.last("HOME_POSITION") is None,
            "offboard_control_signal_lost": not self._offboard.lasts(now, S),
            "manual_control_signal_lost": not checks.get("onboard_control_sensors_health", 0) & _RC_RECEIVER,
            "battery_warning": warning_of(battery) if battery else 0,
        }

    def _landed(self, fields: Fields, at: Ns) -> None:
        landed = fields["landed_state"] == _ON_GROUND
        self._took_off_at = 0 if landed else self._took_off_at or at // US
        if self._wanted("vehicle_land_detected"):
            self._publish(
                "vehicle_land_detected", at, landed=landed, ground_contact=landed, maybe_landed=landed
            )

    def await_answer(self, command: int, asked: int) -> None:
        """Publish the acknowledgements of a MAV_CMD from now on, under the number that was *asked* for."""
        self._awaited[command] = asked

    def _acknowledge(self, fields: Fields, at: Ns) -> None:
        """Publish the acknowledgement of a command that came from this graph."""
        asked = self._awaited.get(fields["command"])
        if asked is not None:
            progress = fields.get("progress", 0), fields.get("result_param2", 0)
            self.answer(asked, fields["result"], at, *progress)

    def answer(self, command: int, result: int, at: Ns, param1: int = 0, param2: int = 0) -> None:
        """Publish ``vehicle_command_ack``; *result* is a MAV_RESULT, which the firmware numbers alike."""
        if "vehicle_command_ack" in self._names:
            self._publish(
                "vehicle_command_ack",
                at,
                command=command,
                result=result,
                result_param1=param1,
                result_param2=param2,
                target_system=self._link.target[0],
                target_component=self._link.target[1],
            )

    # -- motion

    def _odometry(self, fields: Fields, at: Ns) -> None:
        """Publish attitude, local position and odometry, which the estimator updates together."""
        q = tuple(fields["q"])
        if self._wanted("vehicle_attitude"):
            self._publish("vehicle_attitude", at, q=list(q))
        local, odometry = self._wanted("vehicle_local_position"), self._wanted("vehicle_odometry")
        if not (local or odometry):
            return
        velocity = fields["vx"], fields["vy"], fields["vz"]
        if fields["child_frame_id"] == _BODY_FRD:
            velocity = frames.body_to_world(q, velocity)
        place = fields["x"], fields["y"], fields["z"]
        if local:
            self._local(fields, place, velocity, at)
        if odometry:
            poses, speeds = fields["pose_covariance"], fields["velocity_covariance"]
            self._publish(
                "vehicle_odometry",
                at,
                pose_frame=_FRAME_NED,
                position=list(place),
                q=list(q),
                velocity_frame=_FRAME_NED,
                velocity=list(velocity),
                angular_velocity=[fields["rollspeed"], fields["pitchspeed"], fields["yawspeed"]],
                position_variance=[poses[0], poses[6], poses[11]],
                orientation_variance=[poses[15], poses[18], poses[20]],
                velocity_variance=[speeds[0], speeds[6], speeds[11]],
            )

    def _local(self, fields: Fields, place: frames.Vector, velocity: frames.Vector, at: Ns) -> None:
        flags, q = self._flags(), tuple(fields["q"])
        poses, speeds = fields["pose_covariance"], fields["velocity_covariance"]
        positioned = bool(flags & (_RELATIVE | _ABSOLUTE))
        acceleration = self._acceleration(q)
        origin = self._link.last("GPS_GLOBAL_ORIGIN")
        reference: Fields = {}
        if origin is not None and flags & _ABSOLUTE:
            reference = {
                "xy_global": True,
                "z_global": True,
                "ref_lat": origin["latitude"] / 1e7,
                "ref_lon": origin["longitude"] / 1e7,
                "ref_alt": origin["altitude"] / 1e3,
            }
        self._publish(
            "vehicle_local_position",
            at,
            xy_valid=positioned,
            z_valid=bool(flags & _HEIGHT),
            v_xy_valid=bool(flags & _SPEED_VALID),
            v_z_valid=bool(flags & _CLIMB_VALID),
            **dict(zip(("x", "y", "z"), place, strict=True)),
            **dict(zip(("vx", "vy", "vz"), velocity, strict=True)),
            z_deriv=velocity[2],
            **dict(zip(("ax", "ay", "az"), acceleration, strict=True)),
            heading=frames.quaternion_to_euler(q)[2],
            heading_var=poses[20],
            tilt_var=poses[15],
            heading_good_for_control=positioned,
            **reference,
            dist_bottom=nan,
            eph=sqrt(poses[0] + poses[6]),
            epv=sqrt(poses[11]),
            evh=sqrt(speeds[0] + speeds[6]),
            evv=sqrt(speeds[11]),
            **dict.fromkeys(_LIMITS, nan),
        )

    def _acceleration(self, q: frames.Quaternion) -> frames.Vector:
        """Return the acceleration without gravity of the last IMU measurement, north, east, down."""
        imu = self._link.last("HIGHRES_IMU")
        if imu is None:
            return 0.0, 0.0, 0.0
        north, east, down = frames.body_to_world(q, (imu["xacc"], imu["yacc"], imu["zacc"]))
        return north, east, down + G

    def _global(self, fields: Fields, at: Ns) -> None:
        if not self._wanted("vehicle_global_position"):
            return
        latitude, longitude, amsl = fields["lat"] / 1e7, fields["lon"] / 1e7, fields["alt"] / 1e3
        status = self._link.last("ESTIMATOR_STATUS") or {}
        flags = status.get("flags", 0)
        self._publish(
            "vehicle_global_position",
            at,
            lat=latitude,
            lon=longitude,
            alt=amsl,
            alt_ellipsoid=self._geoid.to_ellipsoidal(latitude, longitude, amsl),
            lat_lon_valid=bool(flags & _ABSOLUTE),
            alt_valid=bool(flags & _HEIGHT),
            eph=status.get("pos_horiz_accuracy", nan),
            epv=status.get("pos_vert_accuracy", nan),
            terrain_alt=nan,
        )

    # -- sensors

    def _gps(self, fields: Fields, at: Ns) -> None:
        """Publish what the receiver measures, as the fields of every version; see ``make``."""
        if not self._wanted("vehicle_gps_position"):
            return
        latitude, longitude, amsl = fields["lat"], fields["lon"], fields["alt"]
        height = self._geoid.to_ellipsoidal(latitude / 1e7, longitude / 1e7, amsl / 1e3)
        speed = fields["vel"] / 100.0 if fields["vel"] != _UNKNOWN_U16 else nan
        course = frames.wrap(fields["cog"] * _RADIANS / 100.0) if fields["cog"] != _UNKNOWN_U16 else nan
        motion = self._link.last("GLOBAL_POSITION_INT") or {}
        north, east, down = (motion.get(name, 0) / 100.0 for name in ("vx", "vy", "vz"))
        self._publish(
            "vehicle_gps_position",
            at,
            lat=latitude,
            lon=longitude,
            alt=amsl,
            alt_ellipsoid=round(height * 1e3),
            latitude_deg=latitude / 1e7,
            longitude_deg=longitude / 1e7,
            altitude_msl_m=amsl / 1e3,
            altitude_ellipsoid_m=height,
            fix_type=max(_FIX_NONE, fields["fix_type"]),
            eph=_accuracy(fields, "h_acc", "eph"),
            epv=_accuracy(fields, "v_acc", "epv"),
            hdop=fields["eph"] / 100.0,
            vdop=fields["epv"] / 100.0,
            s_variance_m_s=fields.get("vel_acc", 0) / 1e3,
            vel_m_s=speed,
            vel_n_m_s=north,
            vel_e_m_s=east,
            vel_d_m_s=down,
            cog_rad=course,
            vel_ned_valid=isfinite(speed),
            time_utc_usec=at // US,
            satellites_used=0
            if fields["satellites_visible"] == _UNKNOWN_U8
            else fields["satellites_visible"],
            heading=nan,
            heading_offset=nan,
            heading_accuracy=nan,
        )

    def _imu(self, fields: Fields, at: Ns) -> None:
        if self._wanted("sensor_combined"):
            self._publish(
                "sensor_combined",
                at,
                gyro_rad=[fields["xgyro"], fields["ygyro"], fields["zgyro"]],
                gyro_integral_dt=_IMU_PERIOD_US,
                accelerometer_m_s2=[fields["xacc"], fields["yacc"], fields["zacc"]],
                accelerometer_integral_dt=_IMU_PERIOD_US,
            )

    def _battery(self, fields: Fields, at: Ns) -> None:
        if not self._wanted("battery_status"):
            return
        cells = [one / 1e3 for one in fields["voltages"] if one != _UNKNOWN_U16]
        amperes = fields["current_battery"] / 100.0 if fields["current_battery"] >= 0 else -1.0
        remaining = fields["battery_remaining"]
        self._publish(
            "battery_status",
            at,
            connected=True,
            voltage_v=sum(cells),
            voltage_filtered_v=sum(cells),
            current_a=amperes,
            current_filtered_a=amperes,
            current_average_a=amperes,
            discharged_mah=float(max(0, fields["current_consumed"])),
            remaining=remaining / 100.0 if remaining >= 0 else -1.0,
            scale=1.0,
            time_remaining_s=float(fields.get("time_remaining") or nan),
            temperature=fields["temperature"] / 100.0 if fields["temperature"] != 32_767 else nan,
            cell_count=len(cells),
            id=fields["id"],
            warning=warning_of(fields),
        )

    def _home(self, fields: Fields, at: Ns) -> None:
        if "home_position" not in self._names:
            return
        q = tuple(fields["q"])
        self._publish(
            "home_position",
            at,
            lat=fields["latitude"] / 1e7,
            lon=fields["longitude"] / 1e7,
            alt=fields["altitude"] / 1e3,
            x=fields["x"],
            y=fields["y"],
            z=fields["z"],
            yaw=frames.quaternion_to_euler(q)[2] if all(map(isfinite, q)) and hypot(*q) > 0.5 else nan,
            valid_alt=True,
            valid_hpos=True,
            valid_lpos=True,
        )


_IMU_PERIOD_US = 5_000
"""Time over which the firmware integrates one measurement, by its default IMU_INTEG_RATE of 200 Hz."""
_RADIANS = 0.017453292519943295
_LIMITS = ("vxy_max", "vz_max", "hagl_min", "hagl_max", "hagl_max_z", "hagl_max_xy")
"""Limits of the estimator, NaN where it states none."""


def _as_number(version: str) -> tuple[int, ...]:
    return tuple(map(int, version.split(".")))


def warning_of(battery: Fields) -> int:
    """Return the warning level of a BATTERY_STATUS: 0 none, 1 low, 2 critical, 3 emergency, 4 failed."""
    charge: int = battery.get("charge_state", 1)
    return max(0, min(4, charge - 1))


def _accuracy(fields: Fields, extension: str, dilution: str) -> float:
    """Return an accuracy in m of MAVLink 2, or the dilution of precision that MAVLink 1 has."""
    millimetres: int = fields.get(extension, 0)
    hundredths: int = fields[dilution]
    return millimetres / 1e3 if millimetres else hundredths / 100.0
