"""What an ArduPilot will do if its commander falls silent, in words, from its parameters.

Facts: ArduCopter's and ArduRover's parameter documentation. A ground station that has never been heard is
never missed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from volery.vehicles.drivers.mavlink.client import GCS_SYSTEM
from volery.vehicles.drivers.steps import DRONE_KIND, ROVER_KIND

LINK_LOSS_PARAMETERS: Mapping[str, Sequence[str]] = {
    DRONE_KIND: ("FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "FS_OPTIONS", "GUID_TIMEOUT", "SYSID_MYGCS"),
    ROVER_KIND: ("FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "FS_ACTION", "SYSID_MYGCS"),
}
"""The parameters that say it, by kind of vehicle."""

_COPTER: Mapping[int, str] = {
    1: "it returns home (RTL)",
    2: "it goes on with a mission, else returns home (RTL)",
    3: "it returns by the way it came (SMART_RTL), else straight (RTL)",
    4: "it returns by the way it came (SMART_RTL), else lands",
    5: "it lands",
    6: "it flies its landing sequence (AUTO), else returns home (RTL)",
    7: "it stops (BRAKE), else lands",
}
_ROVER: Mapping[int, str] = {
    1: "it returns home (RTL)",
    2: "it stops (HOLD)",
    3: "it returns by the way it came (SMART_RTL), else straight (RTL)",
    4: "it returns by the way it came (SMART_RTL), else stops (HOLD)",
    5: "it disarms",
    6: "it stops (LOITER or HOLD)",
}
_MISSIONS_GO_ON = 1 << 1
"""Of FS_OPTIONS: a mission goes on without a ground station."""


def on_link_loss(kind: str, parameters: Mapping[str, float]) -> str:
    """One line; empty for what is no copter and no rover."""
    if kind not in LINK_LOSS_PARAMETERS:
        return ""
    enabled = round(parameters.get("FS_GCS_ENABLE", 0.0))
    if not enabled:
        return _left_alone(kind, parameters)
    copter = kind == DRONE_KIND
    action = _COPTER.get(enabled) if copter else _ROVER.get(round(parameters.get("FS_ACTION", 0.0)))
    after = parameters.get("FS_GCS_TIMEOUT", 5.0)
    said = f"{after:g} s after the last heartbeat {action or 'it does nothing'}{_whose(parameters)}"
    goes_on = round(parameters.get("FS_OPTIONS", 0.0)) & _MISSIONS_GO_ON
    return f"{said}; a mission goes on" if copter and goes_on else said


def _left_alone(kind: str, parameters: Mapping[str, float]) -> str:
    said = "it does not miss its commander (FS_GCS_ENABLE=0): it goes to its last target and stays there"
    stands = parameters.get("GUID_TIMEOUT", 3.0)
    return f"{said}; a velocity ends after {stands:g} s" if kind == DRONE_KIND else said


def _whose(parameters: Mapping[str, float]) -> str:
    looked_for = round(parameters.get("SYSID_MYGCS", GCS_SYSTEM))
    return f" (it listens for system {looked_for}, not for this program)" if looked_for != GCS_SYSTEM else ""
