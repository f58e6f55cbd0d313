"""What an autopilot offers beside flying: parameters, plans, logs, commands of payloads, corrections.

A driver has a ``Services`` where its protocol carries them, as MAVLink does. The nouns that users see are
built on it: ``Parameters``, ``OnboardPlan``, ``OnboardLogs`` and ``Payload``. All calls block.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from typing import NamedTuple, Protocol

from volery.base.errors import CapabilityError, Refused, UsageError, did_you_mean
from volery.base.frames import Vector
from volery.base.position import Position
from volery.base.time import Ns
from volery.vehicles.external_pose import ExternalPose


class PlanItem(NamedTuple):
    """An item of a plan as in MAVLink: latitude and longitude in degrees, ``z`` in metres of ``frame``."""

    command: int
    frame: int
    parameters: tuple[float, float, float, float]
    latitude: float
    longitude: float
    z: float


LONGEST_NAME = 16
"""Characters in the name of a parameter, by MAVLink."""
MISSION, FENCE, RALLY = 0, 1, 2
"""MAV_MISSION_TYPE of the three lists that an autopilot keeps."""


class Parameter(NamedTuple):
    """A parameter of an autopilot: its value, and its MAV_PARAM_TYPE (9 and 10 are real, others whole)."""

    name: str
    value: float
    type: int


class RenamedParameter(NamedTuple):
    """A parameter that has another name, and perhaps another unit, from one version of a firmware on.

    Args:
        before: its older name.
        after: its newer name.
        since: the version, as in "4.7".
        factor: the newer value is the older one times this.
        change: what changed beside the name, in words; empty if nothing.
        upgrade: returns the newer value of an older one, where that is no multiple.
        downgrade: the other way.
    """

    before: str
    after: str
    since: str
    factor: float = 1.0
    change: str = ""
    upgrade: Callable[[float], float] | None = None
    downgrade: Callable[[float], float] | None = None

    def other(self, name: str) -> str:
        """Return its other name."""
        return self.after if name == self.before else self.before

    def converted(self, name: str, value: float) -> float:
        """Return the value under its other name; *name* is the one of *value*."""
        if name == self.before:
            return self.upgrade(value) if self.upgrade is not None else value * self.factor
        return self.downgrade(value) if self.downgrade is not None else value / self.factor


class ParameterRules(NamedTuple):
    """What is known of the parameters of a firmware beside what it reports.

    Args:
        renamed: those with another name in another version, by both names.
        volatile: those that the autopilot writes itself, such as counters; they are no settings.
        landing_target: those with which it lands on a LANDING_TARGET, and their values; empty: it takes none.
    """

    renamed: Mapping[str, RenamedParameter] = {}
    volatile: Set[str] = frozenset()
    landing_target: Mapping[str, float] = {}


NO_RULES = ParameterRules()


class LogEntry(NamedTuple):
    """A log on board: number, size in bytes, and the end of its recording in s since 1970 (0 if unknown)."""

    number: int
    size: int
    utc: int


class FileEntry(NamedTuple):
    """A file or a folder on board: its name, and its size in bytes (0 of a folder)."""

    name: str
    size: int
    is_folder: bool


def mavlink_parameter_name(vehicle: str, name: str) -> str:
    """Return a name in capitals; raise ``UsageError`` if no parameter of MAVLink can have it."""
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z0-9_]{1,16}", name):
        raise UsageError(f"{vehicle}: {name!r} is no name of a parameter: {LONGEST_NAME} letters, digits, _")
    return name.upper()


def missing_parameter(
    vehicle: str, name: str, known: Iterable[str], renamed: RenamedParameter | None
) -> Refused:
    """Return the error for a parameter that an autopilot does not have, with its other name if it has that.

    Args:
        vehicle: name of the vehicle.
        name: the name that was asked for.
        known: names that the autopilot has, as far as they are known.
        renamed: the renaming of this parameter, if there is one.
    """
    what = f"the autopilot has no parameter {name}"
    if renamed is not None:
        other = renamed.other(name)
        when = f"since {renamed.since}" if name == renamed.before else f"before {renamed.since}"
        change = f" ({renamed.change})" if renamed.change else ""
        what += f"; {when} it is {other}{change}"
    else:
        what += did_you_mean(name, known)
    return Refused(vehicle, f"the parameter {name}", what)


class FileSystem(Protocol):
    """The files on board of one autopilot, read only. One is open at a time."""

    def list(self, folder: str) -> list[FileEntry]:
        """Return what is in a folder."""

    def open(self, path: str) -> int:
        """Open a file and return its size in bytes."""

    def read(self, path: str, offset: int) -> bytes:
        """Return bytes of the open file from *offset*, some 40 kB or more; none at its end."""

    def close(self) -> None:
        """Close the open file."""

    def reset(self) -> None:
        """Close files that another program left open."""


class Services(Protocol):
    """Services of one autopilot. Every method blocks; without an answer it raises ``NotArrived``."""

    @property
    def files(self) -> FileSystem | None:
        """Its files; ``None`` where the protocol carries none."""

    @property
    def home_first(self) -> bool:
        """Whether item 0 of its mission is home, as in ArduPilot."""

    @property
    def sender(self) -> tuple[int, int] | None:
        """System and component id that the autopilot gets commands from; ``None`` if they are not known."""

    @property
    def parameter_rules(self) -> ParameterRules:
        """Parameters with other names in other versions, and those that the autopilot writes itself."""

    def parameter_name(self, name: str) -> str:
        """Return the autopilot's spelling of a name; raise ``UsageError`` if it is none."""

    def read_parameter(self, name: str) -> Parameter:
        """Read one parameter; ``Refused`` if the autopilot does not have it."""

    def read_parameters(self) -> dict[str, Parameter]:
        """Read all parameters."""

    def write_parameter(self, name: str, value: float) -> Parameter:
        """Write one parameter; return what the autopilot then reports. ``Refused`` if it keeps another."""

    def download_items(self, kind: int) -> list[PlanItem]:
        """Read a list of items."""

    def upload_items(self, kind: int, items: Sequence[PlanItem]) -> None:
        """Replace a list of items; an empty one clears it."""

    def command(self, asked: str, command: str, *parameters: float, within: Ns = 0) -> None:
        """Send COMMAND_LONG and wait for its acknowledgement.

        Args:
            asked: the command in words, for errors.
            command: name of the MAV_CMD.
            parameters: up to seven.
            within: time-out, ns; 0 means the usual one.

        Raises:
            CapabilityError: the autopilot does not support it.
            Refused: the autopilot refuses; the error quotes its result and its last text.
        """

    def list_logs(self) -> list[LogEntry]:
        """Return the logs on board."""

    def read_log(self, entry: LogEntry, offset: int, count: int) -> bytes:
        """Return up to *count* bytes of a log from *offset*; fewer only at its end."""

    def end_log_transfer(self) -> None:
        """Let the autopilot record again."""

    def send_corrections(self, message: bytes) -> None:
        """Send one RTCM message to the GPS receivers. It is not acknowledged."""

    def send_landing_target(self, offset: Vector) -> None:
        """Send where to land: forward, right, down from the vehicle [m]. It is not acknowledged.

        Raises:
            CapabilityError: the autopilot takes none.
            Refused: its parameters have it ignored.
        """

    def send_external_pose(self, pose: ExternalPose) -> None:
        """Send an external position estimate. It is not acknowledged."""

    def set_origin(self, place: Position) -> None:
        """Set the origin of the estimator (AMSL); ``NotArrived`` if it does not state that one then."""


class PartialServices:
    """``Services`` of a vehicle whose protocol carries few of them.

    What a subclass does not override raises ``CapabilityError``.

    Args:
        name: The vehicle's name.
        why: What the protocol offers, for the error.
    """

    files = None
    home_first = False
    sender = None
    parameter_rules = NO_RULES

    def __init__(self, name: str, why: str) -> None:
        self._name, self._why = name, why

    def _unsupported(self, what: str) -> CapabilityError:
        return CapabilityError(f"{self._name}: {what}: {self._why}")

    def parameter_name(self, name: str) -> str:
        """See ``Services``."""
        raise self._unsupported(f"the parameter {name}")

    def read_parameter(self, name: str) -> Parameter:
        """See ``Services``."""
        raise self._unsupported(f"read the parameter {name}")

    def read_parameters(self) -> dict[str, Parameter]:
        """See ``Services``."""
        raise self._unsupported("read its parameters")

    def write_parameter(self, name: str, value: float) -> Parameter:
        """See ``Services``."""
        raise self._unsupported(f"set the parameter {name}")

    def download_items(self, kind: int) -> list[PlanItem]:
        """See ``Services``."""
        raise self._unsupported("read a plan on board")

    def upload_items(self, kind: int, items: Sequence[PlanItem]) -> None:
        """See ``Services``."""
        raise self._unsupported("store a plan on board")

    def command(self, asked: str, command: str, *parameters: float, within: Ns = 0) -> None:
        """See ``Services``."""
        raise self._unsupported(asked)

    def list_logs(self) -> list[LogEntry]:
        """See ``Services``."""
        raise self._unsupported("list its logs")

    def read_log(self, entry: LogEntry, offset: int, count: int) -> bytes:
        """See ``Services``."""
        raise self._unsupported("read a log")

    def end_log_transfer(self) -> None:
        """Do nothing: there is no transfer."""

    def send_corrections(self, message: bytes) -> None:
        """See ``Services``."""
        raise self._unsupported("RTK corrections")

    def send_landing_target(self, offset: Vector) -> None:
        """See ``Services``."""
        raise self._unsupported("a landing target")

    def send_external_pose(self, pose: ExternalPose) -> None:
        """See ``Services``."""
        raise self._unsupported("an external position estimate")

    def set_origin(self, place: Position) -> None:
        """See ``Services``."""
        raise self._unsupported("set the origin of its estimator")
