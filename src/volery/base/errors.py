"""The exceptions of volery, in one tree that separates what is at fault.

| class | at fault | examples |
|---|---|---|
| ``ModelError`` | your model file | a typo in a key, a cycle of required ports |
| ``UsageError`` | your call or option | an unknown URL scheme, coordinates off the globe |
| ``ComponentError`` | the code of a component | it raised, or it froze virtual time |
| ``CapabilityError`` | the request: this vehicle cannot do it | mission upload where the autopilot has none |
| ``LinkError`` | the link | silent, lost, garbled |
| ``VehicleError`` | the aircraft | refused, overridden, in failsafe, did not arrive |
| ``FleetError`` | several of a fleet | each vehicle's own error, by its name |
| ``EstimateError`` | a law of cost or physics | out of range, no figure for this processor |

A message names the offender and, where there are any, the valid choices. The command line shows the message
alone; a traceback is for ``--debug``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import NamedTuple, Self


class VoleryError(Exception):
    """Base class of all errors that volery raises on purpose."""

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the error as it is, whatever its constructor takes."""
        return _again, (type(self), self.args, self.__dict__)


def _again(kind: type[VoleryError], args: tuple[object, ...], state: Mapping[str, object]) -> VoleryError:
    made = kind.__new__(kind, *args)
    made.__dict__.update(state)
    return made


class Location(NamedTuple):
    """Place in a file. Lines count from 1; 0 is no line (an option, a missing file)."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}" if self.line else self.file


class ModelError(VoleryError):
    """The model is wrong. The message names file, line, path in the model, fault and valid choices.

    ``code`` is that of the rule that the model breaks, such as ``V103``; empty if it is of none.
    """

    def __init__(self, what: str, path: str = "", where: Location | None = None, code: str = "") -> None:
        self.what, self.path, self.where, self.code = what, path, where, code
        super().__init__(": ".join(part for part in (str(where) if where else "", path, what) if part))


class UsageError(VoleryError):
    """A call, an option or an address is wrong."""


class ComponentError(VoleryError):
    """The code of a component raised an exception or misbehaved. The cause, if any, is chained."""

    def __init__(self, component: str, what: str) -> None:
        self.component, self.what = component, what
        super().__init__(f"{component}: {what}")


class CapabilityError(VoleryError):
    """The vehicle or its autopilot cannot do this; detected before anything moves."""


class LinkError(VoleryError):
    """The link to a vehicle is silent, lost or carries another protocol."""


class LinkSilent(LinkError):
    """Nothing answers at the address."""


class LinkLost(LinkError):
    """Messages of the autopilot have stopped arriving."""


class LinkGarbled(LinkError):
    """Bytes arrive, but not in the expected protocol."""


class VehicleError(VoleryError):
    """The vehicle did not do it. The message has the vehicle, the request and the autopilot's own text."""

    def __init__(self, vehicle: str, asked: str, what: str) -> None:
        self.vehicle, self.asked, self.what = vehicle, asked, what
        super().__init__(f"{vehicle}: {asked}: {what}")


class Refused(VehicleError):
    """The autopilot refused the command."""


class Overridden(VehicleError):
    """A pilot or another station commands the vehicle now. volery never overrides it."""


class Failsafe(Overridden):
    """A failsafe of the autopilot has taken over."""


class NotArrived(VehicleError):
    """Telemetry did not show the operation as done within its time-out."""


class OutOfBounds(VehicleError):
    """A goal or a path is outside the fence or the limits, or the vehicle has left them on its way.

    A goal or a path is refused before anything moves.
    """


class PositionLost(VehicleError):
    """The vehicle has lost its position in the air: no satellites, or no estimate is reported any more."""


class ControlLost(VehicleError):
    """The vehicle falls or has turned over in the air, as with a motor lost."""


class OffTrack(VehicleError):
    """The autopilot does not keep the vehicle on its path or at its place, or does not follow set-points."""


class ObstacleNear(VehicleError):
    """An obstacle is nearer than the stated clearance, or the range sensors that shall see it are silent."""


class ThrustSaturated(VehicleError):
    """The vehicle does not climb at full thrust: it is overloaded, or a motor or the battery is weak."""


class LowBattery(VehicleError):
    """The battery is below its reserve: only landing and returning home may be started."""


class CriticalBattery(LowBattery):
    """What is left of the battery suffices for a landing only, so the vehicle is landed where it is."""


class FleetError(ExceptionGroup[Exception], VoleryError):
    """Errors of some vehicles of a fleet, by name; the other vehicles have succeeded.

    It is also an exception group, so ``except* Refused`` selects from it.
    """

    failed: Mapping[str, Exception]

    def __new__(cls, asked: str, failed: Mapping[str, Exception]) -> Self:
        """Create the group; *failed* has at least one error."""
        made = super().__new__(cls, asked, list(failed.values()))
        made.failed = dict(failed)
        return made

    def __init__(self, asked: str, failed: Mapping[str, Exception]) -> None:
        super().__init__(asked, list(failed.values()))

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.message, self.failed)

    def derive(self, errors: Sequence[Exception]) -> ExceptionGroup[Exception]:  # type: ignore[override]  # typeshed states a group of any exceptions
        """Return the group of the errors that ``except*`` did not select."""
        left = {name: error for name, error in self.failed.items() if error in errors}
        return FleetError(self.message, left)

    def __str__(self) -> str:
        parts = (f"{name}: {_said(name, error)}" for name, error in self.failed.items())
        return f"{self.message}: {len(self.failed)} failed: " + "; ".join(parts)


def _said(name: str, error: Exception) -> str:
    said = str(error) if isinstance(error, VoleryError) else f"{type(error).__name__}: {error}"
    return said.removeprefix(f"{name}: ")


class EstimateError(VoleryError):
    """A law has no figure for this case, or is used outside its range of validity."""


class Deadlock(VoleryError):
    """Tasks wait and no event is pending. The message names the tasks and what each waits for."""


def choices(names: Iterable[str]) -> str:
    """Return ``a, b or c``, for a message that lists valid choices."""
    listed = sorted(names)
    if not listed:
        return "nothing"
    if len(listed) == 1:
        return listed[0]
    return f"{', '.join(listed[:-1])} or {listed[-1]}"


def did_you_mean(wrong: str, names: Iterable[str]) -> str:
    """Return `` (did you mean 'x'?)`` if one of *names* is close to *wrong*, else an empty string."""
    close = get_close_matches(wrong, list(names), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""
