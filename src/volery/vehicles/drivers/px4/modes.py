"""PX4's modes, and the reaction to a lost link, in words, from its parameters.

The names of modes are those of MAVROS and of PX4's documentation, the numbers those of ``px4_custom_mode.h``.
Sources of the reaction: PX4's parameter reference, and flights of PX4 1.14.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from volery.base.errors import CapabilityError
from volery.vehicles.driver import LinkLossAction, Settings
from volery.vehicles.drivers.steps import DRONE_KIND

MANUAL, STABILIZED, ALTCTL, POSCTL, ACRO = "MANUAL", "STABILIZED", "ALTCTL", "POSCTL", "ACRO"
OFFBOARD = "OFFBOARD"
HOLD, TAKEOFF, LAND, RTL, MISSION = "AUTO.LOITER", "AUTO.TAKEOFF", "AUTO.LAND", "AUTO.RTL", "AUTO.MISSION"


class Px4Mode(NamedTuple):
    """A mode. ``state`` is its number in arming checks (``nav_state`` of ``VehicleStatus.msg``)."""

    main: int
    sub: int
    state: int

    @property
    def number(self) -> int:
        """Number in a heartbeat's ``custom_mode``."""
        return self.sub << 24 | self.main << 16


MODES: Mapping[str, Px4Mode] = {
    MANUAL: Px4Mode(1, 0, 0),
    ALTCTL: Px4Mode(2, 0, 1),
    POSCTL: Px4Mode(3, 0, 2),
    "POSCTL.ORBIT": Px4Mode(3, 1, 21),
    "POSCTL.SLOW": Px4Mode(3, 2, 6),  # since 1.15
    "AUTO.READY": Px4Mode(4, 1, 4),
    TAKEOFF: Px4Mode(4, 2, 17),
    HOLD: Px4Mode(4, 3, 4),
    MISSION: Px4Mode(4, 4, 3),
    RTL: Px4Mode(4, 5, 5),
    LAND: Px4Mode(4, 6, 18),
    "AUTO.FOLLOW_TARGET": Px4Mode(4, 8, 19),
    "AUTO.PRECLAND": Px4Mode(4, 9, 20),
    "AUTO.VTOL_TAKEOFF": Px4Mode(4, 10, 22),
    **{
        f"AUTO.EXTERNAL{number}": Px4Mode(4, 10 + number, 22 + number) for number in range(1, 9)
    },  # since 1.15
    ACRO: Px4Mode(5, 0, 10),
    OFFBOARD: Px4Mode(6, 0, 14),
    STABILIZED: Px4Mode(7, 0, 15),
    "RATTITUDE": Px4Mode(8, 0, 16),
    "TERMINATION": Px4Mode(10, 0, 13),  # since 1.15; before, it is reported as MANUAL
    "ALTITUDE_CRUISE": Px4Mode(11, 0, 8),  # since 1.17
}
"""Modes by name. No number has two meanings in any version."""

MANUAL_MODES = frozenset(
    {
        *(MANUAL, STABILIZED, ALTCTL, POSCTL, ACRO),
        *("POSCTL.ORBIT", "POSCTL.SLOW", "ALTITUDE_CRUISE", "RATTITUDE"),
    }
)
"""Modes that are flown by manual control."""

NEVER_ARMED_IN = frozenset({RTL, LAND, "AUTO.FOLLOW_TARGET", "AUTO.PRECLAND"})
"""Automatic modes in which it does not arm (mode_req_prevent_arming in ModeUtil/mode_requirements.cpp)."""

_NAMES = {mode.number: name for name, mode in MODES.items()}


def mode_name(number: int) -> str:
    """Return the name of a ``custom_mode``, or its number for a mode that is not in this table."""
    return _NAMES.get(number) or f"MODE {number:#010x}"


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


_ACTIONS: Mapping[LinkLossAction, tuple[float, float]] = {
    "return": (2.0, 3.0),
    "land": (3.0, 4.0),
    "hover": (1.0, 5.0),
}
"""Values of NAV_DLL_ACT and of COM_OBL_RC_ACT."""


def link_loss_settings(name: str, kind: str, action: LinkLossAction) -> Settings:
    """Return the parameters with which the vehicle *name* does *action* when the link is lost."""
    if kind != DRONE_KIND and action == "land":
        raise CapabilityError(f"{name}: a rover does not land; hover stops it, return drives it home")
    station, offboard = _ACTIONS[action]
    return {"NAV_DLL_ACT": lambda _: station, "COM_OBL_RC_ACT": lambda _: offboard}
