"""What the driver takes for granted of a DJI aircraft beyond the public definitions: one table."""

from __future__ import annotations

from collections.abc import Mapping

from volery.base.time import to_seconds
from volery.ros.messages.dji import HEALTHY_GPS
from volery.vehicles.drivers.dji.carrier import QUIET
from volery.vehicles.drivers.dji.hearing import MOST_VOLTS, SETTLED, TAKEN_FOR
from volery.vehicles.drivers.dji.stream import BRAKES_M_S2, DOWN_M_S, OBEYED_WITHIN, STALE, UP_M_S

ASSUMED: Mapping[str, str] = {
    "`gps_position`": "its altitude is above the sea",
    "home": "is where the motors started, and `height_above_takeoff` counts from there",
    "`gps_health`": f"from {HEALTHY_GPS} on positions are to be trusted, and it can arm and go by position",
    "`rc`": "the fifth axis is the mode switch: any move of it takes the authority, and its return hands "
    "the aircraft back",
    "`battery_state`": f"percent; a voltage above {MOST_VOLTS:g} is in millivolts; the current is negative "
    "when it is drawn",
    "set-points": f"without effect for {to_seconds(OBEYED_WITHIN):g} s mean that another program has the "
    f"authority, for {to_seconds(TAKEN_FOR):g} s at least",
    "a position": f"older than {to_seconds(STALE):g} s is not reckoned from: no offset is sent",
    "a set-point on its way": f"has come after {to_seconds(QUIET):g} s; it would end a landing or a way home "
    "that a program has asked for",
    "a stated speed": f"is flown as a velocity until it has to brake with {BRAKES_M_S2:g} m/s² for its goal, "
    f"with at most {UP_M_S:g} m/s up and {DOWN_M_S:g} m/s down",
    "a mode after a way down": f"counts once it has shown for {to_seconds(SETTLED):g} s: the news that the "
    "motors stand may come later",
    "task 6 (land) and task 1 (go home)": "stop the motors at the end by themselves",
    "leaving a landing or a way home": "takes a set-point with `dji_sdk`, a task of its own with "
    "`dji_osdk_ros`",
    "silence of the program": "makes it brake and hover; landing, going home and missions go on",
}
"""What, and what is taken for true."""
