"""Reaction of a PX4 to a lost link, in words, from its parameters.

Sources: PX4's parameter reference, and flights of PX4 1.14.
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
"""Parameters that define the reaction."""

_OFFBOARD_LOST: Mapping[int, str] = {
    0: "POSCTL, where it sinks unless a pilot moves the sticks",
    1: "ALTCTL, which needs manual control",
    2: "MANUAL, which needs manual control",
    3: "AUTO.RTL",
    4: "AUTO.LAND",
    5: "AUTO.LOITER",
    6: "flight termination",
    7: "disarmed motors",
}
"""Values of COM_OBL_RC_ACT."""
_LINK_LOST: Mapping[int, str] = {
    1: "it holds its place",
    2: "it returns home",
    3: "it lands",
    5: "it terminates the flight",
    6: "it disarms",
}
"""Values of NAV_DLL_ACT and NAV_RCL_ACT."""


def on_link_loss(parameters: Mapping[str, float]) -> str:
    """Return the reaction in one line; empty if the firmware has none of the parameters."""
    parts = []
    action = round(parameters.get("NAV_DLL_ACT", -1.0))
    if action in _LINK_LOST:
        after = parameters.get("COM_DL_LOSS_T", 10.0)
        parts.append(f"{after:g} s after the last heartbeat {_LINK_LOST[action]}")
    elif action >= 0:
        parts.append("it does not react (NAV_DLL_ACT=0): it flies to its last target and stays there")
    if "COM_OBL_RC_ACT" in parameters:
        mode = _OFFBOARD_LOST.get(round(parameters["COM_OBL_RC_ACT"]), "its failsafe")
        parts.append(f"a velocity ends after {parameters.get('COM_OF_LOSS_T', 1.0):g} s in {mode}")
    if "NAV_RCL_ACT" in parameters:
        reaction = _LINK_LOST.get(round(parameters["NAV_RCL_ACT"]), "it does nothing")
        parts.append(f"{parameters.get('COM_RC_LOSS_T', 0.5):g} s after the last sticks {reaction}")
    return "; ".join(parts)
