"""What differs between the versions of PX4 that are simulated: one table.

1.14.0 is as recorded. Of 1.17.0 that is different which a recording shows or which its public sources say
(tag v1.17.0); nothing else of it is modelled. The newest version is the default.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files

from volery.base.time import MS, Ns, S
from volery.simulation.autopilots.autopilot_parameters import (
    NOT_RENAMED,
    Renamed,
    StoredParameter,
    load,
)
from volery.simulation.autopilots.mavlink.messages import FAILED
from volery.simulation.autopilots.px4 import event_interface
from volery.simulation.autopilots.px4.event_interface import EventToSend

PACKAGE = "volery.simulation.autopilots.px4"

VERTICAL_ABOVE_GROUND, CONSTANT_POSITION = 64, 128
"""ESTIMATOR_STATUS_FLAGS. 1.16 and newer set the second one of a vehicle at rest, with a valid position."""


MainAndSub = tuple[int, int]
"""Main mode and sub-mode of a ``custom_mode``."""

POSITION_SLOW: MainAndSub = (3, 2)
ALTITUDE_CRUISE: MainAndSub = (11, 0)
EXTERNAL: tuple[MainAndSub, ...] = tuple((4, sub) for sub in range(11, 19))
"""External modes 1 to 8, which programs on board bring: none is there."""


STANDARD_MODES: Mapping[MainAndSub, int] = {
    (2, 0): 4,
    (3, 0): 1,
    (3, 1): 2,
    (4, 2): 8,
    (4, 4): 6,
    (4, 5): 5,
    (4, 6): 7,
}
"""MAV_STANDARD_MODE of the modes of a multirotor that have one; AVAILABLE_MODES names the others."""

SIMPLE_MODES = frozenset({(2, 0), (3, 0), ALTITUDE_CRUISE})
"""Modes that are not marked as advanced."""

ADVANCED, NOT_SELECTABLE = 1, 2
"""MAV_MODE_PROPERTY."""


@dataclass(frozen=True, kw_only=True)
class Px4Version:
    """One version of the firmware."""

    name: str
    software: int
    """``flight_sw_version`` of AUTOPILOT_VERSION: major, minor, patch, and 255 of a release."""
    git_hash: tuple[int, ...]
    """``flight_custom_version``."""
    capabilities: int
    """MAV_PROTOCOL_CAPABILITY."""
    at_rest: int = 0
    """Bits that ESTIMATOR_STATUS has while the vehicle is at rest, beside the others."""
    wrong_target: int | None = None
    """MAV_RESULT of a command for another system or component; ``None``: no answer."""
    mode_acknowledged_twice: bool = True
    """Whether DO_SET_MODE is acknowledged as accepted when it arrives, and with its result after that."""
    joystick_sources: frozenset[int]
    """Values of COM_RC_IN_MODE with which MANUAL_CONTROL counts."""
    words: Mapping[MainAndSub, str]
    """Names of modes in refusals."""
    refused_modes: frozenset[MainAndSub] = frozenset()
    """Modes that the firmware has and the simulated one cannot fly: accepted on the ground, refused in
    flight.
    """
    lists_modes: bool = True
    """Whether AVAILABLE_MODES and CURRENT_MODE are sent on request."""
    plan_ids: bool = True
    """Whether MISSION_ACK, MISSION_COUNT and MISSION_CURRENT carry checksums of the lists on board."""
    mission_state: bool = True
    """Whether MISSION_CURRENT has the number of items, ``mission_state`` and ``mission_mode``, and is sent
    without a mission, too.
    """
    mission_period: Ns = S
    """Period of MISSION_CURRENT and of the repetitions of MISSION_ITEM_REACHED."""
    counts_actions: bool = True
    """Whether a waypoint that is followed by an item without a place is reported as reached under that item's
    number, because both are passed at once; else as itself, and the item not at all.
    """
    mission_words: bool = True
    """Whether a mission says that it begins, how high its take-off climbs above home, and that it ends."""
    corrects_home: bool = True
    """Whether home's altitude follows the receiver's after a take-off: see ``HomeCorrection``."""
    short_return: bool = True
    """Whether a return says how high it begins and that it lands, and no other stages."""
    least_takeoff: bool = False
    """Whether a take-off climbs MIS_TAKEOFF_ALT at least; else that is the height without a given one."""
    keeps_takeoff: bool = False
    """Whether a take-off that was requested is the mode after disarming, too."""
    takeoff_words: str = "Using default takeoff altitude: {:.1f} m"
    """What is said when MIS_TAKEOFF_ALT counts."""
    warns_of_destinations: bool = False
    """Whether a destination beyond a limit of the geofence is reported as the vehicle there would be."""
    fence_texts: tuple[str, str, str]
    """What is said outside the greatest distance, the greatest height, and the uploaded fence."""
    hold_words: str = "Failsafe activated: entering Hold for {} seconds\t"
    battery_words: tuple[tuple[int, str], tuple[int, str], tuple[int, str]] = (
        (2, "Low battery\t"),
        (2, ""),
        (0, "Emergency battery level\t"),
    )
    """Severity and text of a battery below its low, its critical and its emergency level, as recorded."""
    unready_state: int = 0
    """MAV_STATE of a vehicle that cannot be armed in its mode now."""
    says_failing_checks: bool = True
    """Whether a refusal to arm is said as a text, too."""
    terminates_as_mode: bool = True
    """Whether DO_FLIGHTTERMINATION enters the mode TERMINATION, and is denied while disarmed."""
    not_landed: str = "Disarming denied: not landed\t"
    """What is said about disarming in flight."""
    events: Mapping[EventToSend, EventToSend | None] = field(default_factory=dict)
    """Events that have another number, or ``None`` where the firmware does not send them."""
    differences: str = ""
    """Start of the names of two files beside 1.14's list: ``.parameters`` are new or have another type or
    default, ``.gone`` are not there.
    """
    renamed: Mapping[str, Renamed] = field(default_factory=lambda: NOT_RENAMED)
    """Names of 1.14 that the simulated one reads, to those of this version."""

    def gone_parameters(self) -> frozenset[str]:
        """Return the names of 1.14 that are not there."""
        if not self.differences:
            return frozenset()
        return frozenset(files(PACKAGE).joinpath(f"{self.differences}.gone").read_text("ascii").split())

    def parameters(self) -> tuple[StoredParameter, ...]:
        """Return the parameters of a multirotor in the order of their indices, by the names of 1.14."""
        found = {one.name: one for one in load(PACKAGE, "data/copter.parameters")}
        if self.differences:
            found |= {one.name: one for one in load(PACKAGE, f"{self.differences}.parameters")}
        shown, gone = {name: one.name for name, one in self.renamed.items()}, self.gone_parameters()
        return tuple(
            one
            for _, name, one in sorted((shown.get(name, name), name, one) for name, one in found.items())
            if name not in gone
        )


V1_14 = Px4Version(
    name="1.14",
    software=0x010E00FF,
    git_hash=(0, 0, 0, 114, 221, 65, 197, 184),
    capabilities=60_671,
    wrong_target=FAILED,
    mode_acknowledged_twice=False,
    joystick_sources=frozenset({1, 2, 3}),
    words={
        (1, 0): "MANUAL",
        (2, 0): "ALTCTL",
        (3, 0): "POSCTL",
        (3, 1): "ORBIT",
        (5, 0): "ACRO",
        (6, 0): "OFFBOARD",
        (7, 0): "STAB",
        (4, 2): "AUTO_TAKEOFF",
        (4, 3): "AUTO_LOITER",
        (4, 4): "AUTO_MISSION",
        (4, 5): "AUTO_RTL",
        (4, 6): "AUTO_LAND",
        (4, 8): "AUTO_FOLLOW_TARGET",
    },
    lists_modes=False,
    plan_ids=False,
    mission_state=False,
    mission_period=100 * MS,
    counts_actions=False,
    mission_words=False,
    corrects_home=False,
    short_return=False,
    least_takeoff=True,
    keeps_takeoff=True,
    warns_of_destinations=True,
    takeoff_words="Using minimum takeoff altitude: {:.2f} m",
    fence_texts=(
        "Maximum distance from home reached ({:.5f})\t",
        "Maximum altitude above home reached ({:.5f})\t",
        "",
    ),
    hold_words="Failsafe activated, entering Hold for {} seconds\t",
    battery_words=((0, "Preflight Fail: low battery\t"),) * 3,
    unready_state=3,
    says_failing_checks=False,
    terminates_as_mode=False,
    not_landed="Disarming denied! Not landed\t",
)
"""1.14.0, of the five recordings of 2023's release."""

V1_17 = Px4Version(
    name="1.17",
    software=0x011100FF,
    git_hash=(0, 0, 0, 196, 209, 42, 241, 214),
    capabilities=59_647,
    at_rest=VERTICAL_ABOVE_GROUND | CONSTANT_POSITION,
    joystick_sources=frozenset({1, 2, 3, 5, 6, 7, 8}),
    words={
        (1, 0): "Manual",
        (2, 0): "Altitude",
        (3, 0): "Position",
        POSITION_SLOW: "Position Slow",
        (3, 1): "Orbit",
        (5, 0): "Acro",
        (6, 0): "Offboard",
        (7, 0): "Stabilized",
        (4, 2): "Takeoff",
        (4, 3): "Hold",
        (4, 4): "Mission",
        (4, 5): "Return",
        (4, 6): "Land",
        (4, 8): "Follow Target",
        ALTITUDE_CRUISE: "Altitude Cruise",
        **{mode: f"External {place}" for place, mode in enumerate(EXTERNAL, start=1)},
    },
    refused_modes=frozenset({POSITION_SLOW, ALTITUDE_CRUISE, *EXTERNAL}),
    fence_texts=(
        "Geofence: exceeding maximum distance to Home",
        "Geofence: exceeding maximum altitude above Home",
        "Geofence: approaching or outside geofence",
    ),
    events={
        event_interface.DISARM_REFUSED: EventToSend(0x018AB9B5, 0x62),
        event_interface.RETURN_ACTIVATED: None,
        event_interface.RETURN_HOME: None,
        event_interface.RETURN_CLIMB: EventToSend(0x01522694, 0x66),
        event_interface.RETURN_FLY: None,
        event_interface.RETURN_DESCEND: None,
        event_interface.MISSION_TAKEOFF: EventToSend(0x017D425C, 0x66),
        event_interface.MINIMUM_TAKEOFF: EventToSend(0x013B2FC7, 0x66),
        event_interface.FENCE_DISTANCE: None,
    },
    differences="data/copter-1.17",
    renamed={"MPC_HOLD_DZ": Renamed("MAN_DEADZONE", None)},
)
"""1.17.0 of 24 April 2026."""

VERSIONS: Mapping[str, Px4Version] = {version.name: version for version in (V1_14, V1_17)}
"""By name, the newest last."""
