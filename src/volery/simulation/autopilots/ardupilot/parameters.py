"""ArduPilot's parameters: which ones the core reads, and the tuning that follows from their values.

Those of features stand there. All other parameters are listed and read, and keep their values.
"""

from __future__ import annotations

from math import pi, radians

from volery.base.time import MS, from_seconds
from volery.simulation.autopilots.ardupilot.feature import ParameterMeanings
from volery.simulation.autopilots.autopilot_parameters import ManoeuvreTuning, VehicleParameters
from volery.simulation.autopilots.manual_control import ChannelRange, StickMap

_STICKS: ParameterMeanings = {
    **{
        f"RCMAP_{stick}": ("", f"channel of the {stick.lower()} stick")
        for stick in ("ROLL", "PITCH", "THROTTLE", "YAW")
    },
    **{
        f"RC{channel}_{part}": (unit, f"{words} of channel {channel}")
        for channel in range(1, 17)
        for part, unit, words in (
            ("MIN", "µs", "lower end"),
            ("TRIM", "µs", "middle"),
            ("MAX", "µs", "upper end"),
            ("DZ", "µs", "dead zone"),
            ("REVERSED", "", "direction"),
        )
    },
}

_SHARED: ParameterMeanings = {
    **_STICKS,
    "ARMING_CHECK": ("", "0 skips all checks; any other value runs all of them"),
    "ARMING_RUDDER": ("", "0: the yaw stick does not arm; 1 arms, 2 disarms, too"),
    "BATT_ARM_MAH": ("mAh", "charge required for arming"),
    "BATT_ARM_VOLT": ("V", "voltage required for arming"),
    "BATT_CAPACITY": ("mAh", "charge of the full battery; by default that of the simulated battery"),
    "BATT_CRT_MAH": ("mAh", "critical level by charge"),
    "BATT_CRT_VOLT": ("V", "critical level by voltage"),
    "BATT_FS_CRT_ACT": ("", "action at the critical level"),
    "BATT_FS_LOW_ACT": ("", "action at the low level"),
    "BATT_LOW_MAH": ("mAh", "low level by charge"),
    "BATT_LOW_TIMER": ("s", "time for which the voltage must stay below a level"),
    "BATT_LOW_VOLT": ("V", "low level by voltage"),
    "EK3_GLITCH_RAD": (
        "m",
        "uncertainty after a reset to a fix that was refused for 10 s; 0: every fix counts",
    ),
    "EK3_POS_I_GATE": ("", "distance from which a fix is refused, in hundredths of its standard deviation"),
    "EK3_POSNE_M_NSE": ("m", "least standard deviation of a fix in that comparison"),
    "FS_GCS_ENABLE": ("", "action when the ground station is lost"),
    "FS_GCS_TIMEOUT": ("s", "silence after which the ground station is lost"),
    "FS_THR_ENABLE": ("", "action when the throttle channel falls below FS_THR_VALUE"),
    "FS_THR_VALUE": ("µs", "pulse width below which the transmitter is lost"),
    "GPS_TYPE": ("", "0: no receiver"),
    "INITIAL_MODE": ("", "mode after boot"),
    "RC_OPTIONS": ("", "bit 5: the throttle, bit 6 off: the other sticks must rest to arm"),
    "RC_OVERRIDE_TIME": ("s", "time after which overrides end; 0 ignores them, a negative value keeps them"),
    "SIM_BATT_VOLTAGE": (
        "V",
        "voltage of the battery from then on, whatever it gives; the default leaves its own",
    ),
    "SIM_ENGINE_FAIL": ("", "the motor that SIM_ENGINE_MUL weakens, from 0"),
    "SIM_ENGINE_MUL": ("", "share of that motor's thrust"),
    "SIM_GPS_DISABLE": ("", "any value but 0: the receiver sees no satellites"),
    "SIM_GPS_GLITCH_X": ("°", "error of the latitude that the receiver reports"),
    "SIM_GPS_GLITCH_Y": ("°", "error of the longitude that the receiver reports"),
    "SIM_GPS_TYPE": ("", "0: no receiver sends anything"),
    "SIM_RC_FAIL": ("", "any value but 0: the transmitter's throttle reads 950"),
    "SIM_WIND_DIR": ("°", "direction that the wind comes from"),
    "SIM_WIND_SPD": ("m/s", "mean speed of the wind"),
    "STAT_BOOTCNT": ("", "counts the boots"),
    "SYSID_ENFORCE": ("", "1: messages of other systems than SYSID_MYGCS are ignored"),
    "SYSID_MYGCS": ("", "system id whose heartbeats and manual control count"),
    **{
        f"SERIAL{port}_OPTIONS": ("", "bit 10: link of that number is private, from the next boot on")
        for port in range(1, 8)
    },
}

YAW_AUTHORITY = 0.755
"""Ratio of yaw accelerations at full output: ArduPilot's own quadrotor, 17 rad/s^2, over the body here."""
ROTOR_LAG_S = 0.04
"""Lag of the rotors here, s; ArduPilot's own simulator has none, so the filter is quicker by as much."""

LEAST_HOVER, MOST_HOVER = 0.125, 0.6875
"""AP_MOTORS_THST_HOVER_MIN and AP_MOTORS_THST_HOVER_MAX."""

COPTER_PARAMETERS: ParameterMeanings = {
    **_SHARED,
    "ANGLE_MAX": ("0.01°", "largest lean"),
    "ATC_RAT_YAW_FLTE": ("Hz", "filter of the yaw rate's error"),
    "ATC_RAT_YAW_I": ("", "integral gain of the yaw rate loop"),
    "ATC_RAT_YAW_P": ("", "gain of the yaw rate loop"),
    "WPNAV_JERK": (
        "m/s³",
        "time that a waypoint within the waypoint radius takes; speed of the ways of ZIGZAG",
    ),
    "SIM_SHOVE_TIME": ("ms", "time for which that force acts; 0 again when it has ended"),
    "AUTO_OPTIONS": ("", "bits: 0 arming in AUTO, 1 its take-off without a raised throttle, 7 weathervaning"),
    "CIRCLE_RADIUS": ("cm", "circle of LOITER_TURNS"),
    "CIRCLE_RATE": ("°/s", "yaw rate on that circle"),
    "DISARM_DELAY": ("s", "time on the ground after which an idle copter disarms"),
    "FLTMODE_CH": ("", "channel of the mode switch; 0: none"),
    "FRAME_TYPE": ("", "frame name in a text, order of the motor test; no effect on the flight"),
    "FS_EKF_ACTION": ("", "action when the position is lost in flight"),
    "FS_EKF_THRESH": ("", "0 disables that action"),
    "FS_OPTIONS": ("", "bits 0 to 4: cases in which a failsafe has no effect"),
    "GUID_TIMEOUT": ("s", "time after which velocities and attitudes without a new message end"),
    "LAND_ALT_LOW": ("cm", "height below which the copter lands slowly"),
    "LAND_SPEED": ("cm/s", "slow landing speed"),
    "LAND_SPEED_HIGH": ("cm/s", "landing speed above; 0: WPNAV_SPEED_DN"),
    "LOIT_ACC_MAX": ("cm/s²", "LOITER's largest acceleration"),
    "LOIT_ANG_MAX": ("°", "LOITER's largest lean; 0: two thirds of ANGLE_MAX"),
    "LOIT_BRK_ACCEL": ("cm/s²", "LOITER's braking"),
    "LOIT_BRK_DELAY": ("s", "time before LOITER brakes"),
    "LOIT_SPEED": ("cm/s", "LOITER's largest speed"),
    "MOT_BAT_VOLT_MAX": (
        "V",
        "voltage for which thrust is computed; not above MOT_BAT_VOLT_MIN: it is ignored",
    ),
    "MOT_BAT_VOLT_MIN": ("V", "least voltage that counts for that"),
    "MOT_HOVER_LEARN": ("", "0 keeps MOT_THST_HOVER, 1 learns it in flight, 2 stores it, too"),
    "MOT_THST_HOVER": ("", "hover thrust at the start of a flight"),
    "PILOT_ACCEL_Z": ("cm/s²", "the pilot's vertical acceleration"),
    "PILOT_SPEED_DN": ("cm/s", "the pilot's largest descent; 0: PILOT_SPEED_UP"),
    "PILOT_SPEED_UP": ("cm/s", "the pilot's largest climb"),
    "PILOT_THR_BHV": ("", "bit 0: the throttle rests in the middle, arming does not check it"),
    "PILOT_TKOFF_ALT": ("cm", "height to which the pilot's climb from the ground goes on by itself"),
    "PILOT_Y_RATE": ("°/s", "the pilot's turn rate"),
    "RTL_ALT": ("cm", "height of the return"),
    "RTL_ALT_FINAL": ("cm", "final height over home; 0 lands"),
    "RTL_CLIMB_MIN": ("cm", "least climb of the return"),
    "RTL_CONE_SLOPE": ("", "slope of the cone about home in which the return is lower"),
    "RTL_LOIT_TIME": ("ms", "waiting time over home"),
    "RTL_SPEED": ("cm/s", "speed of the return; 0: WPNAV_SPEED"),
    "THR_DZ": ("0.1 %", "dead zone about the middle of the throttle"),
    "WPNAV_ACCEL": ("cm/s²", "acceleration in the plane"),
    "WPNAV_ACCEL_Z": ("cm/s²", "vertical acceleration"),
    "WPNAV_RADIUS": ("cm", "radius within which a waypoint is reached"),
    "WPNAV_SPEED": ("cm/s", "speed in the plane"),
    "WPNAV_SPEED_DN": ("cm/s", "descent"),
    "WPNAV_SPEED_UP": ("cm/s", "climb"),
    "WP_YAW_BEHAVIOR": ("", "1, 2 and 3 turn the nose along the path, 2 not on the return"),
    **{f"SIM_SHOVE_{axis}": ("m/s²", "acceleration by a force from outside") for axis in "XYZ"},
    **{f"FLTMODE{position}": ("", "mode of that position of the mode switch") for position in range(1, 7)},
}
"""Parameters that the core of a copter reads: unit, and what each changes."""

ROVER_PARAMETERS: ParameterMeanings = {
    **_SHARED,
    "ATC_ACCEL_MAX": ("m/s²", "acceleration; 0: 1 m/s^2"),
    "ATC_BRAKE": ("", "0: the motor does not brake"),
    "CRUISE_SPEED": ("m/s", "speed where WP_SPEED is 0; at CRUISE_THROTTLE"),
    "CRUISE_THROTTLE": ("%", "throttle of CRUISE_SPEED, from which the speed at full stick is projected"),
    "FS_ACTION": ("", "action when ground station or radio is lost"),
    "FS_OPTIONS": ("", "bit 0: failsafes act in HOLD, too"),
    "FS_TIMEOUT": ("s", "time for which ground station or radio are lost before the action"),
    "MIS_DONE_BEHAVE": ("", "after the mission: 0 stands, 1 loiters, 2 ACRO, 3 MANUAL"),
    "MODE_CH": ("", "channel of the mode switch; 0: none"),
    "RTL_SPEED": ("m/s", "speed of the return; 0: WP_SPEED"),
    "STICK_MIXING": ("", "any value but 0: the steering stick acts in the modes that the autopilot drives"),
    "WP_RADIUS": ("m", "radius within which a waypoint is reached"),
    "SPEED_MAX": ("m/s", "speed at full stick; 0: as projected"),
    "WP_SPEED": ("m/s", "speed"),
    **{f"MODE{position}": ("", "mode of that position of the mode switch") for position in range(1, 7)},
}
"""Parameters that the core of a rover reads: unit, and what each changes."""


CHANNELS = 16
FASTEST = 1000.0
SLOWEST = 0.1
"""Speed [m/s] used where a parameter is not positive, as large as the firmware's own lower limits."""


def channel_range(parameters: VehicleParameters, channel: int) -> ChannelRange:
    """Return the calibration of one RC channel."""
    return ChannelRange(
        parameters[f"RC{channel}_MIN"],
        parameters[f"RC{channel}_TRIM"],
        parameters[f"RC{channel}_MAX"],
        parameters[f"RC{channel}_DZ"],
        parameters[f"RC{channel}_REVERSED"] > 0.0,
    )


def _channel(parameters: VehicleParameters, stick: str, usual: int) -> int:
    """Return the channel of a stick, or the usual one where RCMAP names none that exists."""
    channel = round(parameters[f"RCMAP_{stick}"])
    return channel if 1 <= channel <= CHANNELS else usual


def stick_map(parameters: VehicleParameters) -> StickMap:
    """Return which channel is which stick."""
    roll, pitch, throttle, yaw = (
        _channel(parameters, name, usual)
        for usual, name in enumerate(("ROLL", "PITCH", "THROTTLE", "YAW"), start=1)
    )
    return StickMap(
        roll,
        pitch,
        throttle,
        yaw,
        (
            channel_range(parameters, roll),
            channel_range(parameters, pitch),
            channel_range(parameters, throttle),
            channel_range(parameters, yaw),
        ),
    )


def _moving(value: float, instead: float = SLOWEST) -> float:
    """Return a positive speed or acceleration, limited above; ``instead`` where the value is not positive."""
    return min(value, FASTEST) if value > 0.0 else instead


def copter_tuning(parameters: VehicleParameters) -> ManoeuvreTuning:
    """Return the tuning of a copter, whose parameters are in cm and 1/100 deg."""
    p = parameters
    speed_down = _moving(p["WPNAV_SPEED_DN"] / 100.0)
    pilot_up = _moving(p["PILOT_SPEED_UP"] / 100.0)
    speed = _moving(p["WPNAV_SPEED"] / 100.0)
    angle = radians(min(80.0, max(10.0, p["ANGLE_MAX"] / 100.0)))
    return ManoeuvreTuning(
        sticks=stick_map(p),
        speed=speed,
        speed_up=_moving(p["WPNAV_SPEED_UP"] / 100.0),
        speed_down=speed_down,
        accel=_moving(p["WPNAV_ACCEL"] / 100.0, 1.0),
        accel_z=_moving(p["WPNAV_ACCEL_Z"] / 100.0, 1.0),
        tilt=angle,
        waypoint_radius=_moving(p["WPNAV_RADIUS"] / 100.0),
        face_path=p["WP_YAW_BEHAVIOR"] in (1.0, 2.0, 3.0),
        face_return=p["WP_YAW_BEHAVIOR"] in (1.0, 3.0),
        straight=True,
        yaw_loop=(
            YAW_AUTHORITY * p["ATC_RAT_YAW_P"],
            YAW_AUTHORITY * p["ATC_RAT_YAW_I"],
            1.0 / max(1.0 / (2.0 * pi * _moving(p["ATC_RAT_YAW_FLTE"], 100.0)) - ROTOR_LAG_S, 0.002),
        ),
        land_speed=_moving(p["LAND_SPEED"] / 100.0),
        land_speed_high=_moving(p["LAND_SPEED_HIGH"] / 100.0, speed_down),
        land_slow_below=p["LAND_ALT_LOW"] / 100.0,
        return_height=p["RTL_ALT"] / 100.0,
        return_climb_min=p["RTL_CLIMB_MIN"] / 100.0,
        return_cone=p["RTL_CONE_SLOPE"],
        return_speed=_moving(p["RTL_SPEED"] / 100.0, speed),
        return_wait=round(p["RTL_LOIT_TIME"]) * MS,
        return_final=p["RTL_ALT_FINAL"] / 100.0,
        pilot_up=pilot_up,
        pilot_down=_moving(p["PILOT_SPEED_DN"] / 100.0, pilot_up),
        pilot_accel_z=_moving(p["PILOT_ACCEL_Z"] / 100.0, 1.0),
        pilot_yaw_rate=radians(p["PILOT_Y_RATE"]),
        pilot_takeoff=min(10.0, max(0.0, p["PILOT_TKOFF_ALT"] / 100.0)),
        throttle_dead=p["THR_DZ"] / 1000.0,
        hover_throttle=min(MOST_HOVER, max(LEAST_HOVER, p["MOT_THST_HOVER"])),
        gps_gate=_gps_gate(p),
        thrust_volts=_thrust_volts(p),
        learns_hover=p["MOT_HOVER_LEARN"] > 0.0,
        loiter_speed=_moving(p["LOIT_SPEED"] / 100.0),
        loiter_accel=_moving(p["LOIT_ACC_MAX"] / 100.0, 1.0),
        loiter_tilt=min(angle, _moving(radians(p["LOIT_ANG_MAX"]), angle * 2.0 / 3.0)),
        loiter_brake=_moving(p["LOIT_BRK_ACCEL"] / 100.0, 1.0),
        loiter_brake_delay=from_seconds(p["LOIT_BRK_DELAY"]),
        circle_radius=p["CIRCLE_RADIUS"] / 100.0,
        circle_rate=radians(p["CIRCLE_RATE"]),
        target_timeout=from_seconds(p["GUID_TIMEOUT"]),
    )


def _gps_gate(p: VehicleParameters) -> tuple[float, float, float]:
    """Return gate [sigmas], least sigma and radius of a reset [m]; a radius of 0 lets every fix count."""
    radius = p["EK3_GLITCH_RAD"]
    gate = max(1.0, p["EK3_POS_I_GATE"] / 100.0) if radius > 0.0 else 0.0
    return gate, max(0.1, p["EK3_POSNE_M_NSE"]), radius


def _thrust_volts(p: VehicleParameters) -> tuple[float, float]:
    """Return full and least voltage of the thrust [V]; 0 where the parameters switch it off."""
    full, least = p["MOT_BAT_VOLT_MAX"], p["MOT_BAT_VOLT_MIN"]
    return (full, least) if full > least else (0.0, 0.0)


FASTEST_PILOT, LEAST_CRUISE = 30.0, 0.05
"""Largest speed at full stick of a rover [m/s], and least share of the throttle that it is projected from."""


def rover_tuning(parameters: VehicleParameters) -> ManoeuvreTuning:
    """Return the tuning of a rover, whose parameters are in m and deg."""
    p = parameters
    speed = _moving(p["WP_SPEED"], _moving(p["CRUISE_SPEED"]))
    return ManoeuvreTuning(
        sticks=stick_map(p),
        speed=speed,
        accel=_moving(p["ATC_ACCEL_MAX"], 1.0),
        waypoint_radius=_moving(p["WP_RADIUS"]),
        return_speed=_moving(p["RTL_SPEED"], speed),
        gps_gate=_gps_gate(p),
        brakes=p["ATC_BRAKE"] != 0.0,
        pilot_speed=min(FASTEST_PILOT, _pilot_speed(p)),
    )


def _pilot_speed(p: VehicleParameters) -> float:
    """Return a rover's speed at full stick [m/s]: SPEED_MAX, else projected from CRUISE_SPEED."""
    share = p["CRUISE_THROTTLE"] / 100.0
    if not LEAST_CRUISE <= share <= 1.0:
        return p["CRUISE_SPEED"]
    return p["SPEED_MAX"] if p["SPEED_MAX"] > 0.0 else p["CRUISE_SPEED"] / share
