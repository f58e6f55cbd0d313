"""What a PX4 will do if its commander falls silent, in words, from its parameters.

Facts: PX4's parameter reference, and flights of PX4 1.14.
"""

from __future__ import annotations

from collections.abc import Mapping

LINK_LOSS_PARAMETERS = (
    "COM_OF_LOSS_T",
    "COM_OBL_RC_ACT",
    "COM_RC_LOSS_T",
    "NAV_RCL_ACT",
    "COM_DL_LOSS_T",
    "NAV_DLL_ACT",
)
"""The parameters that say it."""

_OFFBOARD_LOST: Mapping[int, str] = {
    0: "POSCTL, where it sinks unless somebody has the sticks",
    1: "ALTCTL, where somebody must have the sticks",
    2: "MANUAL, where somebody must have the sticks",
    3: "AUTO.RTL",
    4: "AUTO.LAND",
    5: "AUTO.LOITER",
    6: "flight termination",
    7: "disarmed motors",
}
_LINK_LOST: Mapping[int, str] = {
    1: "it holds its place",
    2: "it returns home",
    3: "it lands",
    5: "it terminates the flight",
    6: "it disarms",
}


def on_link_loss(parameters: Mapping[str, float]) -> str:
    """One line; empty if the firmware has none of the parameters."""
    return "; ".join(part for part in (_goal(parameters), _stream(parameters), _sticks(parameters)) if part)


def _goal(parameters: Mapping[str, float]) -> str:
    action = round(parameters.get("NAV_DLL_ACT", -1.0))
    if action < 0:
        return ""
    if action not in _LINK_LOST:
        return "it does not miss its commander (NAV_DLL_ACT=0): it goes to its last target and stays there"
    return f"{parameters.get('COM_DL_LOSS_T', 10.0):g} s after the last heartbeat {_LINK_LOST[action]}"


def _stream(parameters: Mapping[str, float]) -> str:
    if "COM_OBL_RC_ACT" not in parameters:
        return ""
    action = _OFFBOARD_LOST.get(round(parameters["COM_OBL_RC_ACT"]), "its failsafe")
    return f"a velocity ends after {parameters.get('COM_OF_LOSS_T', 1.0):g} s in {action}"


def _sticks(parameters: Mapping[str, float]) -> str:
    if "NAV_RCL_ACT" not in parameters:
        return ""
    action = _LINK_LOST.get(round(parameters["NAV_RCL_ACT"]), "it does nothing")
    return f"{parameters.get('COM_RC_LOSS_T', 0.5):g} s after the last sticks {action}"
