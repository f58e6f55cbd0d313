"""Reaction of an ArduPilot to a lost link, in words, from its parameters.

Source: the parameter documentation of ArduCopter and ArduRover. The failsafe acts only after a heartbeat of a
ground station has been received.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from volery.vehicles.drivers.mavlink.client import GCS_SYSTEM
from volery.vehicles.drivers.steps import DRONE_KIND, ROVER_KIND

LINK_LOSS_PARAMETERS: Mapping[str, Sequence[str]] = {
    DRONE_KIND: ("FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "FS_OPTIONS", "GUID_TIMEOUT", "SYSID_MYGCS"),
    ROVER_KIND: ("FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "FS_ACTION", "SYSID_MYGCS"),
}
"""Parameters that define the reaction, by kind of vehicle."""

_COPTER: Mapping[int, str] = {
    1: "it returns home (RTL)",
    2: "it goes on with a mission, else returns home (RTL)",
    3: "it returns by the way it came (SMART_RTL), else straight (RTL)",
    4: "it returns by the way it came (SMART_RTL), else lands",
    5: "it lands",
    6: "it flies its landing sequence (AUTO), else returns home (RTL)",
    7: "it stops (BRAKE), else lands",
}
"""Values of FS_GCS_ENABLE."""
_ROVER: Mapping[int, str] = {
    1: "it returns home (RTL)",
    2: "it stops (HOLD)",
    3: "it returns by the way it came (SMART_RTL), else straight (RTL)",
    4: "it returns by the way it came (SMART_RTL), else stops (HOLD)",
    5: "it disarms",
    6: "it stops (LOITER or HOLD)",
}
"""Values of FS_ACTION."""
_MISSIONS_GO_ON = 1 << 1
"""Bit of FS_OPTIONS: a mission continues without a ground station."""


def on_link_loss(kind: str, parameters: Mapping[str, float]) -> str:
    """Return the reaction in one line; empty for a vehicle that is neither copter nor rover."""
    if kind not in LINK_LOSS_PARAMETERS:
        return ""
    copter = kind == DRONE_KIND
    enabled = round(parameters.get("FS_GCS_ENABLE", 0.0))
    if not enabled:
        line = "it does not react (FS_GCS_ENABLE=0): it flies to its last target and stays there"
        lasts = parameters.get("GUID_TIMEOUT", 3.0)
        return f"{line}; a velocity ends after {lasts:g} s" if copter else line
    action = _COPTER.get(enabled) if copter else _ROVER.get(round(parameters.get("FS_ACTION", 0.0)))
    after = parameters.get("FS_GCS_TIMEOUT", 5.0)
    line = f"{after:g} s after the last heartbeat {action or 'it does nothing'}"
    station = round(parameters.get("SYSID_MYGCS", GCS_SYSTEM))
    if station != GCS_SYSTEM:
        line += f" (it listens for system {station}, not for this program)"
    goes_on = round(parameters.get("FS_OPTIONS", 0.0)) & _MISSIONS_GO_ON
    return f"{line}; a mission goes on" if copter and goes_on else line
