"""ArduPilot's arming checks of parameters: values that the firmware does not fly with, in its words.

Of each group the first parameter that is wrong is reported. Loops and motors here follow their own laws; the
checks are those of the original, so that a wrong file of parameters shows before a real vehicle has it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from volery.simulation.autopilots.ardupilot.feature import Feature
from volery.simulation.autopilots.autopilot_parameters import VehicleParameters
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

POSITIVE = ("PSC_POSXY_P", "PSC_POSZ_P", "PSC_VELZ_P", "PSC_ACCZ_P", "PSC_ACCZ_I")
ANGLE_GAINS = ("ATC_ANG_PIT_P", "ATC_ANG_RLL_P", "ATC_ANG_YAW_P")
RATE_LOOPS = ("ATC_RAT_RLL", "ATC_RAT_PIT", "ATC_RAT_YAW")

NO_SIGNAL_US, THROTTLE_GAP_US = 910.0, 10.0
"""Least FS_THR_VALUE, and how far it must be below the lower end of the throttle, us."""
LEAST_LEAN, LARGEST_LEAN = 1000.0, 8000.0
"""ANGLE_MAX, 1/100 deg."""
LARGEST_SPIN_MIN = 0.3
CONTINUE_MISSION = 2.0
"""A value of FS_GCS_ENABLE that version 4 has removed."""

WHEEL_ENCODER = "WENC_TYPE"
"""Only a rover has it."""
SETS = (1, 2, 3)
"""Sets of sources of the estimator."""
NONE, BAROMETER, COMPASS, RANGE_FINDER, GPS, GPS_YAW, FALLBACK, BEACON, FLOW, EXTERNAL, WHEELS, GSF = (
    0, 1, 1, 2, 3, 2, 3, 4, 5, 6, 7, 8,
)  # fmt: skip
_NEEDED: Mapping[str, Mapping[int, str]] = {
    "POSXY": {NONE: "", GPS: "GPS", BEACON: "Beacon", EXTERNAL: "VisualOdom"},
    "VELXY": {NONE: "", GPS: "GPS", FLOW: "OpticalFlow", EXTERNAL: "VisualOdom", WHEELS: "WheelEncoder"},
    "POSZ": {
        NONE: "",
        BAROMETER: "Baro",
        RANGE_FINDER: "RangeFinder",
        GPS: "GPS",
        BEACON: "Beacon",
        EXTERNAL: "VisualOdom",
    },
    "VELZ": {NONE: "", GPS: "GPS", EXTERNAL: "VisualOdom"},
}
"""Valid sources of a position and of a velocity, and the sensor that each requires."""
_NEEDED_FOR_YAW: Mapping[int, str] = {
    NONE: "",
    COMPASS: "",
    GPS_YAW: "",
    FALLBACK: "Compass",
    EXTERNAL: "VisualOdom",
    GSF: "GPS",
}
_ENABLING: Mapping[str, tuple[str, ...]] = {
    "Baro": (),
    "Beacon": ("BCN_TYPE",),
    "Compass": ("COMPASS_USE", "COMPASS_USE2", "COMPASS_USE3"),
    "GPS": ("GPS_TYPE", "GPS_TYPE2"),
    "OpticalFlow": ("FLOW_TYPE",),
    "RangeFinder": ("RNGFND1_TYPE",),
    "VisualOdom": ("VISO_TYPE",),
    "WheelEncoder": (WHEEL_ENCODER,),
}
"""Sensor to the parameters of which one must not be 0, in the order in which missing ones are reported."""

SOURCE_PARAMETERS = (
    *(f"EK3_SRC{number}_{kind}" for number in SETS for kind in (*_NEEDED, "YAW")),
    *(
        name
        for names in _ENABLING.values()
        for name in names
        if name not in ("GPS_TYPE", "RNGFND1_TYPE", WHEEL_ENCODER)
    ),
)
"""Parameters that only the check of the sources reads, of copter and rover."""
COPTER_PARAMETERS = (
    *POSITIVE,
    *ANGLE_GAINS,
    *(f"{loop}_{gain}" for loop in RATE_LOOPS for gain in ("P", "I", "D", "FF")),
    *("ACRO_BAL_PITCH", "ACRO_BAL_ROLL", "MOT_PWM_MAX", "MOT_PWM_MIN", "MOT_SPIN_ARM", "MOT_SPIN_MIN"),
)
"""Parameters of a copter that only these checks read, but for the gains of the yaw rate loop."""


def copter_problems(vehicle: AutopilotVehicle) -> list[str]:
    """Return the texts of the parameter checks of a copter that fail."""
    groups: tuple[Callable[[VehicleParameters], Iterator[str]], ...] = (_settings, _motors)
    found = [next(group(vehicle.parameters), "") for group in groups]
    return [*(text for text in found if text), *source_problems(vehicle)]


def _settings(p: VehicleParameters) -> Iterator[str]:
    if p["FS_THR_ENABLE"]:
        lowest = p["FS_THR_VALUE"]
        if lowest < NO_SIGNAL_US or p[f"RC{round(p['RCMAP_THROTTLE'])}_MIN"] <= lowest + THROTTLE_GAP_US:
            yield "Check FS_THR_VALUE"
    if p["FS_GCS_ENABLE"] == CONTINUE_MISSION:
        yield "FS_GCS_ENABLE=2 removed, see FS_OPTIONS"
    if not LEAST_LEAN <= p["ANGLE_MAX"] <= LARGEST_LEAN:
        yield f"Check {p.name('ANGLE_MAX')}"
    if p["ACRO_BAL_ROLL"] > p["ATC_ANG_RLL_P"] or p["ACRO_BAL_PITCH"] > p["ATC_ANG_PIT_P"]:
        yield "Check ACRO_BAL_ROLL/PITCH"
    if p["PILOT_SPEED_UP"] <= 0.0:
        yield f"Check {p.name('PILOT_SPEED_UP')}"
    yield from (f"Bad parameter: {words}" for words in _gains(p))


def _gains(p: VehicleParameters) -> Iterator[str]:
    """Return the gains that no loop can have; with a feed-forward the others may be zero."""
    yield from (f"{p.name(name)} must be > 0" for name in (*POSITIVE, *ANGLE_GAINS) if not p[name] > 0.0)
    for loop in RATE_LOOPS:
        forward = p[f"{loop}_FF"] > 0.0
        for gain in ("P", "I"):
            value = p[f"{loop}_{gain}"]
            if value < 0.0 or (value == 0.0 and not forward):
                yield f"{loop}_{gain} must be {'>=' if forward else '>'} 0"
        if p[f"{loop}_D"] < 0.0:
            yield f"{loop}_D must be >= 0"


def _motors(p: VehicleParameters) -> Iterator[str]:
    if p["MOT_SPIN_MIN"] > LARGEST_SPIN_MIN:
        yield f"Motors: MOT_SPIN_MIN too high {p['MOT_SPIN_MIN']:.2f} > {LARGEST_SPIN_MIN}"
    if p["MOT_SPIN_ARM"] > p["MOT_SPIN_MIN"]:
        yield "Motors: MOT_SPIN_ARM > MOT_SPIN_MIN"
    if not 1.0 <= p["MOT_PWM_MIN"] < p["MOT_PWM_MAX"]:
        yield "Motors: Check MOT_PWM_MIN and MOT_PWM_MAX"


def source_problems(vehicle: AutopilotVehicle) -> list[str]:
    """Return the text of the first source of the estimator that is invalid or has no sensor, if any."""
    p = vehicle.parameters
    required = set()
    kinds = _NEEDED if vehicle.mode.needs_position else {}
    for number in SETS:
        for kind, needed in (*kinds.items(), ("YAW", _NEEDED_FOR_YAW)):
            name = f"EK3_SRC{number}_{kind}"
            sensor = needed.get(round(p[name]))
            if sensor is None:
                return [f"AHRS: Check {name}"]
            required.add(sensor)
    for sensor, names in _ENABLING.items():
        enabling = [p[name] for name in names if name in p]
        if sensor in required and names and not any(enabling):
            return [f"AHRS: EK3 sources require {sensor}"]
    return []


_CHECKED = dict.fromkeys(
    SOURCE_PARAMETERS, ("", "source of the estimator, or its sensor: checked before arming")
)
COPTER = Feature(
    parameters={**_CHECKED, **dict.fromkeys(COPTER_PARAMETERS, ("", "checked before arming"))},
    problems=copter_problems,
)
ROVER = Feature(
    parameters={**_CHECKED, WHEEL_ENCODER: ("", "source of the estimator: checked before arming")},
    problems=source_problems,
)
