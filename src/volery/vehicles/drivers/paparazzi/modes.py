"""Names of the rotorcraft firmware, and what the driver assumes about an aircraft."""

from __future__ import annotations

from collections.abc import Mapping

from volery.links.pprzlink_messages import entry_value, message_type

STATUS = "ROTORCRAFT_STATUS"

KILL, FAILSAFE, HOME = "KILL", "FAILSAFE", "HOME"
NAV, GUIDED = "NAV", "GUIDED"
ATTITUDE_MODE, HEIGHT_MODE = "ATTITUDE_DIRECT", "ATTITUDE_RC_CLIMB"

NUMBERS: Mapping[str, int] = {
    word: number for number, word in enumerate(message_type(STATUS).words("ap_mode"))
}
"""Numbers of the modes."""

GOOD_FIX = entry_value(STATUS, "gps_status", "3D")
"""Least ``gps_status`` for a position."""

NEEDS_CARE = message_type(STATUS).words("arming_status")[8:]
"""Values of ``arming_status`` that state why it does not arm."""

PREVENTS_ARMING = frozenset({"AHRS_NOT_ALLIGNED", "OUT_OF_GEOFENCE", "LOW_BATTERY"})
"""Values that last until the cause is removed. The others concern a pilot's sticks."""

START = "start of the motors"
"""Key of a refusal: the arming status after the command to start the motors."""

CHANGE = "change of mode"
"""Key of an acknowledgement: the value of the setting 'mode' after it was written."""

LASTING_FAILSAFES = frozenset({FAILSAFE, HOME})
"""Modes in which it may stay in the air: HOME hovers, FAILSAFE of version 6.2 keeps its height."""

# Settings that the driver writes; an aircraft's XML defines their numbers.
AUTO2 = "auto2"
KILL_THROTTLE = "kill_throttle"
MODE = "mode"

START_BLOCK, TAKEOFF_BLOCK, LAND_BLOCK = "Start Engine", "Takeoff", "land here"
"""Blocks of the stock rotorcraft plan; the options ``start``, ``takeoff`` and ``land`` name others."""

PREPARING_BLOCKS = ("Wait GPS", "Geo init")
"""Blocks in which the origin of the local frame is not set yet. A plan need not have them."""

HOME_WAYPOINT = "HOME"

ASSUMED: Mapping[str, str] = {
    "GET_SETTING": "is answered with DL_VALUE: the numbers of 'mode' and 'kill_throttle' are checked so",
    "SETTING": "is answered at once with DL_VALUE, which has the value in force",
    "SETTING of 'mode'": "KILL, FAILSAFE and HOME always; NAV and GUIDED while no transmitter is received",
    "SETTING of 'auto2'": "what the third position of the mode switch means, at once where it is in it",
    "SETTING of 'kill_throttle'": "0 starts the motors in every mode but KILL, 1 stops them, in the air, too",
    "RC_UP": "counts as a transmitter if the aircraft takes its sticks from the datalink: roll, pitch "
    "(nose up +), yaw, throttle, mode switch (127 is AUTO2), kill switch (127 is off)",
    "GUIDED_SETPOINT_NED": "about the origin that INS_REF tells; stands until the next one",
    "ROTORCRAFT_FP": "in GUIDED its carrot is the set-point, of any sender",
    "block 'Start Engine'": "starts the motors, in NAV",
    "block 'Takeoff'": "climbs straight up to some 2 m",
    "block 'land here'": "in flight: takes the touch-down point from where it is, descends, and stops the "
    "motors",
    "FAILSAFE": "levels out without a position; it should descend and become KILL on the ground, but "
    "version 6.2 keeps its height",
    "GUIDED on the ground": "lifts off as soon as the motors run",
    "height above home": "is the height above the origin: block 'Geo init' sets it where the aircraft stands",
    "ATTITUDE_RC_CLIMB": "keeps the height with the throttle in the middle, climbs and sinks by it else; "
    "ATTITUDE_Z_HOLD keeps the height at which it began whatever the throttle says",
}
"""What the driver assumes. All but ATTITUDE_RC_CLIMB was seen of version 6.2 in its own simulator."""
