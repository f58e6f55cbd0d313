"""How faults of the world reach a real firmware.

Whatever the link of a project carries is the world's, and so are its faults: they act on a real firmware as
on a simulated one. A sensor that the firmware simulates itself fails by a parameter of that simulation. It is
set when the fault appears in the state row of the body, and gets its value back when the fault is over.

Names of parameters differ between versions, so all of them are read from a firmware after its
boot. A fault that it cannot be given is refused by name.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence, Set
from enum import Enum
from math import radians
from typing import NamedTuple

from volery.base.errors import CapabilityError
from volery.base.time import Ns, S, to_seconds
from volery.links.mavlink_messages import message_type
from volery.simulation.real_firmware.firmware_process import lacks
from volery.simulation.real_firmware.ground_link import GroundLink
from volery.simulation.world.state_layout import (
    P_CAPACITY,
    S_AMPS,
    S_CHARGE,
    U_BARO_BLOCKED,
    U_GPS_BLOCKED,
    U_MAG_BLOCKED,
    U_MAG_TURN,
    U_RC_BLOCKED,
)


class Way(Enum):
    """How a kind of fault reaches a firmware if not by parameters."""

    LINK = "by its link"
    """What the firmware is sent in each exchange has the fault."""
    WORLD = "by the world"
    """The body, the air, a link of the run or a computer beside the firmware has the fault."""


class LinkFrom(NamedTuple):
    """A fault that is in what a firmware is sent, which it takes from a version on."""

    major: int
    minor: int


class FaultParameter(NamedTuple):
    """A parameter of a firmware, and its value while a fault is present."""

    name: str
    value: float


class ByParameters(NamedTuple):
    """A fault that a firmware gives itself.

    Args:
        column: Column of the state row that is not 0 while the fault is present.
        settings: What is set; of each group the first that the firmware has.
        unit: What a value of 1 in the settings stands for in the column; 0: values are fixed.
    """

    column: int
    settings: tuple[tuple[FaultParameter, ...], ...]
    unit: float = 0.0

    def value(self, setting: FaultParameter, row: Sequence[float]) -> float:
        """Return the value of a setting for the fault that is in a state row."""
        return setting.value * round(row[self.column] / self.unit) if self.unit else setting.value


_IN_THE_WORLD = dict.fromkeys(
    (
        "motor-dead",
        "sensor-silent",
        "sensor-stuck",
        "sensor-clock-off",
        "camera-black",
        "ranges-maximum",
        "ranges-not-a-number",
        "link-cut",
        "link-degraded",
        "network-cut",
        "network-degraded",
        "computer-stopped",
        "computer-slowed",
        "wind",
    ),
    Way.WORLD,
)
_FROZEN_COMPASS = 2.0
_ORIENTATION = radians(45.0)
"""Angle from one orientation about the vertical to the next in ArduPilot's list, clockwise from above."""

_BATTERY_OF_THE_WORLD = LinkFrom(4, 6)

WAYS: Mapping[str, Mapping[str, Way | LinkFrom | ByParameters]] = {
    "ardupilot": {
        **_IN_THE_WORLD,
        "battery-low": _BATTERY_OF_THE_WORLD,
        "battery-cell-dead": _BATTERY_OF_THE_WORLD,
        "gps-lost": ByParameters(
            U_GPS_BLOCKED, ((FaultParameter("SIM_GPS1_ENABLE", 0.0), FaultParameter("SIM_GPS_DISABLE", 1.0)),)
        ),
        "gps-drift": Way.LINK,
        "barometer-stuck": ByParameters(
            U_BARO_BLOCKED,
            ((FaultParameter("SIM_BARO_FREEZE", 1.0),), (FaultParameter("SIM_BAR2_FREEZE", 1.0),)),
        ),
        "compass-stuck": ByParameters(
            U_MAG_BLOCKED,
            tuple((FaultParameter(f"SIM_MAG{number}_FAIL", _FROZEN_COMPASS),) for number in (1, 2, 3)),
        ),
        "compass-turned": ByParameters(
            U_MAG_TURN,
            tuple((FaultParameter(f"SIM_MAG{number}_ORIENT", 1.0),) for number in (1, 2, 3)),
            _ORIENTATION,
        ),
        "imu-biased": Way.LINK,
        "imu-noisy": Way.LINK,
        "rc-lost": ByParameters(U_RC_BLOCKED, ((FaultParameter("SIM_RC_FAIL", 1.0),),)),
    },
    "px4": {
        **_IN_THE_WORLD,
        "battery-low": Way.LINK,
        "battery-cell-dead": Way.LINK,
        "gps-lost": Way.LINK,
        "gps-drift": Way.LINK,
        "barometer-stuck": Way.LINK,
        "compass-stuck": Way.LINK,
        "compass-turned": Way.LINK,
        "imu-biased": Way.LINK,
        "imu-noisy": Way.LINK,
        "rc-lost": Way.LINK,
    },
}
"""How each kind of fault that a model can state reaches a firmware, by project and kind."""

_COUNTS_CHARGE = frozenset({"ardupilot"})
"""Projects that count the charge of the battery themselves, from the current."""
_MISCOUNT = 0.01
"""Share of the capacity by which a count may be off before it is set."""
_ALL_BATTERIES = 255.0

_ASK_AFTER: Ns = S
"""Time from a firmware's start until it answers."""
_STATED_AFTER: Ns = 10 * S
"""Time from a firmware's start until it has all parameters: some come with what others switch on."""
_ASK_EVERY: Ns = S // 10
_AT_ONCE = 10
_ASK_AGAIN: Ns = S
_ASKED_AT_MOST = 3
_VERSION = "AUTOPILOT_VERSION"
_TAKEN_UP_WITHIN: Ns = 2 * S


class _PendingParameter(NamedTuple):
    """A parameter that was set, and must be taken up."""

    setting: FaultParameter
    at: Ns


def release(version: str) -> tuple[int, int]:
    """Return the major and minor number of a version such as ``4.6.3 (92b0cd78)``; zeros if it has none."""
    stated = re.match(r"(\d+)\.(\d+)", version)
    return (int(stated[1]), int(stated[2])) if stated else (0, 0)


class FirmwareFaults:
    """The faults of one firmware.

    Args:
        project: One of ``WAYS``.
        whose: Vehicle and program, for messages.
        ground: Connection over which parameters are asked for and set.
        stated: Names of parameters that it must have.
    """

    def __init__(self, project: str, whose: str, ground: GroundLink, stated: Set[str] = frozenset()) -> None:
        self._ways, self._whose, self._ground = WAYS[project], whose, ground
        self._known = ground.reported.parameters
        self._by_version = any(isinstance(way, LinkFrom) for way in self._ways.values())
        self._counts = project in _COUNTS_CHARGE
        self._counted, self._counted_until = 0.0, 0  # [A s] that the firmware has counted, on its clock
        self._stated = stated
        self._asked: dict[str, tuple[int, Ns]] = {}  # how often and when last, by what was asked for
        self._ask_at: Ns = 0
        self._wanted: dict[str, str] = {}  # kind by name of the fault
        self._before: dict[
            str, list[FaultParameter]
        ] = {}  # by kind of a present fault, what is to be restored
        self._changes: list[_PendingParameter] = []
        self.settled = not self._by_version and not stated and not any(self._unknown())
        """Whether it is known which parameters and which version the firmware has."""

    def _unknown(self) -> Iterator[str]:
        for way in self._ways.values():
            if isinstance(way, ByParameters):
                for group in way.settings:
                    if not any(setting.name in self._known for setting in group):
                        yield from (setting.name for setting in group)

    def ask(self, now: Ns) -> None:
        """Ask the firmware, which waits, for the parameters and the version that are not known yet.

        Args:
            now: The firmware's clock, for the time between two requests and the limit of all.

        Raises:
            FirmwareError: It lacks a parameter that it must have.
        """
        if self.settled or now < max(_ASK_AFTER, self._ask_at):
            return
        self._ask_at = now + _ASK_EVERY
        complete = not self._stated or now >= _STATED_AFTER
        missing = [*self._unknown()]
        if self._by_version and not self._ground.reported.version:
            missing.append(_VERSION)
        if complete:
            missing += sorted(self._stated - self._known.keys())
        asked = {name: self._asked.get(name, (0, -_ASK_AGAIN)) for name in missing}
        waits = [name for name, (_, at) in asked.items() if now - at < _ASK_AGAIN]
        due = [name for name, (count, _) in asked.items() if count < _ASKED_AT_MOST and name not in waits]
        for name in due[:_AT_ONCE]:
            self._asked[name] = asked[name][0] + 1, now
            self._request(name)
        if complete and not waits and not due:
            self.settled = True
            absent = self._stated - self._known.keys()
            if absent:
                raise lacks(self._whose, absent)

    def _request(self, name: str) -> None:
        if name == _VERSION:
            self._ground.command("MAV_CMD_REQUEST_MESSAGE", float(message_type(name).id))
        else:
            self._ground.ask_parameter(name)

    def require(self, kind: str, fault: str) -> None:
        """Refuse a fault that the firmware cannot be given; at once, or when its parameters are known.

        Args:
            kind: Kind of the fault.
            fault: Its name.

        Raises:
            CapabilityError: The firmware cannot be given it.
        """
        self._wanted[fault] = kind
        if self.settled:
            self._refuse()

    def _refuse(self) -> None:
        while self._wanted:
            fault, kind = self._wanted.popitem()
            reason = self._obstacle(kind)
            if reason:
                version = self._ground.reported.version or "of no stated version"
                raise CapabilityError(
                    f"fault {fault}: {self._whose} {version} cannot be given {kind}: {reason}, "
                    "or leave the fault out"
                )

    def _obstacle(self, kind: str) -> str:
        """Return why the firmware cannot be given a kind of fault, with the remedy; empty: it can."""
        way = self._ways.get(kind)
        if way is None:
            return "there is no way to it; fly that vehicle on a simulated autopilot"
        if isinstance(way, LinkFrom) and release(self._ground.reported.version) < way:
            since = f"{way.major}.{way.minor}"
            return f"from {since} on it takes that from the world; name a program of {since} or later"
        for group in way.settings if isinstance(way, ByParameters) else ():
            if not any(setting.name in self._known for setting in group):
                names = " or ".join(setting.name for setting in group)
                return f"it has no parameter {names}; name a program built for its project's own simulator"
        return ""

    def act(self, now: Ns, row: Sequence[float]) -> None:
        """Let the firmware, which waits, have the faults that are in a state row.

        Args:
            now: The firmware's clock.
            row: State row of the body.

        Raises:
            CapabilityError: A fault that was required cannot be given.
        """
        self.ask(now)
        if not self.settled:
            return
        self._refuse()
        for kind, way in self._ways.items():
            if isinstance(way, ByParameters) and (row[way.column] != 0.0) != (kind in self._before):
                starts = kind not in self._before
                self._set(self._begin(kind, way, row) if starts else self._before.pop(kind), now)
        self._check(now)
        if self._counts:
            self._count(row, now)

    def _begin(self, kind: str, way: ByParameters, row: Sequence[float]) -> list[FaultParameter]:
        owned = [[setting for setting in group if setting.name in self._known] for group in way.settings]
        settings = [FaultParameter(group[0].name, way.value(group[0], row)) for group in owned if group]
        self._before[kind] = [FaultParameter(name, self._known[name]) for name, _ in settings]
        return settings

    def _set(self, settings: Sequence[FaultParameter], now: Ns) -> None:
        names = {setting.name for setting in settings}
        self._changes = [change for change in self._changes if change.setting.name not in names]
        for setting in settings:
            self._ground.set_parameter(*setting)
            self._changes.append(_PendingParameter(setting, now))

    def _check(self, now: Ns) -> None:
        """Drop the changes that were taken up."""
        self._changes = [
            change for change in self._changes if self._known[change.setting.name] != change.setting.value
        ]
        for (name, value), at in self._changes:
            if now - at > _TAKEN_UP_WITHIN:
                raise CapabilityError(
                    f"{self._whose} has not taken up {name} {value:g} within "
                    f"{to_seconds(_TAKEN_UP_WITHIN):g} s; it says {self._known[name]:g}"
                )

    def _count(self, row: Sequence[float], now: Ns) -> None:
        """Set the firmware's count if charge has come or gone that is no current of the vehicle."""
        elapsed, self._counted_until = now - self._counted_until, now
        self._counted += row[S_AMPS] * to_seconds(elapsed)
        if abs(row[S_CHARGE] - self._counted) > _MISCOUNT * row[P_CAPACITY]:
            self._counted = row[S_CHARGE]
            left = 100.0 * (1.0 - row[S_CHARGE] / row[P_CAPACITY])
            self._ground.command("MAV_CMD_BATTERY_RESET", _ALL_BATTERIES, left)
