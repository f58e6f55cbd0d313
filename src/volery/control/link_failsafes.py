"""What a vehicle under RC override does when this program or its link is lost, from its parameters.

The mode is then a pilot's, and no failsafe of the mode in which the autopilot follows a computer applies.
``link_failsafes`` reads the parameters before the flight and returns one line for each thing that happens,
with the value that lands gently. Sources: ArduPilot's parameter list (FS_, RC_OVERRIDE_TIME, RCn_OPTION) and
PX4's (COM_RC_IN_MODE, COM_RC_LOSS_T, COM_RCL_EXCEPT, NAV_RCL_ACT, NAV_DLL_ACT).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from volery.base.errors import VoleryError
from volery.vehicles import Drone
from volery.vehicles.vehicle_connection import ON_LINK_LOSS

BY_STICKS = f"{ON_LINK_LOSS}, by RC override"
"""Beginning of each line in the record."""
Values = Mapping[str, float]

LAND_OPTION = 18
"""RCn_OPTION of ArduPilot: the upper end of the switch enters LAND."""
CONTINUES_FOR_PILOT = 1 << 4
"""Bit of FS_OPTIONS: the failsafe of the ground station leaves a mode alone that a pilot flies."""
_COPTER_WITHOUT_RADIO: Mapping[int, str] = {
    0: "it does nothing",
    1: "it returns home and lands",
    2: "it goes on with a mission, else returns home and lands",
    3: "it lands",
}
"""Values of FS_THR_ENABLE; others return by the way the vehicle came."""
_PX4_ACTIONS: Mapping[int, str] = {
    0: "it does nothing",
    1: "it holds its place",
    2: "it returns home and lands",
    3: "it lands",
    5: "it terminates the flight",
    6: "it disarms",
}
"""Values of NAV_RCL_ACT and NAV_DLL_ACT."""
_OFFBOARD_EXCEPTED = 1 << 2
"""Bit of COM_RCL_EXCEPT: no failsafe of lost sticks in OFFBOARD."""


def _ardupilot(values: Values, channel: int | None) -> list[str]:
    lasts = values["RC_OVERRIDE_TIME"]
    if lasts < 0.0:
        held = f"the last command lasts for ever (RC_OVERRIDE_TIME={lasts:g}); state RC_OVERRIDE_TIME=1"
    elif lasts == 0.0:
        held = "RC overrides are refused (RC_OVERRIDE_TIME=0); state RC_OVERRIDE_TIME=1"
    else:
        then = "then the transmitter's sticks fly"
        held = f"the last command lasts for {lasts:g} s, {then} (RC_OVERRIDE_TIME={lasts:g})"
        held += "; 1 is safer" if lasts > 1.0 else ""
    action, options = round(values["FS_GCS_ENABLE"]), round(values["FS_OPTIONS"])
    stated = f"FS_GCS_ENABLE={action}, FS_OPTIONS={options}"
    if action == 0:
        lost = f"nothing lands it ({stated}); FS_GCS_ENABLE=5 with FS_OPTIONS=0 lands"
    elif options & CONTINUES_FOR_PILOT:
        lost = f"the failsafe leaves it to the transmitter's sticks ({stated}); FS_OPTIONS=0 lets it act"
    elif action == 5:
        lost = f"it lands by its failsafe ({stated})"
    else:
        lost = f"its failsafe acts ({stated}); FS_GCS_ENABLE=5 lands where it is"
    radio = round(values["FS_THR_ENABLE"])
    silent = _COPTER_WITHOUT_RADIO.get(radio, "it returns by the way it came, or lands")
    lines = [held, lost, f"without a transmitter, too, {silent} (FS_THR_ENABLE={radio})"]
    if channel is not None and round(values.get(f"RC{channel}_OPTION", 0.0)) != LAND_OPTION:
        name = f"RC{channel}_OPTION={LAND_OPTION}"
        lines.append(f"the switch then lands it only if the autopilot reads it, too: state {name}")
    return lines


_MAY_FLY = "a transmitter that sends may fly instead"
_FLIES = "a transmitter that sends flies instead"
_PX4_STICKS: Mapping[int, str] = {
    0: "the sticks of this link are ignored, only a transmitter flies",
    2: _MAY_FLY,
    3: _MAY_FLY,
    4: "the sticks of this link are ignored, as all are",
    5: _FLIES,
    6: _MAY_FLY,
    7: _FLIES,
    8: _MAY_FLY,
}
"""Values of COM_RC_IN_MODE; 5 to 8 since PX4 1.17 (commander_params.c): which source has priority."""


def _px4(values: Values, channel: int | None) -> list[str]:
    source = round(values["COM_RC_IN_MODE"])
    lasts, action = values["COM_RC_LOSS_T"], round(values["NAV_RCL_ACT"])
    after = f"{lasts:g} s after the last sticks {_PX4_ACTIONS.get(action, 'its failsafe acts')}"
    line = f"{after} (NAV_RCL_ACT={action})"
    lines = [line if action == 3 else f"{line}; 3 lands where it is"]
    other = _PX4_STICKS.get(source)
    if other is not None:
        lines[0] += f"; {other} (COM_RC_IN_MODE={source}; 1 is this link only)"
    station = round(values["NAV_DLL_ACT"])
    lines.append(
        f"of the ground station's link alone: {_PX4_ACTIONS.get(station, 'its failsafe acts')} "
        f"(NAV_DLL_ACT={station})"
    )
    if round(values["COM_RCL_EXCEPT"]) & _OFFBOARD_EXCEPTED:
        excepted = f"COM_RCL_EXCEPT={values['COM_RCL_EXCEPT']:g}"
        lines.append(f"lost sticks have no effect in OFFBOARD ({excepted}), from which it takes off")
    return lines


_AUTOPILOTS: Mapping[str, tuple[Sequence[str], Callable[[Values, int | None], list[str]]]] = {
    "ArduPilot": (("FS_GCS_ENABLE", "FS_OPTIONS", "RC_OVERRIDE_TIME", "FS_THR_ENABLE"), _ardupilot),
    "PX4": (("COM_RC_IN_MODE", "COM_RC_LOSS_T", "NAV_RCL_ACT", "NAV_DLL_ACT", "COM_RCL_EXCEPT"), _px4),
}


def describe(autopilot: str, values: Values, channel: int | None = None) -> list[str]:
    """Return one line for each thing that happens when the link is lost under RC override.

    Args:
        autopilot: name of the autopilot.
        values: its parameters.
        channel: RC channel of the safety switch; ``None`` without one.
    """
    return _AUTOPILOTS[autopilot][1](values, channel) if autopilot in _AUTOPILOTS else []


def link_failsafes(drone: Drone, channel: int | None) -> list[str]:
    """Read the parameters and return what happens when the link is lost under RC override.

    Args:
        drone: the drone, before the flight.
        channel: RC channel of the safety switch; ``None`` without one.
    """
    autopilot = drone.telemetry.autopilot
    if autopilot not in _AUTOPILOTS:
        return []
    names = list(_AUTOPILOTS[autopilot][0])
    if autopilot == "ArduPilot" and channel is not None:
        names.append(f"RC{channel}_OPTION")
    try:
        values = {name: drone.parameters.get(name) for name in names}
    except VoleryError as error:
        return [f"what happens is not known: {error}"]
    return describe(autopilot, values, channel)
