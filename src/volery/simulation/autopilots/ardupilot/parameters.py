"""ArduPilot's parameters: which ones change the behaviour, and the tuning that follows from their values.

All other parameters are listed and read, and keep their values.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi, radians
from types import MappingProxyType

from volery.base.time import MS, from_seconds
from volery.simulation.autopilots.ardupilot.parameter_checks import (
    COPTER_PARAMETERS,
    SOURCE_PARAMETERS,
    WHEEL_ENCODER,
)
from volery.simulation.autopilots.autopilot_parameters import Parameters, Tuning
from volery.simulation.autopilots.manual_control import ChannelRange, StickMap

_STICKS = {
    **{
        f"RCMAP_{stick}": f"channel of the {stick.lower()} stick"
        for stick in ("ROLL", "PITCH", "THROTTLE", "YAW")
    },
    **{
        f"RC{channel}_{part}": f"{words} of channel {channel}"
        for channel in range(1, 17)
        for part, words in (
            ("MIN", "lower end"),
            ("TRIM", "middle"),
            ("MAX", "upper end"),
            ("DZ", "dead zone"),
            ("REVERSED", "direction"),
        )
    },
}

_SHARED = {
    **_STICKS,
    **dict.fromkeys(SOURCE_PARAMETERS, "source of the estimator, or its sensor: checked before arming"),
    "ARMING_CHECK": "0 skips all checks; any other value runs all of them",
    **{
        f"RC{channel}_OPTION": "switch: modes, arming, stop, interlock, fence, payload, mission"
        for channel in range(5, 17)
    },
    "ARMING_RUDDER": "0: the yaw stick does not arm; 1 arms, 2 disarms, too",
    "ARSPD_ENABLE": "any value but 0: there may be an airspeed sensor",
    "ARSPD_TYPE": "any value above 0: there is one, and it is reported; 2: without a thermometer",
    "BATT_ARM_MAH": "charge required for arming",
    "BATT_ARM_VOLT": "voltage required for arming",
    "BATT_CAPACITY": "charge of the full battery; by default that of the simulated battery",
    "BATT_CRT_MAH": "critical level by charge",
    "BATT_CRT_VOLT": "critical level by voltage",
    "BATT_FS_CRT_ACT": "action at the critical level",
    "BATT_FS_LOW_ACT": "action at the low level",
    "BATT_LOW_MAH": "low level by charge",
    "BATT_LOW_TIMER": "time for which the voltage must stay below a level",
    "BATT_LOW_VOLT": "low level by voltage",
    "BTN_ENABLE": "any value but 0: buttons are read",
    "BTN_REPORT_SEND": "time after a change for which BUTTON_CHANGE is repeated",
    "AVOID_ACCEL_MAX": "largest change of the velocity by avoidance; 0: any",
    "AVOID_BACKUP_DZ": "distance within AVOID_MARGIN at which the vehicle backs away from an obstacle",
    "AVOID_BACKUP_SPD": "largest speed of backing away",
    "AVOID_BEHAVE": "1 shortens the velocity before a limit, 0 slides along it",
    "AVOID_ENABLE": "bits: 1 avoids the fence, 2 obstacles by the proximity sensor",
    "AVOID_MARGIN": "distance that avoidance keeps from obstacles",
    **{f"BTN_PIN{number}": "pin of that button; -1: none" for number in range(1, 5)},
    **{f"BTN_FUNC{number}": "function of that button, as RCn_OPTION" for number in range(1, 5)},
    **{f"BTN_OPTIONS{number}": "bit 1 inverts that button" for number in range(1, 5)},
    "CAM1_TYPE": "from the next boot on: 1 a camera with a servo, 5 with commands to components",
    "CAM1_DURATION": "time for which the servo presses the trigger",
    "CAM1_INTRVAL_MIN": "least time between two pictures",
    "CAM1_SERVO_OFF": "pulse width of the servo that does not press",
    "CAM1_SERVO_ON": "pulse width of the servo that presses",
    "CAM1_TRIGG_DIST": "distance between two pictures; 0: none by distance",
    "CAM_AUTO_ONLY": "any value but 0: pictures by distance in AUTO only",
    "CAM_MAX_ROLL": "largest roll for pictures by distance; 0: any",
    "EK3_GLITCH_RAD": "uncertainty after a reset to a fix that was refused for 10 s; 0: every fix counts",
    "EK3_POS_I_GATE": "distance from which a fix is refused, in hundredths of its standard deviation",
    "EK3_POSNE_M_NSE": "least standard deviation of a fix in that comparison",
    "FENCE_ACTION": "action beyond the fence; 0 only reports",
    "FENCE_ENABLE": "any value but 0 switches the fence on",
    "FENCE_RADIUS": "circle of the fence about home",
    "FENCE_TYPE": "bits: 1 height, 2 circle, 4 polygons, 8 floor",
    "FENCE_MARGIN": "distance that avoidance keeps from the fence; the limits have to leave room for it",
    "FENCE_TOTAL": "number of points; 0 clears the fence",
    "FS_GCS_ENABLE": "action when the ground station is lost",
    "FS_GCS_TIMEOUT": "silence after which the ground station is lost",
    "FS_THR_ENABLE": "action when the throttle channel falls below FS_THR_VALUE",
    "FS_THR_VALUE": "pulse width below which the transmitter is lost",
    "GPS_TYPE": "0: no receiver",
    "GRIP_ENABLE": "any value but 0: there is a gripper",
    "INITIAL_MODE": "mode after boot",
    "MNT1_TYPE": "1: there is a camera mount with servos, from the next boot on",
    "MNT1_DEFLT_MODE": "first mode of the mount",
    "MNT1_RC_RATE": "positive: the pilot turns the mount at up to this rate; else to angles",
    "MNT1_SYSID_DFLT": "system that the mount follows before one is commanded",
    **{
        f"MNT1_{axis}_{end}": f"{words} of the mount's {axis.lower()}"
        for axis in ("ROLL", "PITCH", "YAW")
        for end, words in (("MIN", "lower end"), ("MAX", "upper end"))
    },
    **{
        f"MNT1_{place}_{axis}": f"angle of the {words} mount"
        for place, words in (("RETRACT", "retracted"), ("NEUTRAL", "neutral"))
        for axis in "XYZ"
    },
    "MNT1_LEAD_RLL": "time by which the mount leads the vehicle's roll",
    "MNT1_LEAD_PTCH": "time by which the mount leads the vehicle's pitch",
    "PRX1_MAX": "largest distance of the proximity sensor that counts; 0: any",
    "PRX1_MIN": "least distance of the proximity sensor that counts",
    "PRX1_ORIENT": "any value but 0: OBSTACLE_DISTANCE counts anticlockwise",
    "PRX1_TYPE": "from the next boot on: 2 distances come by messages, 10 the fence is measured",
    "PRX1_YAW_CORR": "angle that is added to those of OBSTACLE_DISTANCE",
    "PRX_LOG_RAW": "any value but 0: the log has distances before the low-pass, too",
    "PRX_FILT": "cut-off frequency of the distances that avoidance reads; 0: no filter",
    "RALLY_INCL_HOME": "any value but 0: home counts as a rally point of the return",
    "RALLY_LIMIT_KM": "distance beyond which a rally point is not used; 0: none",
    "RALLY_TOTAL": "number of rally points",
    "RC_OPTIONS": "bit 5: the throttle, bit 6 off: the other sticks must rest to arm",
    "RC_OVERRIDE_TIME": "time after which overrides end; 0 ignores them, a negative value keeps them",
    **{
        f"RELAY{number}_{part}": f"{words} of that relay"
        for number in range(1, 7)
        for part, words in (
            ("FUNCTION", "1: commands switch it; function"),
            ("PIN", "pin"),
            ("DEFAULT", "state at the boot"),
        )
    },
    "RNGFND1_MAX_CM": "largest distance below that counts for landings and for the ground that is followed",
    "RNGFND1_MIN_CM": "least distance below that counts",
    "RNGFND1_TYPE": "any value but 0: there is a range finder below, and it is reported",
    "SIM_BATT_VOLTAGE": "voltage of the battery from then on, whatever it gives; the default leaves its own",
    "SIM_ENGINE_FAIL": "the motor that SIM_ENGINE_MUL weakens, from 0",
    "SIM_ENGINE_MUL": "share of that motor's thrust",
    "SIM_GPS_DISABLE": "any value but 0: the receiver sees no satellites",
    "SIM_GPS_GLITCH_X": "error of the latitude that the receiver reports",
    "SIM_GPS_GLITCH_Y": "error of the longitude that the receiver reports",
    "SIM_GPS_TYPE": "0: no receiver sends anything",
    "SIM_RC_FAIL": "any value but 0: the transmitter's throttle reads 950",
    "SIM_WIND_DIR": "direction that the wind comes from",
    "SIM_WIND_SPD": "mean speed of the wind",
    "SIM_PIN_MASK": "bits of the pins that are high: relays set them, buttons are read from them",
    **{
        f"SERIAL{port}_OPTIONS": "bit 10: link of that number is private, from the next boot on"
        for port in range(1, 8)
    },
    **{
        f"SERIAL{port}_PROTOCOL": "43: link of that number is of high latency, from the next boot on"
        for port in range(1, 8)
    },
    **{
        f"SERVO{channel}_{part}": f"{words} of output {channel}"
        for channel in range(1, 17)
        for part, words in (
            ("FUNCTION", "function"),
            ("MIN", "lower end"),
            ("TRIM", "middle"),
            ("MAX", "upper end"),
            ("REVERSED", "direction"),
        )
    },
    "SERVO_RC_FS_MSK": "channels whose scaled outputs go to their middle when the transmitter is lost",
    "SPRAY_ENABLE": "any value but 0: there is a sprayer",
    "SPRAY_PUMP_MIN": "least share of the pump",
    "SPRAY_PUMP_RATE": "share of the pump at 1 m/s",
    "SPRAY_SPEED_MIN": "speed over ground below which it does not spray",
    "SPRAY_SPINNER": "pulse width of the spinner",
    "STAT_BOOTCNT": "counts the boots",
    "SYSID_ENFORCE": "1: messages of other systems than SYSID_MYGCS are ignored",
    "SYSID_MYGCS": "system id whose heartbeats and manual control count",
}

YAW_AUTHORITY = 0.755
"""Ratio of yaw accelerations at full output: ArduPilot's own quadrotor, 17 rad/s^2, over the body here."""
ROTOR_LAG_S = 0.04
"""Lag of the rotors here, s; ArduPilot's own simulator has none, so the filter is quicker by as much."""

LEAST_HOVER, MOST_HOVER = 0.125, 0.6875
"""AP_MOTORS_THST_HOVER_MIN and AP_MOTORS_THST_HOVER_MAX."""

COPTER_SUPPORTED: Mapping[str, str] = MappingProxyType(
    {
        **_SHARED,
        **dict.fromkeys(COPTER_PARAMETERS, "checked before arming"),
        "ANGLE_MAX": "largest lean",
        "ATC_RAT_YAW_FLTE": "filter of the yaw rate's error",
        "ATC_RAT_YAW_I": "integral gain of the yaw rate loop",
        "ATC_RAT_YAW_P": "gain of the yaw rate loop",
        "AVOID_ALT_MIN": "height by the rangefinder below which obstacles do not count",
        "AVOID_ANGLE_MAX": "largest lean away from obstacles in ALT_HOLD",
        "AVOID_BACKZ_SPD": "largest rate of sinking back below the ceiling",
        "AVOID_DIST_MAX": "distance of obstacles from which ALT_HOLD leans away",
        "ADSB_ICAO_ID": "address of the vehicle itself, which is no other aircraft",
        "ADSB_LIST_ALT": "difference of height from which other aircraft do not count; 0: any counts",
        "ADSB_LIST_RADIUS": "distance from which other aircraft do not count; 0: any counts",
        "ADSB_TYPE": "any value but 0: ADSB_VEHICLE counts",
        "AVD_ENABLE": "any value but 0: other aircraft are avoided",
        "AVD_F_ACTION": "2 climbs or descends, 3 moves away level, 4 in three axes, 5 returns, 6 hovers",
        "AVD_F_ALT_MIN": "height above the sea below which other aircraft are reported only; 0: none",
        "AVD_F_RCVRY": "mode after that: 0 stays, 1 the one before, 2 RTL, 3 AUTO if it was that",
        "AVD_OBS_MAX": "number of other aircraft",
        **{
            f"AVD_{level}_{limit}": f"{words} of a threat that is {'avoided' if level == 'F' else 'reported'}"
            for level in "FW"
            for limit, words in (
                ("TIME", "time ahead"),
                ("DIST_XY", "horizontal distance"),
                ("DIST_Z", "vertical distance"),
            )
        },
        "PLND_ENABLED": "any value but 0: landings are over a target, from the next boot on",
        "PLND_TYPE": "1: LANDING_TARGET finds it; 2 and 4: a simulated beacon",
        "PLND_EST_TYPE": "0: its place as measured; 1: filtered, after two seconds",
        "PLND_LAND_OFS_X": "distance of the landing ahead of it",
        "PLND_LAND_OFS_Y": "distance of the landing to its right",
        "PLND_XY_DIST_MAX": "distance from it beyond which the copter does not descend; 0: any",
        "PLND_YAW_ALIGN": "direction of the sensor's forward axis from the nose",
        "SIM_PLD_ENABLE": "any value but 0: there is a simulated beacon",
        "SIM_PLD_LAT": "its latitude",
        "SIM_PLD_LON": "its longitude",
        "SIM_PLD_HEIGHT": "its height above home",
        "SIM_PLD_ALT_LMT": "height above it up to which it is seen",
        "SIM_PLD_DIST_LMT": "distance from it in the plane up to which it is seen",
        "PLDP_DELAY": "time between the release of a load and the climb",
        "PLDP_SPEED_DN": "rate of descent to put down a load; 0: LAND_SPEED",
        "TKOFF_RPM_MIN": "rotor speed below which a copter does not take off; 0: it always may",
        "TKOFF_RPM_MAX": "rotor speed above which it does not; 0: any",
        "WPNAV_JERK": "time that a waypoint within the waypoint radius takes; speed of the ways of ZIGZAG",
        **{f"SIM_SHOVE_{axis}": "acceleration by a force from outside" for axis in "XYZ"},
        "SIM_SHOVE_TIME": "time for which that force acts; 0 again when it has ended",
        "SURFTRAK_MODE": "1: modes by hand keep the height above the ground by the range finder",
        "SURFTRAK_TC": "time constant of that ground's height",
        "THROW_ALT_MAX": "height from which a throw does not count; 0: none",
        "THROW_ALT_MIN": "height below which a throw does not count; 0: none",
        "THROW_MOT_START": "1: motors idle before a throw",
        "THROW_NEXTMODE": "mode after a throw; 18: none",
        "THROW_TYPE": "1: the copter is dropped, not thrown upwards",
        "SIM_ESC_TELEM": "0: the speed controllers send no telemetry",
        "SIM_ESC_ARM_RPM": "rotor speed that the speed controllers report while armed",
        "AUTO_OPTIONS": "bits: 0 arming in AUTO, 1 its take-off without a raised throttle, 7 weathervaning",
        "CIRCLE_RADIUS": "circle of LOITER_TURNS",
        "CIRCLE_RATE": "yaw rate on that circle",
        "DISARM_DELAY": "time on the ground after which an idle copter disarms",
        "FENCE_ALT_MAX": "ceiling of the fence above home",
        "FENCE_ALT_MIN": "floor of the fence above home",
        **{f"FLTMODE{position}": "mode of that position of the mode switch" for position in range(1, 7)},
        "FLTMODE_CH": "channel of the mode switch; 0: none",
        "FOLL_ENABLE": "any value but 0: FOLLOW may be entered",
        "FOLL_SYSID": "system that FOLLOW follows; 0: the first that reports its position",
        "FOLL_DIST_MAX": "distance beyond which it is not followed; 0: none",
        "FOLL_ALT_TYPE": "1: its height above home counts, 0: above the sea",
        "FOLL_OFS_TYPE": "1: the place beside it turns with its heading",
        **{f"FOLL_OFS_{axis}": "place beside it; all 0: the place at the start" for axis in "XYZ"},
        "FOLL_POS_P": "speed for each metre that is missing",
        "FOLL_YAW_BEHAVE": "1 turns the nose to it, 2 takes its heading, 3 turns the nose where it flies",
        "FRAME_TYPE": "frame name in a text, order of the motor test; no effect on the flight",
        "FS_CRASH_CHECK": "0 switches the crash check off: a vehicle on its back keeps its motors running",
        "FS_EKF_ACTION": "action when the position is lost in flight",
        "FS_EKF_THRESH": "0 disables that action",
        "FS_OPTIONS": "bits 0 to 4: cases in which a failsafe has no effect",
        "GUID_OPTIONS": "bit 7 allows weathervaning",
        "GUID_TIMEOUT": "time after which velocities and attitudes without a new message end",
        "LGR_ENABLE": "any value but 0: there is a landing gear",
        "LGR_STARTUP": "1 retracts, 2 deploys the landing gear at the start",
        "LGR_DEPLOY_ALT": "height above home below which a descent deploys the landing gear; 0: none",
        "LGR_RETRACT_ALT": "height above home above which a climb retracts the landing gear; 0: none",
        "LGR_OPTIONS": "landing gear: bit 0 retracts after a take-off, bit 1 deploys for landing",
        "LAND_ALT_LOW": "height below which the copter lands slowly",
        "LAND_SPEED": "slow landing speed",
        "LAND_SPEED_HIGH": "landing speed above; 0: WPNAV_SPEED_DN",
        "LOIT_ACC_MAX": "LOITER's largest acceleration",
        "LOIT_ANG_MAX": "LOITER's largest lean; 0: two thirds of ANGLE_MAX",
        "LOIT_BRK_ACCEL": "LOITER's braking",
        "LOIT_BRK_DELAY": "time before LOITER brakes",
        "LOIT_SPEED": "LOITER's largest speed",
        "MOT_BAT_VOLT_MAX": "voltage for which thrust is computed; not above MOT_BAT_VOLT_MIN: it is ignored",
        "MOT_BAT_VOLT_MIN": "least voltage that counts for that",
        "MOT_HOVER_LEARN": "0 keeps MOT_THST_HOVER, 1 learns it in flight, 2 stores it, too",
        "MOT_PWM_MAX": "pulse width of a motor test at 100 %",
        "MOT_PWM_MIN": "pulse width of a motor test at 0 %",
        "MOT_THST_HOVER": "hover thrust at the start of a flight",
        "PILOT_ACCEL_Z": "the pilot's vertical acceleration",
        "PILOT_SPEED_DN": "the pilot's largest descent; 0: PILOT_SPEED_UP",
        "PILOT_SPEED_UP": "the pilot's largest climb",
        "PILOT_THR_BHV": "bit 0: the throttle rests in the middle, arming does not check it",
        "PILOT_TKOFF_ALT": "height to which the pilot's climb from the ground goes on by itself",
        "PILOT_Y_RATE": "the pilot's turn rate",
        "RTL_ALT": "height of the return",
        "RTL_ALT_FINAL": "final height over home; 0 lands",
        "RTL_CLIMB_MIN": "least climb of the return",
        "RTL_CONE_SLOPE": "slope of the cone about home in which the return is lower",
        "RTL_LOIT_TIME": "waiting time over home",
        "RTL_SPEED": "speed of the return; 0: WPNAV_SPEED",
        "THR_DZ": "dead zone about the middle of the throttle",
        "WINCH_OPTIONS": "bit 0: the winch is let go at the start; bit 1: lengths are reported",
        "WINCH_POS_P": "rate for each metre of line that is missing",
        "WINCH_RATE_MAX": "largest rate of the winch",
        "WINCH_TYPE": "1: there is a winch with a servo",
        "WVANE_ENABLE": "weathervaning: 1 nose, 2 nose or tail, 3 side, 4 tail into the wind; -1 as below",
        "WVANE_ANG_MIN": "lean up to which it does not turn",
        "WVANE_GAIN": "rate of the turn for each degree of lean",
        "WVANE_HGT_MIN": "height above home up to which it does not weathervane",
        "WVANE_LAND": "as WVANE_ENABLE, while it lands; -1: as there",
        "WVANE_OPTIONS": "bit 0: the pitch turns it, too",
        "WVANE_SPD_MAX": "speed in the plane above which it does not weathervane; 0: none",
        "WVANE_TAKEOFF": "as WVANE_ENABLE, during a take-off; -1: as there",
        "WVANE_VELZ_MAX": "climb or descent above which it does not weathervane; 0: none",
        "WPNAV_ACCEL": "acceleration in the plane",
        "WPNAV_ACCEL_Z": "vertical acceleration",
        "WPNAV_RADIUS": "radius within which a waypoint is reached",
        "WPNAV_SPEED": "speed in the plane",
        "WPNAV_SPEED_DN": "descent",
        "WPNAV_SPEED_UP": "climb",
        "WP_YAW_BEHAVIOR": "1, 2 and 3 turn the nose along the path, 2 not on the return",
    }
)
"""Parameters of a copter that have an effect, and what each changes."""

ROVER_SUPPORTED: Mapping[str, str] = MappingProxyType(
    {
        **_SHARED,
        "ATC_ACCEL_MAX": "acceleration; 0: 1 m/s^2",
        "ATC_BRAKE": "0: the motor does not brake",
        "CRUISE_SPEED": "speed where WP_SPEED is 0; at CRUISE_THROTTLE",
        "CRUISE_THROTTLE": "throttle of CRUISE_SPEED, from which the speed at full stick is projected",
        "FS_ACTION": "action when ground station or radio is lost",
        "FS_OPTIONS": "bit 0: failsafes act in HOLD, too",
        "FS_TIMEOUT": "time for which ground station or radio are lost before the action",
        "MIS_DONE_BEHAVE": "after the mission: 0 stands, 1 loiters, 2 ACRO, 3 MANUAL",
        **{f"MODE{position}": "mode of that position of the mode switch" for position in range(1, 7)},
        "MODE_CH": "channel of the mode switch; 0: none",
        "RTL_SPEED": "speed of the return; 0: WP_SPEED",
        WHEEL_ENCODER: "source of the estimator: checked before arming",
        "STICK_MIXING": "any value but 0: the steering stick acts in the modes that the autopilot drives",
        "WP_RADIUS": "radius within which a waypoint is reached",
        "SPEED_MAX": "speed at full stick; 0: as projected",
        "WP_SPEED": "speed",
    }
)
"""Parameters of a rover that have an effect, and what each changes."""


CHANNELS = 16
FASTEST = 1000.0
SLOWEST = 0.1
"""Speed [m/s] used where a parameter is not positive, as large as the firmware's own lower limits."""


def channel_range(parameters: Parameters, channel: int) -> ChannelRange:
    """Return the calibration of one RC channel."""
    return ChannelRange(
        parameters[f"RC{channel}_MIN"],
        parameters[f"RC{channel}_TRIM"],
        parameters[f"RC{channel}_MAX"],
        parameters[f"RC{channel}_DZ"],
        parameters[f"RC{channel}_REVERSED"] > 0.0,
    )


def _channel(parameters: Parameters, stick: str, usual: int) -> int:
    """Return the channel of a stick, or the usual one where RCMAP names none that exists."""
    channel = round(parameters[f"RCMAP_{stick}"])
    return channel if 1 <= channel <= CHANNELS else usual


def stick_map(parameters: Parameters) -> StickMap:
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


def copter_tuning(parameters: Parameters) -> Tuning:
    """Return the tuning of a copter, whose parameters are in cm and 1/100 deg."""
    p = parameters
    speed_down = _moving(p["WPNAV_SPEED_DN"] / 100.0)
    pilot_up = _moving(p["PILOT_SPEED_UP"] / 100.0)
    speed = _moving(p["WPNAV_SPEED"] / 100.0)
    angle = radians(min(80.0, max(10.0, p["ANGLE_MAX"] / 100.0)))
    return Tuning(
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


def _gps_gate(p: Parameters) -> tuple[float, float, float]:
    """Return gate [sigmas], least sigma and radius of a reset [m]; a radius of 0 lets every fix count."""
    radius = p["EK3_GLITCH_RAD"]
    gate = max(1.0, p["EK3_POS_I_GATE"] / 100.0) if radius > 0.0 else 0.0
    return gate, max(0.1, p["EK3_POSNE_M_NSE"]), radius


def _thrust_volts(p: Parameters) -> tuple[float, float]:
    """Return full and least voltage of the thrust [V]; 0 where the parameters switch it off."""
    full, least = p["MOT_BAT_VOLT_MAX"], p["MOT_BAT_VOLT_MIN"]
    return (full, least) if full > least else (0.0, 0.0)


FASTEST_PILOT, LEAST_CRUISE = 30.0, 0.05
"""Largest speed at full stick of a rover [m/s], and least share of the throttle that it is projected from."""


def rover_tuning(parameters: Parameters) -> Tuning:
    """Return the tuning of a rover, whose parameters are in m and deg."""
    p = parameters
    speed = _moving(p["WP_SPEED"], _moving(p["CRUISE_SPEED"]))
    return Tuning(
        sticks=stick_map(p),
        speed=speed,
        accel=_moving(p["ATC_ACCEL_MAX"], 1.0),
        waypoint_radius=_moving(p["WP_RADIUS"]),
        return_speed=_moving(p["RTL_SPEED"], speed),
        gps_gate=_gps_gate(p),
        brakes=p["ATC_BRAKE"] != 0.0,
        pilot_speed=min(FASTEST_PILOT, _pilot_speed(p)),
    )


def _pilot_speed(p: Parameters) -> float:
    """Return a rover's speed at full stick [m/s]: SPEED_MAX, else projected from CRUISE_SPEED."""
    share = p["CRUISE_THROTTLE"] / 100.0
    if not LEAST_CRUISE <= share <= 1.0:
        return p["CRUISE_SPEED"]
    return p["SPEED_MAX"] if p["SPEED_MAX"] > 0.0 else p["CRUISE_SPEED"] / share
